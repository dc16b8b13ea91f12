"""`ir view`: what browsers are shown when files, hands and plans change, and how the command
ends.
"""

from __future__ import annotations

import importlib.util
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_cli.main import main
from ir_cli.view.background import Inbox
from ir_cli.view.cell_file import STILL, Recorded, Watched
from ir_cli.view.clearance import names_in
from ir_cli.view.playback import motion_of
from ir_cli.view.session import Session, ShownCell
from ir_description import load_cell
from ir_planner import Planner
from ir_recorder.report.data import side_content

PATIENCE = 60.0  # s: a busy machine
REFUSED = ("can't stand there", "is no machine")
CELL = """\
format: ir_cell/1
name: small  # a comment
robot: kr6_r900_2
home_deg: [0, -90, 90, 0, 45, 0]
tcp: {xyz: [0.05, 0, 0]}
equipment:
  - name: table
    pose: {xyz: [0.6, 0, 0]}  # where the fitters put it
    bodies: [{name: top, kind: box, size: [0.4, 0.6, 0.2], xyz: [0, 0, 0.1]}]
    stations:
      - {name: pick, pose: {xyz: [-0.05, 0.1, 0.45], abc_deg: [0, 90, 0]}, approach_distance: 0.1}
program:
  - {station: pick, dwell: 0.1}
  - {posture: home}
"""


def _module(name: str) -> Any:
    path = Path(__file__).with_name(f"{name}.py")
    spec = importlib.util.spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


FakeBrowser = _module("fake_browser").FakeBrowser


class View:
    """A session and a browser that looks at it."""

    def __init__(self, shown: Any) -> None:
        self.session = Session(shown)
        self.port = self.session.server.port
        self.token = self.session.server.guard.token
        self.browser = FakeBrowser(self.port, self.token)

    @property
    def stage(self) -> ShownCell:
        assert self.session._shown_cell is not None
        return self.session._shown_cell

    def until(self, condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, self.browser.text
            self.session.run(time.monotonic() + 0.02)

    def shows(self, *words: str) -> None:
        """Wait until the page says all of this."""
        self.until(lambda: all(word in self.browser.text for word in words))

    def planned(self) -> None:
        """Wait until a plan is shown."""
        self.until(lambda: (self.browser.state.get("plan") or {}).get("state") == "planned")

    def close(self) -> None:
        self.browser.close()
        self.session.close()


def write(path: Path, text: str) -> None:
    """Save a file, as an editor does."""
    new = path.with_suffix(".new")
    new.write_text(text)
    new.replace(path)


@pytest.fixture
def path(tmp_path: Path) -> Path:
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    return path


@pytest.fixture
def view(path: Path) -> Iterator[View]:
    started = View(Watched(str(path)))
    yield started
    started.close()


def names(scene: dict[str, Any]) -> set[str]:
    """Bodies and stations that are drawn."""
    drawn = scene["scene"]
    return {each["name"] for each in (*drawn["bodies"], *drawn["stations"])}


def test_the_cell_is_drawn_checked_and_planned(view: View) -> None:
    view.shows("pick with none", "cycle", "energy a cycle", "clearance and limits proved")
    view.planned()
    scene = view.browser.scene()
    assert names(scene) == {"top", "pick"}
    assert scene["scene"]["frames"] > 2
    assert scene["power"] is not None
    assert [joint["name"] for joint in scene["joints"]] == ["A1", "A2", "A3", "A4", "A5", "A6"]


@pytest.mark.long
def test_a_saved_file_is_shown_and_one_with_errors_keeps_the_last_cell(
    view: View, path: Path
) -> None:
    view.planned()
    write(
        path,
        CELL.replace("size: [0.4, 0.6, 0.2]", "size: [0.4, -0.6, 0.2]").replace("dwell", "dwel"),
    )
    view.shows(
        "the last cell that could be read is shown",
        "bodies[0].size[1] is -0.6 m",
        "small.yaml:13",
        "dwel",
    )
    assert names(view.browser.scene()) == {"top", "pick"}
    renamed = CELL.replace("name: top", "name: other_top").replace("name: pick", "name: place")
    write(path, renamed.replace("station: pick", "station: place"))
    view.shows("place with none")
    view.until(lambda: not view.browser.state.get("errors"))
    view.planned()
    assert names(view.browser.scene()) == {"other_top", "place"}


def test_a_file_that_is_wrong_from_the_start_is_shown_as_soon_as_it_can_be_read(
    path: Path,
) -> None:
    path.write_text(CELL.replace("robot: kr6_r900_2", "robot: kr6_r900_3"))
    view = View(Watched(str(path)))
    try:
        view.shows("kr6_r900_3", "is unknown")
        assert view.browser.get("/scene")[0] == 404
        write(path, CELL)
        view.planned()
    finally:
        view.close()


def test_what_cannot_be_reached_says_why_and_shows_the_pair_in_red(view: View, path: Path) -> None:
    write(path, CELL.replace("0.1, 0.45]", "0.1, 0.16]"))
    view.shows("0 of ", "none is free", "not planned")
    view.until(lambda: "top" in view.browser.state["blamed"])
    assert any(name.startswith("l") for name in view.browser.state["blamed"])


def test_sliders_move_the_robot_and_the_nearest_pair(view: View) -> None:
    view.planned()
    view.browser.press("joints", [0.0, -20.0, 90.0, 0.0, 45.0, 0.0])
    view.until(lambda: view.browser.state.get("hand") is True)
    assert view.stage.q[1] == pytest.approx(np.radians(-20.0))
    view.shows("nearest ")
    view.browser.press("at", "pick")
    view.shows("robot at pick")
    view.browser.press("joints", [1.0])
    view.shows("the robot has 6 joints")
    far = view.stage.cell.robot.position_max
    view.browser.press("joints", [9999.0] * 6)
    view.until(lambda: np.allclose(view.stage.q, far))


def test_a_machine_is_moved_checked_planned_and_saved_with_its_comments(
    view: View, tmp_path: Path
) -> None:
    view.planned()
    before = view.browser.state["scene"]
    for k in range(200):  # a quick hand
        view.browser.press("move", ["machine table", 0.6 + 0.0001 * k, 0.05, 0.0, 0.0, 0.0, 0.0])
    view.browser.press("move", ["machine table", 0.62004, 0.1, 0.0, 0.0, 0.0, 0.0])
    view.shows("pose: {xyz: [0.62, 0.1, 0]}")
    assert "table" in view.browser.state["moved"]
    assert "pick" in view.browser.state["stood"]
    view.until(lambda: view.browser.state["scene"] != before)
    view.planned()
    assert view.browser.state["moved"] == {}  # the new scene has it there
    view.browser.press("save")
    view.shows("written: ")
    saved = tmp_path / "small_moved.yaml"
    assert saved.read_text() == CELL.replace(
        "pose: {xyz: [0.6, 0, 0]}", "pose: {xyz: [0.62, 0.1, 0]}"
    )
    view.browser.press("undo")
    view.until(lambda: "pose: {" not in view.browser.text)
    for wrong in (["machine table", 1e8, 0, 0, 0, 0, 0], ["machine table", 1], ["table"], []):
        view.browser.press("move", wrong)
        view.until(lambda: any(each in view.browser.text for each in REFUSED))
        view.browser.press("joints", [0.0, -90.0, 90.0, 0.0, 45.0, 0.0])
        view.until(lambda: view.browser.state["note"] == "")


def test_a_station_is_moved_in_its_machine(view: View) -> None:
    view.planned()
    pose = list(view.browser.state["poses"]["station pick"])
    view.browser.press("move", ["station pick", *pose[:2], pose[2] + 0.05, *pose[3:]])
    view.shows("# station pick", "pose: {xyz: [-0.05, 0.1, 0.5], abc_deg: [0, 90, 0]}")
    view.planned()


def test_planning_is_cancelled_and_asked_for_again(view: View, path: Path) -> None:
    view.browser.press("cancel")
    view.shows("planning was cancelled")
    view.browser.press("plan")
    view.planned()
    write(path, CELL.replace("0.45]", "0.46]"))  # while it is planned
    write(path, CELL.replace("0.45]", "0.47]"))
    view.until(lambda: abs(view.stage.cell.station("pick").pose[2, 3] - 0.47) < 1e-9)
    view.planned()


def test_a_time_of_the_motion_has_its_step_power_and_nearest_pair(view: View) -> None:
    view.planned()
    view.browser.press("time", 0.5)
    view.shows("regional", " W", "nearest ")
    assert view.browser.state["hand"] is False


@pytest.mark.long
def test_it_is_compared_with_what_a_robot_does_today(view: View) -> None:
    view.planned()
    view.browser.press("compare")
    view.shows("planned program", "against the common program", "0.2 EUR/kWh")


def test_viewers_come_and_go(view: View) -> None:
    view.planned()
    others = [FakeBrowser(view.port, view.token) for _ in range(5)]
    view.until(lambda: all("cycle" in each.text for each in others))
    for each in others:
        each.close()
    view.browser.press("joints", [20.0, -90.0, 90.0, 0.0, 45.0, 0.0])
    view.until(lambda: abs(view.stage.q[0] - np.radians(20.0)) < 1e-9)


def test_only_who_has_the_address_with_its_token_gets_an_answer(view: View) -> None:
    host = f"127.0.0.1:{view.port}"
    for token in ("", "guessed", view.token[:-1]):
        stranger = FakeBrowser(view.port, token)
        assert stranger.answer.status == 403
        assert stranger.get("/scene")[0] == 403
        assert stranger.press("plan")[0] == 403
    assert FakeBrowser(view.port, view.token, Origin="http://evil.example").answer.status == 403
    assert FakeBrowser(view.port, view.token, Host="evil.example").answer.status == 403
    status, page = FakeBrowser(view.port, "").get("/")
    assert status == 200
    assert b"kr6_r900" not in page  # nothing of the cell
    assert view.session.server.address == f"http://{host}/#{view.token}"


@pytest.mark.parametrize(
    ("name", "value", "status"),
    [
        ("plan", None, 400),
        ("plan", {"a": 1}, 400),
        ("joints", [None], 400),
        ("joints", [0.0] * 65, 400),
        ("at", "x" * 201, 400),
        ("time", 1e300, 400),
        ("plan", "now", 200),
        ("time", True, 200),
        ("reboot", True, 200),
    ],
)
def test_what_no_control_sends_is_refused(view: View, name: str, value: Any, status: int) -> None:
    found, answer = view.browser.press(name, value)
    assert found == status
    assert not answer.get("done")


@pytest.mark.long
def test_a_recording_is_replayed_and_its_cell_planned(tmp_path: Path) -> None:
    planned = tmp_path / "plan.mcap"
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    assert main(["plan", str(path), "-o", str(planned)]) == 0
    view = View(Recorded(str(planned)))
    try:
        view.until(lambda: (view.browser.state.get("plan") or {}).get("state") == "recorded")
        assert names(view.browser.scene()) == {"top", "pick"}
        assert view.browser.state["origin"] == "Predicted, not driven"
        assert view.browser.state["source"] == "recording plan.mcap"
        assert [tile[0] for tile in view.browser.state["tiles"]][-1] == "least clearance"
        view.browser.press("plan")
        view.planned()
        view.browser.press("recorded")
        view.until(lambda: view.browser.state["plan"]["state"] == "recorded")
    finally:
        view.close()


def test_the_latest_of_each_kind_waits_in_the_order_in_which_it_came() -> None:
    inbox = Inbox()
    seen = list[str]()
    for key, word in (("a", "old"), ("b", "b"), ("a", "new")):
        inbox.post(key, lambda word=word: seen.append(word))  # type: ignore[misc]
    for action in inbox.take(0.0):
        action()
    assert seen == ["b", "new"]
    assert inbox.take(0.0) == []


def test_a_file_is_read_when_it_is_no_longer_written(tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    watched = Watched(str(path))
    assert watched.read().cell is not None
    assert not watched.changed(0.0)
    path.write_text(CELL[:100])
    assert not watched.changed(1.0)
    path.write_text(CELL[:200])
    assert not watched.changed(1.0 + STILL)
    assert watched.changed(1.0 + 2.0 * STILL)
    assert watched.read().cell is None
    (tmp_path / "part.stl").write_bytes(b"")  # a mesh beside it
    assert not watched.changed(2.0)
    assert watched.changed(3.0)
    path.unlink()
    assert not watched.changed(4.0)
    assert watched.changed(5.0)
    assert "can't be opened" in watched.read().errors[0]


def test_sentences_name_bodies_and_capsules() -> None:
    cell = load_cell("demo")
    sentence = "l6 too near lathe_roof (4), 1 m from the robot's base."
    assert names_in(sentence, cell) == {"l6", "lathe_roof"}


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["demon"], "did you mean"),
        (["nowhere.mcap"], "is not a file"),
        (["nowhere.yaml"], "is not a file"),
        (["demo", "--port", "70000"], "0 .. 65535"),
        (["demo", "--seconds", "soon"], "number of seconds"),
    ],
)
def test_what_makes_no_sense_is_refused(
    words: list[str], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        code = main(["view", *words])
    except SystemExit as ended:
        code = ended.code  # type: ignore[assignment]
    assert code == 2
    assert sentence in capsys.readouterr().err


def test_a_taken_port_is_refused_and_two_views_stand_side_by_side(
    view: View, path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", str(path), "--port", str(view.port), "--seconds", "0"]) == 1
    assert "can't be listened on" in capsys.readouterr().err
    assert main(["view", str(path), "--seconds", "0"]) == 0
    assert capsys.readouterr().out.startswith("http://127.0.0.1:")


@pytest.mark.long
def test_ctrl_c_ends_it_and_what_it_plans() -> None:
    process = subprocess.Popen(
        [sys.executable, "-m", "ir_cli.main", "view", "demo", "--port", "0"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline().startswith("http://127.0.0.1:")
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=PATIENCE)
    finally:
        process.kill()
    assert process.returncode == 130
    assert said == ""


def test_the_hottest_colour_is_the_peak_of_the_plan() -> None:
    """As `ir plan` and a comparison say it, not the largest of the samples that are drawn."""
    planner = Planner("open", clock=lambda: 0.0)
    plan = planner.plan_program(stations=("p1", "home"), start=planner.cell.machine_home)
    motion = motion_of(plan.movements, planner.cell)
    assert motion is not None
    content = side_content(motion.side, planner.cell)
    assert content["peak"] == plan.report.peak_power >= motion.side.watts.max()


@pytest.mark.parametrize("words", [["live", "demo"], ["view"], ["view", "demo", "--live"]])
def test_a_cell_or_the_running_one_has_to_be_named(
    words: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    assert "or --live" in capsys.readouterr().err
