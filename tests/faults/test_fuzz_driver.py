"""Thousands of hostile requests of every kind to one running driver, judged by what it publishes.

The judge is in judging.py.
"""

from __future__ import annotations

import importlib.util
import struct
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, load_cell
from ir_msgs.action import ExecuteTrajectory
from ir_msgs_py.modes import Mode, TransitionTimes
from ir_msgs_py.plc import OperatingMode, PlcInputs
from ir_msgs_py.ros.conversions import trajectory_to_msg
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import (
    Driver,
    DriverError,
    ExecutionSettings,
    SimulationSettings,
    TrajectoryGoal,
    make_simulation,
)
from ir_sim_driver.controller import ControllerSettings
from ir_sim_driver.node.messages import goal_from_action
from ir_sim_driver.plant import carried, custom_load
from ir_sim_driver.plc import SERVICE, TOPIC
from ir_sim_driver.plc.inputs import BITS
from ir_sim_driver.plc.modbus import COILS, MODBUS, ControllerTables, answered

PERIOD = 1_000_000  # ns, between two joint states of this driver: every step is judged
SHORT = TransitionTimes(
    **{
        f"{mode}_{part}": 0.03
        for mode in ("stand_on_brakes", "bus_power_off", "hibernation")
        for part in ("enter", "leave", "minimum_stay")
    }
)

BARE = replace(
    load_cell("open"), floor=False, equipment=(), stations=(), parts=(), program=(), tasks=()
)


def neighbour(name: str) -> ModuleType:
    """Another module of this folder."""
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name(f"{name}.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


random_goal = neighbour("test_runaway_goals").random_goal
Judge = neighbour("judging").Judge


class Fuzz:
    """One driver under attack; generator: whatever is random."""

    def __init__(
        self, generator: np.random.Generator, backend: str = "ideal", cell: str | Cell = BARE
    ) -> None:
        self.random = generator
        settings = SimulationSettings(
            transitions=SHORT, controller=ControllerSettings(enabling_switch=True)
        )
        self.simulation = make_simulation(cell, backend=backend, settings=settings)
        self.driver = Driver(self.simulation, steps=1)
        self.tables = ControllerTables(self.driver.plc, 2.0)
        self.judge = Judge(self.simulation.robot)
        self.done: Counter[str] = Counter()
        self._stamp = 0
        self.ride(200)

    def ride(self, steps: int) -> None:
        for _ in range(steps):
            self._stamp += PERIOD
            frame = self.driver.tick(self._stamp)
            braking = (
                self.simulation.modes.mode is Mode.EMERGENCY_STOP
            )  # recovered while it still rolls
            self.judge.see(frame.joints.q, self.simulation.stopped, braking)

    def case(self) -> None:
        """One hostile request, and some time."""
        act = ACTS[int(self.random.choice(len(ACTS), p=WEIGHTS))]
        name = act.__name__
        try:
            act(self)
            self.done[name] += 1
        except DriverError:
            self.done[f"{name} refused"] += 1
        if self.judge.pressed and not self.simulation.stopped:
            self.judge.wrong.append(f"an emergency stop by {name} was lost")
        self.ride(int(10.0 ** self.random.uniform(0.0, 2.2)))
        self.judge.conclude(name)
        if self.simulation.stopped or self.random.random() < 0.05:
            self.restore()

    def restore(self) -> None:
        """What an operator does: release, recover, drives on; sometimes too early."""
        self.driver.plc.write_all_inputs(TOPIC, PlcInputs(operating_mode=OperatingMode.EXT))
        self.ride(int(self.random.integers(1, 600)))
        self.driver.plc.wake()
        self.driver.set_speed_scaling(1.0)
        try:
            self.driver.recover()
            self.judge.pressed = False
        except DriverError:
            pass
        self.driver.plc.write_inputs(SERVICE, {"drives_on": True})
        self.ride(150)
        self.driver.plc.write_inputs(SERVICE, {"drives_on": False})
        self.judge.conclude("restore")

    def execute(self, goal: TrajectoryGoal) -> None:
        now = self._stamp
        self.simulation.execute(self.simulation.vet(goal, now), now)

    def some(self, *values: Any) -> Any:
        return values[int(self.random.integers(len(values)))]


def goal(fuzz: Fuzz) -> None:
    """Spacings from a nanosecond to minutes, every interpolation, stamps."""
    try:
        trajectory, delay = random_goal(fuzz.simulation, fuzz.random)
    except ValueError:  # no trajectory at all
        return
    fuzz.execute(TrajectoryGoal(trajectory, fuzz._stamp + delay if delay else 0))


def harmless_goal(fuzz: Fuzz) -> None:
    """One that is taken where a movement may start, so that something moves; up to an hour long."""
    names = fuzz.simulation.robot.joint_names
    rest = np.zeros((1, 6))
    target = np.array(fuzz.simulation.cell.machine_home) + fuzz.random.uniform(-0.4, 0.4, 6)
    duration = fuzz.some(1.5, 2.0, 3.0, 60.0, 3599.0)
    kinds = ((), (rest,), (rest, rest))
    trajectory = JointTrajectory.from_seconds(
        names, [duration], target[None], *fuzz.some(*kinds[1:])
    )
    fuzz.execute(TrajectoryGoal(trajectory))


def colliding_goal(fuzz: Fuzz) -> None:
    """One that may touch something, said to be known; within the limits, and driven."""
    names = fuzz.simulation.robot.joint_names
    home = np.array(fuzz.simulation.cell.machine_home)
    reach = np.array([2.0, 0.9, 0.9, 2.0, 1.5, 2.0])
    target = home + fuzz.random.uniform(-reach, reach)
    rest = np.zeros((1, 6))
    path = JointTrajectory.from_seconds(names, [fuzz.some(2.5, 4.0)], target[None], rest, rest)
    fuzz.execute(TrajectoryGoal(path, allow_collision=True))
    fuzz.ride(int(fuzz.random.integers(1, 4_000)))


def machine_signal(fuzz: Fuzz) -> None:
    """A machine that closes onto the robot, or opens; a name that nobody has."""
    switches = [
        each.switch.signal for each in fuzz.simulation.cell.equipment if each.switch is not None
    ]
    fuzz.driver.cell_side.hear_signal(
        fuzz.some("", "x" * 100_000, *switches), bool(fuzz.random.integers(2))
    )


def broken_message(fuzz: Fuzz) -> None:
    """A goal as a message, with one field that nobody should send."""
    q = fuzz.simulation.executor.command
    rest = np.zeros((2, 6))
    names = fuzz.simulation.robot.joint_names
    path = JointTrajectory.from_seconds(names, [0.0, 2.0], [q, q + 0.05], rest, rest)
    message = ExecuteTrajectory.Goal(trajectory=trajectory_to_msg(path))
    points = message.trajectory.points
    point = points[int(fuzz.random.integers(2))]
    extreme = fuzz.some(1e308, -1e308, float("nan"), 1e-308)
    field = fuzz.some("positions", "velocities", "accelerations", "effort")
    match int(fuzz.random.integers(8)):
        case 0:
            getattr(point, field)[:] = type(point.positions)(
                "d", [extreme] * len(getattr(point, field))
            )
        case 1:
            setattr(point, field, [extreme] * int(fuzz.random.integers(0, 12)))
        case 2:
            point.time_from_start.sec = int(fuzz.some(-(2**31), -1, 0, 2**31 - 1))
        case 3:
            message.trajectory.joint_names[0] = fuzz.some(
                "", "joint_a2", "\0\n\x1b[2J", "j" * 10_000
            )
        case 4:
            message.trajectory.joint_names = list(fuzz.random.permutation(names))
        case 5:
            message.trajectory.points = points * int(fuzz.some(0, 2, 15_000))
        case 6:
            message.trajectory_id = fuzz.some("\0" * 9, "\x1b]0;pwned\x07", "i" * 100_000, "\u202e")
        case 7:
            message.goal_time_tolerance.sec = int(fuzz.some(-(2**31), -1, 2**31 - 1))
    fuzz.execute(goal_from_action(message, fuzz.driver.max_points))


def cancel(fuzz: Fuzz) -> None:
    fuzz.simulation.cancel(fuzz.simulation.executor.goal_id or 0)


def scale(fuzz: Fuzz) -> None:
    fuzz.driver.set_speed_scaling(float(fuzz.some(0.0, 0.3, 1.0, 1.0, 1e308, -1.0, float("nan"))))


def press(fuzz: Fuzz) -> None:
    """The emergency stop by anybody, taken back at once by half of them."""
    fuzz.judge.pressed = True
    writer = fuzz.some(SERVICE, TOPIC, MODBUS)
    if writer == MODBUS:
        answered(struct.pack(">BHH", 5, COILS.index("emergency_stop"), 0xFF00), fuzz.tables)
    elif writer == TOPIC:
        fuzz.driver.plc.write_all_inputs(TOPIC, PlcInputs(emergency_stop=True))
    else:
        fuzz.driver.press(SERVICE, "emergency_stop", True)
    if fuzz.random.random() < 0.5:
        fuzz.driver.plc.write_all_inputs(TOPIC, PlcInputs())


def bit(fuzz: Fuzz) -> None:
    name = fuzz.some(*(name for name in BITS if name not in ("emergency_stop", "conf_mess")))
    fuzz.driver.plc.write_inputs(
        fuzz.some(SERVICE, MODBUS, TOPIC), {name: bool(fuzz.random.integers(2))}
    )


def switch(fuzz: Fuzz) -> None:
    fuzz.driver.plc.write_mode_and_pause(
        MODBUS, OperatingMode(int(fuzz.random.integers(1, 5))), fuzz.some(None, 0.0, 5.0, 1e9)
    )


def modbus(fuzz: Fuzz) -> None:
    """Any bytes, most of them with a function that there is; none that presses or resets the
    stop.
    """
    function = int(fuzz.random.integers(0, 17))
    words = fuzz.random.integers(0, 12, 3)
    request = struct.pack(">B3H", function, *map(int, words)) + fuzz.random.bytes(4)
    if function not in (5, 15):
        assert 1 < len(answered(request, fuzz.tables)) < 260


def load(fuzz: Fuzz) -> None:
    scale = 10.0 ** fuzz.random.uniform(-3.0, 3.0)
    com = fuzz.random.normal(size=3) * fuzz.some(0.01, 0.2, 1e3)
    inertia = np.diag(np.abs(fuzz.random.normal(size=3)) * scale)[np.triu_indices(3)]
    cell = fuzz.simulation.cell
    fuzz.driver.set_load(
        fuzz.some(
            lambda c: custom_load(cell, scale, com, inertia, 0.0, 0.0), lambda c: carried(c, "none")
        )
    )


def pause(fuzz: Fuzz) -> None:
    fuzz.driver.start_pause(float(fuzz.some(0.1, 1.0, 100.0, 1e308, -1.0, float("nan"))))


def sleep_and_wake(fuzz: Fuzz) -> None:
    fuzz.driver.plc.write_inputs(TOPIC, {"hib": True})
    fuzz.ride(int(fuzz.random.integers(1, 200)))
    fuzz.driver.plc.write_inputs(TOPIC, {"hib": False})
    fuzz.driver.plc.wake()


def parameters(fuzz: Fuzz) -> None:
    """As the node does: only while nothing moves."""
    wanted = {
        "stop_time": fuzz.some(0.05, 0.3, 2.0, -1.0),
        "blend_time": fuzz.some(0.001, 0.02, 0.1, 1e308),
    }
    try:
        settings = ExecutionSettings(**wanted)
    except ValueError:
        return
    if not fuzz.driver.moving:
        fuzz.driver.set_execution(settings)


Act = Callable[[Fuzz], None]
RATES: dict[Act, float] = {
    goal: 25, harmless_goal: 15, broken_message: 10, cancel: 5, scale: 6, press: 6, bit: 8, switch: 4,  # noqa: E501
    modbus: 6, load: 5, pause: 3, sleep_and_wake: 2, parameters: 4, colliding_goal: 4, machine_signal: 3,  # noqa: E501
}  # fmt: skip
ACTS = list(RATES)
WEIGHTS = np.array(list(RATES.values())) / sum(RATES.values())


def attacked(
    cases: int, seed: int, backend: str = "ideal", cell: str | Cell = BARE
) -> tuple[Counter[str], list[str]]:
    """Counts of what was done and refused, and what broke a law."""
    generator = np.random.default_rng(seed)
    done = Counter[str]()
    wrong = []
    for first in range(0, cases, 250):
        fuzz = Fuzz(generator, backend, cell)
        for case in range(first, min(first + 250, cases)):
            fuzz.case()
            wrong += [f"case {case} of seed {seed}: {each}" for each in fuzz.judge.wrong]
            fuzz.judge.wrong.clear()
        done += fuzz.done
        fuzz.driver.close()
    return done, wrong


def test_a_hundred_hostile_requests_break_no_law() -> None:
    done, wrong = attacked(100, seed=1)
    assert wrong == []
    assert {act.__name__ for act in ACTS} == {name.removesuffix(" refused") for name in done}
    assert (
        min(done[name] for name in ("goal", "harmless_goal", "broken_message", "press", "load")) > 0
    )


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_twenty_thousand_hostile_requests_break_no_law(seed: int) -> None:
    assert attacked(1_000, seed=100 + seed)[1] == []


def test_thirty_hostile_requests_to_the_physics_break_no_law() -> None:
    assert attacked(30, seed=2, backend="pybullet")[1] == []


@pytest.mark.long
def test_hostile_requests_among_machines_break_no_law() -> None:
    """Contacts and machines that close are part of it."""
    done, wrong = attacked(100, seed=3, cell="demo")
    assert wrong == []
    assert min(done[name] for name in ("colliding_goal", "machine_signal")) > 0


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_four_thousand_hostile_requests_among_machines_break_no_law(seed: int) -> None:
    assert attacked(1_000, seed=300 + seed, cell="demo")[1] == []


@pytest.mark.long
@pytest.mark.parametrize("seed", range(4))
def test_a_thousand_hostile_requests_to_the_physics_break_no_law(seed: int) -> None:
    assert attacked(250, seed=200 + seed, backend="pybullet")[1] == []
