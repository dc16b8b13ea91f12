"""Pauses of a program, in one power mode or deeper and deeper: go to rest, wake in time, be ready
at the end.

AB switches the drive bus off, HIB hibernates, DRIVES_OFF closes the brakes. While it hibernates
the controller reacts to nothing but a Wake-on-LAN packet; the HIB bit is cleared when it is
back.
"""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import replace

from ir_msgs_py.modes import (
    READY,
    RESTS,
    Mode,
    RestTimes,
    TransitionTimes,
    modes_of,
    shortest_pause,
)
from ir_msgs_py.names import END_REST
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_program_runner.errors import CanceledError, StepFailedError
from ir_program_runner.requests import (
    AskModes,
    Phase,
    Request,
    RequestOutcome,
    SendWakePacket,
    SetPlcInput,
    TakeBack,
    WaitForMode,
    WaitUntil,
    need,
)
from ir_program_runner.settings import ProgramSettings

Requests = Generator[Request, RequestOutcome, RequestOutcome]
_ASLEEP = (Mode.TO_HIBERNATION, Mode.HIBERNATION)
_AWAKE = (Mode.FROM_HIBERNATION, *READY, Mode.STAND_ON_BRAKES)
_ROUNDING = 1e-6  # s; a plan may use the shortest pause exactly
_LATE = 0.1  # s; a shorter delay is not reported: readings and answers take as long
# whichever is larger: readings come every 10 ms, answers take as long
_SHARE = 0.05
_JOULES = 100.0
_BIT = {row.mode: row.bit or "drives_off" for row in RESTS}


class PauseRun:
    """One pause; `run()` is the generator that returns a note, "" when all went as planned.

    end: of the clock of the outcomes [s], None: as long after its begin as planned.
    """

    def __init__(
        self,
        movement: PlannedMovement,
        settings: ProgramSettings,
        times: TransitionTimes,
        end: float | None = None,
    ) -> None:
        self._movement = movement
        self._end = end
        self._duration = movement.duration
        self._modes = modes_of(movement.power_mode)
        self._settings = settings
        self._times = times
        self._mode = Mode.STAND_ON_MOTORS  # the deepest that was asked for
        self.restarted = False  # whether the controller has hibernated

    def run(self) -> Generator[Request, RequestOutcome, str]:
        """Spend the pause; raises StepFailedError when the robot isn't ready in the end."""
        begun = yield Phase("pause")
        end = begun.now + self._duration
        if self._end is not None:
            end = max(self._end, begun.now)
            self._duration = end - begun.now
        if not self._modes:
            outcome = need((yield WaitUntil(end)))
            return self._difference(outcome.energy - begun.energy)
        asked = yield AskModes()
        known = {mode.mode: mode for mode in asked.modes}
        times = [
            known[mode].times if mode in known else self._times.rest(mode.name)
            for mode in self._modes
        ]
        shortest = shortest_pause(times)
        if self._duration + _ROUNDING < shortest:
            need((yield WaitUntil(end)))
            return (
                f"the pause of {self._duration:g} s is too short for {self._movement.power_mode}, "
                f"which needs {shortest:g} s: stood on motors"
            )
        try:
            note = yield from self._rest(end, times)
        except (CanceledError, StepFailedError):
            yield from self._clear()
            raise
        outcome = yield from self._wake(end, times[-1])
        late = outcome.now - end
        if late > _LATE:
            return "; ".join(part for part in (note, f"ready {late:.2f} s late") if part)
        outcome = need((yield WaitUntil(end)))
        return note or self._difference(outcome.energy - begun.energy)

    def _difference(self, measured: float) -> str:
        """What a pause took where it isn't what was planned for this length, "" where it is."""
        planned = self._movement.report
        same = (
            planned.energy > 0.0
            and abs(planned.duration - self._duration) < _ROUNDING
            and measured > 0.0
        )
        if not same or abs(measured - planned.energy) <= max(_SHARE * planned.energy, _JOULES):
            return ""
        return (
            f"the pause took {measured:.0f} J, {planned.energy:.0f} J were planned: the program "
            "was planned for other timers, powers or loads than the driver's"
        )

    def _rest(
        self, end: float, times: Sequence[RestTimes]
    ) -> Generator[Request, RequestOutcome, str]:
        """Enter the modes one after the other and stay until it is time to wake."""
        wake_at = times[-1].wake_at(end)
        stay = 0.0
        for mode, each in zip(self._modes, times, strict=True):
            yield Phase(f"pause: going to {mode.name}")
            outcome = yield from self._ask_for(mode)
            ignored = outcome.status.message
            enough = stay + each.enter + self._settings.enter_timeout
            patience = min(enough, max(0.0, wake_at - outcome.now))
            outcome = yield WaitForMode((mode,), patience)
            if outcome.status.code == StatusCode.TIMED_OUT:
                found = "not known" if outcome.mode is None else outcome.mode.name
                note = f"{mode.name} was not reached within {patience:.1f} s, the mode is {found}"
                note += f": {ignored}" if ignored else ""
                need((yield WaitUntil(wake_at)))
                return note
            need(outcome)
            yield Phase(f"pause: {mode.name}")
            stay = each.stay
        need((yield WaitUntil(wake_at)))
        return ""

    def _ask_for(self, mode: Mode) -> Requests:
        """Set the bit of a mode, then clear that of the one before: between the two the robot stays
        where it is. The controller waits for the shortest stay by itself. The message of the status
        says why the bit does not count, "" where it does.
        """
        before = self._mode
        self._mode = mode
        given = need((yield SetPlcInput(_BIT[mode], True)))
        outcome = given
        if before in _BIT:
            outcome = need((yield TakeBack(_BIT[before])))
        if before is Mode.STAND_ON_BRAKES:  # takes the latched drives_off back
            outcome = need((yield SetPlcInput(END_REST, True)))
        return replace(outcome, status=given.status)

    def _wake(self, end: float, times: RestTimes) -> Requests:
        """Wake the robot and wait until it stands on motors; then no bit of the pause is left."""
        outcome = yield Phase("pause: waking")
        limit = max(end, outcome.now + times.shortest) + self._settings.ready_timeout
        if self._mode is Mode.HIBERNATION:
            outcome = yield from self._wake_by_packets(outcome, limit)
        else:
            outcome = need((yield TakeBack(_BIT[self._mode])))
        if self._mode is Mode.STAND_ON_BRAKES:
            outcome = need((yield SetPlcInput(END_REST, True)))
        outcome = yield WaitForMode(READY, max(0.0, limit - outcome.now))
        if outcome.status.code == StatusCode.TIMED_OUT:
            found = "not known" if outcome.mode is None else outcome.mode.name
            sentence = (
                f"the robot is not ready {outcome.now - end:.1f} s after the pause: the "
                f"mode is {found}"
            )
            raise StepFailedError(Status(StatusCode.TIMED_OUT, sentence))
        ready = need(outcome)
        if self._mode is Mode.HIBERNATION:
            need((yield TakeBack(_BIT[self._mode])))
        return ready

    def _wake_by_packets(self, outcome: RequestOutcome, limit: float) -> Requests:
        """Send packets until the controller starts; one may get lost, or come before it sleeps."""
        if outcome.mode not in _ASLEEP:  # it has not hibernated, or that is heard late
            outcome = yield from self._stay_awake()
            if outcome.status.ok and outcome.mode not in _ASLEEP:
                return outcome
        self.restarted = True
        asleep = outcome.mode in _ASLEEP
        waking = False
        while not waking and outcome.now < limit:
            need((yield SendWakePacket()))
            woken = _AWAKE if asleep else (Mode.FROM_HIBERNATION,)
            outcome = yield WaitForMode(woken, self._settings.wake_repeat)
            if outcome.status.code == StatusCode.ROBOT_STATE_STALE:
                raise StepFailedError(outcome.status)
            asleep = asleep or outcome.mode in _ASLEEP
            waking = outcome.mode is Mode.FROM_HIBERNATION or (asleep and outcome.mode in _AWAKE)
        return outcome

    def _stay_awake(self) -> Requests:
        """Take the HIB bit back; whoever doesn't answer hibernates, and who has begun to shows it
        soon. Raises StepFailedError where somebody else wants it to hibernate.
        """
        outcome = yield TakeBack(_BIT[self._mode])
        status = outcome.status
        if status.ok or status.code == StatusCode.INVALID_ROBOT_STATE:
            seen = yield WaitForMode(_ASLEEP, self._settings.wake_repeat)
            outcome = replace(seen, status=status)
        if status.code == StatusCode.INVALID_ROBOT_STATE and outcome.mode not in _ASLEEP:
            raise StepFailedError(status)
        return outcome

    def _clear(self) -> Generator[Request, RequestOutcome, None]:
        """After a cancel or a fault: clear the bit of the pause, without waiting for the robot.

        A controller that hibernates is woken; its HIB bit counts no more then and is cleared when a
        program starts. One that is still entering hibernation sleeps until a packet wakes it.
        """
        outcome = yield Phase("pause: leaving")
        if self._mode is Mode.HIBERNATION and outcome.mode is Mode.HIBERNATION:
            yield SendWakePacket()
            return
        for mode in reversed(self._modes[: self._modes.index(self._mode) + 1]):
            yield TakeBack(_BIT[mode])
        if self._modes[0] is Mode.STAND_ON_BRAKES:
            outcome = yield SetPlcInput(END_REST, True)
            if outcome.status.ok:  # not while a stop is latched
                yield WaitForMode(READY, self._settings.ready_timeout)
