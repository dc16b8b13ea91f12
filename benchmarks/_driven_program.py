"""A planned program on the simulated robot, as the program runner drives it, without real time:
what every step takes beside what was planned.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from _results import Claim, at_most

from ir_description import Cell, cell_to_yaml, load_cell
from ir_msgs_py.announcements import Event
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import Status, StatusCode
from ir_planner import Planner
from ir_program_runner import Program, ProgramSettings
from ir_program_runner import requests as ask
from ir_sim_driver import TrajectoryGoal, make_simulation
from ir_sim_driver.plant import carried

PLANT = "nominal"  # every term that the planner's model lacks is zero
# of a step, whichever is larger
SHARE = 0.03
JOULES = 20.0
TOTAL = 1.0  # % of the program


@dataclass(frozen=True)
class Step:
    """A step of the program [s], its energy as planned and as the plant took it [J]."""

    cell: str
    number: int
    kind: str
    to: str
    mode: str
    duration: float
    planned: float
    simulated: float

    @property
    def share_of_bound(self) -> float:
        """How far the step is off, of what is allowed."""
        return abs(self.simulated - self.planned) / max(JOULES, SHARE * self.planned)


class Robot:
    """A stepped robot that fulfils a program's requests. took: joules of each step by its
    number.
    """

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.plant = make_simulation(cell, plant=PLANT)
        self.plant.backend.reset(np.array(cell.park))
        self.plant.executor.hold(np.array(cell.park))
        self.begun: dict[int, float] = {}
        self.took: dict[int, float] = {}

    def run(self, movements: tuple[PlannedMovement, ...]) -> Status:
        """Drive them all; how that ended."""
        steps = Program(movements, ProgramSettings()).run()
        answer: tuple[Status, tuple[Any, ...]] | None = None
        while True:
            try:
                request = next(steps) if answer is None else steps.send(self._outcome(*answer))
            except StopIteration as ended:
                status: Status = ended.value.status
                return status
            answer = self._fulfilled(request)

    def _outcome(self, status: Status, modes: tuple[Any, ...]) -> ask.Outcome:
        plant = self.plant
        return ask.Outcome(plant.time, plant.modes.mode, status, modes, plant.mains.energy())

    def _fulfilled(self, request: ask.Request) -> tuple[Status, tuple[Any, ...]]:  # noqa: C901
        plant = self.plant
        match request:
            case ask.Announce(index, event, _):
                energy = plant.mains.energy()
                if event is Event.STARTED:
                    self.begun[index] = energy
                else:
                    self.took[index] = energy - self.begun[index]
            case ask.SetPlcInput(name, value):
                plant.plc.set_bit(name, value)
            case ask.AskModes():
                return Status.success(), plant.pauses.query_modes()
            case ask.SendWakePacket():
                plant.wake()
            case ask.SetLoad(load):
                plant.set_load(carried(self.cell, load))
            case ask.WaitUntil(moment):
                plant.run(max(moment - plant.time, 0.0))
            case ask.WaitForMode(modes, timeout):
                return self._waited(modes, plant.time + timeout), ()
            case ask.Drive(trajectory, cell_hash, load):
                plant.execute(
                    plant.vet(TrajectoryGoal(trajectory, cell_hash=cell_hash, load=load), 0), 0
                )
                while not plant.take_outcomes():
                    plant.step()
        return Status.success(), ()

    def _waited(self, modes: Any, until: float) -> Status:
        while self.plant.modes.mode not in modes:
            if self.plant.time >= until:
                return Status(StatusCode.TIMED_OUT, "not in time")
            self.plant.step()
        return Status.success()


def driven(name: str, longest: float) -> tuple[list[Step], list[Claim]]:
    """The program of a cell, planned with the defaults and driven; its pauses are cut to `longest`
    s.
    """
    cell = load_cell(name)
    short = tuple(
        step if step.dwell <= longest else replace(step, dwell=longest, power_mode="AUTO")
        for step in cell.program
    )
    # no ceiling
    cell = replace(cell, program=short)
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    planner.set_cell(text=cell_to_yaml(cell))
    plan = planner.plan_program(start=np.array(cell.park))
    robot = Robot(cell)
    begun = robot.plant.mains.energy()
    ended = robot.run(plan.movements)
    total = robot.plant.mains.energy() - begun
    steps = [
        Step(
            name,
            k,
            str(m.kind),
            m.to_station,
            m.power_mode,
            m.duration,
            m.report.energy,
            robot.took[k],
        )
        for k, m in enumerate(plan.movements)
        if k in robot.took
    ]
    off = 100.0 * abs(total / plan.report.energy - 1.0)
    moves = [step.share_of_bound for step in steps if step.kind != MovementKind.PAUSE]
    pauses = [step.share_of_bound for step in steps if step.kind == MovementKind.PAUSE]
    what = f"{name} driven, {PLANT} plant"
    count = len(plan.movements)
    seconds = sum(step.duration for step in steps if step.kind == MovementKind.PAUSE)
    rests = f"{len(pauses)} pauses of {seconds:.0f} s in all"
    return steps, [
        at_most(
            f"{what}: steps that did not end, of {count}",
            count - len(steps) + (not ended.ok),
            "",
            0,
        ),
        at_most(f"{what}: {len(moves)} movements, worst of 3 % or 20 J", max(moves), "", 1.0),
        at_most(f"{what}: {rests}, worst of 3 % or 20 J", max(pauses, default=0.0), "", 1.0),
        at_most(f"{what}: energy of the program off the planned one", off, "%", TOTAL),
    ]
