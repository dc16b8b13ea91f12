"""Is a robot made from a URDF where the file has it? Judged by Pinocchio and Coal.

    python tools/judge_robots.py URDF.. [--packages FOLDER] [--postures N]

Links must stand where Pinocchio has them, within 1 nm and what the command says of rounded angles;
distances of capsules must not be above those of the meshes, and below them by no more than the
capsules are said to stand out. And the self check: for random postures that it allows, Coal looks
whether meshes of links that are no neighbours meet in a place where they do not meet by
construction. A place is a ring about the joint that leads from a link towards the other one; they
meet by construction in rings in which they do in at least a third of all postures; a robot fails
where any meets more than 35 mm beside such rings. Exit code 1 where a robot fails.
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
from scipy.spatial import cKDTree

from ir_cli.errors import InputError
from ir_cli.robot_from_urdf import MadeRobot, RobotSource, made_robot, urdf_text
from ir_cli.self_pairs import SAFETY
from ir_description import RobotModel
from ir_kernels import Chain, CollisionModel

BUILT_SO = 1.0 / 3.0
RING = 0.01  # m: width and height of a ring
BESIDE = 0.035  # m from what meets by construction
CONTACTS = 3000
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

    def contacts(self, q: np.ndarray, one: int, other: int) -> np.ndarray:
        """Where meshes of two links meet (N, 2, 2): along and beside the joint after the first
        one, and the joint before the second one [m].
        """
        self.place(q)
        points = []
        for a, b in itertools.product(self.bodies[one], self.bodies[other]):
            result = coal.CollisionResult()
            coal.collide(
                a.geometry,
                self._there(a),
                b.geometry,
                self._there(b),
                coal.CollisionRequest(coal.CollisionRequestFlag.CONTACT, CONTACTS),
                result,
            )
            points += [contact.pos for contact in result.getContacts()]
        sides = [
            self._beside(np.array(points).reshape(-1, 3), self.joints[k]) for k in (one, other - 1)
        ]
        return np.stack(sides, axis=1)

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
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh.faces), len(mesh.vertices))
    model.addVertices(np.asarray(mesh.vertices) * scale * (float(unit[1]) if unit else 1.0))
    model.addTriangles(np.asarray(mesh.faces))
    model.endModel()
    return model


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
    model = CollisionModel(Chain(robot), robot.capsules, (), robot.self_pairs)
    own = {frozenset(each[:2]): each.distance for each in robot.reduced_distances}
    kept = np.array([min(SAFETY, own.get(frozenset((a, b)), SAFETY)) for _, a, b in model.pairs])
    q = np.random.default_rng(5).uniform(robot.position_min, robot.position_max, (count, 6))
    allowed = (model.distances(q) > kept).all(axis=1)
    bad = []
    for one, other in itertools.combinations(range(7), 2):
        if other - one > 1:
            found = [judge.contacts(row, one, other) for row in q]
            far = beyond(found, allowed)
            if far > BESIDE:
                times = sum(
                    len(each) > 0 for each, good in zip(found, allowed, strict=True) if good
                )
                bad.append(f"links {one} and {other} in {times}, {1e3 * far:.0f} mm off")
    reduced = [each.distance for each in robot.reduced_distances]
    return not bad, (
        f"{allowed.sum()} of {count} postures allowed, {len(reduced)} pairs near by construction, "
        f"least {1e3 * min(reduced, default=0.0):.0f} mm; meshes meet elsewhere: "
        f"{'; '.join(bad) or 'never'}"
    )


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
