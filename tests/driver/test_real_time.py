"""The grid and the plant's thread on clocks that behave and clocks that don't; no test sleeps."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_msgs_py.ros.testing import PATIENCE
from ir_sim_driver.node.real_time import (
    FOREIGN,
    OWN,
    SYSTEM,
    ClockPolicy,
    Grid,
    GridThread,
    ScaledClock,
)

NS = 1_000_000_000
PERIOD = 2_000_000
START = 30 * NS


class Day:
    """A grid that is looked at on clocks of our own; ticks: (wall, stamp), gaps: (wall, reason)."""

    def __init__(self, policy: ClockPolicy = SYSTEM, tick_cost: int = PERIOD // 10) -> None:
        self.grid = Grid(PERIOD)
        self.policy = policy
        self.cost = tick_cost
        self.wall = 0
        self.clock = START
        self.ticks: list[tuple[int, int]] = []
        self.gaps: list[str] = []
        self.worst_lag = 0.0

    def pass_by(self, ns: int) -> None:
        """Real time passes, and the clock with it."""
        self.wall += ns
        self.clock += ns

    def live(self, seconds: float) -> None:
        """Look, tick and wait as the thread does, for so much real time."""
        end = self.wall + round(seconds * NS)
        while self.wall < end:
            wait = self.grid.look(self.clock, self.wall, self.policy)
            self.gaps += [self.grid.gap] if self.grid.gap else []
            self.worst_lag = max(self.worst_lag, self.grid.lag)
            if wait > 0:
                self.pass_by(min(wait, PERIOD))
            else:
                self.ticks.append((self.wall, self.grid.take()))
                self.pass_by(self.cost)

    @property
    def steps(self) -> list[int]:
        """Distances between stamps."""
        return [b - a for (_, a), (_, b) in pairwise(self.ticks)]


def fastest(day: Day, window: float) -> float:
    """Largest share of plant time in real time over windows of so many seconds."""
    best = 0.0
    first = 0
    for wall, stamp in day.ticks:
        while wall - day.ticks[first][0] > window * NS:
            first += 1
        best = max(best, (stamp - day.ticks[first][1]) / (window * NS))
    return best


def test_stamps_stand_on_the_grid_without_a_gap() -> None:
    day = Day()
    day.live(0.5)
    assert set(day.steps) == {PERIOD}
    assert all(stamp % PERIOD == 0 for _, stamp in day.ticks)
    assert len(day.ticks) in (249, 250)
    assert day.gaps == []


def test_a_short_delay_is_made_up_for_at_once() -> None:
    day = Day()
    day.live(0.1)
    day.pass_by(NS // 20)
    day.live(0.02)
    assert day.grid.lag < 0.002
    assert set(day.steps) == {PERIOD}


def test_a_delay_is_made_up_for_at_twice_the_speed_without_a_gap() -> None:
    day = Day()
    day.live(0.1)
    day.pass_by(9 * NS // 10)
    before = len(day.ticks)
    day.live(2.0)
    assert set(day.steps) == {PERIOD}
    assert day.gaps == []
    assert day.grid.lag < 0.002
    late = Day()
    late.ticks = day.ticks[before:]
    assert (
        fastest(late, 0.5) < 2.0 + 0.1 / 0.5 + 0.01
    )  # a tenth of a second at once, then twice the speed


@pytest.mark.parametrize("seconds", [2.1, 5.0, 3600.0])
def test_a_process_that_was_suspended_has_one_announced_gap_and_catches_up_nothing(
    seconds: float,
) -> None:
    day = Day()
    day.live(0.1)
    before = len(day.ticks)
    day.pass_by(round(seconds * NS))
    day.live(1.0)
    assert (
        day.gaps == [f"the process was suspended for {seconds:.3f} s"] or "suspended" in day.gaps[0]
    )
    assert len(day.gaps) == 1
    assert sum(step != PERIOD for step in day.steps) == 1
    assert len(day.ticks) - before in range(498, 502)


def test_a_loaded_machine_lags_for_minutes_and_never_has_a_gap() -> None:
    """Each tick takes half as long again as it may: the plant gets two thirds of its time."""
    day = Day(tick_cost=3 * PERIOD // 2)
    day.live(60.0)
    assert day.worst_lag > 15.0
    assert day.gaps == []
    day.cost = PERIOD // 10
    day.live(30.0)
    assert day.grid.lag < 0.002
    assert set(day.steps) == {PERIOD}
    assert fastest(day, 1.0) < 2.2


@pytest.mark.parametrize(
    ("jump", "words"), [(-3.0, "jumped back by 3.0"), (20.0, "jumped ahead by 20.0")]
)
def test_a_clock_that_is_set_starts_the_grid_anew(jump: float, words: str) -> None:
    day = Day()
    day.live(0.1)
    day.clock += round(jump * NS)
    day.live(0.1)
    assert len(day.gaps) == 1
    assert words in day.gaps[0]
    assert sum(step != PERIOD for step in day.steps) == 1


def test_a_clock_that_is_put_back_a_little_is_waited_for() -> None:
    day = Day()
    day.live(0.1)
    day.clock -= NS // 3
    day.live(0.5)
    assert day.gaps == []
    assert set(day.steps) == {PERIOD}


def test_somebodys_clock_that_is_too_fast_to_follow_has_gaps() -> None:
    day = Day(FOREIGN)
    day.live(0.1)
    for _ in range(40):
        day.clock += NS // 2
        day.live(0.005)
    assert 2 <= len(day.gaps) <= 4
    assert all("fallen behind" in gap for gap in day.gaps)


def test_a_clock_that_stops_being_there_is_announced_once() -> None:
    day = Day(FOREIGN)
    day.live(0.1)
    day.clock = -(10**12)  # no simulated time
    day.live(0.1)
    assert day.gaps == ["the clock has stopped"]


slices = st.lists(st.tuples(st.integers(0, 980), st.integers(5, 60)), min_size=1, max_size=30)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(slices=slices)
def test_no_load_makes_a_gap_or_drives_faster_than_twice_the_clock(
    slices: list[tuple[int, int]],
) -> None:
    """The thread is kept waiting for up to 0.99 s, then gets some time, again and again."""
    day = Day()
    day.live(0.05)
    for starved, served in slices:
        day.pass_by(starved * 1_000_000)
        day.live(served * 1e-3)
    assert day.gaps == []
    assert set(day.steps) <= {PERIOD}
    bursts = 0.1 * (len(slices) + 1) + 0.01
    real = (day.wall - day.ticks[0][0]) / NS
    assert (day.ticks[-1][1] - day.ticks[0][1]) / NS <= real + bursts
    assert all(stamp <= START + wall + PERIOD for wall, stamp in day.ticks)


def test_a_scaled_clock_stands_while_its_process_does() -> None:
    walls = iter([0, 10_000_000, 20_000_000, 5 * NS, 5 * NS + 10_000_000])
    clock = ScaledClock(4.0, START, wall=lambda: next(walls))
    assert [clock() - START for _ in range(4)] == [40_000_000, 80_000_000, 480_000_000, 520_000_000]


class Clock:
    """A clock that shows what is set; every reading lets it pass `rate` ns."""

    def __init__(self, start: int, rate: int) -> None:
        self.now = start
        self.rate = rate

    def __call__(self) -> int:
        self.now += self.rate
        return self.now


def thread_on(
    clock: Clock, tick: Callable[[int], None], failed: Callable[[Exception], None]
) -> GridThread:
    return GridThread(PERIOD, clock, lambda: OWN, tick, lambda gap: None, failed)


def test_the_thread_ticks_on_the_grid() -> None:
    stamps: list[int] = []
    enough = threading.Event()

    def tick(stamp: int) -> None:
        stamps.append(stamp)
        if len(stamps) == 50:
            enough.set()

    thread = thread_on(Clock(12_345, PERIOD // 3), tick, lambda error: enough.set())
    thread.start()
    assert enough.wait(PATIENCE)
    thread.close()
    assert {b - a for a, b in pairwise(stamps)} == {PERIOD}


def test_a_slow_stream_looks_at_the_clock_when_a_stamp_is_due() -> None:
    looks: list[int] = []
    stamps: list[int] = []
    enough = threading.Event()

    def clock() -> int:
        looks.append(time.time_ns())
        return looks[-1]

    def tick(stamp: int) -> None:
        stamps.append(stamp)
        if len(stamps) == 20:
            enough.set()

    thread = GridThread(
        10 * PERIOD, clock, lambda: SYSTEM, tick, lambda gap: None, lambda error: enough.set()
    )
    thread.start()
    assert enough.wait(PATIENCE)
    thread.close()
    # one look finds a stamp due, one how long the next takes, one may wake early
    assert len(looks) <= 3 * len(stamps)


def test_a_clock_that_has_not_started_or_stands_still_makes_no_ticks() -> None:
    clock = Clock(0, 0)
    ticked = threading.Event()
    thread = thread_on(clock, lambda stamp: ticked.set(), lambda error: None)
    thread.start()
    assert not ticked.wait(0.05)
    clock.now = 7 * PERIOD
    assert not ticked.wait(0.05)
    clock.rate = PERIOD
    assert ticked.wait(PATIENCE)
    thread.close()


def test_what_a_tick_raises_is_reported_and_ends_the_thread() -> None:
    stamps: list[int] = []
    failures: list[Exception] = []
    failed = threading.Event()

    def tick(stamp: int) -> None:
        stamps.append(stamp)
        if len(stamps) == 3:
            raise RuntimeError("boom")

    thread = thread_on(
        Clock(1, PERIOD), tick, lambda error: (failures.append(error), failed.set())[0]
    )
    thread.start()
    assert failed.wait(PATIENCE)
    thread.close()
    assert len(stamps) == 3
    assert str(failures[0]) == "boom"
