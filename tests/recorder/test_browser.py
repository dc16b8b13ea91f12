"""The page in a real browser: every control operated, at a desk, on a tablet, on a phone and on
paper.

Needs Chromium. Without it these tests say `not checked: browser`; where CI=true it has to be there.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

import axe_core_python
import numpy as np
import pytest

from ir_description import cell_to_yaml, load_cell
from ir_recorder import Analysis, analyse, findings, read_recording
from ir_recorder.live import LiveServer, Stream
from ir_recorder.live.cell_view import CellView, ReceivedCell
from ir_recorder.live.server import ButtonAnswer
from ir_recorder.report import report_html
from ir_recorder.report.side_by_side import comparison_html
from ir_studies.statistics.findings import findings_of
from ir_studies.statistics.outputs import page_html as statistics_html
from ir_studies.statistics.settings import StatisticsSettings

T = TypeVar("T")
CONTROLS = Path(__file__).with_name("page_controls.js").read_text().strip().split("\n\n")
DESK = (1400, 600)
TABLET = (768, 1024)
PHONE = (390, 844)
PAPER = (703, 1047)
BOXES = Path(__file__).with_name("page_boxes.js").read_text()
AXE = (Path(axe_core_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
FOUND = """axe.run(document, {resultTypes: ['violations']}).then(
    (found) => found.violations.map((one) =>
        `${one.id}: ${one.nodes.slice(0, 3).map((node) => node.html.slice(0, 120)).join(' | ')}`))
"""
WAIT_SECONDS = 60.0  # a busy machine
EVIL = "</script><img src=x onerror=document.title='EVIL'><b>&quot;</b>"


@pytest.fixture(scope="module")
def file(page: str, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("page") / "report.html"
    path.write_text(page)
    return path


def wait_for(find: Callable[[], T], page: Any) -> T:
    """What is found at last, if it is anything; the browser goes on meanwhile."""
    deadline = time.monotonic() + WAIT_SECONDS
    while not (found := find()):
        assert time.monotonic() < deadline, "nothing was found"
        page.frame()
    return found


def other(text: str, before: str) -> str:
    """The text, where it is another one than before."""
    return "" if text == before else text


def seconds(label: str) -> float:
    """The time that a label of a chart begins with."""
    return float(label.split(" s")[0])


def clean(page: Any) -> None:
    """No error was reported and nothing was asked of a network."""
    assert page.faults == []
    assert page.requests == []


def test_every_control_of_the_page_works(browser: Any, file: Path, tmp_path: Path) -> None:
    page = browser.open(file, *DESK)
    page.downloads(tmp_path)
    for script in CONTROLS:
        assert page.run(script) is True, script
    tables = page.run("document.querySelectorAll('main table').length")
    page.run("document.querySelectorAll('button.export').forEach((button) => button.click())")
    saved = wait_for(lambda: sorted(tmp_path.glob("what_a_cycle_costs.csv")), page)
    assert "full" in saved[0].read_text() or "this run" in saved[0].read_text()
    assert saved[0].read_text().count("\n") == 7
    charts = page.run(
        "document.querySelectorAll('main canvas, main .figure svg, main .bars').length"
    )
    assert page.run("document.querySelectorAll('button.export').length") == tables + charts
    assert tables >= 10
    clean(page)
    page.close()


def test_charts_zoom_together_and_say_their_values_right_after(browser: Any, file: Path) -> None:
    page = browser.open(file, *DESK)
    x, y, wide, _ = page.middle("#power")
    label = "document.getElementById('tip').textContent"
    drawn = "document.querySelector('#power').toDataURL()"
    before = page.run(drawn)
    page.drag((x - wide / 5, y + 60), (x + wide / 5, y + 60))
    page.wait("!document.getElementById('tip').hidden")
    wait_for(lambda: page.run(drawn) != before, page)
    page.frame()  # what was drawn first may have been the rectangle of the drag
    zoomed = page.run(label)
    page.pointer("mouseMoved", x - wide / 4, y + 60)
    page.frame()
    start = wait_for(lambda: other(page.run(label), zoomed), page)
    page.pointer("mouseMoved", x + wide / 4, y + 60)
    page.frame()
    later = wait_for(lambda: other(page.run(label), start), page)
    assert seconds(start) < seconds(later) <= seconds(zoomed) + 4.0
    page.run("document.querySelector('#clearance').focus()")
    page.key("0")  # by the keyboard, in another chart
    page.pointer("mouseMoved", x - wide / 4, y + 60)
    page.middle("#power")
    page.pointer("mouseMoved", x - wide / 4, y + 60)
    page.wait(f"{label}.includes(' W') && parseFloat({label}) < {seconds(start)}")
    page.key("ArrowRight")
    clean(page)
    page.close()


@pytest.mark.parametrize(("size", "dark"), [(TABLET, True), (PHONE, False)])
def test_nothing_is_cut_off_and_fingers_find_the_controls(
    browser: Any, file: Path, size: tuple[int, int], dark: bool
) -> None:
    page = browser.open(file, *size, dark=dark, touch=size == PHONE)
    assert page.run("document.documentElement.scrollWidth") == size[0]
    wider = """[...document.querySelectorAll('main *')]
        .filter((e) => !e.closest('.scroll, .unseen, .stage, svg'))
        .filter((e) => e.getBoundingClientRect().right > innerWidth + 1)
        .map((e) => e.outerHTML.slice(0, 80))"""
    assert page.run(wider) == []
    if size == PHONE:
        small = """[...document.querySelectorAll('button:not(.go), select')].filter((b) => b.offsetParent)
            .map((b) => b.getBoundingClientRect()).filter((b) => b.height < 43 || b.width < 43).length"""  # noqa: E501
        assert page.run(small) == 0
        over = """(() => { const stage = document.querySelector('.stage').getBoundingClientRect();
            return [...document.querySelectorAll('#motion button, #motion input')]
            .map((b) => b.getBoundingClientRect())
            .filter((c) => c.top < stage.bottom && c.bottom > stage.top).length; })()"""
        assert page.run(over) == 0
        assert page.run("getComputedStyle(document.getElementById('view')).touchAction") == "pan-y"
    clean(page)
    page.close()


def test_recordings_side_by_side_and_a_page_for_management(
    browser: Any, analysis: Analysis, file: Path, tmp_path: Path
) -> None:
    path = tmp_path / "compare.html"
    compared = [(each, ()) for each in (analysis, replace_path(analysis, EVIL.replace("/", "")))]
    path.write_text(comparison_html(compared))
    page = browser.open(path, *PHONE, touch=True)
    assert page.run("document.documentElement.scrollWidth") == PHONE[0]
    drawn = "document.querySelector('.axis-chart canvas').toDataURL()"
    both = page.run(drawn)
    page.run("document.querySelectorAll('.toggles input')[1].click()")
    wait_for(lambda: page.run(drawn) != both, page)
    assert page.run("document.querySelectorAll('img').length") == 0
    clean(page)
    page.close()
    page = browser.open(file, 740, 1094)
    page.call("Emulation.setEmulatedMedia", media="print")
    last = "(() => document.getElementById('levers').getBoundingClientRect().bottom + scrollY)()"
    assert page.run(last) <= 1045  # px of A4 between its margins
    shown = (
        "[...document.querySelectorAll('button.export, .toggles, #theme')].some((e) => "
        "e.offsetParent)"
    )
    assert page.run(shown) is False
    clean(page)
    page.close()


def replace_path(analysis: Analysis, name: str) -> Analysis:
    return replace(analysis, recording=replace(analysis.recording, path=Path(name)))


def test_what_a_cell_is_called_is_never_executed(
    browser: Any, demo_file: Path, tmp_path: Path
) -> None:
    recording = read_recording(demo_file)
    cell = recording.cell_yaml.replace("name: gripper", f"name: {EVIL!r}").replace(
        "name: press\n", f"name: {EVIL!r}\n"
    )
    events = tuple(
        replace(event, note=EVIL, movement=replace(event.movement, from_station=EVIL, load=EVIL))
        for event in recording.events
    )
    texts = (replace(recording.loads[0], text=EVIL, name=EVIL),)
    evil = replace(
        recording,
        cell_yaml=cell.replace("test_cell", f"'{EVIL.replace(chr(39), chr(39) * 2)}'"),
        events=events,
        facts=((EVIL, EVIL),),
        loads=texts,
        warnings=texts,
        problems=(EVIL,),
        hardware=EVIL,
        path=Path(EVIL.replace("/", "")),
    )
    analysis = analyse(evil)
    path = tmp_path / "evil.html"
    path.write_text(report_html(analysis, findings(analysis)))
    page = browser.open(path, *DESK)
    page.frame()
    assert page.run("document.title === 'EVIL'") is False
    assert page.run("document.querySelectorAll('img').length") == 0
    assert page.run("document.body.textContent.includes('onerror')") is True
    clean(page)
    page.close()


def test_a_page_of_an_empty_recording_has_no_error(
    browser: Any, demo_file: Path, tmp_path: Path
) -> None:
    recording = read_recording(demo_file)
    bare = replace(
        recording, power=None, joints=None, controller=None, events=(), loads=(), cell_yaml=""
    )
    path = tmp_path / "empty.html"
    path.write_text(report_html(analyse(bare), ()))
    page = browser.open(path, *TABLET)
    assert page.run("document.getElementById('no-motion').hidden") is False
    clean(page)
    page.close()


def test_a_study_is_light_or_dark_as_its_button_says(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "index.html"
    path.write_text(statistics_html(findings_of([]), StatisticsSettings("open")))
    page = browser.open(path, *DESK)
    page.run("document.getElementById('theme').click()")
    page.wait("document.documentElement.dataset.theme === 'dark'")
    clean(page)
    page.close()


@pytest.fixture
def live() -> Iterator[tuple[LiveServer, Stream, list[tuple[str, bool]]]]:
    """A live view of a cell whose words are made here; the presses of its buttons."""
    stream = Stream()
    pressed = list[tuple[str, bool]]()
    view = CellView()
    robot = load_cell("demo").robot

    def press(name: str, value: dict[str, Any]) -> ButtonAnswer:
        pressed.append((name, value["level"]))
        return ButtonAnswer(False, EVIL)

    server = LiveServer(stream, press, lambda: view.scene)
    text = cell_to_yaml(load_cell("demo"))
    for k in range(40):
        q = np.radians([k, -90.0, 90.0, 0.0, 0.0, 0.0])
        looked = view.look(ReceivedCell(text, joints=robot.joint_names, q=q, load="gripper"))
        levels = {"ab": False, "move_enable": True, "operating_mode": "EXT"}
        step = {"label": EVIL, "kind": EVIL, "event": "started", "at": [1, 27], "note": EVIL}
        machine = {"name": EVIL, "state": EVIL, "next": EVIL}
        values = {"w": [700.0 + k, 800.0 + k], "energy": 10.0 * k, "mode": "MOVING", "target": EVIL}
        texts = {
            "plant": EVIL,
            "load": "gripper",
            "contact": {"number": 1, "words": EVIL},
            "step": step,
        }
        lists = {
            "machines": [machine],
            "in": levels,
            "out": {"bbs": True},
            "q": [float(x) for x in q],
        }
        heard = {"driver": True, "planner": True, "runner": False}
        stream.add(
            {**looked, **values, **texts, **lists, "heard": heard, "bound": 0.02}, always=("w",)
        )
    ended = threading.Event()

    def go_on() -> (
        None
    ):  # as a node does: a page takes 3 s of silence for a connection that was lost
        while not ended.wait(0.2):
            stream.add({})

    talking = threading.Thread(target=go_on, daemon=True)
    talking.start()
    yield server, stream, pressed
    ended.set()
    talking.join()
    server.close()


LIVE_CONTROLS = (
    "document.getElementById('link').textContent === 'live'",
    "document.getElementById('subtitle').textContent.includes('not heard: runner')",
    "document.querySelectorAll('#tiles .tile').length === 5",
    "[...document.querySelectorAll('button, input')]"
    ".every((b) => b.textContent.trim() || b.closest('label'))",
    "[...document.querySelectorAll('canvas')].every((c) => c.getAttribute('aria-label'))",
    "(() => { document.querySelectorAll('[data-view], .views input').forEach((b) => b.click());"
    " return true; })()",
    "(() => { const root = document.documentElement; document.getElementById('theme').click();"
    " return Boolean(root.dataset.theme); })()",
    "document.querySelector('[data-bit=ab]').getAttribute('aria-pressed') === 'false'",
)


def test_the_live_view_shows_what_comes_and_asks_for_bits(
    browser: Any, live: tuple[LiveServer, Stream, list[tuple[str, bool]]]
) -> None:
    server, stream, pressed = live
    page = browser.open(server.address, *DESK)
    page.wait("document.getElementById('no-motion').hidden")
    for script in LIVE_CONTROLS:
        page.wait(script)
    page.run("document.querySelector('[data-bit=ab]').click()")
    page.run(
        "document.getElementById('hold').click()"
    )  # two requests: each is answered when it likes
    wait_for(lambda: len(pressed) == 2, page)
    assert sorted(pressed) == [("ab", True), ("move_enable", False)]
    page.wait("document.getElementById('answer').textContent.includes('refused, <')")
    before = page.run("document.getElementById('view').toDataURL()")
    stream.add({"q": [1.5, -1.0, 1.0, 0.0, 1.0, 0.0], "w": [4000.0, 5000.0], "near": None})
    page.wait("document.querySelector('#tiles b').textContent === '5 000 W'")
    wait_for(lambda: page.run("document.getElementById('view').toDataURL()") != before, page)
    x, y, wide, _ = page.middle("#power")
    page.drag((x - wide / 5, y + 60), (x + wide / 5, y + 60))
    page.wait("document.getElementById('now').getAttribute('aria-pressed') === 'false'")
    page.run("document.getElementById('now').click()")
    page.wait("document.getElementById('now').getAttribute('aria-pressed') === 'true'")
    stream.add({"heard": {"driver": False}, "w": None, "q": None})
    page.wait("document.getElementById('link').textContent === 'no driver heard'")
    page.wait("document.getElementById('hold').disabled")
    assert page.run("document.querySelectorAll('img').length") == 0
    assert page.run("location.hash") == ""  # the token stands in no picture of the window
    own = f"http://127.0.0.1:{server.port}/"
    assert page.faults == []
    assert {address.removeprefix(own) for address in page.requests} <= {
        "",
        "events",
        "scene",
        "press",
    }
    server.close()
    page.wait("document.getElementById('link').textContent === 'connection lost'")
    page.close()


STOP = "document.getElementById('stop')"
IN_REACH = f"""(() => {{ const {{ x, y, width, height }} = {STOP}.getBoundingClientRect();
    return {STOP}.contains(document.elementFromPoint(x + width / 2, y + height / 2)); }})()"""


@pytest.mark.long
def test_a_grip_is_a_gap_with_its_name_in_the_clearance(
    browser: Any, live: tuple[LiveServer, Stream, list[tuple[str, bool]]]
) -> None:
    server, stream, _ = live
    page = browser.open(server.address, *DESK)
    page.wait("document.getElementById('no-motion').hidden")
    page.run(
        "window.drawn = new Set(); const fill = CanvasRenderingContext2D.prototype.fillText; "
        "CanvasRenderingContext2D.prototype.fillText = function (words, ...more) "
        "{ window.drawn.add(words); fill.call(this, words, ...more); }; 0"
    )
    near = [0.1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1, "hand – table"]
    for after in ({"near": near}, {"near": None}, {"near": near, "load": "gripper+gear"}, {}):
        time.sleep(0.8)
        stream.add(after)
    page.wait("window.drawn.has('grips')")
    assert not page.run("window.drawn.has('releases')")
    assert page.faults == []
    page.close()


@pytest.mark.parametrize("size", [pytest.param(DESK, marks=pytest.mark.long), PHONE])
def test_the_emergency_stop_is_always_in_reach_and_says_what_ends_it(
    browser: Any,
    live: tuple[LiveServer, Stream, list[tuple[str, bool]]],
    size: tuple[int, int],
) -> None:
    server, stream, pressed = live
    page = browser.open(server.address, *size, touch=size == PHONE)
    page.wait(f"!{STOP}.disabled && document.getElementById('no-motion').hidden")
    assert page.run("document.getElementById('standing').textContent") == ""
    page.run("scrollTo({top: 1e6, behavior: 'instant'})")
    page.frame()
    assert page.run("scrollY") > 300
    assert page.run(IN_REACH)
    page.run(f"{STOP}.click()")
    wait_for(lambda: pressed == [("emergency_stop", True)], page)
    levels = {"ab": False, "move_enable": False, "emergency_stop": True}
    failed = {"label": "p", "kind": "regional", "event": "failed", "at": [7, 31], "note": "off it"}
    stopped = {"in": levels, "out": {"alarm_stop": False}, "mode": "EMERGENCY_STOP"}
    stream.add({**stopped, "step": failed})
    said = "document.getElementById('standing').textContent"
    page.wait(f"{said}.includes('stop pressed')")
    assert page.run(f"{said}.includes('Step 7 of 31, p, failed: off it.')")
    assert page.run("document.getElementById('hold').disabled")
    assert page.run("document.getElementById('link').textContent") == "live, stopped"
    assert page.run("document.getElementById('outputs').textContent").count("stopactive") == 1
    assert page.run("document.getElementById('stopping').textContent.includes('no safety')")
    assert page.run(f"{STOP}.getAttribute('aria-pressed')") == "true"
    page.run("scrollTo({top: 0, behavior: 'instant'})")
    page.frame()
    assert page.run(BOXES) == []
    page.run(f"{AXE}; 0")
    assert page.run(FOUND) == []
    page.run(f"{STOP}.click()")
    wait_for(lambda: pressed[1:] == [("emergency_stop", False)], page)
    stream.add({"in": {**levels, "emergency_stop": False}})
    page.wait(f"{said}.includes('confirm messages')")
    stream.add({"out": {"alarm_stop": True}})
    page.wait(f"{said}.includes('Held on the path')")
    stream.add({"heard": {"driver": False}})
    page.wait("document.getElementById('hold').disabled")
    assert not page.run(f"{STOP}.disabled")  # who is silent may still hear it
    page.close()


def test_the_live_view_on_a_phone_only_watches_without_the_token(
    browser: Any, live: tuple[LiveServer, Stream, list[tuple[str, bool]]]
) -> None:
    server, _, pressed = live
    page = browser.open(server.address.partition("#")[0], *PHONE, dark=True, touch=True)
    page.wait(
        "document.getElementById('no-motion').hidden && document.querySelector('[data-bit=ab]')"
    )
    assert page.run("document.documentElement.scrollWidth") == PHONE[0]
    assert page.run("document.getElementById('view-only').hidden") is False
    page.wait("document.getElementById('link').textContent === 'live'")
    page.wait(
        "[...document.querySelectorAll('#plc button')].filter((b) => !b.disabled).length === 1"
    )  # CSV
    page.run("for (const id of ['stop', 'hold']) document.getElementById(id).click()")
    assert pressed == []
    assert page.faults == []
    page.close()


@pytest.mark.sampled
@pytest.mark.parametrize("size", [DESK, PHONE, PAPER])
def test_nothing_of_the_live_view_is_cut_overlaps_or_scrolls_and_axe_finds_nothing(
    browser: Any, live: tuple[LiveServer, Stream, list[tuple[str, bool]]], size: tuple[int, int]
) -> None:
    server, _, _ = live
    page = browser.open(server.address, *size, touch=size == PHONE, dark=size == PHONE)
    page.wait(
        "document.getElementById('no-motion').hidden && document.querySelector('[data-bit=ab]')"
    )
    if size == PAPER:
        page.call("Emulation.setEmulatedMedia", media="print")
        page.run("dispatchEvent(new Event('beforeprint'))")
    page.frame()
    assert page.run(BOXES) == []
    if size != PAPER:
        page.run(f"{AXE}; 0")
        assert page.run(FOUND) == []
    page.close()
