"""The load over time, from steps, diagnostics and the base load."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_msgs_py.modes import Mode
from ir_recorder import read_recording
from ir_recorder.analysis.loads import LoadTimeline, load_after, load_timeline
from ir_recorder.reading.recording import TextEvent

HOME = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


def test_the_load_is_unknown_between_two_that_differ() -> None:
    timeline = LoadTimeline(((0.0, "none"), (1.0, "none"), (2.0, "gripper"), (3.0, "gripper")))
    assert list(timeline.certain(5.0)) == [(0.0, 1.0, "none"), (2.0, 5.0, "gripper")]
    assert list(LoadTimeline(()).certain(5.0)) == []


def test_a_step_of_the_base_load_shows_when_the_tool_came(
    new_run: Callable[[], Any], tmp_path: Path
) -> None:
    run = new_run()
    run.rest(1.0, Mode.STAND_ON_MOTORS, HOME, "none")
    run.rest(2.0, Mode.STAND_ON_MOTORS, HOME, "gripper")
    recording = read_recording(run.record(tmp_path / "a.mcap"))
    stale = (
        TextEvent(0.0, "load", "none"),
        TextEvent(1.6, "load", "none"),
        TextEvent(2.6, "load", "gripper"),
    )
    (none, gripper) = load_timeline(replace(recording, loads=stale)).certain(3.0)
    assert none[1] == pytest.approx(1.0, abs=0.011)
    assert gripper[0] == pytest.approx(1.0, abs=0.011)


@pytest.mark.parametrize(
    ("load", "attach", "detach", "expected"),
    [
        ("none", "gripper", "", "gripper"),
        ("gripper", "part", "", "gripper+part"),
        ("gripper+part", "", "part", "gripper"),
        ("gripper", "", "gripper", "none"),
    ],
)
def test_loads_follow_the_steps(load: str, attach: str, detach: str, expected: str) -> None:
    assert load_after(load, attach, detach) == expected
