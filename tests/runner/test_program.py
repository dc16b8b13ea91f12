"""A program against a fake world: its order, its pauses to the second, what happens when something
fails.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest

from ir_msgs_py.modes import Mode, PowerMode, TransitionTimes
from ir_msgs_py.names import JOINT_NAMES
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner import requests as ask
from ir_program_runner.errors import CanceledError
from ir_program_runner.program import Program
from ir_program_runner.settings import ProgramSettings

ENTER = 3.0
STAY = 2.0
LEAVE = 20.0
TO = {
    Mode.STAND_ON_BRAKES: Mode.TO_BRAKES,
    Mode.BUS_POWER_OFF: Mode.TO_BUS_POWER_OFF,
    Mode.HIBERNATION: Mode.TO_HIBERNATION,
}
FROM = {
    Mode.STAND_ON_BRAKES: Mode.FROM_BRAKES,
    Mode.BUS_POWER_OFF: Mode.FROM_BUS_POWER_OFF,
    Mode.HIBERNATION: Mode.FROM_HIBERNATION,
}
REST_OF = {"ab": Mode.BUS_POWER_OFF, "hib": Mode.HIBERNATION, "drives_off": Mode.STAND_ON_BRAKES}


@dataclass
class World:
    """A driver and machines that fulfil requests at once; time passes only in waits."""

    now: float = 100.0
    mode: Mode = Mode.STAND_ON_MOTORS
    bits: dict[str, bool] = field(default_factory=dict)
    load: str = "gripper"
    levels: set[str] = field(default_factory=set)
    log: list[str] = field(default_factory=list)
    changes: list[tuple[float, Mode]] = field(default_factory=list)
    packets: int = 0
    deaf_to_packets: int = 0
    ignores_bits: bool = False
    watts: float = 0.0
    knows_modes: bool = True
    refusals: dict[str, Status] = field(default_factory=dict)
    cancel_in: Callable[[ask.Request], bool] = lambda request: False
    late: float = 0.0  # s: so old is the mode that the program hears
    past: list[tuple[float, Mode]] = field(default_factory=list)

    def run(self, movements, settings=None, times=None):
        steps = Program(movements, settings or ProgramSettings(), times).run()
        try:
            request = next(steps)
            while True:
                if isinstance(request, ask.INTERRUPTIBLE) and self.cancel_in(request):
                    self.cancel_in = lambda request: False
                    self.log.append("cancel")
                    request = steps.throw(CanceledError())
                    continue
                status, modes = self.fulfil(request)
                request = steps.send(
                    ask.RequestOutcome(self.now, self.heard, status, modes, self.watts * self.now)
                )
        except StopIteration as ended:
            return ended.value

    @property
    def heard(self):
        """The mode as the program knows it."""
        if not self.past or self.past[-1][1] is not self.mode:
            self.past.append((self.now, self.mode))
        known = [mode for when, mode in self.past if when <= self.now - self.late]
        return known[-1] if known else self.past[0][1]

    def fulfil(self, request):  # noqa: C901, PLR0911, PLR0912
        refusal = self.refusals.get(type(request).__name__)
        if refusal is not None:
            return refusal, ()
        match request:
            case ask.Announce(index, event, note):
                self.log.append(f"{index} {event}" + (f": {note}" if note else ""))
            case ask.Drive(trajectory):
                self.log.append("drive")
                self.pass_time(self.now + trajectory.duration)
            case ask.SetLoad(load):
                self.log.append(f"load {load}")
                self.load = load
            case ask.SetSignal(signal):
                self.log.append(f"signal {signal.name}={int(signal.value)}")
            case ask.WaitForSignals(signals, timeout):
                if not all((signal.name in self.levels) == signal.value for signal in signals):
                    self.pass_time(self.now + timeout)
                    return Status(StatusCode.TIMED_OUT, "not in time"), ()
            case ask.TakeBack(name):
                if self.mode in (Mode.HIBERNATION, Mode.FROM_HIBERNATION):
                    return Status(StatusCode.TIMED_OUT, "hibernates"), ()
                self.log.append(f"end_{name}")
                self.set_bit(name, False)
            case ask.SetPlcInput(name, value):
                if self.mode in (Mode.HIBERNATION, Mode.FROM_HIBERNATION):
                    return Status(StatusCode.TIMED_OUT, "hibernates"), ()
                self.log.append(f"{name}={int(value)}")
                self.set_bit(name, value)
                if self.ignores_bits and value:
                    return Status.success(f"{name.upper()} counts only in EXT"), ()
            case ask.AskModes():
                table = tuple(
                    PowerMode(
                        mode=mode,
                        time_to_pause=ENTER,
                        time_min_length_of_stay=STAY,
                        regular_time_to_operate=LEAVE,
                    )
                    for mode in TO
                )
                return (
                    (Status.success(), table)
                    if self.knows_modes
                    else (Status(StatusCode.TIMED_OUT), ())
                )
            case ask.SendWakePacket():
                self.packets += 1
                self.log.append("packet")
                if self.mode is Mode.HIBERNATION and self.packets > self.deaf_to_packets:
                    self.wake(Mode.HIBERNATION)
            case ask.WaitUntil(moment):
                self.pass_time(moment)
            case ask.WaitForMode(modes, timeout):
                return self.wait_for_mode(modes, timeout), ()
        return Status.success(), ()

    def set_bit(self, name, value):
        before = self.bits.get(name, False)
        if name != "end_rest":  # a request, no level
            self.bits[name] = value
        if self.ignores_bits:
            return
        rest = REST_OF.get(name)
        if rest is not None and value and not before:
            self.mode = TO[rest]
            self.changes = [(self.now + ENTER, rest)]
        elif rest in (Mode.BUS_POWER_OFF,) and before and not value:
            self.wake(rest)
        elif name == "end_rest" and value and self.mode is Mode.STAND_ON_BRAKES:
            self.wake(Mode.STAND_ON_BRAKES)

    def wake(self, rest):
        self.mode = FROM[rest]
        self.changes = [(self.now + LEAVE, Mode.STAND_ON_MOTORS)]

    def pass_time(self, until):
        while self.changes and self.changes[0][0] <= until:
            self.now, self.mode = self.changes.pop(0)
        self.now = max(self.now, until)

    def wait_for_mode(self, modes, timeout):
        deadline = self.now + timeout
        while self.heard not in modes:
            coming = [when for when, _ in self.changes] + [
                when + self.late for when, _ in self.past
            ]
            soon = [when for when in coming if self.now < when <= deadline]
            if not soon:
                self.pass_time(deadline)
                return Status(StatusCode.TIMED_OUT, "not in time")
            self.pass_time(min(soon))
        return Status.success()


def move(duration=2.0, **fields):
    trajectory = JointTrajectory(JOINT_NAMES, [0, int(duration * 1e9)], np.zeros((2, 6)))
    defaults = {"kind": "regional", "trajectory_id": trajectory.trajectory_id, "load": "gripper"}
    return PlannedMovement(**{**defaults, "trajectory": trajectory, "duration": duration, **fields})


def pause(duration, mode="", **fields):
    return PlannedMovement(kind="pause", duration=duration, power_mode=mode, **fields)


def test_steps_run_in_order_with_their_events():
    world = World()
    result = world.run([move(), pause(5.0), move()])
    assert result.status.ok
    assert result.executed == 3
    assert world.now == 100.0 + 2.0 + 5.0 + 2.0
    assert world.log == [
        "end_ab",
        "end_hib",
        "load gripper",
        "0 started",
        "drive",
        "0 ended",
        "1 started",
        "1 ended",
        "2 started",
        "drive",
        "2 ended",
    ]


def test_the_load_changes_at_the_step_that_the_plan_says():
    world = World()
    world.run([move(attach="part"), move(load="gripper+part", detach="part"), move()])
    assert [entry for entry in world.log if "load" in entry or entry == "drive"] == [
        "load gripper",
        "drive",
        "load gripper+part",
        "drive",
        "load gripper",
        "drive",
    ]


def test_signals_are_awaited_before_a_step_and_set_after_it():
    world = World(levels={"door_open"})
    world.run([move(wait_for=("door_open", "busy=0"), set_signals=("start", "open_door=0"))])
    assert world.log[-4:] == ["drive", "signal start=1", "signal open_door=0", "0 ended"]


def test_a_signal_that_does_not_come_ends_the_program():
    world = World()
    result = world.run(
        [move(), move(from_station="lathe", wait_for=("door_open",))],
        ProgramSettings(signal_timeout=30.0),
    )
    assert result.status.code == StatusCode.TIMED_OUT
    assert result.status.message == (
        "step 2 of 2 (regional lathe): signal door_open did not come within 30 s"
    )
    assert result.executed == 1
    assert world.log[-1] == "1 failed: signal door_open did not come within 30 s"
    assert world.log.count("drive") == 1


@pytest.mark.parametrize(
    ("mode", "sleep", "wake"),
    [
        ("BUS_POWER_OFF", ["ab=1"], ["end_ab"]),
        ("HIBERNATION", ["hib=1"], ["packet", "end_hib"]),
        ("STAND_ON_BRAKES", ["drives_off=1"], ["end_drives_off", "end_rest=1"]),
    ],
)
def test_a_pause_rests_in_its_mode_and_is_ready_when_it_ends(mode, sleep, wake):
    world = World()
    result = world.run([pause(60.0, mode), move()])
    assert result.status.ok
    assert world.log[2:-4] == ["0 started", *sleep, *wake, "0 ended"]
    assert world.now == pytest.approx(100.0 + 60.0 + 2.0)
    assert not any(world.bits.values())
    assert world.mode is Mode.STAND_ON_MOTORS


def test_the_load_is_set_again_after_the_controller_has_started_anew():
    world = World()
    world.run([move(), pause(60.0, "HIBERNATION"), move()])
    assert world.log.count("load gripper") == 2


def test_the_robot_is_woken_as_late_as_possible():
    world = World()
    woken = []
    original = world.wake
    world.wake = lambda rest: (woken.append(world.now), original(rest))
    world.run([pause(60.0, "BUS_POWER_OFF")])
    assert woken == [pytest.approx(100.0 + 60.0 - LEAVE)]


def test_times_come_from_the_settings_when_the_driver_does_not_state_them():
    world = World(knows_modes=False)
    woken = []
    original = world.wake
    world.wake = lambda rest: (woken.append(world.now), original(rest))
    times = TransitionTimes(bus_power_off_leave=30.0, bus_power_off_enter=3.0)
    world.run([pause(60.0, "BUS_POWER_OFF")], times=times)
    assert woken == [pytest.approx(130.0)]


def test_a_pause_of_several_modes_goes_deeper_as_soon_as_it_can():
    """The bit of the next mode first: between the two the robot stays where it is."""
    world = World()
    result = world.run([pause(60.0, "STAND_ON_BRAKES>BUS_POWER_OFF"), move()])
    assert result.status.ok
    deeper = ["drives_off=1", "ab=1", "end_drives_off", "end_rest=1", "end_ab"]
    assert world.log[2:-4] == ["0 started", *deeper, "0 ended"]
    assert world.now == pytest.approx(100.0 + 60.0 + 2.0)
    assert not any(world.bits.values())


@pytest.mark.parametrize("late", [0.0, 5.5, 8.0])
def test_a_controller_whose_hibernation_is_heard_late_is_woken_all_the_same(late):
    world = World(late=late)
    assert world.heard is Mode.STAND_ON_MOTORS
    result = world.run([pause(ENTER + STAY + LEAVE, "HIBERNATION"), move()])
    assert result.status.ok, result.status
    assert world.packets >= 1
    assert world.mode is Mode.STAND_ON_MOTORS
    assert not world.bits["hib"]


def test_a_pause_that_takes_other_joules_than_planned_says_so():
    for measured, note in ((1000.0, ""), (1400.0, "the pause took 1400 J, 1000 J were planned")):
        report = TrajectoryReport(duration=10.0, energy=1000.0, base_energy=1000.0)
        world = World(watts=measured / 10.0)
        world.run([pause(10.0, "", report=report)])
        assert world.log[-1].removeprefix("0 ended").removeprefix(": ").startswith(note)
        assert bool(note) == (world.log[-1] != "0 ended")


def test_a_pause_that_is_too_short_is_spent_on_motors_and_says_so():
    world = World()
    result = world.run([pause(24.9, "BUS_POWER_OFF")])
    assert result.status.ok
    assert world.log[-1] == (
        "0 ended: the pause of 24.9 s is too short for BUS_POWER_OFF, which needs 25 s: stood on "
        "motors"
    )
    assert "ab=1" not in world.log


def test_the_shortest_pause_is_used_and_late_by_no_more_than_the_transition():
    world = World()
    result = world.run([pause(ENTER + STAY + LEAVE, "BUS_POWER_OFF")])
    assert result.status.ok
    assert "ab=1" in world.log


def test_a_mode_that_is_not_reached_is_noted_and_the_program_goes_on():
    world = World(ignores_bits=True)
    result = world.run([pause(60.0, "BUS_POWER_OFF"), move()])
    assert result.status.ok
    sentence = "BUS_POWER_OFF was not reached within 8.0 s, the mode is STAND_ON_MOTORS"
    assert f"{sentence}: AB counts only in EXT" in world.log[5]
    assert f"{sentence}: AB counts only in EXT" in result.status.message
    assert world.bits["ab"] is False


def test_a_lost_packet_is_sent_again_until_the_controller_wakes():
    world = World(deaf_to_packets=3)
    result = world.run([pause(60.0, "HIBERNATION")], ProgramSettings(wake_repeat=1.0))
    assert result.status.ok
    assert world.packets == 4
    assert "ready 3.00 s late" in world.log[-1]
    assert world.bits["hib"] is False


def test_a_robot_that_does_not_wake_ends_the_program():
    world = World(deaf_to_packets=10**6)
    result = world.run([pause(60.0, "HIBERNATION"), move()])
    assert result.status.code == StatusCode.TIMED_OUT
    assert "the robot is not ready" in result.status.message
    assert "the mode is HIBERNATION" in result.status.message
    assert "drive" not in world.log


@pytest.mark.parametrize(
    "mode", [Mode.BUS_POWER_OFF, Mode.HIBERNATION, Mode.EMERGENCY_STOP, Mode.MOVING]
)
def test_a_program_does_not_start_unless_the_robot_stands_awake(mode):
    world = World(mode=mode)
    result = world.run([move()])
    assert result.status.code == StatusCode.INVALID_ROBOT_STATE
    assert result.status.message == (
        f"the power mode is {mode.name}: a program starts in STAND_ON_MOTORS, STAND_ON_BRAKES"
    )
    assert world.log == []


def test_an_aborted_movement_ends_the_program_with_the_drivers_sentence():
    sentence = "the driver aborted with -4: joint_a2 is 0.2 rad off"
    world = World(refusals={"Drive": Status(StatusCode.FAILURE, sentence)})
    result = world.run([move(from_station="lathe", to_station="table"), move()])
    assert result.status == Status(
        StatusCode.FAILURE, f"step 1 of 2 (regional lathe -> table): {sentence}"
    )
    assert result.executed == 0
    assert world.log[-1] == f"0 failed: {sentence}"


def test_a_refused_load_ends_the_program_before_anything_moves():
    world = World(
        refusals={"SetLoad": Status(StatusCode.INVALID_OBJECT_NAME, 'load "x": known are gripper')}
    )
    result = world.run([move(load="x")])
    assert result.status.code == StatusCode.INVALID_OBJECT_NAME
    assert "drive" not in world.log


def test_a_robot_that_still_settles_is_offered_its_load_again():
    world = World()
    refused = []
    original = world.fulfil

    def settling(request):
        if isinstance(request, ask.SetLoad) and len(refused) < 3:
            refused.append(world.now)
            return Status(StatusCode.INVALID_ROBOT_STATE, "the robot moves"), ()
        return original(request)

    world.fulfil = settling
    assert world.run([move()]).status.ok
    assert np.diff(refused) == pytest.approx([0.1, 0.1])


@pytest.mark.parametrize("request_type", ["WaitForMode", "Drive", "WaitUntil", "SetPlcInput"])
def test_a_silent_driver_ends_the_program(request_type):
    silence = Status(StatusCode.ROBOT_STATE_STALE, "nothing was heard from ir_sim_driver for 2 s")
    world = World(refusals={request_type: silence})
    result = world.run([move(), pause(60.0, "BUS_POWER_OFF")])
    assert result.status.code == StatusCode.ROBOT_STATE_STALE
    assert "nothing was heard" in result.status.message


def test_a_cancel_while_moving_says_where():
    world = World(cancel_in=lambda request: isinstance(request, ask.Drive))
    result = world.run([move(), move()])
    assert result.status == Status(StatusCode.PREEMPTED, "canceled in step 1 of 2 (regional)")
    assert world.log[-2:] == ["cancel", "0 canceled"]


@pytest.mark.parametrize("mode", ["BUS_POWER_OFF", "STAND_ON_BRAKES"])
def test_a_cancel_in_a_pause_leaves_no_bit_behind(mode):
    world = World()
    world.cancel_in = lambda request: (
        isinstance(request, ask.WaitUntil) and world.mode is Mode[mode]
    )
    result = world.run([pause(60.0, mode), move()])
    assert result.status.code == StatusCode.PREEMPTED
    assert not any(world.bits.values())
    assert "drive" not in world.log


def test_a_cancel_in_hibernation_wakes_the_robot():
    world = World()
    world.cancel_in = lambda request: (
        isinstance(request, ask.WaitUntil) and world.mode is Mode.HIBERNATION
    )
    assert world.run([pause(60.0, "HIBERNATION")]).status.code == StatusCode.PREEMPTED
    assert world.packets == 1
    assert world.mode is Mode.FROM_HIBERNATION


def test_a_cancel_while_waiting_for_a_signal_ends_the_program_at_once():
    world = World(cancel_in=lambda request: isinstance(request, ask.WaitForSignals))
    assert world.run([move(wait_for=("never",))]).status.code == StatusCode.PREEMPTED
    assert world.now == 100.0


def test_a_cancel_before_the_first_step_moves_nothing():
    world = World(cancel_in=lambda request: True)
    result = world.run([move()])
    assert result.status == Status(StatusCode.PREEMPTED, "canceled before the first step")
    assert world.log == ["cancel"]


def test_signals_of_a_program_are_read_by_their_text():
    world = World(levels={"a"})
    assert world.run([move(wait_for=("a", "not b"), set_signals=("not c",))]).status.ok
    assert "signal c=0" in world.log
    assert Signal.parse("not c") == Signal("c", False)
