"""What a PLC finds at which Modbus address: coils and holding registers in, discrete inputs and
input registers out.

Addresses are zero-based (PDU addresses). 32-bit values take two registers, the high word first.
"""

from __future__ import annotations

from ir_sim_driver.plc.port import Readout

MODBUS = "modbus"
"""How sentences and the parameter `plc.owner` call the link."""
COILS = (
    "ab",
    "hib",
    "ks",
    "emergency_stop",
    "drives_on",
    "drives_off",
    "conf_mess",
    "move_enable",
    "heartbeat",
)
"""Coils 0..8; the first eight are the fields of ir_msgs/PlcInputs."""
HEARTBEAT = COILS.index("heartbeat")
DISCRETE_INPUTS = ("ab", "bbs", "drives_ready", "alarm_stop", "in_home", "moving")
"""Discrete inputs 0..5: the fields of ir_msgs/PlcOutputs."""
OPERATING_MODE = 0
PAUSE = 1
"""Holding registers: mode switch (1 T1, 2 T2, 3 AUT, 4 EXT); pause [s] (writing starts one, 0 ends
it).
"""
HOLDING_REGISTERS = 2
INPUT_REGISTERS = 9
"""Input registers: 0 mode, 1 target mode, 2 time to target [0.1 s], 3 and 4 power [W], 5 and 6
energy [J / 100], 7 time to operate [s], 8 alive counter.
"""
_WORD = 0xFFFF


def discrete_inputs(readout: Readout) -> list[bool]:
    """Values in the order of DISCRETE_INPUTS."""
    return [bool(getattr(readout.outputs, name)) for name in DISCRETE_INPUTS]


def input_registers(readout: Readout) -> list[int]:
    """Values of the INPUT_REGISTERS."""
    return [
        int(readout.mode),
        int(readout.target),
        _clamped(readout.time_to_target * 10.0),
        *_words(readout.power),
        *_words(readout.energy / 100.0),
        _clamped(readout.time_to_operate),
        readout.alive & _WORD,
    ]


def _clamped(value: float) -> int:
    return min(max(round(value), 0), _WORD)


def _words(value: float) -> tuple[int, int]:
    number = min(max(round(value), 0), 0xFFFFFFFF)
    return number >> 16, number & _WORD
