"""A plan that was never driven is a recording like any other: read, reported, planned again."""

from __future__ import annotations

from pathlib import Path

import pytest
from rosbags.highlevel import AnyReader

from ir_cli.main import main
from ir_recorder import Verdict, analyse, findings, read_recording, summary
from ir_recorder.read.raw import read_raw


def test_a_plan_that_was_never_driven_is_recorded_and_planned_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    plan = ["plan", "demo", "--stations", "infeed_pick", "--seed", "3", "--record", "plan.mcap"]
    assert main(plan) == 0
    raw = read_raw(tmp_path / "plan.mcap")
    assert raw.problems == ()
    assert raw.attachment("cell.yaml") is not None
    assert raw.attachment("ir_planner.parameters.yaml") is not None
    assert len(raw.channel("/ir_planner/planned_trajectory").messages) >= 2
    with AnyReader([tmp_path / "plan.mcap"]) as reader:
        assert reader.message_count == sum(len(channel.messages) for channel in raw.channels)
    checks = findings(analyse(read_recording(tmp_path / "plan.mcap")))
    assert summary(checks)[0] is Verdict.NOT_CHECKED  # nothing was driven
    capsys.readouterr()
    assert main(["replan", "plan.mcap"]) == 0
    assert "1 of 1 requests planned again with equal ids" in capsys.readouterr().out
    assert main(plan) == 1
    assert "is there already" in capsys.readouterr().err
