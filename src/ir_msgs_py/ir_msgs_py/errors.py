"""Forwards to ir_values.errors until every package imports that."""

from ir_values.errors import (
    CallTimedOutError,
    ClientError,
    FileRefusedError,
    InvalidValueError,
    JointNamesError,
    MessageTextError,
    ParameterError,
    PoseError,
    RequestRefusedError,
    ServiceUnavailableError,
    TrajectoryError,
    UnknownTypeError,
)
from ir_values.errors import (
    IrError as MsgsError,
)

__all__ = [
    "CallTimedOutError",
    "ClientError",
    "FileRefusedError",
    "InvalidValueError",
    "JointNamesError",
    "MessageTextError",
    "MsgsError",
    "ParameterError",
    "PoseError",
    "RequestRefusedError",
    "ServiceUnavailableError",
    "TrajectoryError",
    "UnknownTypeError",
]
