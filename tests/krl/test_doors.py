"""An export is evaluated with doors as the program's signals move them, sweeping meanwhile."""

from __future__ import annotations

from dataclasses import replace

import pytest

from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_planner import Planner
from ir_planner.krl.step_evaluation import evaluator_of


@pytest.fixture(scope="module")
def out_of_the_lathe() -> tuple[Planner, PlannedMovement]:
    """A service line through the open door, in a cell whose door is closed at first."""
    planner = Planner("demo", clock=lambda: 0.0)
    planner.set_equipment("lathe", enabled=True, state="door_open")
    found = planner.plan_service("lathe_work", near=planner.cell.machine_home, max_candidates=1)
    trajectory = found.candidates[0].trajectory
    assert trajectory is not None
    planner.set_equipment("lathe", enabled=True, state="door_closed")
    step = PlannedMovement(
        kind=MovementKind.SERVICE_EXIT,
        from_station="lathe_work",
        to_station="lathe_work",
        trajectory=trajectory,
        trajectory_id=trajectory.trajectory_id,
        duration=trajectory.duration,
    )
    return planner, step


@pytest.mark.parametrize(
    ("asked", "awaited", "certified"),
    [
        ((), (), False),
        (("lathe_open_door",), (), False),
        (("lathe_open_door",), ("lathe_door_open",), True),
    ],
    ids=["the door is closed", "the door sweeps", "the door is open"],
)
def test_doors_are_as_the_signals_before_a_movement_have_them(
    out_of_the_lathe: tuple[Planner, PlannedMovement],
    asked: tuple[str, ...],
    awaited: tuple[str, ...],
    certified: bool,
) -> None:
    planner, step = out_of_the_lathe
    pause = PlannedMovement(
        kind=MovementKind.PAUSE, to_station="lathe_work", duration=0.1, set_signals=asked
    )
    steps = (pause, replace(step, wait_for=awaited))
    judge = evaluator_of(
        steps, planner.cell, planner.scene("").power, planner.scene("").drives, 0.02
    )
    assert step.trajectory is not None
    assert judge(step.trajectory, steps[1]).verification.certified is certified
