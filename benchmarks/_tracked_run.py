"""A plant that follows its commands exactly, in batch: what a recording of it would hold, in
seconds.

Torques by the kernels' inverse dynamics with the plant's masses, rotors and spring, friction by
formulas of this module (docs/plant.md) with gears that warm up; drives, DC link and meter are the
driver's own. Without a controller there is no tracking error; `_truth_fit` compares one plant with
the stepped driver.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_cli.excitation_programme import ProgrammeStep
from ir_description import Cell, Load
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.modes import Mode
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.measure import Samples, samples_of
from ir_recorder.traces import Trace
from ir_sim_driver.plant import BasePower, MotorWork, Plant, PowerMeter
from ir_values.arrays import FloatArray

DT = 0.002  # s
READING = 10  # steps between readings of the meter
ENCODER = 2  # steps between readings of positions
COUNTS = 65536  # of an encoder per turn of its motor
_STILL = 1e-3  # rad/s over which dry friction changes its sign
_REFERENCE = 40.0  # deg C to which the friction of the data belongs


@dataclass(frozen=True, eq=False)
class _Stretch:
    """Motion (N, n) with one load in one mode."""

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    load: str
    mode: Mode


class TrackedRun:
    """One plant in one cell and what its meter and encoders read; the same calls as
    `SimulatedRun`.
    """

    def __init__(self, cell: Cell, plant: Plant, load: str) -> None:
        self.cell = cell
        self.plant = plant
        self.command = np.array(cell.machine_home)
        self._load = load
        self._loads: dict[str, tuple[Load, ...]] = {}
        self._models: dict[str, DynamicsModel] = {}
        self._base = BasePower(plant.watts)
        self._meter = PowerMeter(plant, DT)
        self._temperature: FloatArray = np.array(plant.gears.start)
        self._runs: list[tuple[float, float, str]] = [(0.0, np.inf, load)]
        self._steps = 0
        self._q: list[FloatArray] = []
        self._times: list[FloatArray] = []
        self._readings: list[tuple[float, float, str]] = [(0.0, 0.0, Mode.STAND_ON_MOTORS.name)]

    @property
    def time(self) -> float:
        """Plant time [s] since the start."""
        return self._steps * DT

    def hold(self, load: str, loads: Sequence[Load]) -> None:
        """Carry something else from now on."""
        self._loads[load] = tuple(loads)
        if load != self._load:
            start, _, before = self._runs.pop()
            self._runs += [(start, self.time, before), (self.time, np.inf, load)]
            self._load = load

    def drive(self, trajectory: JointTrajectory) -> tuple[float, float]:
        """Follow a trajectory; when it began and when it ended [s]."""
        began = self.time
        self._pass(self._along(trajectory))
        self.command = np.array(trajectory.positions[-1])
        return began, began + trajectory.duration

    def energy(self, trajectory: JointTrajectory) -> float:
        """J at the mains that a movement from rest takes, of no other consequence than that gears
        warm up.
        """
        stretch = self._along(trajectory)
        meter = PowerMeter(self.plant, DT)
        torque = self._torques(stretch)
        base, tool = self._standing(stretch)
        meter.add(base, tool, True, len(torque))
        meter.settle(MotorWork(stretch.qd, torque))
        return meter.reading().energy

    def metered(self, start: float, end: float) -> float:
        """J that the meter counted between two times at which it read [s]."""
        time, joules, _ = zip(*self._readings, strict=True)
        return float(np.diff(np.interp([start, end], time, joules))[0])

    def advance(self, seconds: float, mode: Mode = Mode.STAND_ON_MOTORS) -> None:
        """Stand in a mode."""
        count = READING * max(1, round(seconds / DT / READING))
        still = np.zeros((count, len(self.command)))
        self._pass(_Stretch(still + self.command, still, still, self._load, mode))

    def follow(self, step: ProgrammeStep, loads: Sequence[Load]) -> None:
        """One step of a programme of excitation."""
        self.hold(step.load, loads)
        if step.trajectory is not None:
            self.drive(step.trajectory)
        else:
            self.advance(step.seconds, Mode[step.mode])

    def samples(self, modes: Sequence[str]) -> Samples:
        """All readings on one grid."""
        names = self.cell.robot.joint_names
        q = np.concatenate(self._q)
        count = 2.0 * np.pi / COUNTS / np.array(self.cell.robot.gear_ratio)
        q = np.rint(q / count) * count
        columns = {name: q[:, k].copy() for k, name in enumerate(names)}
        joints = Trace("encoders", np.concatenate(self._times), columns)
        time, joules, mode = zip(*self._readings, strict=True)
        meter = Trace("meter", np.array(time), {"energy": np.array(joules)}, {"mode": mode})
        runs = [(a, b, self._loads[load]) for a, b, load in self._runs if load in self._loads]
        return samples_of(joints, meter, names, modes, runs)

    def _pass(self, stretch: _Stretch) -> None:
        """Let a stretch take place: torques, then the meter, reading by reading."""
        torque = self._torques(stretch)
        base, tool = self._standing(stretch)
        count = len(torque)
        on = stretch.mode is Mode.STAND_ON_MOTORS
        for first in range(0, count, READING):
            rows = slice(first, min(first + READING, count))
            steps = rows.stop - rows.start
            self._meter.add(base, tool, on, steps)
            self._meter.settle(MotorWork(stretch.qd[rows], torque[rows]))
            self._steps += steps
            self._readings.append((self.time, self._meter.reading().energy, stretch.mode.name))
        seen = stretch.q[::ENCODER]
        self._q.append(seen)
        first = self._steps - count + 0.5
        self._times.append(np.asarray(DT * (first + ENCODER * np.arange(len(seen))), np.float64))

    def _along(self, trajectory: JointTrajectory) -> _Stretch:
        count = round(trajectory.duration / DT)
        motion = trajectory.sample(np.minimum((np.arange(count) + 0.5) * DT, trajectory.duration))
        return _Stretch(motion.q, motion.qd, motion.qdd, self._load, Mode.STAND_ON_MOTORS)

    def _standing(self, stretch: _Stretch) -> tuple[float, float]:
        """W of everything but the axes, and the tool's part of it."""
        loads = self._loads[stretch.load]
        self._base.set_load(
            sum(load.watts_always for load in loads),
            sum(load.watts_drive_bus for load in loads),
            sum(load.mass for load in loads),
        )
        rest = None
        if stretch.mode is not Mode.STAND_ON_MOTORS:
            rest = self._base.whole(stretch.mode, stretch.q[-1])
        watts = self._base.of(stretch.mode) if rest is None else rest
        return watts, self._base.tool(stretch.mode)

    def _torques(self, stretch: _Stretch) -> FloatArray:
        """Motor torque (N, n) [Nm] at the joints; warms the gears."""
        q = stretch.q
        qd = stretch.qd
        qdd = stretch.qdd
        if stretch.mode is not Mode.STAND_ON_MOTORS:
            self._warm(np.zeros(q.shape[1]), len(q))
            return np.zeros_like(q)
        drive = self._model(stretch.load).inverse_dynamics(q, qd, qdd)
        through = drive - self.plant.robot.reflected_inertia * qdd
        gears = self.plant.gears
        share = np.where(through * qd >= 0.0, gears.load_driven, gears.load_back)
        near_rest = gears.stribeck * np.exp(-((qd / gears.stribeck_speed) ** 2))
        dry = (gears.coulomb + share * np.abs(through) + near_rest) * np.tanh(qd / _STILL)
        fallen = np.exp(gears.viscous_per_kelvin * (_REFERENCE - self._temperature))
        friction = gears.viscous * fallen * qd + dry
        self._warm((friction * qd).sum(axis=0) * DT, len(q))
        return np.asarray(drive + friction)

    def _warm(self, heat: FloatArray, steps: int) -> None:
        """Bring the gears up to after so many steps with this heat (n,) [J]."""
        gears = self.plant.gears
        lost = gears.conductance * (self._temperature - gears.ambient) * steps * DT
        self._temperature = self._temperature + (heat - lost) / gears.capacity

    def _model(self, load: str) -> DynamicsModel:
        if load not in self._models:
            none = np.zeros(self.plant.robot.n)
            smooth = replace(self.plant.robot, friction_viscous=none, friction_coulomb=none)
            self._models[load] = DynamicsModel(smooth, self._loads[load], self.cell.base_pose)
        return self._models[load]
