"""Playback keeps the recorded distances in time, at any rate."""

from __future__ import annotations

import pytest

from ir_recorder.play.player import Player
from ir_recorder.play.schedule import PlaySettings

MESSAGES = [(1_500_000_000, "/b", b"2"), (1_000_000_000, "/a", b"1"), (2_000_000_000, "/a", b"3")]


class Clock:
    """Time that passes only by waiting."""

    def __init__(self, stop_after: float = float("inf")) -> None:
        self.time = 0.0
        self.stop_after = stop_after

    def now(self) -> float:
        return self.time

    def wait(self, seconds: float) -> bool:
        self.time += seconds
        return self.time >= self.stop_after


def play(clock: Clock, **settings: object) -> list[tuple[float, bytes]]:
    out: list[tuple[float, bytes]] = []
    player = Player(clock.now, clock.wait, lambda message: out.append((clock.time, message.data)))
    player.play(MESSAGES, PlaySettings(**settings))
    return out


def test_messages_come_in_order_at_their_times() -> None:
    assert play(Clock()) == [(0.0, b"1"), (0.5, b"2"), (1.0, b"3")]


def test_a_rate_of_two_halves_the_times() -> None:
    assert play(Clock(), rate=2.0) == [(0.0, b"1"), (0.25, b"2"), (0.5, b"3")]


def test_a_loop_goes_on_until_it_is_stopped() -> None:
    assert len(play(Clock(stop_after=5.2), loop=True)) > 10


def test_topics_can_be_chosen() -> None:
    assert [data for _, data in play(Clock(), topics=("/b",))] == [b"2"]


def test_a_loop_over_nothing_ends() -> None:
    assert play(Clock(), loop=True, topics=("/none",)) == []


def test_the_clock_ticks_recorded_time_in_between() -> None:
    clock, ticks = Clock(), []
    player = Player(clock.now, clock.wait, lambda message: None, ticks.append, 0.1)
    player.play(MESSAGES, PlaySettings())
    assert len(ticks) == pytest.approx(11, abs=1)
    assert ticks == sorted(ticks)
    assert (ticks[0], ticks[-1]) == (1_000_000_000, pytest.approx(2_000_000_000, abs=1e8))
