"""Playback keeps the recorded distances in time, at any rate."""

from __future__ import annotations

import math
from typing import Any

import pytest

from ir_recorder.errors import RecorderError
from ir_recorder.play.node import press
from ir_recorder.play.playback import (
    DueMessage,
    Player,
    Playhead,
    PlaySettings,
    PlayState,
    checked_delay,
)

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


def test_a_gap_of_any_length_is_waited_for_in_turns_of_an_hour() -> None:
    """No thread can wait for 1e13 s at once."""
    waits: list[float] = []

    def wait(seconds: float) -> bool:
        waits.append(seconds)
        return len(waits) > 3

    far = [(0, "/a", b"1"), (2**63, "/a", b"2")]
    player = Player(lambda: 0.0, wait, lambda message: None)
    assert player.play(far, PlaySettings(rate=0.001)) == 1
    assert max(waits) == 3600.0


@pytest.mark.parametrize("delay", [-1.0, math.nan, math.inf, 1e300])
def test_a_delay_that_nobody_can_wait_for_is_refused(delay: float) -> None:
    with pytest.raises(RecorderError, match="must be 0 to 3600 s"):
        checked_delay(delay)


def test_a_loop_over_nothing_ends() -> None:
    assert play(Clock(), loop=True, topics=("/none",)) == []


def controlled(at: dict[int, Any], **settings: Any) -> list[tuple[float, bytes]]:
    """What is published when; at: what is done to the playhead after so many messages."""
    clock = Clock()
    out = []
    head = Playhead(clock.now, 1.0)

    def publish(message: DueMessage) -> None:
        out.append((clock.time, message.data))
        at.pop(len(out), lambda head: None)(head)

    player = Player(clock.now, clock.wait, publish, head=head, **settings)
    player.play(MESSAGES, PlaySettings())
    return out


def test_a_new_rate_counts_from_where_playback_stands() -> None:
    found = controlled({2: lambda head: head.control(False, rate=0.5)})
    assert found == [(0.0, b"1"), (0.5, b"2"), (1.5, b"3")]


def test_a_seek_goes_on_from_there_with_what_was_latched() -> None:
    back = controlled({2: lambda head: head.control(False, seek=0.25)}, latched=("/a",))
    assert back == [(0.0, b"1"), (0.5, b"2"), (0.5, b"1"), (0.75, b"2"), (1.25, b"3")]
    on = controlled({1: lambda head: head.control(False, seek=0.75)})
    assert on == [(0.0, b"1"), (0.25, b"3")]


def test_while_it_is_paused_nothing_is_published() -> None:
    clock = Clock()
    out = []
    head = Playhead(clock.now, 1.0)

    def wait(seconds: float) -> bool:
        clock.wait(seconds)
        if clock.time >= 7.5:
            head.control(pause=False)
        return False

    def publish(message: DueMessage) -> None:
        out.append((clock.time, message.data))
        if len(out) == 1:
            head.control(pause=True)

    Player(clock.now, wait, publish, head=head).play(MESSAGES, PlaySettings())
    assert [data for _, data in out] == [b"1", b"2", b"3"]
    assert out[1][0] >= 8.0
    assert out[2][0] - out[1][0] == pytest.approx(0.5)


@pytest.mark.parametrize(
    ("control", "sentence"),
    [({"seek": 1.5}, "seek is 1.5 s, must be at most 1 s"), ({"seek": math.nan}, "seek is nan"),
     ({"rate": -1.0}, "rate is -1"), ({"rate": math.nan}, "rate is nan")],
)  # fmt: skip
def test_a_control_without_sense_is_refused_and_changes_nothing(
    control: dict[str, float], sentence: str
) -> None:
    head = Playhead(lambda: 0.0, 1.0)
    with pytest.raises(RecorderError, match=sentence):
        head.control(True, **control)
    assert head.state == PlayState(False, 1.0, 0.0, 1.0)


def test_keys_pause_seek_and_change_the_rate() -> None:
    head = Playhead(lambda: 0.0, 60.0)
    for key, expected in (
        (b" ", PlayState(True, 1.0, 0.0, 60.0)),
        (b"\x1b[C", PlayState(True, 1.0, 5.0, 60.0)),
        (b"\x1b[A", PlayState(True, 2.0, 5.0, 60.0)),
        (b"\x1b[D", PlayState(True, 2.0, 0.0, 60.0)),
        (b"\x1b[B", PlayState(True, 1.0, 0.0, 60.0)),
        (b"x", PlayState(True, 1.0, 0.0, 60.0)),
        (b" ", PlayState(False, 1.0, 0.0, 60.0)),
    ):
        press(key, head)
        assert head.state == expected


def test_the_clock_ticks_recorded_time_in_between() -> None:
    clock = Clock()
    ticks = []
    player = Player(clock.now, clock.wait, lambda message: None, ticks.append, 0.1)
    player.play(MESSAGES, PlaySettings())
    assert len(ticks) == pytest.approx(11, abs=1)
    assert ticks == sorted(ticks)
    assert (ticks[0], ticks[-1]) == (1_000_000_000, pytest.approx(2_000_000_000, abs=1e8))
