"""Which movements of a program rely on the door: those that come too near to the closed one, by
samples.
"""

from __future__ import annotations

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_planner.planner import Planner

MARGIN = 0.02


@pytest.fixture(scope="module")
def program():
    planner = Planner("demo", clock=lambda: 0.0)
    home = np.array(planner.cell.machine_home)
    options = PlanOptions(max_iterations=4000, safety_distance=MARGIN)
    plan = planner.plan_program(options=options, start=home)
    assert plan.status.ok, plan.status
    planner.set_equipment("lathe", enabled=True, state="door_closed")
    return plan.movements, planner.scene()


@pytest.mark.long
def test_a_movement_relies_on_the_door_where_it_comes_too_near_to_the_closed_one(program):
    movements, shut = program
    relied = []
    for movement in movements:
        if movement.trajectory is None:
            assert movement.states == ()
            continue
        times = np.linspace(0.0, movement.trajectory.duration, 2000)
        service = movement.kind.startswith("service")
        threshold = shut.thresholds(MARGIN, movement.to_station if service else "")
        free = shut.collision.is_free(movement.trajectory.sample(times).q, threshold - 1e-4)
        relied.append(movement.states == ("lathe=door_open",))
        assert relied[-1] or free.all()
        if relied[-1]:
            nearly = shut.collision.is_free(movement.trajectory.sample(times).q, threshold + 1e-3)
            assert not nearly.all()
    assert any(relied)
    assert not all(relied)


@pytest.mark.long
def test_the_hash_of_the_cell_stays_while_the_door_moves(program):
    _, shut = program
    planner = Planner("demo", clock=lambda: 0.0)
    assert planner.cell_hash == shut.cell_hash
