"""Service movement: out of a station along -x of the tool (exit), or into it along the same line
(entry).

The straight line of the tcp over the station's approach distance is followed through closed-form
configurations of one branch, point by point; a joint spline (eq. 10) runs through them. On the line
the station's allowed contacts hold; the outer end keeps S_m from everything.
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from ir_description import Station
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks import FreeSpace, first_too_near
from ir_planner.errors import TimingError
from ir_planner.optimize import QUICK_TIMING, movement_over, rescaled
from ir_planner.request import Context
from ir_planner.scene import MotionLimits
from ir_planner.service.exit_paths import ExitPath
from ir_planner.timing import (
    Movement,
    best_stretch,
    slowed_for_tool,
    stretched,
    time_spline,
    within_torque,
)
from ir_values.arrays import FloatArray

# m between points of the line: in between, the tool leaves it by less than a millimetre
SPACING = 0.03
_JUMP = 0.35  # rad: a larger step between neighbours is another branch or a singular wrist


@dataclass(frozen=True, eq=False)
class ServiceLine:
    """Configurations (L, n) from the interaction configuration to the outer end.

    straight: points of a straight line of the tool; else waypoints of a withdrawal (eq. 7), with
    the `exit` that they are of: the same points, but for whole turns.
    """

    points: FloatArray
    straight: bool = True
    exit: ExitPath | None = None
    _quickest: dict[tuple[object, ...], JointTrajectory] = field(default_factory=dict, repr=False)

    @property
    def interaction(self) -> FloatArray:
        """Configuration (n,) at the station."""
        first: FloatArray = self.points[0]
        return first

    @property
    def outside(self) -> FloatArray:
        """Configuration (n,) at the outer end."""
        last: FloatArray = self.points[-1]
        return last

    def along(self, entry: bool) -> FloatArray:
        """Points (L, n) in the order in which they are passed."""
        return self.points[::-1] if entry else self.points

    def quickest(self, entry: bool, limits: MotionLimits, context: Context) -> JointTrajectory:
        """The fastest spline through the points in a context's scene. It doesn't depend on the
        objective, so requests for several find it once. Raises TimingError when a torque does not
        suffice.
        """
        bounds = (limits.velocity, limits.acceleration, limits.jerk)
        key = (entry, context.scene, limits.torque_share, *(bound.tobytes() for bound in bounds))
        if key not in self._quickest:
            points = self.along(entry)
            dynamics = context.scene.dynamics
            self._quickest[key] = time_spline(points, context.joint_names, limits, dynamics)
            context.work.check()
        return self._quickest[key]


def line_poses(station: Station) -> FloatArray:
    """Poses (L, 4, 4) of the tcp from the station backwards along its -x; one pose where the
    approach is 0 m.
    """
    count = int(np.ceil(station.approach_distance / SPACING)) + 1
    back = np.linspace(0.0, station.approach_distance, max(count, 1))
    poses = np.repeat(np.asarray(station.pose)[None], len(back), axis=0)
    poses[:, :3, 3] -= back[:, None] * np.asarray(station.pose)[:3, 0]
    return poses


def service_lines(
    interaction: FloatArray, context: Context, rejected: Counter[str]
) -> list[ServiceLine]:
    """Lines of the context's station from interaction configurations (K, n); those that leave the
    limits or change branch are counted and dropped.
    """
    scene = context.scene
    poses = line_poses(scene.station(context.station))
    by_place = {
        float(place): scene.inverse_kinematics_at([place]).solve(poses)
        for place in np.unique(interaction[:, : scene.cell.robot.base])
    }
    everywhere = None if by_place else scene.inverse_kinematics.solve(poses)
    lines = []
    for q in interaction:
        found = by_place[float(q[0])] if everywhere is None else everywhere
        points = [q]
        for k in range(1, len(poses)):
            candidates = found.of_pose(k)
            jump = (
                np.abs(candidates - points[-1]).max(axis=1)
                if len(candidates)
                else np.array([np.inf])
            )
            nearest = int(np.argmin(jump))
            if jump[nearest] > _JUMP:
                break
            points.append(candidates[nearest])
        if len(points) == len(poses):
            lines.append(ServiceLine(np.array(points)))
        else:
            share = len(points) / len(poses)
            rejected[
                f"line out of {context.station} leaves the joint limits after {100 * share:.0f} %"
            ] += 1
    return lines


def lines_free(lines: list[ServiceLine], context: Context, rejected: Counter[str]) -> list[bool]:
    """Which lines are free: inside with the station's allowed contacts, at the outer end
    without.
    """
    scene = context.scene
    margin = context.safety_distance
    work = context.work
    if not lines:
        return []
    allowed = FreeSpace.of(scene, margin, work, context.station)
    plain = FreeSpace.of(scene, margin, work)
    inside = allowed.paths_free([line.points for line in lines])
    ends = plain.states_free(np.array([line.outside for line in lines]))
    for line, free, out in zip(lines, inside, ends, strict=True):
        if not free:
            pair = first_too_near(line.points, allowed)
            rejected[f"line out of {context.station}: {pair}"] += 1
        elif not out:
            pair = first_too_near(line.points[-1:], plain)
            rejected[f"outer end at {context.station}: {pair}"] += 1
    return [bool(free) for free in inside & ends]


def timed_service(
    line: ServiceLine, entry: bool, context: Context, near: Movement | None = None
) -> Movement:
    """The movement along the line, outwards or (entry) inwards, verified with the allowed contacts
    of the context's station. near: one along it from whose time scaling the search for a better one
    starts.

    Raises TimingError when a torque does not suffice.
    """
    points = line.along(entry)
    if len(points) < 3 or not line.straight:
        return movement_over(points, context)

    def timed(limits: MotionLimits) -> Movement:
        quickest = slowed_for_tool(line.quickest(entry, limits, context), context)
        trajectory = stretched(quickest, best_stretch(quickest, context))
        return Movement(np.array(points), trajectory, context)

    movement = within_torque(timed, context)
    assert movement is not None  # timed always makes one
    violation = movement.prove().violation
    if violation is not None and violation.what == "clearance":
        # the spline leaves the certified polyline where points lie far apart: refined from the
        # polyline
        return movement_over(points, context)
    if violation is not None and violation.what != "torque":
        raise TimingError(violation.sentence, 0)
    begin = movement if near is None else Movement(movement.path, near.trajectory, context)
    better = rescaled(begin, context, QUICK_TIMING)
    return better if better is not None and better.cost < movement.cost else movement
