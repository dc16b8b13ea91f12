"""Does the self check of a robot object where its meshes penetrate? Judged by Pinocchio and Coal.

    python tools/judge_self_check.py URDF.. [--packages FOLDER] [--postures N]

For random postures that the self check allows, Coal looks whether meshes of links that are no
neighbours meet in a place where they do not meet by construction. A place is a ring about the joint
that leads from a link towards the other one; they meet by construction in rings in which they do in
at least a third of all postures. Exit code 1 where any meets more than 35 mm beside such rings.
"""

from __future__ import annotations

import argparse
import itertools
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio
from scipy.spatial import cKDTree

from ir_cli.errors import InputError
from ir_cli.robot_from_urdf import MadeRobot, RobotSource, made_robot, urdf_text
from ir_cli.self_pairs import SAFETY
from ir_kernels import Chain, CollisionModel

BUILT_SO = 1.0 / 3.0
RING = 0.01  # m: width and height of a ring
BESIDE = 0.035  # m from what meets by construction
CONTACTS = 3000


class Judge:
    """Meshes of a URDF, as Pinocchio reads it."""

    def __init__(self, source: RobotSource, made: MadeRobot) -> None:
        above = [*source.urdf.resolve().parents][:6]
        packages = [str(each) for each in (source.packages, *above) if each is not None]
        with tempfile.NamedTemporaryFile("w", suffix=".urdf") as file:
            file.write(urdf_text(source))
            file.flush()
            self.model = pinocchio.buildModelFromUrdf(file.name)
            self.shapes = pinocchio.buildGeomFromUrdf(
                self.model,
                file.name,
                pinocchio.GeometryType.COLLISION,
                package_dirs=packages,
            )
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
            _check_meshes(shape.meshPath)
            self.bodies[link.get(shape.parentJoint, 0)].append(shape)

    def contacts(self, q: np.ndarray, one: int, other: int) -> np.ndarray:
        """Where meshes of two links meet (N, 2, 2): along and beside the joint after the first
        one, and the joint before the second one [m].
        """
        full = pinocchio.neutral(self.model)
        full[self.columns] = q
        pinocchio.updateGeometryPlacements(self.model, self.data, self.shapes, self.placed, full)
        points = []
        for a, b in itertools.product(self.bodies[one], self.bodies[other]):
            i, j = (self.placed.oMg[self.shapes.getGeometryId(each.name)] for each in (a, b))
            result = coal.CollisionResult()
            coal.collide(
                a.geometry,
                coal.Transform3s(i.rotation, i.translation),
                b.geometry,
                coal.Transform3s(j.rotation, j.translation),
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


def _check_meshes(path: str) -> None:
    """Raise InputError for a Collada file that Pinocchio 4.1 reads wrongly: the corners of its
    second mesh are taken from the first one.
    """
    if path.lower().endswith(".dae"):
        text = Path(path).read_text(encoding="utf-8", errors="replace")
        if text.count("<geometry ") > 1:
            raise InputError(f"{path} has several meshes: Pinocchio mixes up their corners")


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
    """Whether no posture was found that is wrongly allowed, and a line that says so."""
    made = made_robot(source)
    robot = made.robot
    judge = Judge(source, made)
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
