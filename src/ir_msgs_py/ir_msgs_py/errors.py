"""Forwards to ir_values.errors until every package imports that."""

from ir_values.errors import (
    CallTimedOutError,
    ClientError,
    FileRefusedError,
    InvalidValueError,
    JointNamesError,
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
    "MsgsError",
    "ParameterError",
    "PoseError",
    "RequestRefusedError",
    "ServiceUnavailableError",
    "TrajectoryError",
    "UnknownTypeError",
]
