"""Requests of a program to driver, planner and machines, one at a time, and their answers.

The program never waits, sends or looks at a clock itself: it is a generator that yields a request
and gets a RequestOutcome for it.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field

from ir_msgs_py.announcements import Event
from ir_msgs_py.modes import Mode, PowerMode
from ir_msgs_py.plc import Signal
from ir_msgs_py.status import Status
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner.errors import StepFailedError


@dataclass(frozen=True)
class Begin:
    """Step `index` is the next one; it has not started yet."""

    index: int


@dataclass(frozen=True)
class Done:
    """The motion or pause of the step is over: its load and its signals follow."""


@dataclass(frozen=True)
class Announce:
    """Announce that step `index` started, ended, failed or was canceled."""

    index: int
    event: Event
    note: str = ""


@dataclass(frozen=True)
class Phase:
    """Announce what the program does now."""

    text: str


@dataclass(frozen=True)
class WaitForSignals:
    """Wait until all signals have these levels; TIMED_OUT after `timeout` [s]."""

    signals: tuple[Signal, ...]
    timeout: float


@dataclass(frozen=True)
class SetSignal:
    """Set a signal for the machines."""

    signal: Signal


@dataclass(frozen=True)
class SetLoad:
    """Let the driver carry exactly this load text."""

    load: str


@dataclass(frozen=True)
class Drive:
    """Let the driver execute a trajectory to its end; cell_hash, load: what it was planned with.

    station: whose contacts are allowed; states: of machines that it relies on.
    """

    trajectory: JointTrajectory
    cell_hash: str = ""
    load: str = ""
    station: str = ""
    states: tuple[str, ...] = ()


@dataclass(frozen=True)
class SetPlcInput:
    """Set one level from the PLC to the robot's controller."""

    name: str
    value: bool


@dataclass(frozen=True)
class TakeBack:
    """Take the program's own 1 of a bit back; refused where somebody else has given it too."""

    name: str


@dataclass(frozen=True)
class AskModes:
    """Ask the driver for its power modes."""


@dataclass(frozen=True)
class WaitForMode:
    """Wait until the power mode is one of these; TIMED_OUT after `timeout` [s]."""

    modes: Collection[Mode]
    timeout: float


@dataclass(frozen=True)
class WaitUntil:
    """Wait until this moment of the clock of the outcomes [s]."""

    moment: float


@dataclass(frozen=True)
class SendWakePacket:
    """Send a Wake-on-LAN packet."""


Request = (
    Begin
    | Done
    | Announce
    | Phase
    | WaitForSignals
    | SetSignal
    | SetLoad
    | Drive
    | SetPlcInput
    | TakeBack
    | AskModes
    | WaitForMode
    | WaitUntil
    | SendWakePacket
)

# what takes time, so that a cancel interrupts it; all other requests are fulfilled in any case
INTERRUPTIBLE = (WaitForSignals, WaitForMode, WaitUntil, Drive)


@dataclass(frozen=True)
class RequestOutcome:
    """What came of a request.

    now: a steady clock [s]. mode: the power mode, None before it is known. modes: the answer to
    AskModes.
    energy: at the mains so far [J].
    A status ROBOT_STATE_STALE means that the driver is silent, whatever was asked.
    """

    now: float
    mode: Mode | None
    status: Status = field(default_factory=Status.success)
    modes: tuple[PowerMode, ...] = ()
    energy: float = 0.0


def need(outcome: RequestOutcome) -> RequestOutcome:
    """Return the outcome, or end the step with its status. Raises StepFailedError for that."""
    if not outcome.status.ok:
        raise StepFailedError(outcome.status)
    return outcome
