"""`ir view`: what browsers are shown when files, hands and plans change, and how the command
ends.
"""

from __future__ import annotations

import importlib.util
import signal
import subprocess
import sys
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from websockets.exceptions import InvalidStatus

from ir_cli.main import main
from ir_cli.view import server as loopback
from ir_cli.view.background import Inbox
from ir_cli.view.cell_file import STILL, Watched
from ir_cli.view.clearance import names_in
from ir_cli.view.panel import legend_html
from ir_cli.view.playback import motion_of
from ir_cli.view.server import closed, opened
from ir_cli.view.session import Session
from ir_description import load_cell
from ir_planner import Planner

PATIENCE = 60.0  # s: a busy machine
DIRECT = urllib.request.build_opener(urllib.request.ProxyHandler({}))  # what is here needs no proxy
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
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


FakeBrowser = _module("fake_browser").FakeBrowser
TOKEN = "a-token_of-the-test"


class View:
    """A session and a browser that looks at it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.server = opened(0, TOKEN)
        self.session = Session(self.server, Watched(str(path)))
        self.port = self.server.get_port()
        self.browser = FakeBrowser(self.port, TOKEN)

    def until(self, condition: Callable[[], bool]) -> None:
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, self.browser.text
            self.session.run(time.monotonic() + 0.02)

    def shows(self, *words: str) -> None:
        """Wait until the panel says all of this."""
        self.until(lambda: all(word in self.browser.text for word in words))

    def draws(self, *names: str) -> None:
        """Wait until all these are in the scene."""
        self.until(lambda: set(names) <= set(self.browser.nodes))

    def change(self, label: str, value: Any) -> None:
        """Give a control another value as soon as it is there."""
        labels = lambda: {each.get("label") for each in list(self.browser.controls.values())}  # noqa: E731
        self.until(lambda: label in labels())
        self.browser.change(label, value)

    def write(self, text: str) -> None:
        """Save the file, as an editor does."""
        new = self.path.with_suffix(".new")
        new.write_text(text)
        new.replace(self.path)

    def close(self) -> None:
        self.browser.close()
        self.session.close()
        closed(self.server)


@pytest.fixture
def view(tmp_path: Path) -> Iterator[View]:
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    started = View(path)
    yield started
    started.close()


def test_the_cell_is_drawn_checked_and_planned(view: View) -> None:
    view.shows("pick with none", "at the mains", "nearest ", " mm: ")
    view.draws("/machines/table/top", "/machines/table/zone", "/machines/table/station_pick")
    view.draws("/path", *(f"/robot/link_{k}" for k in range(7)))
    view.until(lambda: view.browser.nodes["/path"].get("visible") is True)


def test_a_saved_file_is_shown_and_one_with_errors_keeps_the_last_cell(view: View) -> None:
    view.shows("at the mains")
    view.write(
        CELL.replace("size: [0.4, 0.6, 0.2]", "size: [0.4, -0.6, 0.2]").replace("dwell", "dwel")
    )
    view.shows(
        "the last cell that could be read is shown",
        "bodies[0].size[1] is -0.6 m",
        "small.yaml:13",
        "dwel",
    )
    view.draws("/machines/table/top")
    renamed = CELL.replace("name: top", "name: other_top").replace("name: pick", "name: place")
    view.write(renamed.replace("station: pick", "station: place"))
    view.shows("place with none", "at the mains")
    view.until(lambda: "can&#x27;t be read" not in view.browser.text)
    view.draws("/machines/table/other_top")
    view.until(lambda: "/machines/table/top" not in view.browser.nodes)


@pytest.mark.long
def test_a_file_that_is_wrong_from_the_start_is_shown_as_soon_as_it_can_be_read(
    tmp_path: Path,
) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(
        CELL.replace("robot: kr6_r900_2", "robot: kr6_r900_3 # <img src=x onerror=alert(1)>")
    )
    view = View(path)
    try:
        view.shows("kr6_r900_3", "is unknown")
        assert "<img" not in view.browser.text
        view.write(CELL)
        view.shows("at the mains")
    finally:
        view.close()


def test_what_cannot_be_reached_says_why_and_shows_the_pair_in_red(view: View) -> None:
    view.write(CELL.replace("0.1, 0.45]", "0.1, 0.16]"))
    view.shows("0 of ", "none is free", "not planned")
    view.until(lambda: "top" in view.browser.red())
    view.until(lambda: any(name.startswith("l") for name in view.browser.red()))


def test_sliders_move_the_robot_and_the_nearest_pair(view: View) -> None:
    view.shows("at the mains")
    view.until(lambda: "position" in view.browser.nodes.get("/robot/link_6", {}))
    before = view.browser.nodes["/robot/link_6"]["position"]
    view.change("A2", -20.0)
    view.until(lambda: abs(view.session._stage.q[1] - np.radians(-20.0)) < 1e-9)
    view.until(lambda: view.browser.nodes["/robot/link_6"]["position"] != before)
    view.shows("top")  # it comes down to the table
    cell = load_cell(view.path)
    view.until(lambda: view.session._stage.near is not None)
    assert set(view.session._stage.near.names) <= {c.name for c in cell.capsules()} | {
        "top",
        "floor",
    }
    view.change("A2", float("nan"))  # from a program that is no browser
    view.change("A1", 10.0)
    view.until(lambda: abs(view.session._stage.q[0] - np.radians(10.0)) < 1e-9)


def test_a_machine_is_dragged_checked_planned_and_saved_with_its_comments(
    view: View, tmp_path: Path
) -> None:
    view.shows("at the mains")
    view.change("drag", "machine table")
    view.until(lambda: "/drag" in view.browser.nodes)
    for k in range(200):  # a quick hand
        view.browser.drag((0.6 + 0.0001 * k, 0.05, 0.0))
    view.browser.drag((0.62004, 0.1, 0.0))
    view.shows("pose: {xyz: [0.62, 0.1, 0]}", "at the mains")
    view.change("Save as a new file", True)
    view.shows("written: ")
    saved = tmp_path / "small_moved.yaml"
    assert saved.read_text() == CELL.replace(
        "pose: {xyz: [0.6, 0, 0]}", "pose: {xyz: [0.62, 0.1, 0]}"
    )
    view.change("Undo all moves", True)
    view.until(lambda: "pose: {" not in view.browser.text)
    view.browser.drag((float("nan"), 0.0, 0.0))
    view.shows("can&#x27;t stand there")


@pytest.mark.long
def test_a_station_is_dragged_in_its_machine(view: View) -> None:
    view.shows("at the mains")
    view.change("drag", "station pick")
    view.until(lambda: "/drag" in view.browser.nodes)
    wxyz = view.browser.nodes["/drag"]["wxyz"]
    view.browser.drag((0.55, 0.1, 0.5), wxyz)
    view.shows(
        "# station pick", "pose: {xyz: [-0.05, 0.1, 0.5], abc_deg: [0, 90, 0]}", "at the mains"
    )


@pytest.mark.long
def test_planning_is_cancelled_and_asked_for_again(view: View) -> None:
    view.change("Cancel planning", True)
    view.shows("planning was cancelled")
    view.change("Plan again", True)
    view.shows("at the mains")
    view.write(CELL.replace("0.45]", "0.46]"))  # while it is planned
    view.write(CELL.replace("0.45]", "0.47]"))
    view.until(lambda: abs(view.session._stage.cell.station("pick").pose[2, 3] - 0.47) < 1e-9)
    view.shows("at the mains")


@pytest.mark.long
def test_the_motion_is_played_with_power_and_nearest_pair(view: View) -> None:
    view.shows("at the mains")
    view.change("Play", True)
    view.shows("regional", " kW")
    view.until(lambda: view.session._playback.time > 0.3)
    view.change("Stop", True)
    view.until(lambda: not view.session._playback.runs)


@pytest.mark.long
def test_viewers_come_and_go(view: View) -> None:
    view.shows("at the mains")
    others = [FakeBrowser(view.port, TOKEN) for _ in range(5)]
    view.until(lambda: all("at the mains" in each.text for each in others))
    for each in others:
        each._socket.socket.close()  # without a word
    view.change("A1", 20.0)
    view.until(lambda: abs(view.session._stage.q[0] - np.radians(20.0)) < 1e-9)


def test_pages_from_elsewhere_are_refused_and_nothing_is_published(view: View) -> None:
    with pytest.raises(InvalidStatus):
        FakeBrowser(view.port, TOKEN, "http://evil.example")
    FakeBrowser(view.port, TOKEN, f"http://localhost:{view.port}").close()
    handled = view.server._websock_server._incoming_handlers
    shared = [
        handlers for message, handlers in handled.items() if message.__name__.startswith("ShareUrl")
    ]
    assert [handlers for handlers in shared if handlers] == []
    assert view.server.get_host() == "127.0.0.1"


def _asked(url: str, cookie: str = "") -> tuple[int, str]:
    """Status of a page and the cookie that it sets."""
    request = urllib.request.Request(url, headers={"Cookie": cookie} if cookie else {})
    try:
        with DIRECT.open(request, timeout=PATIENCE) as answer:
            return answer.status, answer.headers.get("Set-Cookie", "")
    except urllib.error.HTTPError as error:
        with error:
            return error.code, error.headers.get("Set-Cookie", "")


def test_only_who_has_the_address_with_its_token_gets_an_answer(view: View) -> None:
    page = f"http://127.0.0.1:{view.port}/"
    name = f"ir_view_{view.port}"
    for url, cookie in (
        (page, ""),
        (page + "?token=", ""),
        (page + "?token=guessed", ""),
        (page + "?token=" + TOKEN[:-1], f"{name}="),
        (page + "assets/any.js", f"{name}=guessed"),
        (page, f"{name}_=" + TOKEN),
        (page, "\xff; ;=" + TOKEN),
    ):
        assert _asked(url, cookie) == (403, ""), (url, cookie)
    status, cookie = _asked(page + "?token=" + TOKEN)
    assert (status, cookie) == (200, f"{name}={TOKEN}; Path=/; HttpOnly; SameSite=Strict")
    assert _asked(page, cookie.split(";")[0]) == (200, "")
    with pytest.raises(InvalidStatus):
        FakeBrowser(view.port, "guessed")


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


def test_without_viser_it_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(loopback, "find_spec", lambda name: None)
    assert main(["view", "demo"]) == 2
    assert 'pip install "ir_cli[view]"' in capsys.readouterr().err


def test_a_taken_port_is_refused_and_two_views_stand_side_by_side(
    view: View, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["view", str(view.path), "--port", str(view.port), "--seconds", "0"]) == 1
    assert "is taken" in capsys.readouterr().err
    assert main(["view", str(view.path), "--seconds", "0"]) == 0
    assert capsys.readouterr().out.startswith("http://127.0.0.1:")


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


def test_the_legend_says_the_peak_of_the_plan() -> None:
    """As `ir plan` and a comparison say it, not the largest of the samples that are drawn."""
    planner = Planner("open", clock=lambda: 0.0)
    plan = planner.plan_program(stations=("p1", "home"), start=planner.cell.machine_home)
    motion = motion_of(plan.movements, planner.cell, planner.scene)
    assert motion is not None
    assert motion.watts.max() <= motion.peak == plan.report.peak_power
    assert f"to {plan.report.peak_power / 1e3:.1f} kW at the mains" in legend_html(motion)
