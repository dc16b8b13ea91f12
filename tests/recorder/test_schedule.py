"""What is played, and when it is due."""

from __future__ import annotations

import pytest

from ir_recorder.errors import RecorderError
from ir_recorder.play.playback import DueMessage, PlaySettings, schedule

MESSAGES = [(1_500_000_000, "/b", b"2"), (1_000_000_000, "/a", b"1"), (2_000_000_000, "/a", b"3")]


def test_hidden_topics_are_played_only_by_name() -> None:
    hidden = "/ir_planner/plan/_action/status"
    assert not PlaySettings().plays(hidden)
    assert PlaySettings(topics=(hidden,)).plays(hidden)


def test_the_schedule_is_relative_to_its_first_message() -> None:
    first = next(schedule(MESSAGES, PlaySettings()))
    assert first == DueMessage(0.0, 1_000_000_000, "/a", b"1")


@pytest.mark.parametrize("rate", [0.0, -1.0, float("nan"), 1e6])
def test_rates_out_of_range_are_refused(rate: float) -> None:
    with pytest.raises(RecorderError, match=r"must be 0\.001 to 1000"):
        PlaySettings(rate)
