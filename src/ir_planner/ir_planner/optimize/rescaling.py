"""A movement with a better time scaling along its path, certified."""

from ir_planner.optimize.path_timing import THOROUGH_TIMING, TimingEffort, along_its_path
from ir_planner.request import Context
from ir_planner.scene import MotionLimits
from ir_planner.timing import Movement, within_torque

KEPT = 1e-3  # rad by which a time scaling may leave its path: some millimetres of the tool at most


def rescaled(
    movement: Movement, context: Context, effort: TimingEffort = THOROUGH_TIMING
) -> Movement | None:
    """The certified movement with the best time scaling along a movement's path; None where there
    is none, or no work left for it. Raises CancelledError when asked to stop.
    """

    def along(limits: MotionLimits) -> Movement | None:
        if context.work.exhausted:
            return None
        found = along_its_path(movement.trajectory, movement.path, limits, context, effort)
        if found is None or found.deviation > KEPT:
            context.journal.reject("no better time scaling along the path")
            return None
        kept = f"within {found.deviation * 1e3:.2f} mrad of its path"
        return Movement(movement.path, found.trajectory, context, kept)

    found = within_torque(along, context)
    if found is not None and found.violation is not None:
        context.journal.reject(
            f"a time scaling along the path isn't certified: {found.violation.what}"
        )
        return None
    return found
