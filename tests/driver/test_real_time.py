"""The plant's thread on clocks that behave and clocks that don't; nothing here waits for real time."""

from __future__ import annotations

import threading
from itertools import pairwise

import pytest

from ir_sim_driver.node.real_time import GridThread

PERIOD = 2_000_000


class Clock:
    """A clock that shows what is set; every reading lets it pass `rate` ns."""

    def __init__(self, start, rate):
        self.now, self.rate = start, rate

    def __call__(self):
        self.now += self.rate
        return self.now


@pytest.fixture
def run():
    """Run a thread on a clock until it has ticked `count` times; `meddle(k)` is called in tick k."""

    def run_thread(clock, count, meddle=lambda k: None, max_lag=5.0):
        stamps, jumps, failures, enough = [], [], [], threading.Event()

        def tick(stamp):
            stamps.append(stamp)
            meddle(len(stamps))
            if len(stamps) >= count:
                enough.set()

        thread = GridThread(
            PERIOD, clock, tick, jumps.append, lambda e: (failures.append(e), enough.set()), max_lag
        )
        thread.start()
        assert enough.wait(20.0)
        thread.close()
        return stamps[:count], jumps, failures

    return run_thread


def on_the_grid(stamps):
    return all(stamp % PERIOD == 0 for stamp in stamps)


def gaps(stamps):
    return [b - a for a, b in pairwise(stamps)]


def test_stamps_stand_on_the_grid_without_a_gap(run):
    stamps, jumps, _ = run(Clock(12_345, PERIOD // 3), 50)
    assert on_the_grid(stamps)
    assert set(gaps(stamps)) == {PERIOD}
    assert jumps == []


def test_a_hiccup_is_caught_up_stamp_by_stamp(run):
    clock = Clock(1, PERIOD // 4)

    def hiccup(k):
        if k == 10:
            clock.now += 500 * PERIOD

    stamps, jumps, _ = run(clock, 600, hiccup)
    assert set(gaps(stamps)) == {PERIOD}
    assert jumps == []


@pytest.mark.parametrize(("jump", "word"), [(-3_000_000_000, "back"), (20_000_000_000, "ahead")])
def test_a_clock_that_jumps_starts_the_grid_anew_and_is_reported(run, jump, word):
    clock = Clock(30_000_000_000, PERIOD // 4)

    def leap(k):
        if k == 10:
            clock.now += jump

    stamps, jumps, _ = run(clock, 30, leap)
    assert on_the_grid(stamps)
    assert len(jumps) == 1
    assert word in jumps[0]
    assert sum(gap != PERIOD for gap in gaps(stamps)) == 1


def test_a_clock_that_has_not_started_or_stands_still_makes_no_ticks(run):
    clock = Clock(0, 0)
    ticked = threading.Event()
    thread = GridThread(PERIOD, clock, lambda stamp: ticked.set(), lambda jump: None, lambda error: None)
    thread.start()
    assert not ticked.wait(0.05)
    clock.now = 7 * PERIOD
    assert not ticked.wait(0.05)
    clock.rate = PERIOD
    assert ticked.wait(20.0)
    thread.close()


def test_what_a_tick_raises_is_reported_and_ends_the_thread(run):
    def fail(k):
        if k == 3:
            raise RuntimeError("boom")

    stamps, _, failures = run(Clock(1, PERIOD), 100, fail)
    assert len(stamps) == 3
    assert str(failures[0]) == "boom"
