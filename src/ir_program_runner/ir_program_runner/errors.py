"""Errors of a program that runs, as one tree.

::

    RunnerError
    ├── ProgramError         a program that must not be started; carries its status code
    ├── StepFailedError      a step that went wrong while it ran; carries its status
    └── CanceledError        thrown into a running program: stop, and leave no bit behind
"""

from __future__ import annotations

from ir_msgs_py.status import Status, StatusCode


class RunnerError(Exception):
    """Root of all errors of this package."""


class ProgramError(RunnerError):
    """A program that makes no sense; nothing has moved."""

    def __init__(self, sentence: str, code: StatusCode = StatusCode.INVALID_MOTION_PLAN) -> None:
        super().__init__(sentence)
        self.code = code


class StepFailedError(RunnerError):
    """A step that did not end well."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.message)
        self.status = status


class CanceledError(RunnerError):
    """Somebody canceled the program; the message describes how it stopped."""
