"""Why a path can't be driven as asked: a sentence with the place along it."""

from ir_msgs_py.status import Status, StatusCode


class PathRefusedError(Exception):
    """The path can't be driven so; `place` [m] along it, None: nowhere in particular."""

    def __init__(self, sentence: str, code: StatusCode = StatusCode.PLANNING_FAILED) -> None:
        super().__init__(sentence)
        self.code = code

    @property
    def status(self) -> Status:
        """The answer."""
        return Status(self.code, str(self))
