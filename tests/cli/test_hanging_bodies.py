"""Bodies of every kind that hang anywhere on an arm, against Pinocchio and Coal: wherever joints
stand, each lies in the capsules of the planned link that carries it.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from ir_cli.robot_from_urdf import RobotSource, made_robot
from ir_kernels import Chain
from ir_values.arrays import FloatArray

sys.path.append(str(Path(__file__).parent))

pinocchio = pytest.importorskip("pinocchio")
coal = pytest.importorskip("coal")

HANGING = 8  # links beside the arm
POSTURES = 12
POINTS = 150  # of a body
DIGITS = 1e-8  # m: of the numbers of a robot file
KINDS = ("fixed", "revolute", "prismatic", "continuous", "follower")
SHAPES = (
    '<box size="0.03 0.05 0.02"/>',
    '<sphere radius="0.03"/>',
    '<cylinder radius="0.02" length="0.06"/>',
    '<capsule radius="0.02" length="0.05"/>',
)
LIMITS = {
    "revolute": '<limit lower="-0.4" upper="0.7" effort="1" velocity="1"/>',
    "prismatic": '<limit lower="-0.02" upper="0.06" effort="1" velocity="1"/>',
}


def hanging(draw: np.random.Generator) -> str:
    """Links with up to three bodies each, on links of the arm and on each other, by joints of all
    kinds; some limits of followers contradict what their leader drives them to.
    """
    parents = ["base_link", *(f"link_{k}" for k in range(1, 7))]
    lines = []
    for k in range(HANGING):
        kind = str(draw.choice(KINDS))
        limit = LIMITS.get(kind, "")
        mimic = ""
        if kind == "follower":
            leader = draw.integers(1, 7)
            ratio = draw.choice([-1.0, 0.3, -0.5])
            mimic = f'<mimic joint="joint_{leader}" multiplier="{ratio}" offset="0.1"/>'
            if draw.random() < 0.5:
                limit = '<limit lower="-0.1" upper="0.1" effort="1" velocity="1"/>'
        bodies = "".join(
            f"<collision>{place(draw, 0.08)}<geometry>{draw.choice(SHAPES)}</geometry></collision>"
            for _ in range(draw.integers(1, 4))
        )
        lines.append(
            f'<link name="x{k}">{bodies}</link><joint name="jx{k}" '
            f'type="{"continuous" if kind == "follower" else kind}">'
            f'<parent link="{draw.choice(parents)}"/><child link="x{k}"/>{place(draw, 0.1)}'
            f'<axis xyz="{numbers(draw.normal(size=3))}"/>{mimic}{limit}</joint>'
        )
        parents.append(f"x{k}")
    flange = '<link name="flange"/><joint name="jf" type="fixed"><parent link="link_6"/>'
    return "\n".join([*lines, f'{flange}<child link="flange"/></joint>'])


def place(draw: np.random.Generator, far: float) -> str:
    xyz = numbers(draw.uniform(-far, far, 3))
    return f'<origin xyz="{xyz}" rpy="{numbers(draw.uniform(-3.0, 3.0, 3))}"/>'


def numbers(values: FloatArray) -> str:
    return " ".join(f"{value:.4f}" for value in values)


def in_three_ways(text: str, package: Path) -> str:
    """The same meshes by package://, file:// and from the folder of the URDF, in turn."""
    ways = ("package://pk", f"file://{package}", "..")
    names = iter(range(1000))

    def named(match: re.Match[str]) -> str:
        return f'filename="{ways[next(names) % 3]}/meshes/{Path(match[1]).name}"'

    return re.sub(r'filename="file://([^"]+)"', named, text)


def value_of_joint(
    joint: ElementTree.Element, planned: dict[str, float], draw: np.random.Generator
) -> float:
    """Where a joint stands while the planned ones are where `planned` says."""
    name = joint.get("name", "")
    mimic = joint.find("mimic")
    limit = joint.find("limit")
    if name in planned:
        return planned[name]
    if mimic is not None:
        turned = planned[mimic.get("joint", "")]
        return float(mimic.get("multiplier", "")) * turned + float(mimic.get("offset", ""))
    if limit is None:
        return float(draw.uniform(-np.pi, np.pi))
    return float(draw.uniform(float(limit.get("lower", "")), float(limit.get("upper", ""))))


def points_of(shape: Any, draw: np.random.Generator) -> FloatArray:
    """Points (N, 3) of a body's surface."""
    ball = draw.normal(size=(POINTS, 3))
    ball /= np.linalg.norm(ball, axis=1)[:, None]
    if isinstance(shape, coal.BVHModelBase):
        return np.asarray(shape.vertices())
    if isinstance(shape, coal.Box):
        return np.asarray(np.sign(ball) * shape.halfSide)
    if isinstance(shape, coal.Sphere):
        return np.asarray(shape.radius * ball)
    around = shape.radius * ball[:, :2] / np.linalg.norm(ball[:, :2], axis=1)[:, None]
    return np.column_stack([around, np.sign(ball[:, 2]) * shape.halfLength])


def out_of(points: FloatArray, capsules: list[Any], pose: FloatArray) -> FloatArray:
    """How far points (N, 3) are out of all capsules of a link at a pose (4, 4) (N,) [m]."""
    out = []
    for capsule in capsules:
        a, b = (pose[:3, :3] @ end + pose[:3, 3] for end in (capsule.p0, capsule.p1))
        square = float((b - a) @ (b - a))
        share = np.clip((points - a) @ (b - a) / square, 0.0, 1.0) if square else 0.0 * points[:, 0]
        feet = a + share[:, None] * (b - a)
        out.append(np.linalg.norm(points - feet, axis=1) - capsule.radius)
    return np.asarray(np.min(out, axis=0))


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3, 4))])
def test_every_body_lies_in_the_capsules_of_its_link(seed: int, tmp_path: Path) -> None:
    from test_robot_laws import urdf

    draw = np.random.default_rng(seed)
    package = tmp_path / "pk"
    for folder in ("meshes", "urdf"):
        (package / folder).mkdir(parents=True)
    (package / "package.xml").write_text("<package><name>pk</name></package>")
    absolute = urdf(seed, package / "meshes").replace("</robot>", f"{hanging(draw)}\n</robot>")
    path = package / "urdf" / "arm.urdf"
    path.write_text(in_three_ways(absolute, package))
    made = made_robot(RobotSource(path, payload=5.0, mass=60.0))
    # Pinocchio drops capsules without a word: the cylinder in each stands for it
    text = absolute.replace("<capsule", "<cylinder")
    other = tmp_path / "other.urdf"
    other.write_text(text)
    model = pinocchio.buildModelFromUrdf(str(other))
    shapes = pinocchio.buildGeomFromUrdf(model, str(other), pinocchio.GeometryType.COLLISION)
    assert len(shapes.geometryObjects) == text.count("<collision>") == sum(map(len, made.bodies))
    joints = {each.get("name"): each for each in ElementTree.fromstring(text).findall("joint")}
    names = [joint.name for joint in made.arm.joints]
    data, placed = model.createData(), shapes.createData()
    chain = Chain(made.robot)
    for q in draw.uniform(-2.4, 2.4, (POSTURES, 6)):
        full = pinocchio.neutral(model)
        planned = dict(zip(names, q.tolist(), strict=True))
        for k in range(1, model.njoints):
            value = value_of_joint(joints[model.names[k]], planned, draw)
            at = model.joints[k].idx_q
            full[at : at + model.joints[k].nq] = (
                [np.cos(value), np.sin(value)] if model.joints[k].nq == 2 else [value]
            )
        pinocchio.forwardKinematics(model, data, full)
        pinocchio.updateGeometryPlacements(model, data, shapes, placed)
        poses = chain.link_poses(q[None])[0]
        for shape, pose in zip(shapes.geometryObjects, placed.oMg, strict=True):
            joint = shape.parentJoint
            while joint and model.names[joint] not in names:
                joint = model.parents[joint]
            link = names.index(model.names[joint]) + 1 if joint else 0
            points = points_of(shape.geometry, draw) @ pose.rotation.T + pose.translation
            own = [each for each in made.robot.capsules if each.link == link]
            assert out_of(points, own, poses[link]).max() < DIGITS, shape.name
