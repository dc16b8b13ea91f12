"""URDFs and meshes as strangers might write them, each with what it says, and the judge of what was
read.
"""

from __future__ import annotations

import itertools
import re
import struct
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ir_cli.robot_from_urdf import RobotSource, made_robot
from ir_description.files.solid_mesh import read_solid
from ir_description.shapes import Capsule
from ir_kernels import Chain

sys.path.append(str(Path(__file__).parents[1] / "tools"))
from judge_robots import judged

POSTURES = 20
NEAR = 1e-9  # m: kinematics
INSIDE = 1e-7  # m: bodies in capsules


@dataclass(frozen=True, eq=False)
class Arm:
    """Origins (6, 3) [m], axes (6, 3), and a ball at the middle of every link: radii (7,) [m]."""

    origins: np.ndarray
    axes: np.ndarray
    radii: np.ndarray

    def frames(self, q: np.ndarray) -> list[np.ndarray]:
        """Frames (4, 4) of the base and the six links at q (6,) [rad]."""
        found = [np.eye(4)]
        for origin, axis, angle in zip(self.origins, self.axes, q, strict=True):
            step = np.eye(4)
            step[:3, :3] = Rotation.from_rotvec(angle * axis).as_matrix()
            step[:3, 3] = origin
            found.append(found[-1] @ step)
        return found


def drawn_arm(rng: np.random.Generator) -> Arm:
    """An arm of the usual kind in random proportions."""
    size = rng.uniform(0.3, 1.2)
    origins = size * np.array(
        [[0, 0, 0.5], [0.2, 0, 0], [0, 0, 0.8], [0.4, 0, 0.1], [0.4, 0, 0], [0.12, 0, 0]]
    )
    axes = np.array([[0, 0, 1], [0, 1, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0]], float)
    return Arm(origins, axes, size * rng.uniform(0.04, 0.08, 7))


def text_of(arm: Arm, more: str = "", link_6: str = "") -> str:
    """Its URDF; more: elements of the robot; link_6: elements of the last link."""
    names = ["base_link", *(f"l{k}" for k in range(1, 7))]
    lines = ['<?xml version="1.0"?>', '<robot name="arm">']
    for name, radius in zip(names, arm.radii.tolist(), strict=True):
        own = link_6 if name == "l6" else ""
        lines.append(
            f'<link name="{name}"><inertial><mass value="10"/><inertia ixx="0.1" iyy="0.1" '
            f'izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial><collision><geometry><sphere '
            f'radius="{radius!r}"/></geometry></collision>{own}</link>'
        )
    for k, (origin, axis) in enumerate(zip(arm.origins, arm.axes, strict=True), 1):
        lines.append(
            f'<joint name="j{k}" type="revolute"><parent link="{names[k - 1]}"/><child '
            f'link="{names[k]}"/><origin xyz="{" ".join(map(repr, origin.tolist()))}"/><axis '
            f'xyz="{" ".join(map(repr, axis.tolist()))}"/><limit lower="-2.5" upper="2.5" '
            f'effort="900" velocity="3"/></joint>'
        )
    return "\n".join([*lines, more, "</robot>"])


STOUT = (2.0, 2.6, 3.2)
"""How much wider than usual the balls of stout arms are."""
STOUT_POSTURES = 200
_MESH = (
    '<collision name="more"><origin xyz="{}" rpy="{}"/><geometry><mesh filename="{}" '
    'scale="{}"/></geometry></collision>'
)


def stout_urdfs(rng: np.random.Generator, folder: Path) -> Iterator[tuple[str, Path]]:
    """Name and file of arms whose links overlap by construction: wide balls, and beside each the
    hull of drawn points as a mesh.
    """
    for wider in STOUT:
        arm = drawn_arm(rng)
        arm = Arm(arm.origins, arm.axes, wider * arm.radii)
        name = f"stout {wider:g}"
        more = []
        for k, radius in enumerate(arm.radii.tolist()):
            mesh = folder / f"{name}_{k}.stl".replace(" ", "_")
            mesh.write_bytes(binary_stl(solid(rng)))
            place = 0.5 * arm.origins[k] if k < 6 else np.zeros(3)
            angles = rng.uniform(-3.0, 3.0, 3)
            scale = radius / 400.0 * rng.uniform(0.4, 1.2, 3)
            numbers = (" ".join(map(repr, each.tolist())) for each in (place, angles))
            size = " ".join(map(repr, scale.tolist()))
            more.append(_MESH.format(*numbers, f"file://{mesh}", size))
        bodies = iter(more)
        end = "</collision></link>"
        text = re.sub(end, lambda _, b=bodies: f"</collision>{next(b)}</link>", text_of(arm))
        path = folder / f"{name.replace(' ', '_')}.urdf"
        path.write_text(text)
        yield name, path


def meet_though_allowed(path: Path) -> str:
    """Where meshes meet in a posture that the robot's self check allows, though they are not built
    so, "" for nowhere. Raises InputError.
    """
    good, line = judged(RobotSource(path, payload=5.0, mass=100.0), STOUT_POSTURES)
    return "" if good else line


SHAPE = '<collision name="more"><origin xyz="0.05 0.1 0"/><geometry>{}</geometry></collision>'
FINGER = (
    '<link name="f"><inertial><mass value="8"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" '
    'ixz="0" iyz="0"/></inertial><collision><geometry><sphere radius="0.05"/></geometry>'
    '</collision></link><joint name="jf" type="prismatic"><parent link="l6"/><child link="f"/>'
    '<origin xyz="0.05 0.1 0"/><axis xyz="0 1 0"/><limit lower="0" upper="0.1" effort="9" '
    'velocity="1"/>{}</joint>'
)
FOLLOWER = re.sub(
    r"<limit[^>]*/></joint>$",
    "</joint>",
    FINGER.replace("prismatic", "continuous").format('<mimic joint="j6" multiplier="-0.5"/>'),
)
BALL = "a ball of 0.05 m at 0.05 0.1 0 of link 6"
CHANGES: dict[str, tuple[str, str]] = {
    "a limit of nan": (r'lower="-2.5"', 'lower="nan"'),
    "swapped limits": (r'lower="-2.5" upper="2.5"', 'lower="2.5" upper="-2.5"'),
    "a decimal comma": (r'velocity="3"', 'velocity="3,0"'),
    "an underscore": (r'velocity="3"', 'velocity="3_0"'),
    "a slash in a joint": (r'name="j2"', 'name="arm/j2"'),
    "an axis of zeros": (r'<axis xyz="[^"]*"', '<axis xyz="0 0 0"'),
    "two links of a name": (r'<link name="l2"', '<link name="l1"'),
    "a loop": (r'<child link="l6"', '<child link="base_link"'),
    "an entity": (r"<robot ", '<!DOCTYPE r [<!ENTITY a "9">]><robot '),
    "a mesh that is missing": (r'<sphere radius="[^"]*"/>', '<mesh filename="gone.stl"/>'),
    "a negative radius": (r'<sphere radius="', '<sphere radius="-'),
    "a cut file": (r"</joint>\n*</robot>", "</jo"),
}
"""What is wrong beyond repair, as a pattern and what stands there instead."""


def urdfs(rng: np.random.Generator, folder: Path) -> Iterator[tuple[str, Path, Arm, bool, bool]]:
    """Name, file, what it says, whether a ball (BALL) is on link 6, and whether it may be read."""
    arm = drawn_arm(rng)
    capsule = SHAPE.format('<capsule radius="0.05" length="1e-9"/>')
    box = SHAPE.format('<box size="0.05 0.05 0.05"/>')
    kept = {
        "plain": text_of(arm),
        "a capsule as a second shape": text_of(arm, link_6=capsule),
        "a box as a second shape": text_of(arm, link_6=box),
        "a finger on a prismatic joint": text_of(arm, FINGER.format("")),
        "a finger that mimics": text_of(arm, FINGER.format('<mimic joint="j6" multiplier="2"/>')),
        "a finger that turns as another joint": text_of(arm, FOLLOWER),
        "comments and CRLF": text_of(arm).replace("\n", "\r\n<!-- <link/> -->\r\n"),
    }
    for name, text in kept.items():
        path = folder / f"{name.replace(' ', '_')}.urdf"
        path.write_text(text, newline="")
        yield name, path, arm, "second" in name or "finger" in name, True
    for name, (pattern, instead) in CHANGES.items():
        path = folder / f"{name.replace(' ', '_')}.urdf"
        changed, count = re.subn(pattern, instead, text_of(arm), count=1)
        assert count == 1, name
        path.write_text(changed)
        yield name, path, arm, False, False


def misread_robot(path: Path, arm: Arm, more: bool, rng: np.random.Generator) -> str:
    """What was read otherwise than it stands in the file, "" where nothing was. Raises
    InputError.
    """
    robot = made_robot(RobotSource(path, payload=5.0, mass=100.0)).robot
    chain = Chain(robot)
    q = rng.uniform(-2.4, 2.4, (POSTURES, 6))
    poses = np.asarray(chain.link_poses(q))
    for row, angles in enumerate(q):
        frames = arm.frames(angles)
        balls = [(frame[:3, 3], radius) for frame, radius in zip(frames, arm.radii, strict=True)]
        if more:
            balls.append(((frames[6] @ [0.05, 0.1, 0.0, 1.0])[:3], 0.02))
        for number, (centre, radius) in enumerate(balls):
            link = min(number, 6)
            points = centre + radius * _BALL
            depth = np.max(
                [
                    _depth(points, poses[row, each.link], each)
                    for each in robot.capsules
                    if each.link == link
                ],
                axis=0,
            )
            if depth.min() < -INSIDE - 1e-6 * radius:
                out = -depth.min()
                return f"ball {number} stands out of the capsules of link {link} by {out:.3g} m"
    if not np.allclose(robot.position_max, 2.5, atol=1e-5):
        return "limits are others"
    return ""


def _directions() -> np.ndarray:
    """Points (N, 3) all over a ball of radius 1, on its surface and at half its depth."""
    turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(300)
    z = 1.0 - 2.0 * (np.arange(300) + 0.5) / 300
    beside = np.sqrt(1.0 - z**2)
    surface = np.stack([beside * np.cos(turn), beside * np.sin(turn), z], axis=1)
    return np.concatenate([surface, 0.5 * surface, np.zeros((1, 3))])


_BALL = _directions()


def _depth(points: np.ndarray, pose: np.ndarray, capsule: Capsule) -> np.ndarray:
    """How deep [m] points (N, 3) lie in a capsule of a link (N,)."""
    a, b = (pose[:3, :3] @ end + pose[:3, 3] for end in (capsule.p0, capsule.p1))
    along = b - a
    square = float(along @ along)
    share = np.clip((points - a) @ along / square, 0.0, 1.0) if square else np.zeros(len(points))
    return capsule.radius - np.linalg.norm(points - a - np.outer(share, along), axis=1)


def solid(rng: np.random.Generator) -> np.ndarray:
    """Triangles (T, 3, 3) of a convex solid with corners on whole millimetres, outwards."""
    points = rng.integers(-400, 400, (30, 3)).astype(float)
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    inwards = np.einsum("ti,ti->t", normals, hull.equations[:, :3]) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    return triangles


def binary_stl(triangles: np.ndarray, head: bytes = b"") -> bytes:
    rows = b"".join(
        struct.pack("<12fH", *np.zeros(3), *each.ravel(), 0) for each in triangles.astype("<f4")
    )
    return head.ljust(80, b" ") + struct.pack("<I", len(triangles)) + rows


def ascii_stl(triangles: np.ndarray) -> bytes:
    facets = [
        "facet normal 0 0 0\nouter loop\n"
        + "".join(f"vertex {p[0]:.9g} {p[1]:.9g} {p[2]:.9g}\n" for p in each)
        + "endloop\nendfacet\n"
        for each in triangles
    ]
    return ("solid part\n" + "".join(facets) + "endsolid part\n").encode()


def obj(triangles: np.ndarray, *, backwards: bool = False) -> bytes:
    lines = [f"v {p[0]:.9g} {p[1]:.9g} {p[2]:.9g}" for p in triangles.reshape(-1, 3)]
    count = len(lines)
    for k in range(len(triangles)):
        own = [3 * k + each + 1 for each in range(3)]
        lines.append("f " + " ".join(str(each - count - 1 if backwards else each) for each in own))
    return "\n".join(lines).encode()


def meshes(rng: np.random.Generator, folder: Path) -> Iterator[tuple[str, Path, np.ndarray, bool]]:
    """Name, file, its triangles, and whether it may be read."""
    triangles = solid(rng)
    whole = binary_stl(triangles)
    text = ascii_stl(triangles)
    faces = obj(triangles)
    files = {
        "binary that begins with solid.stl": (binary_stl(triangles, b"solid part"), True),
        "ascii.stl": (text, True),
        "corners from the end.obj": (obj(triangles, backwards=True), True),
        "CRLF and comments.obj": (faces.replace(b"\n", b"\r\n# v 9 9 9\r\n"), True),
        "an underscore.obj": (re.sub(rb"^v (-?\d)", rb"v \g<1>_0", faces, count=1), False),
        "an underscore.stl": (re.sub(rb"vertex (-?\d)", rb"vertex \g<1>_0", text, count=1), False),
        "a count that is missing.stl": (whole[:80] + whole[84:], False),
        "zero bytes.obj": (b"\0" * 400, False),
        "the drawing of a CAD system.sldprt": (whole, False),
        "cut.stl": (whole[:-25], False),
        "count too large.stl": (whole[:80] + struct.pack("<I", 10**6) + whole[84:], False),
        "cut ascii.stl": (text[: len(text) // 2].rsplit(b"\n", 1)[0], False),
        "a corner of nan.stl": (text.replace(b"vertex ", b"vertex nan ", 1), False),
        "an index that is not there.obj": (faces + b"\nf 1 2 99999", False),
        "a decimal comma.obj": (faces.replace(b"v ", b"v 1,5 ", 1), False),
        "an infinite corner.obj": (re.sub(rb"^v \S+", b"v inf", faces, count=1), False),
        "curved surfaces.step": (b"ISO-10303-21;\nHEADER;\n", False),
    }
    for name, (content, readable) in files.items():
        path = folder / name.replace(" ", "_")
        path.write_bytes(content)
        yield name, path, triangles, readable


def misread_mesh(path: Path, triangles: np.ndarray) -> str:
    """What was read otherwise, "" where nothing was. Raises InvalidValueError."""
    found = read_solid(path.parent, path.name).triangles
    if found.shape != triangles.shape:
        return f"{len(found)} triangles of {len(triangles)}"
    worst = max(
        float(np.abs(a - b).max()) for a, b in itertools.zip_longest(found, triangles, fillvalue=0)
    )
    return "" if worst <= 1e-4 else f"corners differ by {worst:.3g}"
