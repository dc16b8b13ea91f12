"""The six axes of a URDF, in frames parallel to the base at q = 0 and a flange whose x points out.

Fixed joints disappear: what they carry belongs to the link that carries them. So does what hangs on
a moving joint that leads to no flange (fingers, a linkage): it stands for everywhere that this
joint can move it. A tool frame (tool0, flange) says where the flange is and how it is turned.

A sliding joint before the axes is a linear unit. It belongs to the cell file (`rail`), so that the
arm begins with what it carries; what stands still under it is no part of the robot.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ir_description.files.making.transmissions import coupling_notes
from ir_description.files.making.urdf_tree import (
    UrdfJoint,
    UrdfLink,
    UrdfShape,
    UrdfTree,
    urdf_tree,
)
from ir_description.robot import TOOL0
from ir_values.arrays import FloatArray
from ir_values.errors import RobotFileError, listed, shown

AXES = 6
MOVING = ("revolute", "continuous")
TIPS = ("flange", "tool0")
EXACT = 2e-5
"""Entries of a rotation miss 0 or 1 by so much where angles were written with five digits."""
SAID = 1e-9  # m: rounding that moves points by less is not worth a sentence
_BODY = 0.5  # m: how far bodies reach beyond the frames of an arm, for a bound of rounding


@dataclass(frozen=True, eq=False)
class SideMotion:
    """A joint beside the planned axes, which carries the link `child`: `pose` (4, 4) of its frame
    in the link before, `axis` (3,) in it, "revolute" or "prismatic", from `lower` to `upper` [rad
    or m].
    """

    joint: str
    child: str
    kind: str
    pose: FloatArray
    axis: FloatArray
    lower: float
    upper: float

    def at(self, value: float) -> FloatArray:
        """The pose (4, 4) of what the joint carries at a value, in the link that carries it."""
        step = np.eye(4)
        if self.kind == "prismatic":
            step[:3, 3] = value * self.axis
        else:
            step[:3, :3] = _turn(self.axis, value)
        return np.asarray(self.pose @ step)


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A collision shape in the frame of its planned link: its `shape`, and the `motions`, inner
    first, of joints beside the planned axes that move it.
    """

    shape: UrdfShape
    motions: tuple[SideMotion, ...] = ()

    def moved(self, pose: FloatArray) -> PlacedShape:
        """The same re-expressed by the pose (4, 4) of its frame in another one."""
        if not self.motions:
            return replace(self, shape=replace(self.shape, pose=pose @ self.shape.pose))
        *inner, last = self.motions
        return replace(self, motions=(*inner, replace(last, pose=pose @ last.pose)))


@dataclass(frozen=True, eq=False)
class ArmLink:
    """A link with everything that belongs to it, in its frame: mass [kg] (0: the URDF gives none),
    com (3,) [m], inertia (3, 3) [kg m^2] about it; estimate: whence these are where not from the
    URDF, moments: whence the inertia alone is. line: of the link. doubted: whether com lies far
    from all of its bodies.
    """

    name: str
    mass: float
    com: FloatArray
    inertia: FloatArray
    shapes: tuple[PlacedShape, ...]
    estimate: str = ""
    moments: str = ""
    line: int = 0
    doubted: bool = False

    @property
    def place(self) -> str:
        """For people: which link it is."""
        return f"link {self.name} (line {self.line})"


@dataclass(frozen=True, eq=False)
class UrdfArm:
    """joints: the moving ones; origin (6, 3) [m] of each in the frame of the link before, axis (6,
    3) in its own; flange (3, 3): the last frame in the base at q = 0. links: 7, in these frames.
    rounding [m]: by which right angles that were written with few digits move any point, at most.
    notes: what was read otherwise than it stands there, in words. leaders: names of planned joints
    whose limits bound bodies that follow them. source: the file, for people.
    """

    name: str
    joints: tuple[UrdfJoint, ...]
    origin: FloatArray
    axis: FloatArray
    flange: FloatArray
    links: tuple[ArmLink, ...]
    rounding: float = 0.0
    notes: tuple[str, ...] = ()
    leaders: frozenset[str] = frozenset()
    source: str = ""

    @property
    def joint_origin(self) -> FloatArray:
        """Poses (6, 4, 4) of the joints' frames, as kinematics take them."""
        origins = np.tile(np.eye(4), (len(self.origin), 1, 1))
        origins[:, :3, 3] = self.origin
        origins[-1, :3, :3] = self.flange
        return origins

    @property
    def joint_axis(self) -> FloatArray:
        """Axes (6, 3)."""
        return self.axis

    @property
    def reach(self) -> float:
        """Sum of the distances from joint to joint, without the first [m]."""
        return float(np.linalg.norm(self.origin[1:], axis=1).sum())


def urdf_arm(text: str, source: str, tip: str = "", without: Collection[str] = ()) -> UrdfArm:
    """The arm from the base to a link `tip` ("": flange, tool0 or the link that ends the longest
    chain); without: links that are left out with all that they carry.

    Raises RobotFileError where it has not six turning axes.
    """
    read = urdf_tree(text, source)
    end = _tip(read, tip, source)
    whole, rounding = _right_angles(_joints_to(read, end, source))
    under, path = _on_rail(whole, source)
    moving = _axes(path, source, under)
    tree = replace(read, above={**read.above, **{joint.child: joint for joint in path}})
    base = path[0].parent
    below_base = tree.path(base)
    fixed_before = [] if under else below_base
    placed = _placed(fixed_before, path)
    frames = _frames(path, moving, placed)
    planned = {joint.name for joint in (*below_base, *path)}
    _check_without(without, [base, *_chain(path)], tree, source)

    # each link with all that is fixed to it, in its own frame
    gathering = _Gathering(tree, without, planned, source)
    links = []
    names = [base, *(joint.child for joint in moving)]
    for name, group, frame in zip(names, _groups(path, fixed_before), frames, strict=True):
        inverse = np.linalg.inv(frame)
        poses = [inverse @ placed[each] for each in group]
        links.append(gathering.link(name, group, poses))

    origins = []
    for before, after in pairwise(frames):
        origins.append(after[:3, 3] - before[:3, 3])
    origin = np.array(origins)
    turned = []
    for joint, frame in zip(moving, frames[1:], strict=True):
        to_frame = frame[:3, :3].T @ placed[joint.child][:3, :3]
        turned.append(to_frame @ joint.axis)
    axis = np.array([_squared(each, EXACT) for each in turned])
    beyond = np.cumsum(np.linalg.norm(origin[::-1], axis=1))[::-1]  # from each joint on
    changed = np.linalg.norm(axis - np.array(turned), axis=1)
    rounding += float((beyond + _BODY) @ changed)
    couplings = coupling_notes(read.transmissions, [joint.name for joint in moving])
    notes = [*read.notes, *_below_base(below_base), *gathering.notes, *couplings]
    notes += [_rail_note(joint, tree) for joint in under]
    if rounding > SAID:
        notes.append(
            "angles written with few digits are taken as right angles: that moves a point of the "
            f"arm by at most {1e6 * rounding:.2g} um, by which all capsules are wider"
        )
    return UrdfArm(
        name=tree.name,
        joints=tuple(moving),
        origin=origin,
        axis=axis / np.linalg.norm(axis, axis=1, keepdims=True),
        flange=frames[-1][:3, :3],
        links=tuple(links),
        rounding=rounding if rounding > SAID else 0.0,
        notes=tuple(notes),
        leaders=frozenset(gathering.leaders),
        source=source,
    )


def _on_rail(path: Sequence[UrdfJoint], source: str) -> tuple[list[UrdfJoint], list[UrdfJoint]]:
    """The linear unit under an arm, and the path behind it; no unit and the whole path where no
    joint before the first axis slides. Raises RobotFileError for one that no `rail` describes.
    """
    first = next((k for k, joint in enumerate(path) if joint.kind in MOVING), 0)
    sliding = [k for k, joint in enumerate(path[:first]) if joint.kind != "fixed"]
    if len(sliding) != 1 or path[sliding[0]].kind != "prismatic":
        return [], list(path)
    joint = path[sliding[0]]
    if joint.mimic or not -np.inf < joint.lower < joint.upper < np.inf:
        raise RobotFileError(
            source,
            joint.line,
            f"joint {joint.name} slides under the arm: a rail moves by itself, from one end to "
            "another",
        )
    return [joint], list(path[sliding[0] + 1 :])


def _rail_note(joint: UrdfJoint, tree: UrdfTree) -> str:
    """What a cell file says of a linear unit, and what is left out with it."""
    still = [
        name
        for name, link in tree.links.items()
        if link.shapes and joint.name not in [each.name for each in tree.path(name)]
    ]
    axis = ", ".join(f"{value + 0.0:g}" for value in joint.axis)
    speed = f", velocity: {joint.velocity:g}" if joint.velocity > 0.0 else ""
    lacking = "acceleration" if speed else "velocity, acceleration"
    left = (
        f"; bodies of {listed(still)} don't ride on it and are no part of the robot: give the cell "
        "machines for them"
    )
    return (
        f"joint {joint.name} slides under the arm: write rail: {{axis: [{axis}], travel: "
        f"[{joint.lower:g}, {joint.upper:g}]{speed}}} into the cell file, with {lacking} and "
        "carriage_mass (what moves besides the links of the URDF), which the URDF doesn't say; the "
        f"robot begins with link {joint.child}{left if still else ''}"
    )


def _axes(
    path: Sequence[UrdfJoint], source: str, under: Sequence[UrdfJoint] = ()
) -> list[UrdfJoint]:
    """The moving joints of a path; six free turning ones, else RobotFileError. under: a linear
    unit.
    """
    moving = [joint for joint in path if joint.kind != "fixed"]
    for joint in moving:
        if joint.kind not in MOVING:
            raise RobotFileError(
                source,
                joint.line,
                f"joint {joint.name} is {joint.kind}: only turning axes are planned, on at most "
                "one sliding joint under the arm",
            )
        if joint.mimic:
            raise RobotFileError(
                source,
                joint.line,
                f"joint {joint.name} mimics {joint.mimic}: it is no axis of its own, and arms of "
                "six free axes are planned; see --tip",
            )
    if len(moving) != AXES:
        names = listed(joint.name for joint in moving)
        rail = f" on the rail {under[0].name}" if under else ""
        raise RobotFileError(
            source,
            0,
            f"the arm has {len(moving)} axes ({names}){rail}: arms of six axes are planned; "
            "see --tip",
        )
    for joint in moving:
        if joint.kind == "revolute" and not joint.lower < joint.upper:
            raise RobotFileError(
                source,
                joint.line,
                f"joint {joint.name} may turn from {joint.lower:g} to {joint.upper:g} rad: lower "
                "must be below upper",
            )
    return moving


def _chain(path: Sequence[UrdfJoint]) -> list[str]:
    """Names of the links behind the joints of a path up to its last axis."""
    last = max(k for k, joint in enumerate(path) if joint.kind != "fixed")
    return [joint.child for joint in path[: last + 1]]


def _check_without(
    without: Collection[str], chain: Collection[str], tree: UrdfTree, source: str
) -> None:
    """Raise RobotFileError for links to leave out that are none, or of the arm itself."""
    for name in without:
        if name not in tree.links:
            raise RobotFileError(
                source, 0, f"link {shown(name)} is unknown; known are {listed(tree.links)}"
            )
        if name in chain:
            raise RobotFileError(
                source,
                tree.links[name].line,
                f"link {name} is part of the arm, whose clearance is proved with all its bodies: "
                "--without leaves out only what the links from the base to the flange carry",
            )


def _tip(tree: UrdfTree, tip: str, source: str) -> str:
    if tip and tip not in tree.links:
        raise RobotFileError(
            source, 0, f"link {shown(tip)} is unknown; known are {listed(tree.links)}"
        )
    known = [name for suffix in TIPS for name in tree.links if name.endswith(suffix)]
    six = [name for name in known if _turning(tree, name) == AXES]
    if tip or six or known:
        return tip or (six or known)[0]
    hand = next((name for name in tree.links if _is_hand(tree, name)), "")
    return hand or max(tree.links, key=lambda name: (_turning(tree, name), -_followers(tree, name)))


def _is_hand(tree: UrdfTree, name: str) -> bool:
    """Whether a link behind six turning joints carries several moving ones side by side: fingers,
    not a seventh axis.
    """
    beside = [joint for joint in tree.below(name) if joint.kind != "fixed"]
    return len(beside) > 1 and _turning(tree, name) == AXES


def _turning(tree: UrdfTree, name: str) -> int:
    """Turning joints of its own before a link."""
    return sum(joint.kind in MOVING and not joint.mimic for joint in tree.path(name))


def _followers(tree: UrdfTree, name: str) -> int:
    """Joints before a link that follow others."""
    return sum(bool(joint.mimic) for joint in tree.path(name))


def _joints_to(tree: UrdfTree, tip: str, source: str) -> list[UrdfJoint]:
    """The joints from the base to a link; a first link called world is not the base."""
    path = tree.path(tip)
    if path and path[0].kind == "fixed" and path[0].parent == "world":
        path = path[1:]
    if not path:
        raise RobotFileError(source, 0, f"no joint leads to link {tip}: see --tip")
    return path


def _right_angles(path: Sequence[UrdfJoint]) -> tuple[list[UrdfJoint], float]:
    """The path with right angles where few digits miss them, and by how much that moves points."""
    beyond = np.cumsum([float(np.linalg.norm(joint.pose[:3, 3])) for joint in reversed(path)])
    moved = 0.0
    result = []
    for joint, far in zip(path, beyond[::-1], strict=True):
        R = joint.pose[:3, :3]
        near = np.round(R)
        if 0.0 < np.abs(R - near).max() < EXACT:
            moved += (far + _BODY) * float(np.linalg.norm(R - near))
            pose = joint.pose.copy()
            pose[:3, :3] = near
            joint = replace(joint, pose=pose)  # the same joint, squared
        result.append(joint)
    return result, moved


def _groups(path: Sequence[UrdfJoint], before: Sequence[UrdfJoint]) -> list[list[str]]:
    """Names of the links along the path that each planned link consists of; what is below the
    base belongs to it.
    """
    groups = [[*(joint.parent for joint in before), path[0].parent]]
    for joint in path:
        if joint.kind == "fixed":
            groups[-1].append(joint.child)
        else:
            groups.append([joint.child])
    return groups


def _placed(before: Sequence[UrdfJoint], path: Sequence[UrdfJoint]) -> dict[str, FloatArray]:
    """Pose (4, 4) in the base at q = 0 of every link along the path, and of those before it."""
    placed = {path[0].parent: np.eye(4)}
    for joint in reversed(before):
        placed[joint.parent] = placed[joint.child] @ np.linalg.inv(joint.pose)
    for joint in path:
        placed[joint.child] = placed[joint.parent] @ joint.pose
    return placed


def _below_base(before: Sequence[UrdfJoint]) -> Iterator[str]:
    for joint in before:
        if not np.allclose(joint.pose, np.eye(4), atol=1e-9):
            x, y, z = joint.pose[:3, 3] + 0.0
            yield (
                f"joint {joint.name} places {joint.child} at ({x:g}, {y:g}, {z:g}) m in "
                f"{joint.parent}: a cell says where its robot stands (base)"
            )


def _frames(
    path: Sequence[UrdfJoint], moving: Sequence[UrdfJoint], placed: dict[str, FloatArray]
) -> list[FloatArray]:
    """Poses (4, 4) of the 7 frames in the base: where the joints are, the last where the flange
    is, with its x along the last axis.
    """
    frames = [np.eye(4)]
    for joint in moving:
        frame = np.eye(4)
        frame[:3, 3] = placed[joint.child][:3, 3]
        frames.append(frame)
    tip = placed[path[-1].child]
    last = placed[moving[-1].child]
    axis = last[:3, :3] @ moving[-1].axis
    from_last = tip[:3, 3] - last[:3, 3]
    outwards = from_last @ axis
    frames[-1][:3, 3] = last[:3, 3] + outwards * axis
    R = tip[:3, :3]
    if path[-1].child.endswith("tool0"):
        R = tip[:3, :3] @ TOOL0[:3, :3].T
    if abs(abs(R[:, 0] @ axis) - 1.0) > EXACT:  # not a flange by its x: build one
        x = axis if outwards >= 0.0 else -axis
        helper = np.eye(3)[2] if abs(x[2]) < 0.9 else np.eye(3)[1]
        across = np.cross(helper, x)
        y = across / np.linalg.norm(across)
        R = np.stack([x, y, np.cross(x, y)], axis=1)
    frames[-1][:3, :3] = _squared(R, SAID)
    return frames


def _squared(values: FloatArray, within: float) -> FloatArray:
    """A direction along an axis, or a rotation by right angles, where all values miss that by less:
    as a whole, so that it stays a direction or a rotation.
    """
    near = np.round(values)
    close = float(np.abs(values - near).max()) < within
    return np.asarray(near if close else values)


_Part = tuple[UrdfLink, tuple[PlacedShape, ...]]
"""A link of the URDF, its mass and its shapes in the frame of another one."""


class _Gathering:
    """What belongs to each planned link; no body is left out but those of `without`."""

    def __init__(
        self, tree: UrdfTree, without: Collection[str], planned: set[str], source: str
    ) -> None:
        self._tree = tree
        self._source = source
        self._without = without
        self._planned = planned
        self._joints = {joint.name: joint for joint in tree.above.values()}
        self.notes: list[str] = []
        self.leaders: set[str] = set()

    def link(self, name: str, names: Sequence[str], poses: Sequence[FloatArray]) -> ArmLink:
        """The links `names` with everything beside the path that they carry, from their poses (4,
        4) in the planned link.
        """
        parts = [
            _part_in_frame(part, pose)
            for each, pose in zip(names, poses, strict=True)
            for part in self._carried(each)
        ]
        return replace(_one_link(name, parts), line=self._tree.links[name].line)

    def _carried(self, name: str) -> Iterator[_Part]:
        """A link, and what it carries beside the path, in its frame."""
        if name in self._without:
            bodies = sum(len(link.shapes) for link in self._below(name))
            self.notes.append(f"link {name} is left out as asked, with {bodies} bodies")
            return
        link = self._tree.links[name]
        yield link, tuple(PlacedShape(shape) for shape in link.shapes)
        for joint in self._tree.below(name):
            if joint.name in self._planned:
                continue
            found = list(self._carried(joint.child))
            if joint.kind == "fixed":
                yield from (_part_in_frame(part, joint.pose) for part in found)
            else:
                motion = self._motion(joint)
                self._say(joint, motion, sum(len(shapes) for _, shapes in found))
                yield from (_moving(part, motion) for part in found)

    def _say(self, joint: UrdfJoint, motion: SideMotion, bodies: int) -> None:
        unit = "m" if motion.kind == "prismatic" else "rad"
        if bodies:
            kind = f"{joint.kind}, follows {joint.mimic}" if joint.mimic else joint.kind
            self.notes.append(
                f"joint {joint.name} ({kind}) leads to no flange and is not planned: its "
                f"{bodies} {'body fills' if bodies == 1 else 'bodies fill'} everything between "
                f"{motion.lower:.4g} and {motion.upper:.4g} {unit}, masses stand in its middle"
            )

    def _motion(self, joint: UrdfJoint) -> SideMotion:
        if joint.kind in ("floating", "planar"):
            raise RobotFileError(
                self._source,
                joint.line,
                f"joint {joint.name} is {joint.kind}: what it carries may be anywhere; "
                f"--without {joint.child} leaves that out",
            )
        lower, upper = self._range(joint)
        endless = joint.kind == "continuous" and not lower < upper
        if endless or (joint.kind != "prismatic" and upper - lower > 2.0 * np.pi):
            lower = -np.pi
            upper = np.pi
        kind = "prismatic" if joint.kind == "prismatic" else "revolute"
        return SideMotion(joint.name, joint.child, kind, joint.pose, joint.axis, lower, upper)

    def _range(self, joint: UrdfJoint, behind: frozenset[str] = frozenset()) -> tuple[float, float]:
        """From where to where a joint moves: by its limits, and as what it follows does; behind:
        joints that follow it.
        """
        own = (joint.lower, joint.upper)
        behind |= {joint.name}
        leader = self._joints.get(joint.mimic)
        if leader is None or leader.name in behind:
            return own
        if leader.name in self._planned and leader.lower < leader.upper:
            self.leaders.add(leader.name)
        lower, upper = self._range(leader, behind)
        ends = [joint.multiplier * each + joint.offset for each in (lower, upper)]
        if joint.lower < joint.upper:
            ends += own
        return min(ends), max(ends)

    def _below(self, name: str) -> Iterator[UrdfLink]:
        yield self._tree.links[name]
        for joint in self._tree.below(name):
            if joint.name not in self._planned:
                yield from self._below(joint.child)


def _part_in_frame(part: _Part, pose: FloatArray) -> _Part:
    """A part re-expressed by the pose (4, 4) of its frame."""
    link, shapes = part
    R = pose[:3, :3]
    own = replace(link, com=R @ link.com + pose[:3, 3], inertia=R @ link.inertia @ R.T)
    return own, tuple(shape.moved(pose) for shape in shapes)


def _moving(part: _Part, motion: SideMotion) -> _Part:
    """A part that a joint beside the path moves, in the link that carries the joint."""
    middle = motion.at(0.5 * (motion.lower + motion.upper))
    own, _ = _part_in_frame(part, middle)
    _, shapes = part
    return own, tuple(replace(shape, motions=(*shape.motions, motion)) for shape in shapes)


def _one_link(name: str, parts: Sequence[tuple[UrdfLink, tuple[PlacedShape, ...]]]) -> ArmLink:
    """Mass, centre and inertia of several links as of one."""
    shapes = tuple(shape for _, own in parts for shape in own)
    mass = sum(part.mass for part, _ in parts)
    if not mass > 0.0:
        return ArmLink(name, 0.0, np.zeros(3), np.zeros((3, 3)), shapes)
    com = sum((part.mass * part.com for part, _ in parts), np.zeros(3)) / mass
    inertia = np.zeros((3, 3))
    for part, _ in parts:
        d = part.com - com
        inertia += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return ArmLink(name, mass, com, inertia, shapes)


def _turn(axis: FloatArray, angle: float) -> FloatArray:
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * (K @ K))
