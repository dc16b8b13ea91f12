"""Sequences and timeout policies of a pause against exhaustive search, which simulates each by
itself.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import load_cell, load_power_data
from ir_msgs_py.modes import RestTimes, TransitionTimes
from ir_planner.errors import RequestError
from ir_planner.program.pause_lengths import SAMPLES_MAX, lengths_of
from ir_planner.program.rests import Recharge, Rest, Rests, rests_at
from ir_planner.program.standby import plan_standby
from ir_planner.program.timeouts import Timeouts
from ir_planner.scene.planning_scene import load_text, scene_with

CELL = load_cell("demo")
SCENE = scene_with(CELL, load_text(CELL), load_power_data())
HOME = np.array(CELL.machine_home)
TIMES = TransitionTimes()
NAMES = ("STAND_ON_BRAKES", "BUS_POWER_OFF", "HIBERNATION")
NOT_GIVEN = np.zeros(0)


def simulated(
    rests: Rests, plan: tuple[tuple[int, float], ...], end: float, wake: float
) -> tuple[float, float]:
    """Energy [J] until the robot is ready, and when [s]: mode plan[i][0] is asked for at
    plan[i][1], motors at `wake`, and they are needed at `end`. An automaton of its own, event by
    event.
    """
    watts = [rests.motors, *(mode.watts for mode in rests.modes)]
    orders = [(at, k + 1) for k, at in plan if at < wake]
    if not orders or orders[0][0] > rests.timer:
        closed = [(rests.timer, 1), *[(at, k) for at, k in orders if k != 1]]
        orders = closed if wake > rests.timer else []
    now = 0.0
    energy = 0.0
    mode = 0
    cut: float | None = None  # when the mains were cut from the DC link
    for at, k in orders:
        start = max(at, now)
        if mode and start >= wake:
            break
        energy += watts[mode] * (start - now)
        rest = rests.modes[k - 1]
        energy += watts[mode] * rest.times.enter + watts[k] * rest.times.stay
        now = start + rest.times.enter + rest.times.stay
        if rest.bus_off and cut is None:
            cut = start + rest.times.enter
        mode = k
    if cut is not None:  # a capacitor that is charged through a resistor takes twice what it holds
        share = math.exp(-rests.recharge.rate * (max(wake, now) - cut))
        energy += rests.recharge.whole * (1.0 - share)
    if mode:
        leave = rests.modes[mode - 1].times.leave
        energy += watts[mode] * max(wake - now, 0.0) + watts[0] * leave
        now = max(wake, now) + leave
    energy += watts[0] * max(end - now, 0.0)
    return energy, max(now, end)


def plans(rests: Rests, grid: list[float]) -> Iterator[tuple[tuple[int, float], ...]]:
    """All sequences of deeper modes with switch times on a grid, and as soon as the mode before
    allows.
    """
    for count in range(len(rests.modes) + 1):
        for chosen in itertools.combinations(range(len(rests.modes)), count):
            yield from _timed(rests, chosen, grid, ())


def _timed(
    rests: Rests, chosen: tuple[int, ...], grid: list[float], before: tuple[tuple[int, float], ...]
) -> Iterator[tuple[tuple[int, float], ...]]:
    if len(before) == len(chosen):
        yield before
        return
    first = 0.0
    if before:
        k, at = before[-1]
        first = at + rests.modes[k].times.busy
    for at in [first, *(time for time in grid if time > first)]:
        yield from _timed(rests, chosen, grid, (*before, (chosen[len(before)], at)))


@st.composite
def controllers(draw: st.DrawFn, whole: float = 0.0) -> Rests:
    """Controllers of any times, whose deeper modes draw less; whole [J]: to charge their DC link,
    at most.
    """
    watts = sorted((draw(st.floats(5.0, 900.0)) for _ in range(4)), reverse=True)
    seconds = st.floats(0.0, 40.0)
    modes = tuple(
        Rest(name, power, RestTimes(draw(seconds), draw(seconds), draw(seconds)), name != NAMES[0])
        for name, power in zip(NAMES, watts[1:], strict=True)
    )
    timer = draw(st.floats(0.5, 60.0))
    rate = st.floats(1e-3, 1.0)
    recharge = Recharge(draw(st.floats(0.0, whole)), draw(rate)) if whole else Recharge()
    return Rests(watts[0], timer, modes, recharge)


@pytest.mark.parametrize(
    "pause", [0.5, 1.9, 2.1, 8.0, 20.5, 60.0, 97.0, 240.0, 400.0, 900.0, 1800.0, 7200.0]
)
def test_no_sequence_with_timers_costs_less_than_the_planned_one(pause: float) -> None:
    rests = rests_at(HOME, SCENE, TIMES)
    grid = [float(t) for t in np.linspace(0.0, min(pause, 300.0), 6)]
    least = np.inf
    for plan in plans(rests, grid):
        for wake in (pause, *(pause - mode.times.leave for mode in rests.modes)):
            energy, ready = simulated(rests, plan, pause, wake)
            if wake > 0.0 and ready <= pause + 1e-9:
                least = min(least, energy)
    planned = plan_standby(pause, HOME, SCENE, TIMES)
    assert planned.energy == pytest.approx(least, rel=1e-9)


def test_the_shortest_pause_may_end_with_the_controllers_timer() -> None:
    brakes = RestTimes(0.0, 1.0, 2.0)
    deeper = RestTimes(0.0, 0.0, 1.0)
    modes = tuple(
        Rest(name, 5.0, times) for name, times in zip(NAMES, (brakes, deeper, deeper), strict=True)
    )
    rests = Rests(5.0, 1.0, modes)
    lengths = np.array([1.0, 2.0])
    steps = Timeouts(rests, lengths).best()
    least = np.mean([simulated(rests, ((1, 1.0),), pause, pause)[0] for pause in lengths])
    assert np.mean([rests.cost(steps, pause)[0] for pause in lengths]) == pytest.approx(least)


@pytest.mark.parametrize("whole", [0.0, 2000.0])
@given(data=st.data(), samples=st.lists(st.floats(0.1, 7200.0), min_size=1, max_size=5))
@settings(deadline=None, max_examples=60)
def test_no_timeout_policy_on_a_grid_has_a_lower_expectation(
    whole: float, samples: list[float], data: st.DataObject
) -> None:
    """By more than what a DC link takes to be charged again, which the search only brackets."""
    rests = data.draw(controllers(whole))
    lengths = np.sort(np.array(samples))
    steps = Timeouts(rests, lengths).best()
    expected = float(np.mean([rests.cost(steps, pause)[0] for pause in samples]))
    more = data.draw(st.lists(st.floats(0.0, float(lengths[-1])), max_size=3))
    grid = sorted({0.0, *samples, *more})
    least = min(
        np.mean([simulated(rests, plan, pause, pause)[0] for pause in samples])
        for plan in plans(rests, grid)
    )
    assert expected <= least * (1.0 + 1e-9) + 1e-6 + rests.recharge.whole
    assert expected == pytest.approx(rests.mean_cost(steps, lengths))
    own = tuple((NAMES.index(step.rest.name), step.at) for step in steps)
    again = [simulated(rests, own, pause, pause) for pause in samples]
    assert expected == pytest.approx(float(np.mean([energy for energy, _ in again])))
    assert [ready for _, ready in again] == pytest.approx(
        [p + rests.cost(steps, p)[1] for p in samples]
    )


@given(
    st.lists(st.floats(0.1, 7200.0), min_size=1, max_size=40),
    st.sampled_from(["samples", "quantiles"]),
)
@settings(deadline=None, max_examples=10)
def test_more_information_never_costs_more(values: list[float], form: str) -> None:
    given_ = np.sort(np.array(values))
    quantiles = form == "quantiles" and len(values) > 1
    lengths = lengths_of(0.0, NOT_GIVEN, given_) if quantiles else lengths_of(0.0, given_)
    found = plan_standby(lengths, HOME, SCENE, TIMES)
    rounding = 1e-9 * found.expected
    assert found.clairvoyant <= found.expected + rounding
    assert found.expected <= min(found.energies) + rounding
    assert found.worst >= found.expected - rounding
    assert found.saving >= -rounding
    rests = rests_at(HOME, SCENE, TIMES)
    assert found.clairvoyant == pytest.approx(
        np.mean([rests.clairvoyant(float(p)) for p in lengths.likely])
    )
    for pause in lengths.likely[:: max(1, len(lengths.likely) // 20)]:
        known = plan_standby(float(pause), HOME, SCENE, TIMES).energy
        assert rests.clairvoyant(float(pause)) <= known * (1.0 + 1e-9)


def test_quantiles_are_what_many_samples_between_them_are() -> None:
    quantiles = np.array([5.0, 20.0, 60.0, 600.0])
    rng = np.random.default_rng(0)
    drawn = np.interp(rng.uniform(0.0, 3.0, 9000), np.arange(4.0), quantiles)
    by_samples = plan_standby(lengths_of(0.0, drawn), HOME, SCENE, TIMES)
    by_quantiles = plan_standby(lengths_of(0.0, NOT_GIVEN, quantiles), HOME, SCENE, TIMES)
    assert by_quantiles.expected == pytest.approx(by_samples.expected, rel=0.03)
    assert by_quantiles.worst == pytest.approx(by_samples.worst, rel=0.03)


@pytest.mark.parametrize(
    ("pause", "samples", "quantiles", "sentence"),
    [
        (
            0.0,
            [3.0, float("nan")],
            [],
            r"pause_samples\[1\] is nan s: it must be in \(0, 604800\] s",
        ),
        (0.0, [-1.0], [], r"pause_samples\[0\] is -1 s"),
        (0.0, [], [0.0, 1.0], r"pause_quantiles\[0\] is 0 s"),
        (
            0.0,
            [],
            [1.0, 7.0, 5.0],
            r"pause_quantiles\[2\] is 5 s: it must be at least the one before, 7 s",
        ),
        (0.0, [], [1.0], "at least 2 are needed"),
        (0.0, [1.0] * (SAMPLES_MAX + 1), [], "has 10001 values: at most 10000"),
        (60.0, [1.0], [], r"pause \(60 s\) and pause_samples \(1 values\) are given: exactly one"),
        (0.0, [1.0], [1.0, 2.0], "exactly one of pause, pause_samples and pause_quantiles"),
        (float("nan"), [], [], r"pause is nan s"),
        (0.0, [], [], r"pause is 0 s: it must be in \(0, 604800\] s"),
    ],
)
def test_lengths_that_make_no_sense_are_named(
    pause: float, samples: list[float], quantiles: list[float], sentence: str
) -> None:
    with pytest.raises(RequestError, match=sentence):
        lengths_of(pause, np.array(samples), np.array(quantiles))
