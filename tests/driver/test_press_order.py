"""Presses that are heard ahead of the topic's other levels: whatever the delays, none is lost, each
has one number, the last level counts, and nothing of before a press acknowledges it.
"""

from __future__ import annotations

import random
import time
from collections import deque
from itertools import pairwise
from types import SimpleNamespace
from typing import Any

import pytest
from rclpy.qos import DurabilityPolicy
from rclpy.serialization import serialize_message

from ir_msgs.msg import PlcInputs
from ir_msgs_py.modes import Mode
from ir_sim_driver.controller.mode_control import Latches
from ir_sim_driver.emergency_stop import StopState
from ir_sim_driver.node import presses
from ir_sim_driver.notices import Notices
from ir_sim_driver.plc import Plc, PlcSettings

STEP = 0.004  # s
CASES = 300


class Handle:
    """A subscription's, from which messages are taken when they have come."""

    def __init__(self) -> None:
        self.queue: deque[tuple[bytes, dict[str, int]]] = deque()

    def __enter__(self) -> None: ...

    def __exit__(self, *exception: object) -> None: ...

    def take_message(self, _kind: Any, _raw: bool) -> Any:
        return self.queue.popleft() if self.queue else None


class Bench:
    """The topic on a Plc, without ROS; ahead, turn: where its presses and all its levels come."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(presses, "keep_only", lambda subscription, expression: True)
        self.core = Plc(PlcSettings(startup_window=0.0), Notices())
        self.latches = Latches()
        self.plc = self
        self.said: list[str] = []
        handles: list[Handle] = []

        def subscribe(_kind: Any, _topic: str, _call: Any, quality: Any, **_: Any) -> Any:
            handle = Handle()
            if quality.durability == DurabilityPolicy.VOLATILE:
                handles.append(handle)
            return SimpleNamespace(handle=handle, msg_type=PlcInputs)

        node = SimpleNamespace(create_subscription=subscribe, resolve_topic_name=str)
        apart = SimpleNamespace(node=node, apart=True)
        self.topic = presses.PlcTopic(node, self, apart)  # type: ignore[arg-type]
        self.turn, self.ahead = (handle.queue for handle in handles)

    @property
    def stop_number(self) -> int:
        return self.core.stop.number

    def warn(self, sentence: str) -> None:
        self.said.append(sentence)

    def write_inputs(self, writer: str, levels: Any) -> None:
        self.core.write(writer, levels)

    def write_heard(self, writer: str, heard: Any) -> None:
        for each in heard:
            self.core.write_all(writer, each)

    def step(self) -> None:
        self.topic.poll()
        self.core.step(STEP)
        self.latches.react(self.core, Mode.EMERGENCY_STOP)


def drawn(generator: random.Random) -> list[PlcInputs]:
    """What a PLC sends, one level after the other."""
    levels = {"emergency_stop": False, "conf_mess": False, "drives_on": False}
    sent = []
    for _ in range(generator.randrange(2, 30)):
        if generator.random() < 0.8:
            bit = generator.choice(list(levels))
            levels[bit] = not levels[bit]
        sent.append(PlcInputs(move_enable=True, **levels))
    return sent


def delivered(bench: Bench, sent: list[PlcInputs], generator: random.Random) -> None:
    """All presses come on one way, everything on the other, each in order and some time late."""
    begin = time.time_ns()
    ways = (deque[Any](), deque[Any]())
    patience = generator.choice((0.1, 0.5, 0.9)), generator.choice((0.3, 0.9))

    def come(share: float, way: deque[Any], queue: deque[Any]) -> None:
        while way and generator.random() < share:
            data, stamp = way.popleft()
            queue.append((data, stamp | {"received_timestamp": time.time_ns()}))

    for k, message in enumerate(sent):
        said = (bytes(serialize_message(message)), {"source_timestamp": begin + k})
        ways[0].append(said)
        if message.emergency_stop:
            ways[1].append(said)
        for _ in range(generator.randrange(12)):
            come(patience[0], ways[0], bench.turn)
            come(patience[1], ways[1], bench.ahead)
            bench.step()
    while any(ways):
        come(1.0, ways[0], bench.turn)
        come(1.0, ways[1], bench.ahead)
        bench.step()
    for _ in range(20):
        bench.step()


def test_presses_ahead_of_their_turn_keep_the_law_of_stops(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    recovered = 0
    stopped = 0
    for seed in range(CASES):
        generator = random.Random(seed)
        bench = Bench(monkeypatch)
        sent = drawn(generator)
        delivered(bench, sent, generator)
        levels = [message.emergency_stop for message in sent]
        rises = sum(b and not a for a, b in zip([False, *levels], levels, strict=False))
        stop = bench.core.stop
        assert stop.number == rises, seed
        assert bench.core.raw.emergency_stop == levels[-1], seed
        assert not bench.said, seed
        if not rises:
            continue
        assert stop.pressed == levels[-1], seed
        last = max(k for k, level in enumerate(levels) if level)
        since = sent[last + 1 :]  # the first of them lets go of the button
        follows = any(b.conf_mess and not a.conf_mess for a, b in pairwise(since))
        if stop.state in (StopState.RUN, StopState.ACKNOWLEDGED):
            assert follows, seed
            recovered += 1
        stopped += 1
    assert stopped > CASES // 2
    assert recovered > CASES // 20


def test_a_press_counts_while_thousands_of_levels_wait(monkeypatch: pytest.MonkeyPatch) -> None:
    bench = Bench(monkeypatch)
    now = time.time_ns()
    idle = bytes(serialize_message(PlcInputs(move_enable=True)))
    for k in range(3_000):
        bench.turn.append((idle, {"source_timestamp": now + k, "received_timestamp": now}))
    press = bytes(serialize_message(PlcInputs(move_enable=True, emergency_stop=True)))
    stamp = {"source_timestamp": now + 3_000, "received_timestamp": now}
    bench.ahead.append((press, stamp))
    bench.turn.append((press, stamp))
    bench.step()
    assert bench.core.stop.number == 1
    for _ in range(100):
        bench.step()
        assert bench.core.raw.emergency_stop  # none of the levels of before lets go
    assert not bench.turn
    assert bench.core.stop.number == 1
