"""Curves and medians of runs that were made up."""

from __future__ import annotations

import math

import numpy as np

from ir_studies.arena.entries import Entry
from ir_studies.arena.figures import cost_over_time, energy_and_time, figures, success_over_time
from ir_studies.arena.table import Run


def run(planner: str, task: str, cost: float, first: float, final: float) -> Run:
    """A solved run, or with a cost of NaN one that wasn't."""
    entry = Entry(planner, "open", task, 0, "", "synchronous")
    if math.isnan(cost):
        return Run(entry, {"solved": False, "total_s": 1.0})
    row = {"solved": True, "cost_j": cost, "first_s": first, "final_s": final, "movement_cost": cost}
    progress = [[first, 2.0 * cost], [final, cost]]
    return Run(entry, {**row, "duration_s": 1.0, "energy_j": cost, "clearance_m": 0.02, "progress": progress})


RUNS = [
    run("a", "1", 100.0, 0.1, 0.5),
    run("a", "2", 300.0, 0.3, 0.6),
    run("b", "1", 150.0, 0.2, 0.2),
    run("b", "2", math.nan, 0.0, 0.0),
]
TIME = np.array([0.0, 0.1, 0.25, 0.55, 1.0])


def test_success_is_a_share_of_all_runs_that_only_grows() -> None:
    assert success_over_time(("a", "b"), RUNS, TIME).T.tolist() == [[0, 50, 50, 100, 100], [0, 0, 50, 50, 50]]


def test_cost_is_held_against_the_best_known_of_the_same_question() -> None:
    cost = cost_over_time(("a",), RUNS, TIME)[:, 0]
    assert np.isnan(cost[:3]).all()  # of two runs only one has an answer: half of them have none
    assert cost[3:].tolist() == [50.0, 0.0]


def test_figures_of_a_planner_count_what_it_did_not_solve() -> None:
    found = figures("b", RUNS)
    assert (found.solved, found.count, found.success) == (1, 2, 0.5)
    assert found.cost_ratio == 1.5
    assert figures("a", RUNS).cost_ratio == 1.0


def test_means_are_of_questions_that_all_solved() -> None:
    assert energy_and_time(("a", "b"), RUNS) == {"a": (1.0, 100.0), "b": (1.0, 150.0)}
    assert energy_and_time(("a",), RUNS) == {"a": (1.0, 200.0)}
    assert energy_and_time(("a",), []) == {}
