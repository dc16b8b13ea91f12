"""The shared vocabulary in Python: array types, names, values, settings; no ROS is needed to import
it.

Conversions to and from messages, the client for scripts and the test fixtures are in
`ir_msgs_py.ros`: nothing else here knows rclpy.
"""

from ir_msgs_py.announcements import Event, ProgramState
from ir_msgs_py.modes import (
    MODES,
    REST_MODES,
    Mode,
    ModeRow,
    PowerMode,
    PowerState,
    TransitionTimes,
)
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.options import OBJECTIVES, TIMINGS, PlanOptions
from ir_msgs_py.plc import (
    PLC_INPUT_NAMES,
    OperatingMode,
    PlcInputs,
    PlcOutputs,
    Signal,
    magic_packet,
    send_packet,
)
from ir_msgs_py.report import (
    DistancePair,
    IkSolution,
    MovementKind,
    PairKind,
    PlannedMovement,
    PlanningInfo,
    PlanningStage,
    Rejection,
    ServiceCandidate,
    TrajectoryReport,
)
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory, MotionSamples
from ir_values.arrays import BoolArray, FloatArray, IntArray
from ir_values.errors import (
    CallTimedOutError,
    ClientError,
    InvalidValueError,
    IrError,
    JointNamesError,
    ParameterError,
    PoseError,
    RequestRefusedError,
    ServiceUnavailableError,
    TrajectoryError,
    UnknownTypeError,
)
from ir_values.settings import Setting, check_settings, describe, setting, settings_table

__all__ = [
    "JOINT_NAMES",
    "MODES",
    "OBJECTIVES",
    "PLC_INPUT_NAMES",
    "REST_MODES",
    "TIMINGS",
    "BoolArray",
    "CallTimedOutError",
    "ClientError",
    "DistancePair",
    "Event",
    "FloatArray",
    "IkSolution",
    "IntArray",
    "InvalidValueError",
    "IrError",
    "JointNamesError",
    "JointTrajectory",
    "Mode",
    "ModeRow",
    "MotionSamples",
    "MovementKind",
    "OperatingMode",
    "PairKind",
    "ParameterError",
    "PlanOptions",
    "PlannedMovement",
    "PlanningInfo",
    "PlanningStage",
    "PlcInputs",
    "PlcOutputs",
    "PoseError",
    "PowerMode",
    "PowerState",
    "ProgramState",
    "Rejection",
    "RequestRefusedError",
    "ServiceCandidate",
    "ServiceUnavailableError",
    "Setting",
    "Signal",
    "Status",
    "StatusCode",
    "TrajectoryError",
    "TrajectoryReport",
    "TransitionTimes",
    "UnknownTypeError",
    "check_settings",
    "describe",
    "magic_packet",
    "send_packet",
    "setting",
    "settings_table",
]
