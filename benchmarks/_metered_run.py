"""A plant driven without real time while a meter and encoders are read: what a recording would hold."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from _driver_power import RESTS, press, until

from ir_cli.excitation.programme import Step
from ir_description import Cell, Load
from ir_msgs_py.modes import Mode
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.measure import Samples, samples_of
from ir_recorder.traces import Trace
from ir_sim_driver import Outcome, Simulation, TrajectoryGoal, carried, make_simulation

ENCODER, METER = 0.005, 0.02  # s between readings
SETTLING = 1.0  # s after a movement: the capacitors give their charge to the holding torque
_LIMIT = 2.0  # times of a movement's duration until it must have ended


class MeteredRun:
    """One plant in one cell, and everything that was read of it."""

    def __init__(self, cell: Cell, plant: str, load: str) -> None:
        self.cell = cell
        self.simulation: Simulation = make_simulation(cell, load, plant=plant)
        self._load = load
        self._loads: dict[str, tuple[Load, ...]] = {}
        self._runs: list[tuple[float, float, str]] = [(0.0, np.inf, load)]
        self._times: list[float] = []
        self._q: list[np.ndarray] = []
        self._meter: list[tuple[float, float, str]] = []
        self.outcomes: list[Outcome] = []
        self.read_meter()

    def advance(self, seconds: float) -> None:
        """Let so much plant time pass, at least one reading of the meter."""
        self.until(lambda: False, seconds)

    def until(self, done: Callable[[], bool], limit: float) -> None:
        """Let time pass until something is so, at most `limit` [s]."""
        for _ in range(max(1, round(limit / METER))):
            for _ in range(round(METER / ENCODER)):
                self.simulation.run(ENCODER)
                self._times.append(self.simulation.time)
                self._q.append(np.array(self.simulation.backend.q))
            self.read_meter()
            if done():
                return

    def read_meter(self) -> None:
        """Note time, joules and mode."""
        mode = self.simulation.modes.mode
        self._meter.append((self.simulation.time, self.simulation.mains.energy(), mode.name))

    def hold(self, load: str, loads: Sequence[Load]) -> None:
        """Carry something else from now on."""
        self._loads[load] = tuple(loads)
        if load != self._load:
            self.simulation.set_load(carried(self.cell, load))
            start, _, before = self._runs.pop()
            self._runs += [(start, self.simulation.time, before), (self.simulation.time, np.inf, load)]
            self._load = load

    def drive(self, trajectory: JointTrajectory) -> tuple[float, float]:
        """Drive a trajectory and rest a moment; when it began and when it should have ended [s]."""
        simulation = self.simulation
        vetted = simulation.vet(TrajectoryGoal(trajectory), 0)
        began = simulation.time
        simulation.execute(vetted, 0)
        self.until(lambda: not simulation.executor.active, _LIMIT * trajectory.duration + 1.0)
        self.outcomes += simulation.take_outcomes()
        self.advance(SETTLING)
        return began, began + trajectory.duration

    def follow(self, step: Step, loads: Sequence[Load]) -> None:
        """One step of a programme of excitation."""
        self.hold(step.load, loads)
        if step.trajectory is not None:
            self.drive(step.trajectory)
        elif step.mode == Mode.STAND_ON_MOTORS.name:
            self.advance(step.seconds)
        else:
            _, enter, leave = next(rest for rest in RESTS if rest[0].name == step.mode)
            enter(self.simulation)
            until(self.simulation, Mode[step.mode])
            self.read_meter()
            self.advance(step.seconds)
            leave(self.simulation)
            until(self.simulation, Mode.STAND_ON_MOTORS)
            press("-drives_on")(self.simulation)
            self.read_meter()

    def samples(self, modes: Sequence[str]) -> Samples:
        """All readings on one grid."""
        q, meter = np.array(self._q), self._meter
        names = self.cell.robot.joint_names
        joints = Trace("encoders", np.array(self._times), {n: q[:, k].copy() for k, n in enumerate(names)})
        columns = {"energy": np.array([joules for _, joules, _ in meter])}
        words = {"mode": tuple(mode for _, _, mode in meter)}
        meters = Trace("meter", np.array([time for time, _, _ in meter]), columns, words)
        runs = [(a, b, self._loads[load]) for a, b, load in self._runs if load in self._loads]
        return samples_of(joints, meters, names, modes, runs)
