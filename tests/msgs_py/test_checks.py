"""What people typed may stand in a sentence, but never as a control character, and never without a
bound.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_msgs_py.ros.conversions import status_to_msg
from ir_msgs_py.status import Status, StatusCode
from ir_values.errors import one_line


@given(st.text(max_size=300), st.integers(min_value=10, max_value=200))
def test_one_line_is_printable_and_bounded(text: str, limit: int) -> None:
    line = one_line(text, limit)
    assert line.isprintable()
    assert len(line) <= limit


@pytest.mark.parametrize("text", ["plain", "Größe 20 mm ≤ S_m", ""])
def test_plain_text_stays_as_it_is(text: str) -> None:
    assert one_line(text) == text


def test_the_sentence_of_a_status_is_one_line() -> None:
    message = status_to_msg(Status(StatusCode.FAILURE, "a\x1b[2Jb\nc\ud800" + "x" * 10_000)).message
    assert message.startswith("a\\x1b[2Jb\\nc\\ud800x")
    assert message.isprintable()
    assert len(message) <= 4000
