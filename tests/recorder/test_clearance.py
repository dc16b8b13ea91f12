"""Executed clearance is that of the recorded joint states."""

from __future__ import annotations

import numpy as np
import pytest

from ir_description import load_cell
from ir_msgs_py.report import PlannedMovement
from ir_recorder import Analysis
from ir_recorder.analysis.clearance import collision_model, places_after


def test_clearance_is_that_of_the_recorded_joint_states(analysis: Analysis) -> None:
    result = analysis.movements[1]
    near = result.clearance
    joints = analysis.recording.joints
    model = collision_model(analysis.cell, "gripper+part", analysis.cell.parts_at_start())
    inside = (joints.time >= result.step.start) & (joints.time <= result.step.end)
    distances = model.distances(joints.position[inside])
    allowed = [{"p_body", "press_bed"} == {pair.body_a, pair.body_b} for pair in model.pairs]
    assert near.least == pytest.approx(distances[:, ~np.array(allowed)].min(), abs=1e-6)
    assert near.contact_margin >= distances[:, allowed].min() - 0.001 - 1e-9
    assert near.least <= near.distance.min()


def test_a_part_that_was_put_down_is_a_body_where_it_lies(analysis: Analysis) -> None:
    leaving = analysis.movements[2].clearance
    assert any("part_box" in pair for pair in leaving.pairs)


def test_a_route_takes_parts_away_at_its_end_and_brings_the_next() -> None:
    cell = load_cell("flexible")
    assert cell.route is not None
    first, *_, last = cell.route.visits
    places = cell.parts_at_start()
    for movement in (
        PlannedMovement(kind="regional", to_station=first, attach="gear"),
        PlannedMovement(kind="regional", to_station=last, detach="gear"),
    ):
        places = places_after(cell, places, movement)
    assert places.held == ""
    assert dict(places.lying) == {"gear": first}
