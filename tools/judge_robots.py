"""Is a robot made from a URDF where the file has it? Judged by Pinocchio and Coal.

    python tools/judge_robots.py URDF.. [--packages FOLDER] [--postures N]

Links must stand where Pinocchio has them, within 1 nm and what the command says of rounded angles;
distances of capsules must not be above those of the meshes, and below them by no more than the
capsules are said to stand out. And the self check: shapes of links that are no neighbours may meet
in no posture that it allows, of random ones and of those that are looked for: from the nearest
random ones towards what meets, and from what meets towards what is allowed. Of links that meet in
every random posture, as a shaft does in its housing, only the place counts: a ring about the joint
that leads from a link towards the other one; they are built so in rings in which they meet in at
least a third of all postures, and a robot fails where any meets more than 35 mm beside these. Exit
code 1 where a robot fails.
"""

from __future__ import annotations

import argparse
import itertools
import re
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import coal
import numpy as np
import pinocchio
from scipy.spatial import ConvexHull, cKDTree

from ir_cli.errors import InputError
from ir_cli.robot_from_urdf import MadeRobot, RobotSource, made_robot, urdf_text
from ir_cli.self_pairs import SAFETY
from ir_description import RobotModel
from ir_kernels import Chain, CollisionModel

BUILT_SO = 1.0 / 3.0
RING = 0.01  # m: width and height of a ring
BESIDE = 0.035  # m from what meets by construction
CONTACTS = 30_000
COUNTED = 100  # postures in which rings are counted
FINE = 0.012  # m: edge of triangles whose contacts are counted in rings, at most
ROUND = 500  # corners of a ball or a cylinder in triangles
STARTS = 4
TURNS = (0.3, 0.1, 0.03, 0.01, 0.003)  # rad: what is tried around a posture
TRIED = 10  # times each
NEAR = 1e-9  # m, and entries of a rotation
TOUCH = 1e-6  # m: what Coal's distances are off by
FEW = 12  # postures in which all distances are measured


class Judge:
    """Meshes of a URDF, as Pinocchio reads it."""

    def __init__(self, source: RobotSource, made: MadeRobot) -> None:
        above = [*source.urdf.resolve().parents][:6]
        packages = [str(each) for each in (source.packages, *above) if each is not None]
        with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
            file.write(_solid(_with_own_package(urdf_text(source), above)))
            file.flush()
            self.model = pinocchio.buildModelFromUrdf(file.name)
            self.shapes, only_seen = (
                pinocchio.buildGeomFromUrdf(self.model, file.name, kind, package_dirs=packages)
                for kind in (pinocchio.GeometryType.COLLISION, pinocchio.GeometryType.VISUAL)
            )
        for shape in only_seen.geometryObjects:
            self.shapes.addGeometryObject(shape)
        self.data = self.model.createData()
        self.placed = self.shapes.createData()
        names = [joint.name for joint in made.arm.joints]
        self.columns = [self.model.joints[self.model.getJointId(name)].idx_q for name in names]
        self.joints = [self.model.getJointId(name) for name in names]
        still = pinocchio.neutral(self.model)
        self.axes = {
            joint: pinocchio.computeJointJacobian(self.model, self.data, still, joint)[
                3:, self.model.joints[joint].idx_v
            ]
            for joint in self.joints
        }
        link = {joint: k + 1 for k, joint in enumerate(self.joints)}
        self.bodies: list[list[Any]] = [[] for _ in range(7)]
        for shape in self.shapes.geometryObjects:
            if _mixed_up(shape.meshPath):
                shape.geometry = _by_trimesh(shape.meshPath, shape.meshScale)
            joint = shape.parentJoint
            while joint and joint not in link:  # of a joint that is not planned: what carries it
                joint = self.model.parents[joint]
            self.bodies[link.get(joint, 0)].append(shape)
        self._fine: dict[str, Any] = {}

    def place(self, q: np.ndarray) -> None:
        """Move everything to joint values (6,) [rad]."""
        full = pinocchio.neutral(self.model)
        full[self.columns] = q
        pinocchio.forwardKinematics(self.model, self.data, full)
        pinocchio.updateGeometryPlacements(self.model, self.data, self.shapes, self.placed)

    def frames(self, q: np.ndarray) -> np.ndarray:
        """Poses (6, 4, 4) of the joints at q (6,) [rad]."""
        self.place(q)
        return np.array([self.data.oMi[joint].homogeneous for joint in self.joints])

    def distance(self, one: int, other: int) -> float:
        """Of the meshes of two links as they were placed [m]; inf without any."""
        found = [np.inf]
        for a, b in itertools.product(self.bodies[one], self.bodies[other]):
            there = [self._there(each) for each in (a, b)]
            found.append(
                coal.distance(
                    a.geometry,
                    there[0],
                    b.geometry,
                    there[1],
                    coal.DistanceRequest(),
                    coal.DistanceResult(),
                )
            )
        return float(min(found))

    def _there(self, shape: Any) -> Any:
        pose = self.placed.oMg[self.shapes.getGeometryId(shape.name)]
        return coal.Transform3s(pose.rotation, pose.translation)

    def meet(self, q: np.ndarray, one: int, other: int) -> bool:
        """Whether shapes of two links meet at q (6,) [rad]."""
        self.place(q)
        request = coal.CollisionRequest()
        return any(
            coal.collide(
                a.geometry,
                self._there(a),
                b.geometry,
                self._there(b),
                request,
                coal.CollisionResult(),
            )
            for a, b in itertools.product(self.bodies[one], self.bodies[other])
        )

    def contacts(self, q: np.ndarray, one: int, other: int) -> np.ndarray:
        """Where surfaces of two links meet (N, 2, 2): along and beside the joint after the first
        one, and the joint before the second one [m].
        """
        self.place(q)
        points = []
        for a, b in itertools.product(self.bodies[one], self.bodies[other]):
            result = coal.CollisionResult()
            coal.collide(
                self._in_triangles(a),
                self._there(a),
                self._in_triangles(b),
                self._there(b),
                coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, CONTACTS),
                result,
            )
            points += [contact.pos for contact in result.getContacts()]
        sides = [
            self._beside(np.array(points).reshape(-1, 3), self.joints[k]) for k in (one, other - 1)
        ]
        return np.stack(sides, axis=1)

    def _in_triangles(self, shape: Any) -> Any:
        """A shape as small triangles: Coal has one contact for each pair of them."""
        if shape.name not in self._fine:
            self._fine[shape.name] = _mesh(_small(_triangles(shape.geometry)))
        return self._fine[shape.name]

    def _beside(self, points: np.ndarray, joint: int) -> np.ndarray:
        """How far points (N, 3) are along the axis of a joint and beside it (N, 2) [m]."""
        placed = self.data.oMi[joint]
        axis = placed.rotation @ self.axes[joint]
        along = (points - placed.translation) @ axis
        beside = np.linalg.norm(np.cross(points - placed.translation, axis), axis=1)
        return np.stack([along, beside], axis=1)


def _solid(text: str) -> str:
    """A URDF whose links have visual shapes only where they have no collision shape: files of the
    others need not be there.
    """
    root = ElementTree.fromstring(text)
    for link in root.iter("link"):
        if link.find("collision") is not None:
            for shape in link.findall("visual"):
                link.remove(shape)
    return ElementTree.tostring(root, "unicode")


def _with_own_package(text: str, above: Sequence[Path]) -> str:
    """The URDF with places of its own package, whose folder may have another name than the
    package: its package.xml says which.
    """
    for folder in above:
        described = folder / "package.xml"
        if described.is_file():
            name = ElementTree.parse(described).findtext("name", "").strip()
            return text.replace(f"package://{name}/", f"file://{folder}/")
    return text


def _mixed_up(path: str) -> bool:
    """Whether it is a Collada file that Pinocchio 4.1 reads wrongly: the corners of its second mesh
    are taken from the first one.
    """
    if not path.lower().endswith(".dae"):
        return False
    return Path(path).read_text(encoding="utf-8", errors="replace").count("<geometry ") > 1


def _by_trimesh(path: str, scale: np.ndarray) -> Any:
    """A mesh as trimesh reads it (with pycollada), in metres."""
    import trimesh

    text = Path(path).read_text(encoding="utf-8", errors="replace")
    unit = re.search(r'<unit[^>]*meter="([^"]+)"', text)
    mesh: Any = trimesh.load(path, force="mesh")
    corners = np.asarray(mesh.vertices) * scale * (float(unit[1]) if unit else 1.0)
    return _mesh(corners[np.asarray(mesh.faces)])


def _mesh(triangles: np.ndarray) -> Any:
    """Triangles (T, 3, 3) for Coal."""
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), 3 * len(triangles))
    model.addVertices(triangles.reshape(-1, 3))
    model.addTriangles(np.arange(3 * len(triangles)).reshape(-1, 3))
    model.endModel()
    return model


def _triangles(geometry: Any) -> np.ndarray:
    """Triangles (T, 3, 3) of a shape in its own frame."""
    if isinstance(geometry, coal.BVHModelBase):
        rows = [geometry.tri_indices(k) for k in range(geometry.num_tris)]
        return np.asarray(geometry.vertices())[[[row[0], row[1], row[2]] for row in rows]]
    if isinstance(geometry, coal.Box):
        corners = np.array([*itertools.product((-1.0, 1.0), repeat=3)]) * geometry.halfSide
    else:
        turn = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(ROUND)
        z = 1.0 - 2.0 * (np.arange(ROUND) + 0.5) / ROUND
        around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
        ball = np.column_stack([np.sqrt(1.0 - z**2)[:, None] * around, z])
        ends = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]) * getattr(geometry, "halfLength", 0.0)
        flat = np.column_stack([around, np.zeros(ROUND)])
        own = flat if isinstance(geometry, coal.Cylinder) else ball
        corners = np.concatenate([geometry.radius * own + end for end in ends])
    return corners[ConvexHull(corners).simplices]


def _small(triangles: np.ndarray) -> np.ndarray:
    """The same surface in triangles (T, 3, 3) of short edges."""
    done = []
    while len(triangles):
        edges = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2)
        long = edges.max(axis=1) > FINE
        done.append(triangles[~long])
        first = edges[long].argmax(axis=1)[:, None] + np.arange(3)  # the longest edge comes first
        a, b, c = np.take_along_axis(triangles[long], first[:, :, None] % 3, axis=1).swapaxes(0, 1)
        middle = 0.5 * (a + b)
        triangles = np.concatenate([np.stack([a, middle, c], 1), np.stack([middle, b, c], 1)])
    return np.concatenate(done)


def beyond(contacts: list[np.ndarray], allowed: np.ndarray) -> float:
    """How far [m] at most two links meet, in allowed postures, from where they do by construction,
    as seen from the farther of both; inf where they never do so.
    """
    trees = []
    for side in (0, 1):
        count: Counter[tuple[int, ...]] = Counter()
        for each in contacts:
            count.update({tuple(cell) for cell in np.floor(each[:, side] / RING).astype(int)})
        usual = [cell for cell, times in count.items() if times >= BUILT_SO * len(contacts)]
        trees.append(cKDTree(RING * (np.array(usual) + 0.5)) if usual else None)
    worst = 0.0
    for each in (found for found, good in zip(contacts, allowed, strict=True) if good):
        if len(each):
            far = [
                np.full(len(each), np.inf) if tree is None else tree.query(each[:, side])[0]
                for side, tree in enumerate(trees)
            ]
            worst = max(worst, float(np.max(far)))
    return worst


def judged(source: RobotSource, count: int) -> tuple[bool, str]:
    """Whether no posture was found that is wrongly allowed, and a line that says so. Raises
    InputError for a robot that is not made.
    """
    made = made_robot(source)
    judge = Judge(source, made)
    parts = [where_it_is(judge, made), verdict(judge, made.robot, count)]
    return all(good for good, _ in parts), "; ".join(line for _, line in parts)


def where_it_is(judge: Judge, made: MadeRobot) -> tuple[bool, str]:
    """Whether links stand where they should, and distances are what is said of them."""
    parts = [_kinematics(judge, made), _distances(judge, made)]
    return all(good for good, _ in parts), "; ".join(line for _, line in parts)


def _kinematics(judge: Judge, made: MadeRobot) -> tuple[bool, str]:
    """Turns of the links since zero, and places of their joints, against the first one's."""
    chain = Chain(made.robot)
    q = np.random.default_rng(6).uniform(
        made.robot.position_min, made.robot.position_max, (FEW, chain.n)
    )
    rows = np.concatenate([np.zeros((1, chain.n)), q])
    own = np.asarray(chain.link_poses(rows))[:, 1:]
    other = np.array([judge.frames(row) for row in rows])
    turned = (each[1:, :, :3, :3] @ each[:1, :, :3, :3].swapaxes(-1, -2) for each in (own, other))
    turns = float(np.abs(np.subtract(*turned)).max())
    placed = (each[:, :5, :3, 3] - each[:1, :1, :3, 3] for each in (own, other))
    places = float(np.abs(np.subtract(*placed)).max())
    allowed = NEAR + made.arm.rounding
    said = f" ({1e6 * made.arm.rounding:.2g} um are said)" if made.arm.rounding else ""
    line = f"kinematics {places:.1e} m and {turns:.1e} off{said}"
    return max(places, turns) <= allowed, line


def _distances(judge: Judge, made: MadeRobot) -> tuple[bool, str]:
    """Of capsules against meshes, of links that are no neighbours; links that hold all that joints
    beside the axes can reach may be nearer.
    """
    robot = made.robot
    link = {each.name: each.link for each in robot.capsules}
    far = [
        (a.name, b.name)
        for a, b in itertools.combinations(robot.capsules, 2)
        if abs(a.link - b.link) > 1
    ]
    model = CollisionModel(Chain(robot), robot.capsules, (), far)
    said = {}
    for sentence in made.shapes.sentences:
        stated = sentence.partition("stands out ")[2].partition(" mm")[0]
        said[sentence.partition(":")[0]] = 1e-3 * float(stated) if stated else 0.0
    q = np.random.default_rng(7).uniform(robot.position_min, robot.position_max, (FEW, robot.n))
    swept = {
        k for k, each in enumerate(made.arm.links) if any(shape.motions for shape in each.shapes)
    }
    counts: Counter[str] = Counter()
    most = 0.0
    for row, own in zip(q, model.distances(q), strict=True):
        judge.place(row)
        for one, other in itertools.combinations(range(robot.n + 1), 2):
            here = [
                (own[z], said[a] + said[b])
                for z, (_, a, b) in enumerate(model.pairs)
                if {link[a], link[b]} == {one, other}
            ]
            if not here:
                continue
            least, slack = min(here)
            true = judge.distance(one, other)
            if not np.isfinite(true):  # a link without a body
                continue
            counts["all"] += 1
            counts["above"] += 0.0 < true < least - TOUCH
            if least > 0.0 and not swept & {one, other}:
                counts["apart"] += 1
                most = max(most, true - least)
                counts["below"] += true - least > slack + TOUCH
    return not counts["above"] and not counts["below"] and counts["apart"] > 0, (
        f"{counts['all']} distances, {counts['apart']} of capsules that are apart: "
        f"{counts['above']} above the true one, {counts['below']} below it by more than is said, "
        f"at most {1e3 * most:.0f} mm below"
    )


def verdict(judge: Judge, robot: RobotModel, count: int) -> tuple[bool, str]:
    """The same of a robot with the joints and links of the judge's."""
    check = SelfCheck(robot)
    q = np.random.default_rng(5).uniform(robot.position_min, robot.position_max, (count, 6))
    allowed = check.room(q) > 0.0
    bad = []
    built_so = []
    for one, other in itertools.combinations(range(7), 2):
        if other - one < 2 or not (judge.bodies[one] and judge.bodies[other]):
            continue
        met = np.array([judge.meet(row, one, other) for row in q])
        links = f"links {one} and {other}"
        if met.all():
            built_so.append(links)
            found = [judge.contacts(row, one, other) for row in q[:COUNTED]]
            far = beyond(found, allowed[:COUNTED])
            if far > BESIDE:
                bad.append(f"{links}, {1e3 * far:.0f} mm beside where they always do")
        elif (met & allowed).any():
            bad.append(f"{links} in {(met & allowed).sum()}")
        elif (wrong := looked_for(judge, check, q, met, (one, other))) is not None:
            bad.append(f"{links} at {np.round(np.degrees(wrong), 2).tolist()} deg")
    reduced = [each.distance for each in robot.reduced_distances]
    always = f"; {', '.join(built_so)} meet in all" if built_so else ""
    return not bad, (
        f"{allowed.sum()} of {count} postures allowed, {len(reduced)} pairs near by construction, "
        f"least {1e3 * min(reduced, default=0.0):.0f} mm{always}; shapes meet though allowed: "
        f"{'; '.join(bad) or 'never'}"
    )


class SelfCheck:
    """That of a robot."""

    def __init__(self, robot: RobotModel) -> None:
        self.low = robot.position_min
        self.high = robot.position_max
        self._model = CollisionModel(Chain(robot), robot.capsules, (), robot.self_pairs)
        own = {frozenset(each[:2]): each.distance for each in robot.reduced_distances}
        self._kept = np.array(
            [min(SAFETY, own.get(frozenset((a, b)), SAFETY)) for _, a, b in self._model.pairs]
        )

    def room(self, q: np.ndarray) -> np.ndarray:
        """What the nearest pair has more than it must keep at postures q (N, 6) (N,) [m]: allowed
        where above 0.
        """
        return np.asarray((self._model.distances(q) - self._kept).min(axis=1))


def looked_for(
    judge: Judge, check: SelfCheck, q: np.ndarray, met: np.ndarray, links: tuple[int, int]
) -> np.ndarray | None:
    """A posture (6,) that is allowed though shapes of two links meet, None where none is found:
    from allowed ones of q (N, 6) towards smaller distances, and from those that meet, met (N,),
    towards what is allowed.
    """
    one, other = links
    draw = np.random.default_rng(8)
    room = check.room(q)

    def distance(row: np.ndarray) -> float:
        judge.place(row)
        return judge.distance(one, other)

    free = np.flatnonzero(room > 0.0)[: 10 * STARTS]
    nearest = sorted(free, key=lambda k: distance(q[k]))[:STARTS]
    roomy = np.flatnonzero(met)[np.argsort(-room[met], kind="stable")][:STARTS]
    for begin, towards_meeting in [(k, True) for k in nearest] + [(k, False) for k in roomy]:
        here = q[begin]
        best = -distance(here) if towards_meeting else float(room[begin])
        for turn in TURNS:
            tried = np.repeat(here[None], TRIED, axis=0)
            tried[:, one:other] += draw.normal(scale=turn, size=(TRIED, other - one))
            tried = np.clip(tried, check.low, check.high)
            for row, its_room in zip(tried, check.room(tried), strict=True):
                if towards_meeting and its_room <= 0.0:
                    continue
                better = -distance(row) if towards_meeting else float(its_room)
                meets = better > best and judge.meet(row, one, other)
                if meets and its_room > 0.0:
                    return row
                if better > best and (towards_meeting or meets):
                    here = row
                    best = better
    return None


def main() -> int:
    """Print a line for each robot."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("urdf", type=Path, nargs="+")
    parser.add_argument("--packages", type=Path)
    parser.add_argument("--postures", type=int, default=300)
    given = parser.parse_args()
    wrong = 0
    skipped = 0
    for path in given.urdf:
        try:
            source = RobotSource(path, payload=5.0, packages=given.packages)
            good, line = judged(source, given.postures)
        except InputError as error:
            skipped += 1
            print(f"{path.name}: not judged: {error}", flush=True)
            continue
        wrong += not good
        print(f"{path.name}: {line}", flush=True)
    count = len(given.urdf)
    print(f"{count - wrong - skipped} of {count} hold, {wrong} wrong, {skipped} not judged")
    return 0 if wrong == 0 and skipped < count else 1


if __name__ == "__main__":
    sys.exit(main())
