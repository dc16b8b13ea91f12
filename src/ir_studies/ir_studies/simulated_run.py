"""The simulated driver, stepped without real time, while a meter and encoders are read: a recording
as a trace.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from ir_description import Cell
from ir_msgs_py.modes import RESTS, Mode
from ir_msgs_py.trajectory import JointTrajectory
from ir_recorder.traces import Trace
from ir_sim_driver import DriverError, ErrorCode, TrajectoryGoal, make_simulation
from ir_sim_driver.plant import carried
from ir_studies.errors import StudyError
from ir_values.arrays import FloatArray

READING = 0.01  # s between readings of positions and meter
_LATEST = 2.0  # times of a movement's duration until it must have ended
_CHANGE = 600.0  # s until a mode must have come
# s between looks at the capacitor, and until it counts as empty
_REST = 0.5
_LONGEST_REST = 20.0
_BITS = {row.mode: row.bit or "drives_off" for row in RESTS}


class Step(Protocol):
    """Drive a trajectory with a load, or stand for some seconds in a mode."""

    @property
    def load(self) -> str:
        """As "gripper+part"."""

    @property
    def trajectory(self) -> JointTrajectory | None:
        """None: stand."""

    @property
    def mode(self) -> str:
        """Name of the power mode."""

    @property
    def seconds(self) -> float:
        """How long to stand."""


class SimulatedRun:
    """One plant (see `ir_sim_driver.plant`) in one cell, and what was read of it."""

    def __init__(self, cell: Cell, plant: str, load: str) -> None:
        self.cell = cell
        self.simulation = make_simulation(cell, load, plant=plant)
        self._times: list[float] = []
        self._q: list[FloatArray] = []
        self._joules: list[float] = []
        self._words: list[tuple[str, str]] = []  # mode and load
        self._read()

    def follow(self, step: Step) -> None:
        """One step of a programme of excitation."""
        self.hold(step.load)
        if step.trajectory is not None:
            self.drive(step.trajectory)
        elif step.mode == Mode.STAND_ON_MOTORS.name:
            self.advance(step.seconds)
        else:
            self._stay(Mode[step.mode], step.seconds)

    def close(self) -> None:
        """Let go of the physics server: tens of megabytes."""
        self.simulation.backend.close()

    def place(self, q: FloatArray) -> None:
        """Stand at q (n,) as if driven there long ago: the loops have settled, the capacitor is
        empty.
        """
        simulation = self.simulation
        mains = self.simulation.mains
        if simulation.stopped:
            simulation.recover()
        simulation.backend.reset(q)
        simulation.executor.hold(q)
        latest = simulation.time + _LONGEST_REST
        self.advance(_REST)
        while mains.meter.reading().capacitor_energy > 0.0 and simulation.time < latest:
            self.advance(_REST)

    def hold(self, load: str) -> None:
        """Carry something else from now on: tool and parts are taken and put back by hand."""
        simulation = self.simulation
        if load != simulation.load.text:
            simulation.set_load(carried(self.cell, load))
            simulation.cell_watch.stand_in(self.cell, simulation.load)

    def drive(self, trajectory: JointTrajectory) -> tuple[float, float]:
        """Drive a trajectory; when it began and should have ended [s]. StudyError where it
        fails.
        """
        simulation = self.simulation
        began = simulation.time
        simulation.execute(simulation.vet(TrajectoryGoal(trajectory), 0), 0)
        self._until(lambda: not simulation.executor.active, _LATEST * trajectory.duration + 1.0)
        for outcome in simulation.take_outcomes():
            if outcome.code is not ErrorCode.SUCCESSFUL:
                raise StudyError(f"{simulation.plant.name}: {outcome.sentence}")
        return began, began + trajectory.duration

    def advance(self, seconds: float) -> None:
        """Let so much time pass."""
        self._until(lambda: False, seconds)

    def trace(self) -> Trace:
        """All readings: time, positions [rad], the meter's count [J], mode and load."""
        q = np.array(self._q)
        columns = {name: q[:, k].copy() for k, name in enumerate(self.cell.robot.joint_names)}
        modes, loads = zip(*self._words, strict=True)
        texts = {"mode": tuple(modes), "load": tuple(loads)}
        columns["energy"] = np.array(self._joules)
        return Trace(
            f"simulated, {self.simulation.plant.name}", np.array(self._times), columns, texts
        )

    def _read(self) -> None:
        simulation = self.simulation
        self._times.append(simulation.time)
        self._q.append(np.array(simulation.backend.q))
        self._joules.append(simulation.mains.energy())
        self._words.append((simulation.modes.mode.name, simulation.load.text))

    def _until(self, done: Callable[[], bool], limit: float) -> None:
        for _ in range(max(1, round(limit / READING))):
            self.simulation.run(READING)
            self._read()
            if done():
                return

    def _stay(self, mode: Mode, seconds: float) -> None:
        """Enter a mode of rest by the signals of a PLC, stay, and leave it again."""
        simulation = self.simulation
        bit = _BITS[mode]
        simulation.plc.set_bit(bit, True)
        self._come(mode)
        self.advance(seconds)
        simulation.plc.set_bit(bit, False)
        if mode is Mode.HIBERNATION:
            simulation.wake()
        simulation.plc.set_bit("drives_on", mode is Mode.STAND_ON_BRAKES)
        self._come(Mode.STAND_ON_MOTORS)
        simulation.plc.set_bit("drives_on", False)

    def _come(self, mode: Mode) -> None:
        modes = self.simulation.modes
        self._until(lambda: modes.mode is mode, _CHANGE)
        if modes.mode is not mode:
            raise StudyError(
                f"{mode.name} has not come within {_CHANGE:g} s, it is {modes.mode.name}"
            )


def driven(cell: Cell, plant: str, steps: Sequence[Step]) -> Trace:
    """What is read while the plant drives these steps. StudyError where it can't."""
    try:
        run = SimulatedRun(cell, plant, steps[0].load)
        for step in steps:
            run.follow(step)
    except DriverError as error:
        raise StudyError(str(error)) from error
    return run.trace()
