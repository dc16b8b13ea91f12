"""Errors of the driver, as one tree.

::

    DriverError
    ├── SettingsError (ValueError)  a setting out of its range
    ├── TrajectoryRefusedError      not executed; code of control_msgs/FollowJointTrajectory
    ├── RequestRefusedError         a request that cannot be met; a status code
    ├── ModbusRefusedError          a request that an exception code of Modbus answers
    └── BackendError                the physics gave up: not installed, disconnected or diverged
"""

from __future__ import annotations

from ir_msgs_py.status import StatusCode


class DriverError(Exception):
    """Root of all errors of this package."""


class SettingsError(DriverError, ValueError):
    """A setting out of its range; the sentence names it with value, bound and unit."""


class TrajectoryRefusedError(DriverError):
    """A trajectory that is not executed; `code` is an ErrorCode."""

    def __init__(self, code: int, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code

    def __reduce__(self) -> tuple[type[TrajectoryRefusedError], tuple[int, str]]:
        """It passes from one process to another with its code."""
        return type(self), (self.code, str(self))


class RequestRefusedError(DriverError):
    """A service request that cannot be met; `code` answers it."""

    def __init__(self, code: StatusCode, sentence: str) -> None:
        super().__init__(sentence)
        self.code = code

    def __reduce__(self) -> tuple[type[RequestRefusedError], tuple[StatusCode, str]]:
        """It passes from one process to another with its code."""
        return type(self), (self.code, str(self))


class ModbusRefusedError(DriverError):
    """A Modbus request that is not met; `code` is its exception code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception {code:02d}")
        self.code = code


class BackendError(DriverError):
    """The physics cannot go on."""
