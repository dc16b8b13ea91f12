"""What `ir demo` changes of a cell, and what it leaves as it is."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import pytest

from ir_cli.errors import CommandError
from ir_cli.output import Progress
from ir_cli.ros.demo import LONGEST_PAUSE, Demonstration, finish_recording, recorded
from ir_cli.ros.robots_demo import driven_together
from ir_description import load_cell
from ir_msgs_py.ros.client import ProgramRun
from ir_msgs_py.ros.spinning import Cancellation
from ir_msgs_py.ros.testing import PATIENCE
from ir_values.errors import CallTimedOutError, RequestRefusedError

STORY = {
    "_plan": RequestRefusedError("no path", -1),
    "_tour": CommandError("waited 30 s"),
    "_drive": RequestRefusedError("the robot is not ready", -6),
}


def pauses(demonstration: Demonstration) -> list[float]:
    return [step.dwell for step in demonstration._cell.program if step.kind == "PAUSE"]


def test_pauses_are_shortened_with_a_fact_that_says_so_and_real_ones_are_the_programs(
    tmp_path: Path,
) -> None:
    full = [step.dwell for step in load_cell("demo").program if step.kind == "PAUSE"]
    assert max(full) > LONGEST_PAUSE
    short = Demonstration("demo", tmp_path, 0, "nominal", Progress())
    assert max(pauses(short)) == LONGEST_PAUSE
    assert any(fact.startswith("shortened=") for fact in short._facts())
    real = Demonstration("demo", tmp_path, 0, "nominal", Progress(), real_pauses=True)
    assert pauses(real) == full
    facts = [fact.partition("=")[0] for fact in real._facts()]
    assert facts == ["seed", "plant", "safety_distance", "modes_at_rest"]
    assert "modes_at_rest=8" in real._facts()  # four modes, with the tool and without


@pytest.mark.parametrize("stage", ["_plan", "_tour", "_drive"])
def test_a_demonstration_that_ends_early_says_why_and_is_reported(
    stage: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    demonstration = Demonstration("demo", tmp_path, 0, "nominal", Progress())
    reached = []
    plan = SimpleNamespace(program_id="0")

    def done(name: str) -> SimpleNamespace:
        reached.append(name)
        if name == stage:
            raise STORY[stage]
        return plan

    for name in STORY:
        monkeypatch.setattr(demonstration, name, lambda *_, name=name: done(name))
    assert demonstration._story(None) == str(STORY[stage])
    assert reached[-1] == stage
    monkeypatch.setattr(demonstration, stage, lambda *_: plan)
    assert demonstration._story(None) == ""


class WaitingRecorder:
    """A client whose recorder answers once it is let."""

    def __init__(self) -> None:
        self.let = threading.Event()
        self.asked: list[str] = []

    def ask(self, service: str, request: object, timeout: float) -> None:
        self.asked.append(service)
        assert timeout > 600.0
        if not self.let.wait(PATIENCE):
            raise CallTimedOutError("closed")


def test_a_recording_is_finished_however_long_it_takes_while_the_nodes_live() -> None:
    alive: list[str] = []
    recorder = WaitingRecorder()

    def look(only: str) -> None:
        alive.append(only)
        if len(alive) == 2:
            recorder.let.set()

    finish_recording(recorder, SimpleNamespace(check=look))
    assert recorder.asked == ["/ir_recorder/stop"]
    assert len(alive) >= 2
    assert set(alive) == {"ir_recorder.node"}  # that another has died keeps it from nothing


def test_a_recorder_that_has_died_is_named_at_once() -> None:
    recorder = WaitingRecorder()

    def dead(only: str) -> None:
        raise CommandError("ir_recorder was killed")

    with pytest.raises(CommandError, match="ir_recorder was killed"):
        finish_recording(recorder, SimpleNamespace(check=dead))
    assert not recorder.let.is_set()  # it was not waited for
    recorder.let.set()


def test_a_recording_is_finished_whatever_ends_what_is_recorded(tmp_path: Path) -> None:
    asked: list[str] = []
    client = SimpleNamespace(ask=lambda service, *_: asked.append(service))
    nodes = SimpleNamespace(check=lambda only: None)
    with pytest.raises(KeyboardInterrupt), recorded(client, nodes, tmp_path / "x.mcap"):
        raise KeyboardInterrupt
    assert asked == ["/ir_recorder/start", "/ir_recorder/stop"]


def waiting(begun: threading.Event) -> Callable[..., ProgramRun]:
    """A robot that waits for another, and ends when it is given up."""

    def drive(give_up: Cancellation) -> ProgramRun:
        begun.set()
        ended = threading.Event()
        with give_up.calling(ended.set):
            canceled = ended.wait(PATIENCE)
        raise RequestRefusedError("canceled in step 1" if canceled else "waited too long", -7)

    return drive


def test_a_robot_that_fails_stops_the_others_and_its_reason_is_the_answer() -> None:
    begun = threading.Event()

    def failing(give_up: Cancellation) -> ProgramRun:
        assert begun.wait(60.0)
        raise RequestRefusedError("the robot is not ready", -6)

    runs, failed = driven_together({"left": waiting(begun), "right": failing})
    assert not runs
    assert failed == "right: the robot is not ready; then left: canceled in step 1"
    run = ProgramRun(1, 2.0, 3.0)
    whole = {robot: lambda give_up: run for robot in ("left", "right")}
    assert driven_together(whole) == ({"left": run, "right": run}, "")


def test_ctrl_c_stops_every_robot() -> None:
    begun = {robot: threading.Event() for robot in ("left", "right")}

    def press() -> None:
        for each in begun.values():
            each.wait(60.0)
        os.kill(os.getpid(), signal.SIGINT)

    threading.Thread(target=press, daemon=True).start()
    before = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        driven_together({robot: waiting(each) for robot, each in begun.items()})
    assert time.monotonic() - before < 30.0  # nobody waited too long
