"""Errors of a program: not to be started, failed in a step, canceled."""

from __future__ import annotations

from ir_msgs_py.status import Status, StatusCode


class ProgramError(Exception):
    """A program that makes no sense, with the code of the answer; nothing has moved."""

    def __init__(self, sentence: str, code: StatusCode = StatusCode.INVALID_MOTION_PLAN) -> None:
        super().__init__(sentence)
        self.code = code


class StepFailedError(Exception):
    """A step that did not end well."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.message)
        self.status = status


class CanceledError(Exception):
    """Thrown into a running program: stop, and leave no bit behind; the message says how it
    stopped.
    """
