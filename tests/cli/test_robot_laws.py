"""A robot made from a URDF against Pinocchio and Coal, which read the same file: where it is, how
far its links are apart, and that a first movement of it is certified.
"""

from __future__ import annotations

import itertools
import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from ir_cli.home_posture import ROOMS, Postures
from ir_cli.main import main
from ir_cli.robot_from_urdf import RobotSource, made_robot
from ir_cli.self_pairs import SAFETY, pairs_of
from ir_description import InvalidValueError
from ir_description.files.making import urdf_arm
from ir_description.robot import ReducedDistance
from ir_kernels import Chain, CollisionModel

sys.path.append(str(Path(__file__).parents[2] / "tools"))

pinocchio = pytest.importorskip("pinocchio")
coal = pytest.importorskip("coal")

KINEMATICS = 1e-9  # m and entries of a rotation
POSTURES = 40
FAT_POSTURES = 120
TOUCH = 1e-6  # m: what the judge's distances are off by
AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
PLACES = ("0 0 0.4", "0.25 0.05 0.1", "0 0 0.7", "0.2 0 0.1", "0.5 0 0", "0.15 0 0")


def urdf(seed: int, meshes: Path | None = None, digits: int = 17, size: float = 1.0) -> str:
    """A six-axis arm with turned frames, two bodies of drawn kinds a link, and no masses; meshes: a
    folder for some of them that are meshes; digits: of the angles; size: of the bodies, against the
    arm.
    """
    draw = np.random.default_rng(seed)
    names = ["base_link", *(f"link_{k}" for k in range(1, 7))]
    turn = np.eye(3)  # of the frame of each link against the base at q = 0
    lines = ['<robot name="drawn">']
    for k, name in enumerate(names):
        to = np.array((*PLACES, "0.1 0 0")[k].split(), dtype=float)
        bodies = []
        for share in (0.15, 0.6):
            at = " ".join(f"{x:.17g}" for x in turn.T @ (share * to))
            one = shape(draw, size)
            turned = ""
            if meshes is not None:
                one = mesh(draw, meshes / f"{name}_{share}.stl", size)
                turned = f'rpy="{" ".join(f"{x:.6f}" for x in draw.uniform(-3.0, 3.0, 3))}"'
            bodies.append(
                f'<collision><origin xyz="{at}" {turned}/><geometry>{one}</geometry></collision>'
            )
        lines.append(f'<link name="{name}">{"".join(bodies)}</link>')
        if k < 6:
            other = draw.choice([0, 1, 2])
            step = np.roll(np.eye(3), int(other), axis=0)
            at = " ".join(f"{x:.17g}" for x in turn.T @ to)
            rpy = ((0, 0, 0), (np.pi / 2, 0, np.pi / 2), (-np.pi / 2, -np.pi / 2, 0))[other]
            step = rotation(*rpy)
            turn = turn @ step
            axis = " ".join(f"{x:.17g}" for x in turn.T @ np.array(AXES[k].split(), dtype=float))
            angles = " ".join(f"{x:.{digits}g}" for x in rpy)
            lines.append(
                f'<joint name="joint_{k + 1}" type="revolute"><parent link="{name}"/>'
                f'<child link="{names[k + 1]}"/><origin xyz="{at}" rpy="{angles}"/>'
                f'<axis xyz="{axis}"/>'
                '<limit lower="-2.4" upper="2.4" effort="0" velocity="2"/></joint>'
            )
    return "\n".join([*lines, "</robot>"])


def shape(draw: np.random.Generator, size: float) -> str:
    a, b, c = (f"{x:.4f}" for x in size * draw.uniform(0.03, 0.08, 3))
    return draw.choice(
        [
            f'<box size="{a} {b} {c}"/>',
            f'<cylinder radius="{a}" length="{b}"/>',
            f'<sphere radius="{a}"/>',
        ]
    )


def mesh(draw: np.random.Generator, path: Path, size: float) -> str:
    """A mesh that is not convex, thin, or far from its origin, at a scale that may mirror it."""
    a, b, c = draw.uniform(0.03, 0.09, 3)
    thin = draw.uniform(0.001, 0.01)
    kinds = {
        "channel": [((a, b, thin), (0, 0, 0)), ((a, thin, c), (0, b / 2, c / 2))],
        "frame": [((a, thin, thin), (0, s * b, 0)) for s in (-1, 1)]
        + [((thin, 2 * b, thin), (s * a / 2, 0, 0)) for s in (-1, 1)],
        "plate": [((a, b, 1e-4), (0, 0, 0))],
        "moved": [((a, b, c), (0.1, -0.05, 0.08))],
    }
    boxes = kinds[draw.choice([*kinds])]
    corners = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    sides = ConvexHull(corners).simplices
    scale = draw.uniform(0.5, 1.5, 3) * [1.0, draw.choice([-1.0, 1.0]), 1.0]
    facets = [size * (corners * box + at)[side] / scale for box, at in boxes for side in sides]
    return stl(np.array(facets), path, f'scale="{" ".join(f"{x:.17g}" for x in scale)}"')


def stl(facets: np.ndarray, path: Path, scale: str = "") -> str:
    """The element for triangles (T, 3, 3), which are written as a file of text."""
    path.write_text(
        "solid s\n"
        + "".join(
            "facet normal 0 0 0\nouter loop\n"
            + "".join(f"vertex {p[0]:.9g} {p[1]:.9g} {p[2]:.9g}\n" for p in facet)
            + "endloop\nendfacet\n"
            for facet in facets
        )
        + "endsolid s\n"
    )
    return f'<mesh filename="file://{path}" {scale}/>'


def rotation(roll: float, pitch: float, yaw: float) -> np.ndarray:
    return np.asarray(pinocchio.rpy.rpyToMatrix(roll, pitch, yaw))


@pytest.mark.parametrize(
    ("seed", "meshes"),
    [
        (1, False),
        (3, True),
        *(pytest.param(*each, marks=pytest.mark.long) for each in ((2, False), (4, True))),
    ],
)
def test_a_drawn_urdf_is_where_pinocchio_has_it_and_never_farther_apart(
    seed: int, meshes: bool, tmp_path: Path
) -> None:
    path = tmp_path / "drawn.urdf"
    path.write_text(urdf(seed, tmp_path if meshes else None))
    made = made_robot(RobotSource(path, payload=5.0, mass=60.0))
    model = pinocchio.buildModelFromUrdf(str(path))
    shapes = pinocchio.buildGeomFromUrdf(model, str(path), pinocchio.GeometryType.COLLISION)
    data = model.createData()
    placed = shapes.createData()
    chain = Chain(made.robot)
    q = np.random.default_rng(seed).uniform(-2.4, 2.4, (POSTURES, 6))
    poses = chain.link_poses(q)
    far = [
        (a.name, b.name)
        for a, b in itertools.combinations(made.robot.capsules, 2)
        if a.link != b.link
    ]
    ours = CollisionModel(chain, made.robot.capsules, (), far)
    distance = ours.distances(q)
    link = {capsule.name: capsule.link for capsule in made.robot.capsules}
    said = overhangs(made.shapes.sentences)
    bodies = [[g for g in shapes.geometryObjects if g.parentJoint == k] for k in range(7)]
    assert [len(each) for each in bodies] == [len(each) for each in made.bodies]
    for n, row in enumerate(q):
        pinocchio.forwardKinematics(model, data, row)
        pinocchio.updateGeometryPlacements(model, data, shapes, placed, row)
        zero = model.createData()
        pinocchio.forwardKinematics(model, zero, np.zeros(6))
        for k in range(1, 7):
            turned = data.oMi[k].rotation @ zero.oMi[k].rotation.T
            own = poses[n, k, :3, :3] @ chain.link_poses(np.zeros((1, 6)))[0, k, :3, :3].T
            assert np.abs(own - turned).max() < KINEMATICS
            if k < 6:
                assert np.abs(poses[n, k, :3, 3] - data.oMi[k].translation).max() < KINEMATICS
        for one, other in itertools.combinations(range(7), 2):
            least = min(
                coal_distance(shapes, placed, a, b) for a in bodies[one] for b in bodies[other]
            )
            near = [
                (distance[n, z], said[a] + said[b])
                for z, (_, a, b) in enumerate(ours.pairs)
                if {link[a], link[b]} == {one, other}
            ]
            below, slack = min(near)
            if least > 0.0:
                assert below <= least + TOUCH
            if below > 0.0:  # where capsules overlap, nothing is said of how far bodies are apart
                assert least - below <= slack + TOUCH


@pytest.mark.parametrize("digits", [5, 6, 7, 8])
def test_angles_of_few_digits_move_points_by_no_more_than_is_said(
    digits: int, tmp_path: Path
) -> None:
    """Frames and points half a metre beside them, against Pinocchio with the angles as written."""
    text = urdf(digits, digits=digits)
    arm = urdf_arm(text, "drawn.urdf")
    model = pinocchio.buildModelFromXML(text)
    data = model.createData()
    beside = 0.5 * np.eye(3)
    q = np.random.default_rng(digits).uniform(-2.4, 2.4, (POSTURES, 6))
    poses = Chain(arm).link_poses(np.concatenate([np.zeros((1, 6)), q]))
    pinocchio.forwardKinematics(model, data, np.zeros(6))
    zero = [placed.rotation.copy() for placed in data.oMi]
    moved = 0.0
    for row, pose in zip(q, poses[1:], strict=True):
        pinocchio.forwardKinematics(model, data, row)
        for k in range(1, 6):
            there = beside @ (data.oMi[k].rotation @ zero[k].T).T + data.oMi[k].translation
            here = beside @ (pose[k, :3, :3] @ poses[0, k, :3, :3].T).T + pose[k, :3, 3]
            moved = max(moved, float(np.linalg.norm(there - here, axis=1).max()))
    assert 1e-9 < moved <= arm.rounding
    assert any(f"by at most {1e6 * arm.rounding:.2g} um" in note for note in arm.notes)


@pytest.mark.parametrize(
    "seed", [1, *(pytest.param(seed, marks=pytest.mark.long) for seed in (2, 3))]
)
def test_a_home_leaves_room_to_every_pair_also_to_those_near_by_construction(
    seed: int, tmp_path: Path
) -> None:
    path = tmp_path / "drawn.urdf"
    path.write_text(urdf(seed))
    robot = made_robot(RobotSource(path, payload=5.0, mass=60.0)).robot
    model = CollisionModel(Chain(robot), robot.capsules, (), robot.self_pairs)
    own = {frozenset(each[:2]): each.distance for each in robot.reduced_distances}
    kept = [min(SAFETY, own.get(frozenset((a, b)), SAFETY)) for _, a, b in model.pairs]
    room = model.distances(robot.machine_home[None])[0] - np.array(kept)
    assert room.min() > 0.9 * min(min(each) for each in ROOMS)


@pytest.mark.parametrize("seed", [1, *(pytest.param(k, marks=pytest.mark.long) for k in (2, 3, 4))])
def test_shapes_meet_in_no_allowed_posture_but_where_they_are_built_so(
    seed: int, tmp_path: Path
) -> None:
    """Fat bodies that overlap by construction, in drawn postures and in those that are looked for;
    and the judge objects where less is kept.
    """
    from judge_robots import Judge, verdict

    path = tmp_path / "drawn.urdf"
    path.write_text(urdf(seed, tmp_path, size=3.5))
    source = RobotSource(path, payload=5.0, mass=60.0)
    made = made_robot(source)
    assert made.robot.reduced_distances
    judge = Judge(source, made)
    good, line = verdict(judge, made.robot, FAT_POSTURES)
    assert good, line
    unkept = tuple(ReducedDistance(*pair, -1.0, "") for pair in made.robot.self_pairs)
    good, line = verdict(judge, replace(made.robot, reduced_distances=unkept), FAT_POSTURES)
    assert not good, line


@pytest.mark.long
def test_links_that_lie_in_each_other_but_never_meet_keep_their_postures(tmp_path: Path) -> None:
    """A ball of link 4 around the middle of the wrist, and 12 mm outside of it half a shell of link
    6: their capsules overlap in every posture.
    """
    from judge_robots import Judge, verdict

    turns = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(2000)
    z = np.linspace(-1.0, 1.0, len(turns))
    beside = np.sqrt(1.0 - z**2)
    points = np.stack([beside * np.cos(turns), beside * np.sin(turns), z], axis=1)
    around = points[ConvexHull(points).simplices]
    shell = around[around[:, :, 0].min(axis=1) > 0.1]
    meshes = {
        4: stl(0.05 * around + [0.5, 0.0, 0.0], tmp_path / "ball.stl"),
        6: stl(0.062 * shell - [0.15, 0.0, 0.0], tmp_path / "shell.stl"),
    }
    names = ["base_link", *(f"link_{k}" for k in range(1, 7))]
    lines = ['<robot name="nested">']
    for k, name in enumerate(names):
        one = meshes.get(k, '<box size="0.04 0.04 0.04"/>')
        lines.append(
            f'<link name="{name}"><collision><geometry>{one}</geometry></collision></link>'
        )
        if k < 6:
            lines.append(
                f'<joint name="joint_{k + 1}" type="revolute"><parent link="{name}"/>'
                f'<child link="{names[k + 1]}"/><origin xyz="{PLACES[k]}"/><axis xyz="{AXES[k]}"/>'
                '<limit lower="-2.4" upper="2.4" effort="0" velocity="2"/></joint>'
            )
    path = tmp_path / "nested.urdf"
    path.write_text("\n".join([*lines, "</robot>"]))
    source = RobotSource(path, payload=5.0, mass=60.0)
    made = made_robot(source)
    link = {capsule.name: capsule.link for capsule in made.robot.capsules}
    nested = [
        each
        for each in made.robot.reduced_distances
        if {link[each.first], link[each.second]} == {4, 6}
    ]
    assert nested
    assert all("meet nowhere beyond: it is proved" in each.reason for each in nested)
    good, line = verdict(Judge(source, made), made.robot, POSTURES)
    assert good, line


def test_a_linkage_that_fills_the_work_of_the_arm_is_named_with_the_remedy(tmp_path: Path) -> None:
    """What a lever beside the planned axes can reach is a part of its link."""
    lever = (
        '<link name="lever"><collision><geometry><box size="0.1 0.02 0.02"/></geometry></collision>'
        '</link><joint name="side" type="revolute"><parent link="link_2"/><child link="lever"/>'
        '<axis xyz="0 1 0"/><mimic joint="joint_3"/><limit lower="-1" upper="1" velocity="1" '
        'effort="1"/></joint></robot>'
    )
    path = tmp_path / "drawn.urdf"
    path.write_text(urdf(1).replace("</robot>", lever))
    made = made_robot(RobotSource(path, payload=5.0, mass=60.0))
    limits = made.robot.position_min, made.robot.position_max
    capsules = tuple(
        replace(each, radius=2.0) if each.link == 2 else each for each in made.shapes.capsules
    )
    postures = Postures(made.arm, capsules, made.pairs, limits, np.full(6, np.inf), 5.0)
    with pytest.raises(InvalidValueError, match=r"leave it out \(--without lever\)"):
        postures.home()
    made = made_robot(RobotSource(path, payload=5.0, mass=60.0, without=("lever",)))
    assert any("lever is left out as asked" in note for note in made.notes)


def test_a_capsule_whose_link_lies_in_narrower_ones_takes_no_postures(tmp_path: Path) -> None:
    """It stands for nothing that could meet; one of a link without a body may not overlap."""
    ball = '<geometry><sphere radius="0.05"/></geometry>'
    path = tmp_path / "balls.urdf"
    path.write_text(re.sub("<geometry>.*?</geometry>", ball, urdf(1)))
    made = made_robot(RobotSource(path, payload=5.0, mass=60.0))
    wide = next(each for each in made.shapes.capsules if each.link == 2)
    wide = replace(wide, name="wide", radius=0.6)
    capsules = (*made.shapes.capsules, wide)
    limits = made.robot.position_min, made.robot.position_max
    held = pairs_of(made.arm, capsules, made.bodies, *limits, None)
    own = [each for each in held.reduced if "wide" in each[:2]]
    assert own
    assert all("meet nowhere beyond: it is proved" in each.reason for each in own)
    assert all(each.distance < 0.0 for each in own)
    bare = pairs_of(made.arm, capsules, (*made.bodies[:2], (), *made.bodies[3:]), *limits, None)
    own = [each for each in bare.reduced if "wide" in each[:2]]
    assert own
    assert all(each.distance >= 0.0 for each in own)


@pytest.mark.long
def test_a_flat_end_at_a_joint_beside_a_box_leaves_postures(tmp_path: Path) -> None:
    """Ends of capsules stand out of both, so that these overlap alike in every posture."""
    from judge_robots import Judge, verdict

    places = ("0 0 0.3", "0.1 0 0.2", "0 0 0.6", "0 0 0.05", "0.6 0 0", "0.1 0 0")
    bodies = (
        '<origin xyz="0 0 0.15"/><geometry><cylinder radius="0.12" length="0.3"/></geometry>',
        '<geometry><box size="0.2 0.2 0.2"/></geometry>',
        '<origin xyz="0 0 0.3"/><geometry><cylinder radius="0.07" length="0.6"/></geometry>',
        '<geometry><box size="0.16 0.16 0.16"/></geometry>',
        '<origin xyz="0.3 0 0"/><geometry><box size="0.5 0.12 0.12"/></geometry>',
        '<origin xyz="0.03 0 0"/><geometry><sphere radius="0.06"/></geometry>',
        '<origin xyz="-0.02 0 0"/><geometry><cylinder radius="0.04" length="0.04"/></geometry>',
    )
    names = ["base_link", *(f"link_{k}" for k in range(1, 7))]
    lines = ['<robot name="flat">']
    lines += [
        f'<link name="{name}"><collision>{body}</collision></link>'
        for name, body in zip(names, bodies, strict=True)
    ]
    lines += [
        f'<joint name="joint_{k + 1}" type="revolute"><parent link="{names[k]}"/>'
        f'<child link="{names[k + 1]}"/><origin xyz="{places[k]}"/><axis xyz="{AXES[k]}"/>'
        '<limit lower="-2.4" upper="2.4" effort="0" velocity="2"/></joint>'
        for k in range(6)
    ]
    path = tmp_path / "flat.urdf"
    path.write_text("\n".join([*lines, "</robot>"]))
    source = RobotSource(path, payload=5.0, mass=60.0)
    made = made_robot(source)
    assert not made.pairs.unclear
    good, line = verdict(Judge(source, made), made.robot, POSTURES)
    assert good, line


def coal_distance(shapes: object, placed: object, a: object, b: object) -> float:
    i = shapes.getGeometryId(a.name)  # type: ignore[attr-defined]
    j = shapes.getGeometryId(b.name)  # type: ignore[attr-defined]
    result = coal.DistanceResult()
    one, other = (
        coal.Transform3s(placed.oMg[k].rotation, placed.oMg[k].translation) for k in (i, j)
    )  # type: ignore[attr-defined]
    return float(
        coal.distance(a.geometry, one, b.geometry, other, coal.DistanceRequest(), result)  # type: ignore[attr-defined]
    )


def overhangs(sentences: tuple[str, ...]) -> dict[str, float]:
    """What the command says: name of a capsule, and how far [m] it stands out."""
    found = {}
    for sentence in sentences:
        name, _, rest = sentence.partition(":")
        stated = rest.partition("stands out ")[2].partition(" mm")[0]
        found[name] = 1e-3 * float(stated) if stated else 0.0
    return found


def test_one_command_leads_to_a_certified_movement(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drawn.urdf").write_text(urdf(3))
    assert main(["robot", "new", "drawn.urdf", "--payload", "5", "--mass", "60"]) == 0
    said = capsys.readouterr().out
    assert "14 bodies of the URDF in" in said
    assert "estimated (confidence L)" in said
    assert main(["plan", "--robot", "drawn", "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["certified"]
    assert 0.0 < plan["joules_low"] < plan["joules"] < plan["joules_high"]


def test_nothing_is_written_where_nothing_could_be_planned(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "drawn.urdf"
    path.write_text(urdf(3))
    out = tmp_path / "out.yaml"
    assert main(["robot", "new", str(path), "-o", str(out)]) == 2
    assert "give --payload KG" in capsys.readouterr().err
    assert main(["robot", "new", str(path), "--payload", "nan", "-o", str(out)]) == 2
    assert main(["robot", "new", str(path), "--payload", "5", "--mass", "-1", "-o", str(out)]) == 2
    assert not out.exists()
