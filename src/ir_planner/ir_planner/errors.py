"""Errors of the planner, as one tree.

::

    PlannerError
    ├── RequestError    a request that makes no sense; status code, sentence with value, bound, unit
    ├── TimingError     no time law exists: a torque does not carry the arm along this path
    └── CancelledError  the caller asked to stop

A plan that was looked for and not found is no error: it is a result with a status.
"""

from collections.abc import Iterable

from ir_msgs_py.status import Status, StatusCode


class PlannerError(Exception):
    """Root of everything that ir_planner raises."""


class RequestError(PlannerError):
    """A request that makes no sense; answered with `code` and the sentence."""

    def __init__(self, code: StatusCode, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code

    @property
    def status(self) -> Status:
        """The answer."""
        return Status(self.code, str(self))


def unfit(sentence: str) -> RequestError:
    """An argument of another type."""
    return RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, sentence)


def unknown_name(what: str, name: str, known: Iterable[str]) -> RequestError:
    """A name that is not known; the sentence lists the known ones."""
    shown = ascii(name) if len(name) <= 60 else ascii(name[:57]) + "..."
    listed = ", ".join(known) or "none"
    return RequestError(
        StatusCode.INVALID_OBJECT_NAME, f"{what} {shown} is unknown: known are {listed}"
    )


class TimingError(PlannerError):
    """A path that can't be driven however slowly; `joint` is the one that can't carry on.

    too_heavy: as the torque that may be used doesn't even move the load slowly.
    """

    def __init__(self, sentence: str, joint: int, *, too_heavy: bool = False) -> None:
        super().__init__(sentence)
        self.joint = joint
        self.too_heavy = too_heavy


class CancelledError(PlannerError):
    """The caller asked to stop."""
