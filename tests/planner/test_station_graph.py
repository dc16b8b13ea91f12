"""The cheapest chain over stations x configurations, judged by enumeration of all chains."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_planner.program.station_graph import (
    ACROSS,
    ENTER,
    LEAVE,
    HopBounds,
    HopPart,
    Settled,
    StationGraph,
)


@dataclass
class World:
    """True costs of the parts of every hop; inf: impossible. `share`: how much of them a bound
    says.
    """

    leave: list[np.ndarray]
    across: list[np.ndarray]
    enter: list[np.ndarray]
    share: float
    asked: list[HopPart] = field(default_factory=list)

    def hops(self) -> list[HopBounds]:
        """Bounds; what is impossible looks cheap at first."""
        parts = (self.leave, self.across, self.enter)
        bounds = [
            [self.share * np.where(np.isfinite(a), a, 1.0) for a in hop]
            for hop in zip(*parts, strict=True)
        ]
        return [HopBounds(*hop) for hop in bounds]

    def cost(self, part: HopPart) -> float:
        if part.kind == LEAVE:
            return float(self.leave[part.hop][part.first])
        if part.kind == ENTER:
            return float(self.enter[part.hop][part.second])
        return float(self.across[part.hop][part.first, part.second])

    def settle(self, parts: list[HopPart]) -> list[Settled]:
        """Half of the parts get a better bound first, then all their cost."""
        found = []
        for part in parts:
            again = part in self.asked
            self.asked.append(part)
            halfway = part.kind == ACROSS and not again and np.isfinite(self.cost(part))
            found.append(
                Settled(
                    self.cost(part) * (0.95 if halfway else 1.0),
                    exact=not halfway,
                    proved=not halfway,
                )
            )
        return found

    def enumerated(self) -> float:
        """The least cost of all chains, one by one."""
        sizes = [len(self.leave[0]), *(len(enter) for enter in self.enter)]
        best = np.inf
        for chain in itertools.product(*(range(size) for size in sizes)):
            total = 0.0
            for k, (a, b) in enumerate(itertools.pairwise(chain)):
                total += self.leave[k][a] + self.across[k][a, b] + self.enter[k][b]
            best = min(best, total)
        return float(best)


@st.composite
def worlds(draw: st.DrawFn) -> World:
    sizes = draw(st.lists(st.integers(1, 4), min_size=2, max_size=5))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    impossible = draw(st.sampled_from([0.0, 0.2, 0.6]))

    def costs(*shape: int) -> np.ndarray:
        values = rng.uniform(1.0, 10.0, shape)
        values[rng.random(shape) < impossible] = np.inf
        return values

    pairs = list(itertools.pairwise(sizes))
    return World(
        [costs(a) for a, _ in pairs],
        [costs(a, b) for a, b in pairs],
        [costs(b) for _, b in pairs],
        draw(st.sampled_from([0.0, 0.5, 0.9])),
    )


@given(worlds())
@settings(deadline=None)
def test_the_chain_is_the_cheapest_of_all(world: World) -> None:
    chain = StationGraph(world.hops(), world.settle).solve()
    best = world.enumerated()
    assert chain.cost == pytest.approx(best)
    if np.isfinite(best):
        total = 0.0
        for k, (a, b) in enumerate(itertools.pairwise(chain.chosen)):
            total += world.leave[k][a] + world.across[k][a, b] + world.enter[k][b]
        assert total == pytest.approx(best)
        assert chain.gap == pytest.approx(0.0, abs=1e-12)


@given(worlds(), st.integers(0, 5))
@settings(deadline=None)
def test_a_stated_gap_is_true_where_the_work_ends_first(world: World, most: int) -> None:
    chain = StationGraph(
        world.hops(), world.settle, may_go_on=lambda: len(world.asked) < most
    ).solve()
    best = world.enumerated()
    assert chain.proved <= chain.bound <= best + 1e-9
    if np.isfinite(best):
        assert (1.0 - chain.gap) * chain.cost <= best + 1e-9


@given(worlds(), st.integers(0, 5))
@settings(deadline=None)
def test_a_bound_that_is_only_measured_is_not_in_the_proved_one(world: World, most: int) -> None:
    """Measured bounds that are wrong by a fifth spoil the bound, but not the proved one."""

    def settle(parts: list[HopPart]) -> list[Settled]:
        return [
            s if s.exact else Settled(1.2 * s.cost, False, proved=False)
            for s in world.settle(parts)
        ]

    chain = StationGraph(world.hops(), settle, may_go_on=lambda: len(world.asked) < most).solve()
    best = world.enumerated()
    assert chain.proved <= best + 1e-9
    if np.isfinite(best):
        assert (1.0 - chain.proved_gap) * chain.cost <= best + 1e-9


@given(worlds(), st.sampled_from([0.01, 0.1]))
@settings(deadline=None)
def test_the_answer_is_within_the_tolerance(world: World, tolerance: float) -> None:
    chain = StationGraph(world.hops(), world.settle, tolerance).solve()
    best = world.enumerated()
    assert chain.cost == best or chain.cost <= best / (1.0 - tolerance) + 1e-9


def test_good_bounds_leave_most_parts_alone() -> None:
    rng = np.random.default_rng(0)
    count = 12
    stops = 6
    world = World(
        [rng.uniform(1.0, 2.0, count) for _ in range(stops)],
        [rng.uniform(1.0, 10.0, (count, count)) for _ in range(stops)],
        [rng.uniform(1.0, 2.0, count) for _ in range(stops)],
        0.95,
    )
    StationGraph(world.hops(), world.settle).solve()
    assert len(set(world.asked)) < 0.2 * stops * count**2


def test_the_cost_of_the_best_chain_is_reported() -> None:
    world = World([np.ones(2)], [np.array([[5.0, 6.0], [7.0, 4.0]])], [np.ones(2)], 0.5)
    heard: list[float] = []
    chain = StationGraph(world.hops(), world.settle).solve(heard.append)
    assert heard[-1] == chain.cost == 6.0


@given(worlds(), st.integers(0, 5))
@settings(deadline=None)
def test_a_search_that_must_end_knows_a_chain_or_none(world: World, most: int) -> None:
    chain = StationGraph(
        world.hops(), world.settle, must_end=lambda: len(world.asked) >= most
    ).solve()
    best = world.enumerated()
    assert chain.cost == pytest.approx(best) or chain.cost == np.inf
    if np.isfinite(chain.cost):
        assert all(world.cost(part) < np.inf for part in parts_of(chain.chosen))


def parts_of(chosen: list[int]) -> list[HopPart]:
    """All parts of a chain."""
    kinds = (LEAVE, ACROSS, ENTER)
    return [
        HopPart(k, kind, a, b)
        for k, (a, b) in enumerate(itertools.pairwise(chosen))
        for kind in kinds
    ]
