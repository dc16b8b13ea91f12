"""The movements of a program within a cycle time: stretched alike, or as fast as they can."""

from collections.abc import Callable

from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import StatusCode

from ir_planner.errors import RequestError
from ir_planner.program.assembly import Leg
from ir_planner.request import DURATION_MAX

Legs = dict[int, Leg]
_SLACK = 1e-9  # relative: rounding of durations


def within_cycle(
    cycle: float,
    legs: Legs,
    assemble: Callable[[Legs], tuple[PlannedMovement, ...]],
    hurried: Callable[[], Legs],
) -> tuple[PlannedMovement, ...]:
    """The program in `cycle` s. assemble: steps of legs. hurried: the legs as fast as they can.

    Raises RequestError for a cycle time that is too short, or that makes a movement too long.
    """
    standing, moving = _seconds(assemble(legs))
    wanted = cycle - standing
    if wanted < moving:
        legs = hurried()
        standing, moving = _seconds(assemble(legs))
    if wanted < moving * (1.0 - _SLACK):
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"cycle_time is {cycle:g} s: the shortest is {moving + standing:.3f} s, "
            f"of which {standing:.3f} s are pauses",
        )
    factor = wanted / moving if moving > 0.0 else 1.0
    durations = [movement.trajectory.duration for leg in legs.values() for _, movement in leg.movements]
    longest = factor * max(durations, default=0.0)
    if longest > DURATION_MAX:
        raise RequestError(
            StatusCode.INVALID_GOAL_CONSTRAINTS,
            f"cycle_time is {cycle:g} s: stretched to it, a movement would take {longest:.4g} s, at most "
            f"{DURATION_MAX:g} s; a shorter cycle time with a pause in the program costs less",
        )
    return assemble({k: leg.slower(factor) for k, leg in legs.items()})


def _seconds(planned: tuple[PlannedMovement, ...]) -> tuple[float, float]:
    """How long a program stands and how long it moves [s]."""
    standing = sum(movement.duration for movement in planned if movement.is_pause)
    return standing, sum(movement.duration for movement in planned if not movement.is_pause)
