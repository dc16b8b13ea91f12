"""A plan that was never driven is a recording like any other: read, reported, planned again."""

from __future__ import annotations

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.serialization import deserialize_message
from rosbags.highlevel import AnyReader

from ir_cli.main import main
from ir_description import load_cell
from ir_msgs.msg import RecordedCall
from ir_msgs.srv import PlanProgram
from ir_msgs_py.search_log import ConfigurationLog
from ir_recorder import Analysis, Verdict, analyse, findings, read_recording, summary
from ir_recorder.analysis.production import planned_interval, production_of
from ir_recorder.reading.mcap_file import RawRecording, read_raw
from ir_recorder.report import report_html
from ir_recorder.report.number_text import joules, kilowatt_hours
from ir_recorder.report.side_by_side import comparison_html


def assert_planned_figures_are_those_of_the_answer(analysis: Analysis, raw: RawRecording) -> None:
    calls = raw.channel("/ir_planner/calls")
    assert calls is not None
    call = deserialize_message(calls.messages[-1], RecordedCall)
    answer = deserialize_message(bytes(call.response), PlanProgram.Response)
    steps = answer.movements
    planned = analysis.recording.planned
    report = answer.report
    assert planned_interval(analysis.recording) == (report.energy_low, report.energy_high)
    assert [step.report.energy for step in planned] == [step.report.energy for step in steps]
    assert [step.duration for step in planned] == [step.duration for step in steps]
    assert [step.from_station for step in planned] == [step.from_station for step in steps]
    assert analysis.problems == ()  # nothing is missing: nothing was driven
    energy = kilowatt_hours(sum(step.report.energy for step in steps))
    drawn = report_html(analysis, ())
    cycle = production_of(analysis)
    assert cycle is not None
    assert f"<b>{kilowatt_hours(cycle.energy)}</b>" in drawn
    assert analysis.recording.planned_certified == report.certified
    assert ("proved: free of collision" in drawn) == report.certified
    page = comparison_html([(analysis, ()), (analysis, ())])
    assert page.count(f"<b>{energy}</b>") >= 2
    assert page.count("predicted, not driven") == 3
    assert page.count(f"<b>{joules(steps[0].report.energy)}</b>") >= 2


@pytest.mark.long
def test_a_plan_that_was_never_driven_is_recorded_and_planned_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    plan = ["plan", "demo", "--stations", "outfeed_place", "--seed", "3", "-o", "plan.mcap"]
    assert main(plan) == 0
    raw = read_raw(tmp_path / "plan.mcap")
    assert raw.problems == ()
    assert raw.attachment("cell.yaml") is not None
    assert raw.attachment("ir_planner.parameters.yaml") is not None
    planned = raw.channel("/ir_planner/planned_trajectory")
    assert planned is not None
    assert len(planned.messages) >= 2
    with AnyReader([tmp_path / "plan.mcap"]) as reader:
        assert reader.message_count == sum(len(channel.messages) for channel in raw.channels)
    analysis = analyse(read_recording(tmp_path / "plan.mcap"))
    assert summary(findings(analysis))[0] is Verdict.NOT_CHECKED  # nothing was driven
    assert_planned_figures_are_those_of_the_answer(analysis, raw)
    (search,) = analysis.recording.searches  # configurations above the conveyor are searched
    assert isinstance(search, ConfigurationLog)
    page = report_html(analysis, ())
    doors = "assumed, as the cell has them: lathe door_open"
    assert f"of {search.starts} random starts {search.accepted} were accepted" in page
    assert f"<li>doors at the start <b>{doors}</b></li>" in page
    assert capsys.readouterr().out.endswith(f"\nnote: doors at the start are {doors}\n")
    assert main(["ros", "replan", "plan.mcap"]) == 0
    assert "1 of 1 requests planned again with equal ids" in capsys.readouterr().out
    assert main(plan) == 1
    assert "is there already" in capsys.readouterr().err


def data_of(page: str) -> dict[str, Any]:
    """What the page's scripts draw."""
    (text,) = re.findall(r'<script[^>]*id="data"[^>]*>(.*?)</script>', page, re.DOTALL)
    data: dict[str, Any] = json.loads(text)
    return data


def assert_motion_is_that_of_the_plan(page: str, answer: dict[str, Any]) -> None:
    """The picture moves as long as the plan, from home, with the joules of the plan under its
    power.
    """
    drawn = data_of(page)
    scene = drawn["scene"]
    assert drawn["end"] == pytest.approx(answer["seconds"])
    shorts = {
        name: np.frombuffer(base64.b64decode(scene[name]), "<i2")
        for name in ("jointValues", "power")
    }
    q = scene["jointSteps"] * shorts["jointValues"].reshape(scene["frames"], 6)
    assert q[0] == pytest.approx(load_cell("kr6_bench").park, abs=2e-4)
    joules = float(shorts["power"].sum()) * scene["step"]
    assert joules == pytest.approx(answer["joules"], rel=0.05)
    assert [span[2] for span in drawn["lanes"][0]["spans"]][-1] == "pick"
    assert drawn["blamed"] == []


def test_a_plan_is_a_page_and_a_failed_one_says_which_pair_is_in_the_path(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    asked = ["plan", "kr6_bench", "--stations", "pick", "--json", "-o"]
    assert main([*asked, "found.html"]) == 0
    found = (tmp_path / "found.html").read_text()
    assert "planned program" in found
    assert_motion_is_that_of_the_plan(found, json.loads(capsys.readouterr().out))
    assert main([*asked, "failed.html", "--safety-distance", "0.05"]) == 1
    sentence = capsys.readouterr().err.splitlines()[-1]
    assert "base too near l2" in sentence
    failed = (tmp_path / "failed.html").read_text()
    assert "base too near l2" in failed
    drawn = data_of(failed)
    assert drawn["blamed"] == ["base", "l2"]
    assert {body["name"] for body in drawn["scene"]["bodies"]} >= {"tray_in_top", "divider"}
    assert {"base", "l2"} <= {shape["name"] for shape in drawn["scene"]["shapes"]}


def test_recordings_are_no_programs_to_compare(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["compare", "a.mcap", "b.mcap"]) == 2
    assert "a.mcap: a recording, not a cell: use ir report a.mcap b.mcap" in capsys.readouterr().err
