"""The port between PLC and controller: what a link may ask of the controller, and what a link is.

A link knows its own wire (registers, packets) and nothing of the simulation; the controller knows
no link.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar, Protocol

from ir_msgs_py.modes import Mode
from ir_msgs_py.plc import OperatingMode, PlcInputs, PlcOutputs

STOP_BIT = "emergency_stop"
"""The input that anybody may press, in every mode."""


@dataclass(frozen=True)
class Readout:
    """What a PLC may read. power [W], energy [J], times [s]; alive counts on while the plant
    runs.
    """

    outputs: PlcOutputs
    mode: Mode
    target: Mode
    time_to_target: float
    time_to_operate: float
    power: float
    energy: float
    alive: int


class Controller(Protocol):
    """What a link may do; whatever is refused raises DriverError. writer: the name of the link.

    A pressed emergency stop is never refused and latched in every mode, also while `readout` is
    None.
    """

    def readout(self) -> Readout | None:
        """Present outputs; None while the controller is off the network."""

    def inputs(self) -> PlcInputs:
        """Levels of the inputs as they were written last."""

    def write_inputs(self, writer: str, levels: Mapping[str, bool], came_ns: int = 0) -> None:
        """Set these levels, the others stay. came_ns: when they came at the earliest [ns of the
        monotonic clock], 0: now; only a press of the emergency stop may come before the last stop.
        """

    def write_mode_and_pause(
        self, writer: str, mode: OperatingMode | None, pause: float | None
    ) -> None:
        """Turn the mode switch, and start a PROFIenergy pause [s] or end it with 0; None: leave it.

        Both or, where one of them is refused, neither.
        """

    def heartbeat(self, timeout: float) -> None:
        """The PLC is alive; without another heartbeat within `timeout` [s] its link counts as
        lost.
        """

    def wake(self) -> None:
        """Wake the controller from hibernation; does nothing otherwise."""


class OpenLink(Protocol):
    """A link that serves until it is closed; port: where it listens."""

    @property
    def port(self) -> int:
        """Port number that it listens on."""

    def close(self) -> None:
        """Stop serving."""


class Link(Protocol):
    """A link that can be opened: a frozen dataclass whose fields are its settings.

    name: how sentences and `plc.owner` call it. sets_inputs: whether it writes PLC inputs.
    """

    name: ClassVar[str]
    sets_inputs: ClassVar[bool]

    @property
    def wanted(self) -> bool:
        """Whether the settings ask for it."""

    def open(self, controller: Controller) -> OpenLink:
        """Serve the controller. Raises DriverError when that is not possible here."""
