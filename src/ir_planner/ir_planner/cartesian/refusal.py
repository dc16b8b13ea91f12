"""Why a path can't be driven as asked: a sentence with the place along it."""

from ir_msgs_py.arrays import IntArray
from ir_msgs_py.status import Status, StatusCode


class PathRefusedError(Exception):
    """The path can't be driven so; the sentence names the place [m] along it, if there is one."""

    def __init__(self, sentence: str, code: StatusCode = StatusCode.PLANNING_FAILED) -> None:
        super().__init__(sentence)
        self.code = code

    @property
    def status(self) -> Status:
        """The answer."""
        return Status(self.code, str(self))


class NoChainError(Exception):
    """No chain of configurations leads through all layers; reached (M,): those to which one
    leads.
    """

    def __init__(self, reached: IntArray) -> None:
        super().__init__(f"chains lead to {len(reached)} configurations, and not to the last layer")
        self.reached = reached
