"""A pause in a power mode: go to rest, wake in time, be ready when the pause ends.

AB switches the drive bus off, HIB hibernates, DRIVES_OFF closes the brakes. While it hibernates the
controller reacts to nothing but a Wake-on-LAN packet; the HIB bit is cleared when it is back.
"""

from __future__ import annotations

from collections.abc import Generator

from ir_msgs_py.modes import READY, RESTS, Mode
from ir_msgs_py.power import PowerMode
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.transitions import TransitionTimes
from ir_program_runner.errors import CanceledError, StepFailedError
from ir_program_runner.requests import (
    AskModes,
    Outcome,
    Phase,
    Request,
    SendWakePacket,
    SetPlcInput,
    WaitForMode,
    WaitUntil,
    need,
)
from ir_program_runner.settings import ProgramSettings

Requests = Generator[Request, Outcome, Outcome]
_ASLEEP = (Mode.TO_HIBERNATION, Mode.HIBERNATION)
_AWAKE = (Mode.FROM_HIBERNATION, *READY, Mode.STAND_ON_BRAKES)
_ROUNDING = 1e-6  # s; a plan may use the shortest pause exactly
_LATE = 0.1  # s; a shorter delay is not reported: readings and answers take as long
_BIT = {row.mode: row.bit or "drives_off" for row in RESTS}


class Pause:
    """One pause; `run()` is the generator that returns a note, "" when all went as planned."""

    def __init__(self, movement: PlannedMovement, settings: ProgramSettings, times: TransitionTimes) -> None:
        self._duration = movement.duration
        self._mode = Mode[movement.power_mode or Mode.STAND_ON_MOTORS.name]
        self._settings, self._times = settings, times
        self._bit = _BIT.get(self._mode, "")
        self.restarted = False  # whether the controller has hibernated

    def run(self) -> Generator[Request, Outcome, str]:
        """Spend the pause; raises StepFailedError when the robot isn't ready in the end."""
        outcome = yield Phase("pause")
        end = outcome.now + self._duration
        if self._mode is Mode.STAND_ON_MOTORS:
            need((yield WaitUntil(end)))
            return ""
        times = self._times.of(self._mode)
        asked = yield AskModes()
        times = next((mode for mode in asked.modes if mode.mode is self._mode), times)
        shortest = times.time_to_pause + times.time_min_length_of_stay + times.regular_time_to_operate
        if self._duration + _ROUNDING < shortest:
            need((yield WaitUntil(end)))
            return (
                f"the pause of {self._duration:g} s is too short for {self._mode.name}, "
                f"which needs {shortest:g} s: stood on motors"
            )
        try:
            note = yield from self._rest(end, times)
        except (CanceledError, StepFailedError):
            yield from self._clear()
            raise
        outcome = yield from self._wake(end, times)
        late = outcome.now - end
        if late > _LATE:
            return "; ".join(part for part in (note, f"ready {late:.2f} s late") if part)
        need((yield WaitUntil(end)))
        return note

    def _rest(self, end: float, times: PowerMode) -> Generator[Request, Outcome, str]:
        """Enter the mode and stay until it is time to wake."""
        yield Phase(f"pause: going to {self._mode.name}")
        outcome = need((yield SetPlcInput(self._bit, True)))
        wake_at = end - times.regular_time_to_operate - self._settings.wake_margin
        patience = min(times.time_to_pause + self._settings.enter_timeout, max(0.0, wake_at - outcome.now))
        outcome = yield WaitForMode((self._mode,), patience)
        note = ""
        if outcome.status.code == StatusCode.TIMED_OUT:
            found = "not known" if outcome.mode is None else outcome.mode.name
            note = f"{self._mode.name} was not reached within {patience:.1f} s, the mode is {found}"
        else:
            need(outcome)
            yield Phase(f"pause: {self._mode.name}")
        need((yield WaitUntil(wake_at)))
        return note

    def _wake(self, end: float, times: PowerMode) -> Requests:
        """Wake the robot and wait until it stands on motors; then no bit of the pause is left."""
        outcome = yield Phase("pause: waking")
        change = times.time_to_pause + times.time_min_length_of_stay + times.regular_time_to_operate
        limit = max(end, outcome.now + change) + self._settings.ready_timeout
        if self._mode is Mode.HIBERNATION:
            outcome = yield from self._wake_by_packets(outcome, limit)
        else:
            outcome = need((yield SetPlcInput(self._bit, False)))
        if self._mode is Mode.STAND_ON_BRAKES:
            outcome = need((yield SetPlcInput("drives_on", True)))
        outcome = yield WaitForMode(READY, max(0.0, limit - outcome.now))
        if outcome.status.code == StatusCode.TIMED_OUT:
            found = "not known" if outcome.mode is None else outcome.mode.name
            sentence = (
                f"the robot is not ready {outcome.now - end:.1f} s after the pause: the mode is {found}"
            )
            raise StepFailedError(Status(StatusCode.TIMED_OUT, sentence))
        ready = need(outcome)
        if self._mode is Mode.HIBERNATION:
            need((yield SetPlcInput(self._bit, False)))
        elif self._mode is Mode.STAND_ON_BRAKES:
            need((yield SetPlcInput("drives_on", False)))
        return ready

    def _wake_by_packets(self, outcome: Outcome, limit: float) -> Requests:
        """Send packets until the controller starts; one may get lost, or come before it sleeps."""
        if outcome.mode not in _ASLEEP:  # never hibernated: clear the bit instead
            return need((yield SetPlcInput(self._bit, False)))
        self.restarted = True
        while outcome.mode in _ASLEEP and outcome.now < limit:
            need((yield SendWakePacket()))
            outcome = yield WaitForMode(_AWAKE, self._settings.wake_repeat)
            if outcome.status.code == StatusCode.ROBOT_STATE_STALE:
                raise StepFailedError(outcome.status)
        return outcome

    def _clear(self) -> Generator[Request, Outcome, None]:
        """After a cancel or a fault: clear the bit of the pause, without waiting for the robot.

        A controller that hibernates is woken; its HIB bit counts no more then and is cleared when a
        program starts. One that is still entering hibernation sleeps until a packet wakes it.
        """
        outcome = yield Phase("pause: leaving")
        if self._mode is Mode.HIBERNATION and outcome.mode is Mode.HIBERNATION:
            yield SendWakePacket()
            return
        yield SetPlcInput(self._bit, False)
        if self._mode is Mode.STAND_ON_BRAKES:
            yield SetPlcInput("drives_on", True)
            yield WaitForMode(READY, self._settings.ready_timeout)
            yield SetPlcInput("drives_on", False)
