"""Surprises on the schedule of a tended cell: without any it is the plan; with one, what who knows
more needs less, and the line comes back into step.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from tending import steady

from ir_description import Cell, load_cell
from ir_description.cell import ProcessTimes
from ir_planner import RequestError, SteadyPlan
from ir_planner.flexible import counted_times, outage_replay, with_counted_times
from ir_planner.flexible.surprises import BY_ITSELF, KNOWN, POLICIES, TIMEOUTS, Replay

CYCLES = 5
ROUNDING = 0.01  # s, and of joules its share
LENGTHS = np.geomspace(1.0, 3600.0, 50)


def two_machines() -> Cell:
    """Washer and gauge of the flexible cell."""
    cell = load_cell("flexible")
    assert cell.route is not None
    machines = tuple(
        machine if machine.name in ("washer", "gauge") else replace(machine, process=0.0)
        for machine in cell.equipment
    )
    visits = ("infeed_pick", "washer_basket", "gauge_seat", "outfeed_place")
    return replace(cell, equipment=machines, route=replace(cell.route, visits=visits))


@cache
def planned() -> SteadyPlan:
    return steady(two_machines(), cycles=CYCLES)


def test_without_surprises_the_schedule_is_the_plan() -> None:
    plan = planned()
    assert plan.run is not None
    replay = Replay(plan)
    for policy in (BY_ITSELF, TIMEOUTS):
        parts = replay.follow(replay.planned_times(), policy, LENGTHS)
        assert len(parts) == CYCLES
        end = sum(part.seconds for part in parts)
        assert end <= plan.run.report.duration + ROUNDING
        assert plan.cycle is not None
        assert parts[-1].seconds == pytest.approx(plan.cycle.period, abs=ROUNDING)
        assert parts[-1].joules == pytest.approx(plan.joules, rel=ROUNDING)


@pytest.mark.long
def test_without_surprises_parts_in_slots_are_in_the_plan_s_time() -> None:
    """A washer for two parts: followed by the signals of its slots, nobody is late."""
    cell = two_machines()
    machines = tuple(
        replace(machine, capacity=2) if machine.name == "washer" else machine
        for machine in cell.equipment
    )
    plan = steady(replace(cell, equipment=machines), cycles=2)
    assert plan.run is not None
    assert plan.cycle is not None
    assert plan.cycle.most == (2, 1)
    replay = Replay(plan)
    parts = replay.follow(replay.planned_times(), BY_ITSELF, LENGTHS)
    assert sum(part.late for part in parts) <= ROUNDING
    planned = sum(part.seconds for part in parts)
    assert planned <= plan.run.report.duration + ROUNDING
    half = replay.planned_times()
    half["washer"] = [seconds + 30.0 for seconds in half["washer"]]
    late = replay.follow(half, BY_ITSELF, LENGTHS)
    each = 30.0 * len(parts) / 2.0  # two parts at once
    assert sum(part.seconds for part in late) >= planned + each - 60.0


@given(
    machine=st.sampled_from(("washer", "gauge")),
    seconds=st.floats(30.0, 3600.0),
    part=st.integers(1, 2),
)
@settings(max_examples=30, deadline=None)
def test_an_outage_costs_less_the_more_is_known_and_ends(
    machine: str, seconds: float, part: int
) -> None:
    replay = outage_replay(planned(), machine, seconds, part, LENGTHS)
    assert replay.joules(KNOWN) <= replay.joules(BY_ITSELF) + ROUNDING
    assert replay.joules(KNOWN) <= replay.joules(TIMEOUTS) + ROUNDING
    for policy in POLICIES:
        longer = sum(row.seconds for row in replay.parts[policy])
        longer -= sum(row.seconds for row in replay.planned)
        assert longer <= seconds + 300.0  # and what a deep mode takes to wake
        last = replay.parts[policy][-1]
        assert last.seconds == pytest.approx(replay.planned[-1].seconds, abs=ROUNDING)
    assert replay.back <= 1


def test_a_machine_that_works_on_nothing_has_no_outage() -> None:
    with pytest.raises(RequestError, match="machine with a process 'lathe' is unknown"):
        outage_replay(planned(), "lathe", 600.0, 1, LENGTHS)


@pytest.mark.long
def test_who_knows_the_times_needs_no_more_and_longer_times_are_kept() -> None:
    cell = two_machines()
    machines = tuple(
        replace(machine, process_times=ProcessTimes.of([8.0, 10.0, 12.0, 20.0]))
        if machine.name == "gauge"
        else machine
        for machine in cell.equipment
    )
    cell = replace(cell, equipment=machines)
    for share in (0.0, 1.0):
        counted = counted_times(steady(with_counted_times(cell, share), cycles=8), share, 3)
        assert counted.known <= counted.joules * (1.0 + ROUNDING)
        assert counted.times["gauge"] == (20.0 if share else 12.0)
