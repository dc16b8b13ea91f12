"""Laws: whenever a reader begins and however slow it is, it ends with the same values; memory is
bounded.
"""

from __future__ import annotations

import json
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from ir_recorder.live import stream as module
from ir_recorder.live.stream import Stream

VALUES = st.dictionaries(
    st.sampled_from(["q", "w", "mode", "load"]), st.none() | st.text(max_size=3) | st.integers(0, 3)
)


class Reader:
    """A browser: begins anew where it fell behind, else takes the records that follow."""

    def __init__(self) -> None:
        self.number: int | None = None
        self.state: dict[str, Any] = {}

    def read(self, stream: Stream) -> None:
        kept = None if self.number is None else stream.after(self.number, 0.0)
        if kept is None:
            content, self.number = stream.begin()
            start = json.loads(content)
            self.state = start["before"]
            changes = start["records"]
        else:
            changes = [json.loads(text) for text in kept[0]]
            self.number = kept[1]
        for change in changes:
            self.state = {**self.state, **change}


@settings(max_examples=40)
@given(st.lists(st.tuples(VALUES, st.booleans()), max_size=30), st.integers(1, 5))
def test_every_reader_ends_with_the_last_values(
    steps: list[tuple[dict[str, Any], bool]], most: int
) -> None:
    now = [0.0]
    before = module.MOST_KEPT
    module.MOST_KEPT = most
    try:
        stream = Stream(clock=lambda: now[0])
        slow = Reader()
        expected: dict[str, Any] = {}
        for values, reads in steps:
            now[0] += 0.05
            stream.add(values)
            expected |= values
            if reads:
                slow.read(stream)
        late = Reader()
        for reader in (slow, late):
            reader.read(stream)
            known = {k: v for k, v in reader.state.items() if k != "t" and v is not None}
            assert known == {k: v for k, v in expected.items() if v is not None}
        kept, _ = stream.begin()
        assert len(json.loads(kept)["records"]) <= most
    finally:
        module.MOST_KEPT = before


def test_old_and_long_records_go_first_and_the_values_stay() -> None:
    now = [0.0]
    stream = Stream(clock=lambda: now[0])
    stream.add({"cell": "demo"})
    for k in range(30):
        now[0] += 10.0
        stream.add({"load": f"{k}" * 1_000_000})
    content, _ = stream.begin()
    assert len(content) < 2 * module.MOST_BYTES
    start = json.loads(content)
    assert start["before"]["cell"] == "demo"
    assert start["records"][-1]["t"] - start["records"][0]["t"] <= module.SECONDS_KEPT


def test_what_stays_the_same_is_said_once_and_asked_for_always() -> None:
    stream = Stream()
    for _ in range(2):
        stream.add({"mode": "MOVING", "w": [1.0, 2.0]}, always=("w",))
    first, second = json.loads(stream.begin()[0])["records"]
    assert set(first) == {"t", "mode", "w"}
    assert set(second) == {"t", "w"}


def test_a_closed_stream_lets_a_waiting_reader_go() -> None:
    stream = Stream()
    stream.close()
    assert stream.after(0, 60.0) == ([], 0)
