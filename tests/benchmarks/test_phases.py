"""A recording that one set of parameters does not explain, as something changed half-way, is named
with time, size and cause; the plant is one of Pinocchio's torques and knows them.
"""

from __future__ import annotations

import numpy as np
import pytest
from _measured_phases import CLEAN, LONG, ROBOTS, WARM, estimate_of, outcome, recorded, torque_log

from ir_recorder.fit import Change, change, doubts, left_out, recommendation
from ir_recorder.fit.changes import opened, shuffled, warming


@pytest.mark.parametrize("name", ["ur10e", pytest.param("kr300_r2700_2", marks=pytest.mark.long)])
def test_a_payload_that_changes_is_found_by_torques(name: str) -> None:
    estimate, phases = torque_log(name, 0, "payload")
    found = change(estimate)
    assert found is not None
    assert found.kind == "payload"
    assert found.start == pytest.approx(phases.start, abs=1.0)
    assert found.size == pytest.approx(phases.size, rel=0.35)  # its lever is not known


def test_torques_of_one_load_are_not_suspected() -> None:
    estimate, _ = torque_log("ur10e", 1, CLEAN)
    assert change(estimate) is None


CASES = [
    ("kr6_r900_2", "watts", 0),
    ("kr6_r900_2", "clock", 0),
    ("kr6_r900_2", "rest", 0),
    ("kr210_r2700_extra", "payload", 1),  # at 0 few movements carry it: it is not seen
    ("ur10e", "watts", 0),
]


@pytest.mark.long
@pytest.mark.parametrize(("name", "kind", "seed"), CASES)
def test_a_change_is_named_by_a_meter(name: str, kind: str, seed: int) -> None:
    phases = recorded(name, kind, seed)
    found = change(estimate_of(phases))
    assert outcome(phases, found) == "named rightly", found
    assert found is not None
    if kind in ("watts", "rest", "clock"):
        assert found.size == pytest.approx(phases.size, rel=0.25)


@pytest.mark.long
@pytest.mark.parametrize("name", ROBOTS)
def test_nothing_is_named_where_nothing_changes(name: str) -> None:
    assert change(estimate_of(recorded(name, CLEAN, 0))) is None


@pytest.mark.long
def test_a_fit_of_two_phases_is_not_recommended() -> None:
    """The whole way: the sentence is a doubt, and what is doubted is not planned with."""
    estimate, _ = torque_log("ur10e", 0, "payload")
    found = doubts(estimate, estimate.result("two loads"))
    assert any("kg at the flange" in each for each in found.sentences)
    advised = recommendation(left_out(estimate), doubted=bool(found.sentences))
    assert "settle what speaks against the data" in advised or "plan with the data" in advised


@pytest.mark.parametrize(
    ("kind", "size", "words"),
    [
        ("payload", -2.7, "-2.7 kg"),
        ("watts", -27.0, "-27 W"),
        ("clock", -0.27, "0.27 s earlier"),
        ("friction", -0.27, "-27 %"),
    ],
)
def test_a_sentence_has_run_time_and_size(kind: str, size: float, words: str) -> None:
    said = Change("run_2", kind, 12.34, size=size).sentence
    assert said.startswith("run_2: from about 12.3 s on ")
    assert words in said


def test_gears_that_get_warm_are_named_with_about_their_friction_at_the_begin() -> None:
    phases = recorded("ur10e", WARM, 22, LONG)
    estimate = estimate_of(phases)
    usual = opened(estimate)
    found = warming(usual, usual.fitted(usual.with_more(estimate.found)))
    assert found is not None
    assert outcome(phases, found) == "named rightly"
    assert 0.25 < found.size < 1.5  # of 0.4 to 1.0: its own friction is hidden in that of the axes
    assert "friction fell while it was recorded" in found.sentence


def test_gears_that_stay_as_they_are_are_not_called_warm() -> None:
    estimate = estimate_of(recorded("ur10e", CLEAN, 20, LONG))
    usual = opened(estimate)
    assert warming(usual, usual.fitted(usual.with_more(estimate.found))) is None


def test_movements_are_shuffled_and_rests_are_not() -> None:
    fades = np.array([1.0, 0.8, 0.6, 0.4, 0.2])
    moves = np.array([True, False, True, True, False])
    orders = shuffled(fades, moves)
    assert (orders[:, ~moves] == fades[~moves]).all()
    assert (np.sort(orders[:, moves]) == np.sort(fades[moves])).all()
    assert len(np.unique(orders, axis=0)) == 6


def test_the_shape_of_a_change_ends_and_fades() -> None:
    time = np.array([0.0, 1.0, 2.0, 3.0])
    assert Change("a", "watts", 1.0, 2.5).shape(time).tolist() == [0.0, 1.0, 1.0, 0.0]
    fading = Change("a", "friction", 0.0, fading=1.0).shape(time)
    assert fading == pytest.approx(np.exp(-time))
