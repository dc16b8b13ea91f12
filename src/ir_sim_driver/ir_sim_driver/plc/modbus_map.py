"""What a PLC finds at which Modbus address: coils and holding registers in, discrete inputs and input
registers out.

Addresses are zero-based (PDU addresses). 32-bit values take two registers, the high word first.
"""

from __future__ import annotations

from dataclasses import dataclass

from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import PlcOutputs

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
OPERATING_MODE, PAUSE = 0, 1
"""Holding registers: mode switch (1 T1, 2 T2, 3 AUT, 4 EXT); pause [s] (writing starts one, 0 ends it)."""
HOLDING_REGISTERS = 2
INPUT_REGISTERS = 9
"""Input registers: 0 mode, 1 target mode, 2 time to target [0.1 s], 3 and 4 power [W], 5 and 6 energy [J /
100], 7 time to operate [s], 8 alive counter."""
_WORD = 0xFFFF


@dataclass(frozen=True)
class Readout:
    """What the PLC may read. power [W], energy [J], times [s]; alive counts on while the plant runs."""

    outputs: PlcOutputs
    mode: Mode
    target: Mode
    time_to_target: float
    time_to_operate: float
    power: float
    energy: float
    alive: int

    def discrete_inputs(self) -> list[bool]:
        """Values in the order of DISCRETE_INPUTS."""
        return [bool(getattr(self.outputs, name)) for name in DISCRETE_INPUTS]

    def input_registers(self) -> list[int]:
        """Values of the INPUT_REGISTERS."""
        return [
            int(self.mode),
            int(self.target),
            _clamped(self.time_to_target * 10.0),
            *_words(self.power),
            *_words(self.energy / 100.0),
            _clamped(self.time_to_operate),
            self.alive & _WORD,
        ]


def _clamped(value: float) -> int:
    return min(max(round(value), 0), _WORD)


def _words(value: float) -> tuple[int, int]:
    number = min(max(round(value), 0), 0xFFFFFFFF)
    return number >> 16, number & _WORD
