"""Asynchronous movements: each joint with a law of its own, beside the synchronous answer to the
same request.
"""

from collections.abc import Callable

from ir_msgs_py.status import Status
from ir_planner.checks import FreeSpace
from ir_planner.errors import RequestError, TimingError
from ir_planner.regional.safeguards import DIRECT
from ir_planner.regional.waypoints import over_free_steps
from ir_planner.request import Context
from ir_planner.timing import Movement, straight_steps

Found = tuple[Status, Movement | None]
LATE = "timing is synchronous: no time was left for own laws of the joints"
SYNCHRONOUS = "timing is synchronous: own laws for the joints serve no better"


def with_own_laws(context: Context, synchronous: Callable[[], Found]) -> Found:
    """The better of the synchronous answer and of the same free path in straight steps, each joint
    with its own law; it notes when it is the synchronous one. The synchronous one too where
    planning_time is over.

    Raises what `synchronous` raises where own laws don't serve either.
    """
    refused: RequestError | None = None
    try:
        status, common = synchronous()
    except RequestError as error:
        status = Status.success()
        common = None
        refused = error
    with context.journal.stage("asynchronous") as notes:
        if common is not None and _too_late(context):
            notes.append(LATE)
            return status, common
        own = None if common is None else _own(common, context)
        if (
            own is not None
            and common is not None
            and (_as_named(context) or own.cost <= common.cost)
        ):
            notes.append(own.note or "each joint has its own law")
            context.journal.timing = own.timing
            return status, own
        notes.append(SYNCHRONOUS)
    if refused is not None:
        raise refused
    return status, common


def _too_late(context: Context) -> bool:
    """Whether planning_time is over, with an answer at hand."""
    return not _as_named(context) and context.work.exhausted and context.work.truncated


def _as_named(context: Context) -> bool:
    """Whether asynchronous joints are asked for at any cost: a PTP by name, unless the fastest."""
    return context.options.planner_id == DIRECT and context.options.objective != "time"


def _own(common: Movement, context: Context) -> Movement | None:
    """The movement over the free path that the synchronous one came from; None where no joint has a
    law of its own, or it isn't certified.
    """
    try:
        space = FreeSpace.of(context.scene, context.safety_distance, context.work)
        movement = straight_steps(over_free_steps(common, space).path, context)
    except (TimingError, RequestError) as error:
        context.journal.reject(f"own laws: {error}")
        return None
    if movement.timing == "synchronous":
        return None
    return movement if movement.certified else None
