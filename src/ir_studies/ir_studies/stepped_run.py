"""A program as the program runner drives it: simulated robot and machines, without real time.

The runner's own program asks; the stepped simulation and the soft PLC of the cell answer at once.
Everything that the nodes do is done but what takes the nodes' own time.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np

from ir_description import Cell
from ir_msgs_py.announcements import Event
from ir_msgs_py.modes import PowerMode
from ir_msgs_py.names import END_REST
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_program_runner import Machines, Program, ProgramResult, ProgramSettings
from ir_program_runner import requests as ask
from ir_recorder.analysis.tending import SignalChange, TendedStep
from ir_sim_driver import DriverError, ErrorCode, Simulation, TrajectoryGoal, make_simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.plant import carried
from ir_studies.errors import StudyError
from ir_values.arrays import FloatArray

_REST = 0.5  # s in which the loops settle, and between looks at the capacitor
_LONGEST_REST = 20.0  # s until the capacitor counts as empty


class SteppedRun:
    """A plant (see `ir_sim_driver.plant`) in a cell with its machines; what they did is in `steps`
    and `signals`, what the program remarked in `notes`. deviation [m]: largest of the tool.
    """

    def __init__(
        self,
        cell: Cell,
        plant: str = "nominal",
        seed: int = 0,
        before_step: Callable[[], None] = lambda: None,
    ) -> None:
        self.cell = cell
        self._before_step = before_step
        self.simulation: Simulation = make_simulation(cell, plant=plant)
        self.machines = Machines.of(cell, seed)
        self.steps: list[TendedStep] = []
        self.signals: list[SignalChange] = []
        self.notes: list[str] = []
        self.deviation = 0.0
        # whom the program's signals reach
        self.told: Callable[[Signal], None] = lambda signal: None
        self._movements: Sequence[PlannedMovement] = ()
        self._begin = (0.0, 0.0)
        self._start = (0.0, 0.0)
        self._end = (0.0, 0.0)

    def close(self) -> None:
        """Let go of the physics server: tens of megabytes."""
        self.simulation.backend.close()

    def place(self, q: FloatArray) -> None:
        """Stand at q (n,) as if driven there long ago: settled, the capacitor empty."""
        simulation = self.simulation
        simulation.backend.reset(q)
        simulation.executor.hold(q)
        latest = simulation.time + _LONGEST_REST
        simulation.run(_REST)
        while simulation.mains.meter.reading().capacitor_energy > 0.0 and simulation.time < latest:
            simulation.run(_REST)

    def run(
        self, movements: Sequence[PlannedMovement], settings: ProgramSettings | None = None
    ) -> ProgramResult:
        """Drive a program from where the robot stands."""
        self._movements = movements
        steps = Program(movements, settings or ProgramSettings()).run()
        try:
            request = next(steps)
            while True:
                status, modes = self._fulfil(request)
                plant = self.simulation
                request = steps.send(
                    ask.RequestOutcome(
                        plant.time, plant.modes.mode, status, modes, plant.mains.energy()
                    )
                )
        except StopIteration as ended:
            result: ProgramResult = ended.value
            return result

    def _now(self) -> tuple[float, float]:
        return self.simulation.time, self.simulation.mains.energy()

    def _fulfil(self, request: ask.Request) -> tuple[Status, tuple[PowerMode, ...]]:  # noqa: C901, PLR0912
        """Do what a request asks of the simulation; its status, and the modes if asked for."""
        plant = self.simulation
        match request:
            case ask.Begin():
                self._begin = self._now()
            case ask.Done():
                self._end = self._now()
            case ask.Announce(index, event, note):
                self._announced(index, event, note)
            case ask.SetPlcInput(name, value) if name == END_REST:
                if value:
                    plant.control.end_rest()
            case ask.SetPlcInput(name, value):
                plant.plc.set_bit(name, value)
            case ask.TakeBack(name):
                plant.control.take_back(name)
            case ask.AskModes():
                return Status.success(), plant.pauses.query_modes()
            case ask.SendWakePacket():
                plant.wake()
            case ask.SetLoad(load):
                return self._carry(load), ()
            case ask.SetSignal(signal):
                self.machines.set(signal, plant.time)
                self._note(signal)
                self.told(signal)
            case ask.WaitUntil(moment):
                self._until(lambda: plant.time >= moment, moment)
            case ask.WaitForSignals(signals, timeout):
                done = self._until(lambda: self.machines.holds(signals), plant.time + timeout)
                return done, ()
            case ask.WaitForMode(modes, timeout):
                return self._until(lambda: plant.modes.mode in modes, plant.time + timeout), ()
            case ask.Drive(trajectory, cell_hash, load, station, _):
                return self._drive(trajectory, cell_hash, load, station), ()
        return Status.success(), ()

    def _announced(self, index: int, event: Event, note: str) -> None:
        if event is Event.STARTED:
            self._start = self._now()
            return
        begin, before = self._begin
        start, counted = self._start
        end, joules = self._end if event is Event.ENDED else self._now()
        if note:
            self.notes.append(f"{index + 1}: {note}")
        step = TendedStep(
            self._movements[index], begin, start, end, counted - before, joules - counted
        )
        self.steps.append(step)

    def _carry(self, load: str) -> Status:
        try:
            self.simulation.set_load(carried(self.cell, load))
        except RequestRefusedError as error:
            return Status(error.code, str(error))
        return Status.success()

    def _drive(
        self, trajectory: JointTrajectory, cell_hash: str, load: str, station: str
    ) -> Status:
        plant = self.simulation
        goal = TrajectoryGoal(trajectory, cell_hash=cell_hash, load=load, station=station)
        try:
            plant.execute(plant.vet(goal, 0), 0)
        except DriverError as error:
            return Status(StatusCode.FAILURE, str(error))
        outcomes = plant.take_outcomes()
        while not outcomes:
            self._step()
            outcomes = plant.take_outcomes()
        outcome = outcomes[-1]
        self.deviation = max(self.deviation, outcome.max_tool_deviation)
        if outcome.code is not ErrorCode.SUCCESSFUL:
            return Status(StatusCode.FAILURE, outcome.sentence)
        return Status.success()

    def _until(self, condition: Callable[[], bool], latest: float) -> Status:
        while not condition():
            if self.simulation.time >= latest:
                return Status(StatusCode.TIMED_OUT, f"not within {latest:g} s of the plant")
            self._step()
        return Status.success()

    def _step(self) -> None:
        self._before_step()
        self.simulation.step()
        now = self.simulation.time
        if self.machines.next_answer <= now:
            for signal in self.machines.take_answers(now):
                self.machines.hear(signal, now)
                self._note(signal)

    def _note(self, signal: Signal) -> None:
        self.signals.append(SignalChange(self.simulation.time, signal.name, signal.value))


def driven_program(cell: Cell, movements: Sequence[PlannedMovement]) -> SteppedRun:
    """A planned program on the nominal plant, driven from where its first movement begins.

    StudyError where it can't be driven to its end.
    """
    first = next(step for step in movements if step.trajectory is not None)
    assert first.trajectory is not None
    run = SteppedRun(cell)
    run.place(first.trajectory.positions[0])
    result = run.run(movements)
    if not result.status.ok:
        raise StudyError(f"{run.simulation.plant.name}: {result.status.message}")
    return run


class _Turns:
    """Lets simulations advance in turns: it is always that one's whose time is least."""

    def __init__(self, count: int) -> None:
        self._times = [0.0] * count
        self._changed = threading.Condition()

    def wait(self, number: int, time: float) -> None:
        """Return when it is the turn of this simulation, which is at a time [s]."""
        with self._changed:
            self._times[number] = time
            self._changed.notify_all()
            self._changed.wait_for(lambda: self._times.index(min(self._times)) == number)

    def wait_no_more(self, number: int) -> None:
        """Never let the others wait for this one again."""
        with self._changed:
            self._times[number] = math.inf
            self._changed.notify_all()


class RobotRun(SteppedRun):
    """One of several robots; time (N,) [s], q (N, n) and what the mains gave by then (N,) [J] are
    in `times`, `postures` and `joules`.
    """

    def __init__(self, cell: Cell, turns: _Turns, number: int) -> None:
        super().__init__(cell, before_step=self._take_turn)
        self.times: list[float] = []
        self.postures: list[FloatArray] = []
        self.joules: list[float] = []
        self.result: ProgramResult | None = None
        self._turns = turns
        self._number = number
        self.zero = np.inf

    def begin(self, q: FloatArray) -> None:
        """Stand where the program begins; the time of all robots counts from now on."""
        self.place(q)
        self.zero = self.simulation.time

    def _take_turn(self) -> None:
        now = self.simulation.time - self.zero
        if now < 0.0:
            return
        self._turns.wait(self._number, now)
        self.times.append(now)
        self.postures.append(np.array(self.simulation.backend.q))
        self.joules.append(self.simulation.mains.energy())

    def follow(self, movements: Sequence[PlannedMovement], settings: ProgramSettings) -> None:
        """Drive a program in turns with the others."""
        self._turns.wait(self._number, 0.0)
        try:
            self.result = self.run(movements, settings)
        finally:
            self._turns.wait_no_more(self._number)


def driven_robots(
    cells: Mapping[str, Cell],
    programs: Mapping[str, Sequence[PlannedMovement]],
    *,
    late: Mapping[str, float] | None = None,
    signal_timeout: float = 60.0,
) -> dict[str, RobotRun]:
    """Several robots in one time, each with its own program and controller; a signal of one is
    heard by all. late [s]: how much later robots begin. StudyError where a program doesn't end.
    """
    turns = _Turns(len(cells))
    runs = {robot: RobotRun(cell, turns, k) for k, (robot, cell) in enumerate(cells.items())}
    threads = []
    for robot, run in runs.items():
        first = next(step for step in programs[robot] if step.trajectory is not None)
        assert first.trajectory is not None
        run.begin(first.trajectory.positions[0])
        run.told = partial(_tell, [other for other in runs.values() if other is not run])
        wait = PlannedMovement(
            kind=MovementKind.PAUSE, duration=(late or {}).get(robot, 0.0), load=first.load
        )
        settings = ProgramSettings(signal_timeout=signal_timeout)
        steps = (wait, *programs[robot]) if wait.duration > 0.0 else programs[robot]
        threads.append(threading.Thread(target=run.follow, args=(steps, settings), name=robot))
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for robot, run in runs.items():
        run.close()
        if run.result is None or not run.result.status.ok:
            why = "it ended by an error" if run.result is None else run.result.status.message
            raise StudyError(f"{robot}: {why}")
    return runs


def _tell(others: Sequence[SteppedRun], signal: Signal) -> None:
    for other in others:
        other.machines.hear(signal, other.simulation.time)
