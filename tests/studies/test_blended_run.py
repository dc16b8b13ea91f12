"""A program that passes ends of lines without standing still is driven as planned: the simulated
robot with its supervision of contacts, tool deviation and torque is the judge.
"""

from __future__ import annotations

from dataclasses import replace

import pytest

from ir_description import ProgramStep, load_cell
from ir_msgs_py.report import MovementKind
from ir_planner import Planner
from ir_studies.stepped_run import driven_program

WITHIN = 0.01  # of the joules: the plant is driven in steps


@pytest.mark.long
def test_a_blended_program_is_driven_as_planned() -> None:
    steps = (
        ProgramStep("POSTURE", "home"),
        ProgramStep("STATION", "infeed_pick", attach="gear", dwell=0.2),
        ProgramStep("STATION", "gauge_measure", dwell=0.2),
        ProgramStep("POSTURE", "home"),
    )
    cell = replace(load_cell("demo"), program=steps)
    planner = Planner(cell, clock=lambda: 0.0)
    resting = planner.plan_program(start="home")
    passing = planner.plan_program(start="home", blend=0.05)
    assert len(passing.movements) < len(resting.movements)
    joined = [
        step
        for step in passing.movements
        if step.kind in (MovementKind.SERVICE_ENTRY, MovementKind.SERVICE_EXIT)
        and step.from_station != step.to_station
    ]
    assert joined
    assert any(step.report.contacts for step in joined)
    run = driven_program(cell, passing.movements)
    run.close()
    driven = sum(step.joules + step.waiting for step in run.steps)
    assert driven == pytest.approx(passing.report.energy, rel=WITHIN)
