"""Texts of a program: .src and .dat, and the PLC's part of its pauses."""

from ir_krl.write.names import NAME_MAX, Numbers, SignalNames, Wiring, check_name
from ir_krl.write.parts import (
    STYLES,
    URSCRIPT,
    Attached,
    Part,
    Style,
    WrittenHandling,
    WrittenMove,
    WrittenPath,
    WrittenPause,
    WrittenSignals,
    WrittenSpline,
    check_style,
)
from ir_krl.write.plc import PlcPause, plc_input, plc_table, read_plc_table, structured_text
from ir_krl.write.program import GRIP, PLC_DONE, PLC_PAUSE, PLC_THERE, Texts, check_signal, written

__all__ = [
    "GRIP",
    "NAME_MAX",
    "PLC_DONE",
    "PLC_PAUSE",
    "PLC_THERE",
    "STYLES",
    "URSCRIPT",
    "Attached",
    "Numbers",
    "Part",
    "PlcPause",
    "SignalNames",
    "Style",
    "Texts",
    "Wiring",
    "WrittenHandling",
    "WrittenMove",
    "WrittenPath",
    "WrittenPause",
    "WrittenSignals",
    "WrittenSpline",
    "check_name",
    "check_signal",
    "check_style",
    "plc_input",
    "plc_table",
    "read_plc_table",
    "structured_text",
    "written",
]
