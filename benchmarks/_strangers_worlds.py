"""Worlds as strangers might write them: SDF with its frames, includes and meshes, Collada files,
MoveIt's .scene.

Each comes with the corners of the bodies that it says, and the judge of what was read.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from ir_description.cell import NameRegister
from ir_description.files.worlds import read_world

NEAR = 1e-7  # m: corners
MORE = 1.02  # volume of pieces of a mesh over its own
INCH = 0.0254  # m


@dataclass(frozen=True, eq=False)
class WorldCase:
    """A file, the corners [m] of each body that it says, how many things of it must be named as
    left out, and whether it may be read.
    """

    name: str
    path: Path
    bodies: list[np.ndarray] = field(default_factory=list)
    left_out: int = 0
    readable: bool = True


def drawn_pose(rng: np.random.Generator) -> tuple[str, np.ndarray]:
    """A pose as six numbers, and as a matrix (4, 4)."""
    xyz = rng.uniform(-1.0, 1.0, 3)
    rpy = rng.uniform(-1.5, 1.5, 3)
    pose = np.eye(4)
    pose[:3, :3] = Rotation.from_euler("xyz", rpy).as_matrix()
    pose[:3, 3] = xyz
    return " ".join(f"{x:.17g}" for x in (*xyz, *rpy)), pose


def corners(size: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Corners (8, 3) of a box in the world."""
    own = np.array(list(itertools.product(*((-s / 2, s / 2) for s in size))))
    return moved(own, pose)


def moved(points: np.ndarray, pose: np.ndarray) -> np.ndarray:
    return np.asarray(points @ pose[:3, :3].T + pose[:3, 3])


SIZE = np.array([0.3, 0.2, 0.1])
BOX = "<geometry><box><size>0.3 0.2 0.1</size></box></geometry>"


def collision(pose: str = "", geometry: str = BOX, *, to: str = "") -> str:
    relative = f"relative_to='{to}'" if to else ""
    return f"<collision name='c'><pose {relative}>{pose}</pose>{geometry}</collision>"


def model(inside: str, pose: str = "", *, name: str = "m", more: str = "") -> str:
    return f"<model name='{name}' {more}><static>true</static><pose>{pose}</pose>{inside}</model>"


def sdf(inside: str, version: str = "1.9") -> str:
    return f"<sdf version='{version}'><world name='w'>{inside}</world></sdf>"


def mesh(file: str, scale: str = "1 1 1", more: str = "") -> str:
    return f"<geometry><mesh><uri>{file}</uri><scale>{scale}</scale>{more}</mesh></geometry>"


def solid(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Corners (N, 3) of a convex solid, and its triangles (T, 3), outwards."""
    directions = rng.normal(size=(14, 3))
    points = directions / np.linalg.norm(directions, axis=1, keepdims=True) * [0.3, 0.2, 0.4]
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = (points[faces[:, k]] for k in range(3))
    inwards = np.einsum("ni,ni->n", np.cross(b - a, c - a), hull.equations[:, :3]) < 0.0
    faces[inwards] = faces[inwards][:, ::-1]
    return points, faces


def numbers(values: np.ndarray) -> str:
    return " ".join(f"{x:.17g}" for x in np.ravel(values))


def collada(
    points: np.ndarray,
    faces: np.ndarray,
    nodes: str = "<node><instance_geometry url='#g'/></node>",
    *,
    unit: str = "1",
    up: str = "Z_UP",
    params: str = "XYZ",
    more: str = "",
) -> str:
    """A Collada file of one geometry, placed by nodes."""
    names = "".join(f"<param name='{each}' type='float'/>" for each in params)
    return (
        "<?xml version='1.0'?><COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' "
        f"version='1.4.1'><asset><unit name='u' meter='{unit}'/><up_axis>{up}</up_axis></asset>"
        "<library_geometries><geometry id='g'><mesh><source id='s'><float_array id='a' "
        f"count='{points.size}'>{numbers(points)}</float_array><technique_common><accessor "
        f"source='#a' count='{len(points)}' stride='3'>{names}</accessor></technique_common>"
        "</source><vertices id='v'><input semantic='POSITION' source='#s'/></vertices><triangles "
        f"count='{len(faces)}'><input semantic='VERTEX' source='#v' offset='0'/><p>"
        f"{' '.join(map(str, faces.ravel()))}</p></triangles></mesh></geometry>{more}"
        f"</library_geometries><library_visual_scenes><visual_scene id='vs'>{nodes}"
        "</visual_scene></library_visual_scenes><scene><instance_visual_scene url='#vs'/></scene>"
        "</COLLADA>"
    )


def worlds(rng: np.random.Generator, folder: Path) -> Iterator[WorldCase]:
    """All worlds of a seed, each in a folder of its own."""
    drawn = [*_frames(rng), *_pieces(), *_wrong(rng), *_meshes(rng), *_scenes(rng)]
    for number, (name, files, bodies, left_out, readable) in enumerate(drawn):
        home = folder / f"world_{number}"
        for file, text in files.items():
            path = home / file
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, newline="")
        yield WorldCase(name, home / next(iter(files)), bodies, left_out, readable)


_Drawn = tuple[str, dict[str, str], list[np.ndarray], int, bool]


def _frames(rng: np.random.Generator) -> Iterator[_Drawn]:
    """Right worlds whose poses are relative to one another."""
    (a, A), (b, B), (c, C), (d, _) = (drawn_pose(rng) for _ in range(4))
    there = corners(SIZE, A @ B @ C)
    one = f"<link name='l'><pose>{b}</pose>{collision(c)}</link>"
    link_a = f"<link name='a'><pose>{a}</pose></link>"
    quaternion = np.array([*A[:3, 3], *Rotation.from_matrix(A[:3, :3]).as_quat()])
    degrees = " ".join(
        f"{x:.17g}" for x in (*A[:3, 3], *np.degrees(np.array(a.split()[3:], float)))
    )
    texts = {
        "poses in poses": sdf(model(one, a)),
        "a pose as quaternion": sdf(
            model(one).replace(
                "<pose></pose>",
                f"<pose rotation_format='quat_xyzw'>{numbers(quaternion)}</pose>",
                1,
            )
        ),
        "a pose in degrees": sdf(
            model(one).replace("<pose></pose>", f"<pose degrees='true'>{degrees}</pose>", 1)
        ),
        "a link relative to a link": sdf(
            model(link_a + one.replace("<pose>", "<pose relative_to='a'>", 1))
        ),
        "a link relative to a link as SDF 1.6 says it": sdf(
            model(link_a + one.replace("<pose>", "<pose frame='a'>", 1)), "1.6"
        ),
        "a body relative to a frame on a link": sdf(
            model(
                f"{link_a}<frame name='f' attached_to='a'><pose>{b}</pose></frame><link name='l'>"
                f"<pose>{d}</pose>{collision(c, to='f')}</link>"
            )
        ),
        "a body relative to a joint": sdf(
            model(
                f"{link_a}<link name='l'><pose>{d}</pose>{collision(c, to='j')}"
                f"</link><joint name='j' type='fixed'><pose>{b}</pose><parent>l</parent><child>a"
                "</child></joint>"
            )
        ),
        "a link relative to a frame of a model inside": sdf(
            model(
                model(f"<frame name='f'><pose>{b}</pose></frame>", a, name="n")
                + f"<link name='l'><pose relative_to='n::f'>{c}</pose>{collision()}</link>"
            )
        ),
        "a model relative to a frame of the world": sdf(
            f"<frame name='f'><pose>{a}</pose></frame>"
            + model(f"<link name='l'>{collision(c)}</link>", b).replace(
                "<pose>", "<pose relative_to='f'>", 1
            )
        ),
        "a model placed by one of its frames": sdf(
            model(
                f"<link name='x'><pose>{d}</pose></link><link name='l'><pose relative_to='x'>{b}"
                f"</pose>{collision(c)}</link>",
                a,
                more="placement_frame='x'",
            )
        ),
    }
    for name, text in texts.items():
        yield name, {"w.sdf": text}, [there], 0, True
    included = {
        "w.sdf": sdf(
            f"<frame name='f'><pose>{a}</pose></frame><include><uri>model://one</uri>"
            f"<pose relative_to='f'>{b}</pose></include>"
        ),
        "one/model.sdf": "<sdf version='1.9'><model name='one'><include><uri>model://two</uri>"
        f"<pose>{c}</pose></include></model></sdf>",
        "two/model.sdf": "<sdf version='1.9'><model name='two'><pose>9 9 9 0 0 0</pose>"
        f"<link name='l'>{collision()}</link></model></sdf>",
    }
    yield "includes in includes", included, [there], 0, True


def _pieces() -> Iterator[_Drawn]:
    """Worlds of which a part can't be read: it must be named, and the rest be there."""
    here = [corners(SIZE, np.eye(4))]
    good = model(f"<link name='l'>{collision()}</link>", name="good")
    cycle = (
        "<sdf version='1.9'><model name='r'><include><uri>model://r</uri></include></model></sdf>"
    )
    bad = {
        "a mesh that is missing": collision(geometry=mesh("gone.stl")),
        "two shapes in one geometry": collision(geometry=BOX.replace("<box>", "<box/><box>")),
        "a heightmap": collision(geometry="<geometry><heightmap/></geometry>"),
        "no geometry": "<collision name='c'/>",
        "visuals only": collision().replace("collision", "visual"),
    }
    parts = {name: model(f"<link name='l'>{body}</link>") for name, body in bad.items()}
    parts |= {
        "an include that is missing": "<include><uri>model://gone</uri></include>",
        "an include that includes itself": "<include><uri>model://r</uri></include>",
        "an actor": "<actor name='walker'/>",
        "a model that moves": model(
            f"<link name='l'>{collision()}</link><joint name='j' type='prismatic'/>"
        ),
    }
    for name, part in parts.items():
        yield name, {"w.sdf": sdf(good + part), "r/model.sdf": cycle}, here, 1, True
    two = sdf(good).replace("</sdf>", f"<world name='v'>{good}</world></sdf>")
    yield "a second world", {"w.sdf": two}, here, 1, True
    beside = sdf(good).replace("</sdf>", f"{good}</sdf>")
    yield "a model beside the world", {"w.sdf": beside}, here, 1, True


def _wrong(rng: np.random.Generator) -> Iterator[_Drawn]:
    """Worlds that are wrong beyond repair."""
    pose, _ = drawn_pose(rng)
    link = f"<link name='l'><pose>{pose}</pose>{collision()}</link>"
    whole = sdf(model(link))
    ring = (
        "<frame name='f'><pose relative_to='g'/></frame><frame name='g'><pose relative_to='f'/>"
        "</frame><link name='l'><pose relative_to='f'/></link>"
    )
    texts = {
        "a pose of nan": whole.replace(pose, "nan 0 0 0 0 0"),
        "a pose with an underscore": whole.replace(pose, "1_0 0 0 0 0 0"),
        "a pose of five numbers": whole.replace(pose, "0 0 0 0 0"),
        "a pose very far away": whole.replace(pose, "1e300 0 0 0 0 0"),
        "a quaternion of length 0": whole.replace(
            f"<pose>{pose}", "<pose rotation_format='quat_xyzw'>0 0 0 0 0 0 0"
        ),
        "frames in a ring": sdf(model(ring + link)),
        "a frame that is not there": whole.replace(
            f"<pose>{pose}", f"<pose relative_to='x'>{pose}"
        ),
        "a box of a negative size": whole.replace("0.3 0.2", "0.3 -0.2"),
        "a box of an infinite size": whole.replace("0.3 0.2", "0.3 inf"),
        "a cut file": whole[: len(whole) // 2],
        "an entity": "<!DOCTYPE s [<!ENTITY a 'b'>]>" + whole,
        "visuals and nothing else": whole.replace("collision", "visual"),
        "no body at all": sdf(""),
        "another document": "<html/>",
    }
    for name, text in texts.items():
        yield name, {"w.sdf": text}, [], 0, False
    twice = "<include><uri>model://{0}</uri></include>" * 2
    files = {"w.sdf": sdf(twice.format("m0"))}
    for k in range(19):
        inside = f"<model name='m{k}'>{twice.format(f'm{k + 1}')}</model>"
        files[f"m{k}/model.sdf"] = f"<sdf version='1.9'>{inside}</sdf>"
    yield "includes that double at each of 20 levels", files, [], 0, False


def _meshes(rng: np.random.Generator) -> Iterator[_Drawn]:
    """Collada meshes in a world, right and wrong ones."""
    points, faces = solid(rng)
    pose, P = drawn_pose(rng)
    shear = np.eye(4)
    shear[:3, :3] += rng.uniform(-0.3, 0.3, (3, 3))
    shear[:3, 3] = rng.uniform(-0.5, 0.5, 3)
    instance = "<instance_geometry url='#g'/>"
    tree = (
        f"<node><translate>0 0 1</translate><node><rotate>0 0 1 90</rotate><scale>2 1 1</scale>"
        f"{instance}</node></node>"
    )
    turned = np.array([[0.0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 1, 1], [0, 0, 0, 1]])
    placed = turned @ np.diag([2.0, 1.0, 1.0, 1.0])
    two = f"<node>{instance}</node><node><translate>3 0 0</translate>{instance}</node>"
    flip = np.array([1.0, -1.0, 1.0])
    beside = points + np.array([3.0, 0.0, 0.0])
    right = {
        "Collada": (collada(points, faces), "1 1 1", [points]),
        "Collada in millimetres": (collada(1e3 * points, faces, unit="0.001"), "1 1 1", [points]),
        "Collada in inches": (collada(points / INCH, faces, unit="0.0254"), "1 1 1", [points]),
        "Collada that calls y up": (collada(points, faces, up="Y_UP"), "1 1 1", [points]),
        "Collada with a node in a node": (
            collada(points, faces, tree),
            "1 1 1",
            [moved(points, placed)],
        ),
        "Collada with a sheared node": (
            collada(points, faces, f"<node><matrix>{numbers(shear)}</matrix>{instance}</node>"),
            "1 1 1",
            [moved(points, shear)],
        ),
        "Collada with two instances": (
            collada(points, faces, two),
            "1 1 1",
            [points, beside],
        ),
        "a mirrored mesh": (collada(points, faces), "1 -1 1", [points * flip]),
        "a scaled mesh": (collada(1e3 * points, faces), "0.001 0.001 0.002", [points * [1, 1, 2]]),
    }
    for name, (text, scale, bodies) in right.items():
        world = sdf(
            model(f"<link name='l'>{collision(geometry=mesh('a.dae', scale))}</link>", pose)
        )
        there = [moved(each, P) for each in bodies]
        yield name, {"w.sdf": world, "a.dae": text}, there, 0, True
    world = sdf(model(f"<link name='l'>{collision(geometry=mesh('a.dae'))}</link>"))
    plain = collada(points, faces)
    node = "<node><instance_geometry url='#g'/></node>"
    wrong = {
        "Collada with a skew": plain.replace(
            node, f"<node><skew>30 1 0 0 0 1 0</skew>{node}</node>"
        ),
        "Collada with a lookat": plain.replace(
            node, f"<node><lookat>1 0 0 0 0 0 0 0 1</lookat>{node}</node>"
        ),
        "Collada of unit 0": collada(points, faces, unit="0"),
        "Collada of unit nan": collada(points, faces, unit="nan"),
        "Collada with corners z y x": collada(points, faces, params="ZYX"),
        "Collada with a corner of nan": plain.replace(numbers(points[:1]), "nan 0 0"),
        "Collada with an index that is not there": collada(points, faces + 1),
        "Collada with a turn about nothing": plain.replace(
            node, f"<node><rotate>0 0 0 90</rotate>{node}</node>"
        ),
        "Collada with a node that it does not have": plain.replace("url='#g'", "url='#h'"),
    }
    for name, text in wrong.items():
        yield name, {"w.sdf": world, "a.dae": text}, [], 0, False
    flat = sdf(model(f"<link name='l'>{collision(geometry=mesh('a.dae', '1 1 0'))}</link>"))
    yield "a mesh of scale 0", {"w.sdf": flat, "a.dae": plain}, [], 0, False
    part = mesh("a.dae", more="<submesh><name>g</name><center>true</center></submesh>")
    centred = sdf(model(f"<link name='l'>{collision(geometry=part)}</link>"))
    yield "a submesh in its own middle", {"w.sdf": centred, "a.dae": plain}, [], 0, False


def _scenes(rng: np.random.Generator) -> Iterator[_Drawn]:
    """MoveIt's .scene files."""
    _, A = drawn_pose(rng)
    _, B = drawn_pose(rng)
    points, faces = solid(rng)
    box = f"box\n{numbers(SIZE)}\n{_scene_pose(B)}\n0 0 0 0\n"
    wedge = (
        f"mesh\n{len(points)} {len(faces)}\n"
        + "".join(f"{numbers(each)}\n" for each in points)
        + "".join(f"{' '.join(map(str, each))}\n" for each in faces)
        + f"{_scene_pose(np.eye(4))}\n0 0 0 0\n"
    )
    new = f"cell\n* a table\n{_scene_pose(A)}\n2\n{box}{wedge}1\ntop\n{_scene_pose(B)}\n.\n"
    old = f"cell\n* a table\n2\n{box}{wedge}.\n"
    both = [corners(SIZE, B), points]
    placed = [corners(SIZE, A @ B), moved(points, A)]
    cone = f"* hat\n{_scene_pose(A)}\n1\ncone\n0.1 0.2\n{_scene_pose(B)}\n0 0 0 0\n0\n.\n"
    right = {
        "a scene": (new, placed, 0),
        "a scene of MoveIt 1.0": (old, both, 0),
        "a scene without a name": (new.replace("cell", "", 1), placed, 0),
        "a scene with CRLF": (new.replace("\n", "\r\n"), placed, 0),
        "a scene with a cone": (new[:-2] + cone, placed, 1),
    }
    for name, (text, bodies, left_out) in right.items():
        yield name, {"w.scene": text}, bodies, left_out, True
    wrong = {
        "a scene that goes on after its end": new + new,
        "a scene without an end": new[:-2],
        "a scene of a box with two lengths": new.replace(numbers(SIZE), numbers(SIZE[:2]), 1),
        "a scene of a negative box": new.replace(numbers(SIZE), numbers(-SIZE), 1),
        "a scene with a quaternion of length 0": new.replace(_scene_pose(A), "0 0 0\n0 0 0 0", 1),
        "a scene with a pose very far away": new.replace(_scene_pose(A), "1e300 0 0\n0 0 0 1", 1),
        "a scene with an unknown shape": new.replace("box\n", "octree\n", 1),
        "a scene with a count of nan": new.replace("\n2\nbox", "\nnan\nbox", 1),
    }
    for name, text in wrong.items():
        assert text != new, name
        yield name, {"w.scene": text}, [], 0, False


def _scene_pose(pose: np.ndarray) -> str:
    return f"{numbers(pose[:3, 3])}\n{numbers(Rotation.from_matrix(pose[:3, :3]).as_quat())}"


def misread_world(case: WorldCase) -> str:
    """What was read otherwise, "" where nothing was. Raises InvalidValueError."""
    world = read_world(case.path, NameRegister("body"))
    if len(world.left_out) != case.left_out:
        return f"left out are {len(world.left_out)}, must be {case.left_out}: {world.left_out}"
    found = []
    for machine in world.machines:
        for body in machine.bodies:
            pose = machine.pose @ body.pose
            own = body.vertices if body.kind == "mesh" else None
            found.append(corners(body.size, pose) if own is None else moved(own, pose))
    if len(found) != len(case.bodies):
        return f"there are {len(found)} bodies of {len(case.bodies)}"
    for wanted in case.bodies:
        if not any(_same(wanted, each) for each in found):
            return f"no body has the corners {np.round(wanted[:2], 4).tolist()} .."
    return ""


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    """Whether the hull of `other` contains the corners `one`, and hardly more."""
    hull = ConvexHull(other)
    outside = one @ hull.equations[:, :3].T + hull.equations[:, 3]
    return bool(outside.max() < NEAR and hull.volume <= MORE * ConvexHull(one).volume)
