"""Pauses of planned programs as the program runner drives them, without real time: every step and
the program cost what was planned.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, cell_to_yaml, load_cell
from ir_msgs_py.announcements import Event
from ir_msgs_py.modes import modes_of
from ir_msgs_py.names import END_REST
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.planner import Planner
from ir_program_runner import Program, ProgramSettings
from ir_program_runner import requests as ask
from ir_sim_driver.controller.simulation import make_simulation
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.motion.goal import ErrorCode, TrajectoryGoal
from ir_sim_driver.plant.loads import carried

# of a movement or a pause, whichever is larger
SHARE = 0.03
JOULES = 20.0
TOTAL = 0.01  # of the program
TOOL = 0.001  # m


class Plant:
    """A stepped robot that fulfils a program's requests; what each step took [J], and its note."""

    def __init__(self, cell: Cell) -> None:
        self.cell = cell
        self.plant = make_simulation(cell)
        self.plant.backend.reset(np.array(cell.park))
        self.plant.executor.hold(np.array(cell.park))
        self.took: dict[int, float] = {}
        self.notes: dict[int, str] = {}
        self.deviation = 0.0

    def run(self, program: Program) -> Any:
        steps = program.run()
        status = Status.success()
        modes = ()
        try:
            request = next(steps)
            while True:
                status, modes = self.fulfil(request)
                plant = self.plant
                outcome = ask.RequestOutcome(
                    plant.time, plant.modes.mode, status, modes, plant.mains.energy()
                )
                request = steps.send(outcome)
        except StopIteration as ended:
            return ended.value

    def fulfil(self, request: ask.Request) -> tuple[Status, tuple[Any, ...]]:  # noqa: C901, PLR0912
        plant = self.plant
        match request:
            case ask.Announce(index, event, note):
                energy = plant.mains.energy()
                self.took[index] = energy - (0.0 if event is Event.STARTED else self.took[index])
                if event is Event.STARTED:
                    self.took[index] = energy
                self.notes[index] = note
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
                try:
                    plant.set_load(carried(self.cell, load))
                except RequestRefusedError as error:
                    return Status(error.code, str(error)), ()
            case ask.WaitUntil(moment):
                plant.run(max(moment - plant.time, 0.0))
            case ask.WaitForMode(modes, timeout):
                return self.wait_for_mode(modes, timeout), ()
            case ask.Drive(trajectory, cell_hash, load):
                self.drive(trajectory, cell_hash, load)
        return Status.success(), ()

    def wait_for_mode(self, modes: Any, timeout: float) -> Status:
        until = self.plant.time + timeout
        while self.plant.modes.mode not in modes:
            if self.plant.time >= until:
                return Status(StatusCode.TIMED_OUT, "not in time")
            self.plant.step()
        return Status.success()

    def drive(self, trajectory: JointTrajectory, cell_hash: str, load: str) -> None:
        plant = self.plant
        plant.execute(plant.vet(TrajectoryGoal(trajectory, cell_hash=cell_hash, load=load), 0), 0)
        while not (outcomes := plant.take_outcomes()):
            plant.step()
        assert outcomes[0].code is ErrorCode.SUCCESSFUL
        self.deviation = max(self.deviation, outcomes[0].max_tool_deviation)


def with_pauses(cell: Cell, pauses: tuple[tuple[float, str], ...]) -> Cell:
    """The cell with these pauses in place of its own."""
    own = iter(pauses)
    steps = (
        replace(step, dwell=pause[0], power_mode=pause[1])
        if step.kind == "PAUSE" and (pause := next(own, None)) is not None
        else step
        for step in cell.program
    )
    return replace(cell, program=tuple(steps))


SHORT = (0, 7, 11, 10)  # two postures, and a pause at each
WHOLE = range(13)


@pytest.mark.long
@pytest.mark.parametrize(
    ("steps", "pauses", "modes"),
    [
        # the first is too short for its mode, but so long that the controller would close its
        # brakes
        *(
            pytest.param(
                steps,
                ((22.0, "BUS_POWER_OFF"), (90.0 if steps is SHORT else 120.0, "AUTO")),
                ("STAND_ON_BRAKES", "STAND_ON_BRAKES>BUS_POWER_OFF"),
                marks=[] if steps is SHORT else [pytest.mark.long],
            )
            for steps in (SHORT, WHOLE)
        ),
        pytest.param(
            WHOLE,
            ((30.0, "BUS_POWER_OFF"), (10.0, "STAND_ON_MOTORS")),
            ("BUS_POWER_OFF", "STAND_ON_MOTORS"),
            marks=pytest.mark.long,
        ),
        pytest.param(
            WHOLE,
            ((2.5, "AUTO"), (900.0, "AUTO")),
            ("STAND_ON_BRAKES", "STAND_ON_BRAKES>BUS_POWER_OFF>HIBERNATION"),
            marks=pytest.mark.long,
        ),
    ],
)
def test_every_pause_of_a_program_costs_what_was_planned(
    steps: Sequence[int], pauses: tuple[tuple[float, str], ...], modes: tuple[str, ...]
) -> None:
    """The planner's clock stands still: no ceiling cuts the plan."""
    planner = Planner(clock=itertools.repeat(0.0).__next__)
    demo = load_cell("demo")
    chosen = replace(demo, program=tuple(demo.program[k] for k in steps))
    cell = planner.set_cell(text=cell_to_yaml(with_pauses(chosen, pauses)))
    plan = planner.plan_program(options=PlanOptions(seed=0), start=np.array(cell.park))
    assert plan.status.ok, plan.status.message
    planned = [step.power_mode for step in plan.movements if step.is_pause and step.duration > 1.0]
    assert planned[: len(modes)] == list(modes) or set(modes) <= set(planned)

    robot = Plant(cell)
    begun = robot.plant.mains.energy()
    result = robot.run(Program(plan.movements, ProgramSettings()))
    assert result.status.ok, result.status.message
    assert robot.deviation < TOOL
    for index, step in enumerate(plan.movements):
        assert robot.notes[index] == ""
        expected = step.report.energy
        off = abs(robot.took[index] - expected)
        assert off <= max(JOULES, SHARE * expected), (
            index,
            step.kind,
            step.power_mode,
            robot.took[index],
            expected,
        )
    total = robot.plant.mains.energy() - begun
    assert total == pytest.approx(plan.report.energy, rel=TOTAL)
    assert any(modes_of(step.power_mode) for step in plan.movements)
