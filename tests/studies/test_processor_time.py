"""Seconds of the processor: other processes count while they are charged, and stay counted."""

from __future__ import annotations

import subprocess
import sys
import time
from contextlib import nullcontext
from dataclasses import asdict
from typing import Any

import numpy as np
import pytest

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.status import StatusCode
from ir_planner import Goal, Planner, RequestError
from ir_planner.search.with_ompl import charge_to, missing
from ir_studies.arena import ArenaSettings
from ir_studies.arena.one_run import (
    charged,
    excuse,
    others_time,
    processor_time,
    row_maker,
    warm_up,
)
from ir_studies.arena.settings import ArenaEntry
from ir_values.arrays import FloatArray

ENTRY = ArenaEntry("rrt_connect", "open", "home->p1", 0, "", "synchronous")


def test_a_process_that_is_charged_counts_also_when_it_has_ended(wait_for: Any) -> None:
    busy = subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"])
    own = time.process_time()
    begin = processor_time()
    try:
        with charged(busy.pid):
            wait_for(
                lambda: processor_time() - begin > time.process_time() - own + 0.02,
                what="it counts",
            )
            during = processor_time()
    finally:
        busy.kill()
        busy.wait()
    assert processor_time() >= during


def test_a_process_that_is_gone_costs_nothing() -> None:
    gone = subprocess.Popen(["true"])
    gone.wait()
    own = time.process_time()
    begin = processor_time()
    with charged(gone.pid):
        passed = processor_time() - begin
    assert passed <= time.process_time() - own


def test_a_process_that_dies_meanwhile_has_cost_what_it_had_run(wait_for: Any) -> None:
    busy = subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"])
    begin = others_time()
    try:
        with charged(busy.pid):
            wait_for(lambda: others_time() > begin, what="it counts")
            busy.kill()
            busy.wait()
            counted = others_time()
    finally:
        busy.kill()
    assert begin < counted == others_time()


def test_what_it_takes_to_start_a_process_counts_for_nobody(wait_for: Any) -> None:
    busy = subprocess.Popen([sys.executable, "-S", "-c", "while True: pass"])
    begin = others_time()
    excuse(0.1)
    try:
        with charged(busy.pid):
            wait_for(lambda: others_time() > begin, what="it counts from then on")
            least = time.clock_gettime((~busy.pid << 3) | 2)
            counted = others_time() - begin
            most = time.clock_gettime((~busy.pid << 3) | 2)
            assert 0.1 <= least <= counted + 0.1 + 1e-9
            assert counted + 0.1 <= most + 1e-9
    finally:
        excuse(0.0)
        busy.kill()
        busy.wait()


@pytest.mark.skipif(bool(missing()), reason=missing())
def test_what_ompls_processes_need_to_start_is_measured_and_counts_for_nobody(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    settings = ArenaSettings(cells=("open",), planners=("rrt_connect",))
    excused: list[float] = []
    monkeypatch.setattr("ir_studies.arena.one_run.excuse", excused.append)
    try:
        start = row_maker(asdict(settings))({**asdict(ENTRY)})["start_s"]
        assert excused == [0.0, start]
        assert start > 0.0
        assert warm_up(settings) > 0.0
        excuse(60.0)
        assert warm_up(settings) == 0.0
    finally:
        excuse(0.0)
        charge_to(lambda process: nullcontext())


def test_starting_is_measured_where_an_end_of_a_task_is_near_something(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The first question asks for no safety distance, between the ends of the first task."""
    planner = Planner("open", clock=lambda: 0.0)
    task = planner.cell.tasks[0]
    asked: list[PlanOptions] = []

    def refuse(start: FloatArray, goal: Goal, options: PlanOptions) -> None:
        asked.append(options)
        assert goal.configuration is not None
        share = (goal.configuration - start)[1] / (np.array(task.goal) - start)[1]
        assert 0.0 < share < 0.01
        raise RequestError(StatusCode.FAILURE, "seen")

    monkeypatch.setattr(planner, "plan_regional", refuse)
    monkeypatch.setattr("ir_studies.arena.one_run.planner_of", lambda cell: planner)
    assert warm_up(ArenaSettings(cells=("open",), planners=("portfolio", "sbl"))) == 0.0
    assert [one.safety_distance for one in asked] == [0.0, 0.0]
