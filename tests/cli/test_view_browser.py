"""`ir view` in a real browser: it draws, its controls work, nothing is cut or lies on another, and
nothing is asked of a network.

Needs Chromium. Without it this says `not checked: browser`; where CI=true it has to be there.
"""

from __future__ import annotations

import importlib.util
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import axe_core_python
import pytest

from ir_cli.main import main
from ir_description import load_cell

ROOT = Path(__file__).resolve().parents[2]
TOOL = ROOT / "tools" / "_chromium.py"
BOXES = (ROOT / "tests" / "recorder" / "page_boxes.js").read_text()
AXE = (Path(axe_core_python.__file__).parent / "axe.min.js").read_text(encoding="utf-8")
FOUND = """axe.run(document, {resultTypes: ['violations']}).then(
    (found) => found.violations.map((one) =>
        `${one.id}: ${one.nodes.slice(0, 3).map((node) => node.html.slice(0, 120)).join(' | ')}`))
"""
LABELS = """(() => {
  const shown = [...document.querySelectorAll('.stage .machine, .stage .station')].filter((e) => !e.hidden);
  const boxes = shown.map((e) => e.getBoundingClientRect()), faults = [];
  boxes.forEach((a, i) => boxes.slice(i + 1).forEach((b, k) => {
    const across = Math.min(a.right, b.right) - Math.max(a.left, b.left), down = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
    if (across > 2 && down > 2) faults.push(`${shown[i].textContent} | ${shown[i + 1 + k].textContent}`);
  }));
  return [shown.length, faults];
})()"""  # noqa: E501
SIZES = {"desk": (1400, 900), "phone": (390, 844), "paper": (703, 1047)}
PATIENCE = 60.0  # s: a busy machine
PLANNED = "document.getElementById('link').textContent === 'planned'"
CELL = """\
format: ir_cell/1
name: small
robot: kr6_r900_2
home_deg: [0, -90, 90, 0, 45, 0]
tcp: {xyz: [0.05, 0, 0]}
equipment:
  - name: table
    pose: {xyz: [0.6, 0, 0]}
    bodies: [{name: top, kind: box, size: [0.4, 0.6, 0.2], xyz: [0, 0, 0.1]}]
    stations: [{name: pick, pose: {xyz: [-0.05, 0.1, 0.45], abc_deg: [0, 90, 0]}, approach_distance: 0.1}]
program: [{station: pick, dwell: 0.1}, {posture: home}]
"""  # noqa: E501


@pytest.fixture
def browser() -> Iterator[Any]:
    spec = importlib.util.spec_from_file_location("_chromium", TOOL)
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    sys.modules["_chromium"] = tool
    spec.loader.exec_module(tool)
    if tool.chromium() is None:
        pytest.skip("needs Chromium: apt install chromium")
    with tool.Browser() as started:
        yield started


@contextmanager
def viewed(shown: str) -> Iterator[str]:
    """The address of a cell's page."""
    command = [sys.executable, "-m", "ir_cli.main", "view", shown, "--port", "0"]
    view = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert view.stdout is not None
        yield view.stdout.readline().strip()
    finally:
        view.send_signal(signal.SIGINT)
        assert view.wait(PATIENCE) == 130


def own(page: Any, address: str) -> None:
    """No error was reported, and nothing was asked of anybody else."""
    assert page.faults == []
    assert [asked for asked in page.requests if not asked.startswith(address.split("#")[0])] == []


@pytest.mark.long
def test_the_page_draws_plays_and_follows_the_file(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    with viewed(str(path)) as address:
        page = browser.open(address, 900, 700)
        page.wait(PLANNED, PATIENCE)
        page.wait("document.getElementById('no-motion').hidden", PATIENCE)
        drawn = page.run("document.getElementById('view').toDataURL()")
        page.run("document.getElementById('play').click()")
        page.wait("document.getElementById('now-shown').textContent.includes(' W')", PATIENCE)
        deadline = time.monotonic() + PATIENCE
        while page.run("document.getElementById('view').toDataURL()") == drawn:
            assert time.monotonic() < deadline, "the robot is not drawn anew"
        path.write_text(CELL.replace("size: [0.4,", "size: [-0.4,"))
        page.wait("document.getElementById('problem').textContent.includes('last cell')", PATIENCE)
        path.write_text(
            CELL.replace("name: pick", "name: place").replace("station: pick", "station: place")
        )
        page.wait("document.getElementById('stations').textContent.includes('place')", PATIENCE)
        assert page.run("location.hash") == ""
        own(page, address)
        page.close()


@pytest.mark.long
def test_a_machine_that_the_mouse_drags_is_planned_anew(browser: Any, tmp_path: Path) -> None:
    """Along the floor and by a key; nothing but its place changes."""
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    before = load_cell(path).machine("table").pose[:3, 3]
    with viewed(str(path)) as address:
        page = browser.open(address, 1400, 900)
        page.wait(PLANNED, PATIENCE)
        page.wait("document.getElementById('no-motion').hidden", PATIENCE)
        page.run(
            "(() => { document.getElementById('move').open = true; const t = "
            "document.getElementById('target'); t.value = 'machine table'; "
            "t.dispatchEvent(new Event('change')); })()"
        )
        page.wait("!document.querySelector('.handle').hidden", PATIENCE)
        page.frame()
        x, y, _, _ = page.middle(".handle")
        page.drag((x, y), (x + 30, y + 12))
        page.wait("!document.getElementById('snippet').hidden", PATIENCE)
        page.run("document.querySelector('.handle').focus()")
        page.key("PageUp")
        page.wait("/, 0.01\\]/.test(document.getElementById('snippet').textContent)", PATIENCE)
        page.wait(PLANNED, PATIENCE)
        found = page.run("document.getElementById('snippet').textContent")
        place = [float(word) for word in found.split("[")[1].split("]")[0].split(", ")]
        assert 0.02 < max(abs(place[k] - before[k]) for k in (0, 1)) < 0.5
        assert "abc_deg" not in found
        assert path.read_text() == CELL
        own(page, address)
        page.close()


@pytest.mark.long
@pytest.mark.parametrize("shown", ["demo", "small", "recording"])
def test_nothing_of_the_view_is_cut_overlaps_or_scrolls_and_axe_finds_nothing(
    browser: Any, tmp_path: Path, shown: str
) -> None:
    ready = PLANNED
    if shown != "demo":
        path = tmp_path / "small.yaml"
        path.write_text(CELL)
    if shown == "recording":
        path = tmp_path / "plan.mcap"
        assert main(["plan", str(tmp_path / "small.yaml"), "-o", str(path)]) == 0
        ready = "document.getElementById('link').textContent === 'recorded'"
    if shown != "demo":
        shown = str(path)
    faults: dict[str, Any] = {}
    with viewed(shown) as address:
        for size, (wide, high) in SIZES.items():
            page = browser.open(address, wide, high, touch=size == "phone", dark=size == "phone")
            page.wait(ready, PATIENCE)
            page.wait("document.getElementById('no-motion').hidden", PATIENCE)
            page.run(
                "document.querySelectorAll('details').forEach((each) => { each.open = true; })"
            )
            page.run(
                "(() => { const t = document.getElementById('target'); t.selectedIndex = 1; "
                "t.dispatchEvent(new Event('change')); })()"
            )
            if size == "paper":
                page.call("Emulation.setEmulatedMedia", media="print")
                page.run("dispatchEvent(new Event('beforeprint'))")
            page.frame()
            faults[size] = page.run(BOXES)
            if size != "paper":
                count, faults[f"{size}, names"] = page.run(LABELS)
                assert count
                stations = page.run("document.querySelectorAll('.station:not([hidden])').length")
                assert bool(stations) is (size == "desk")
                page.run(f"{AXE}; 0")
                faults[f"{size}, axe"] = page.run(FOUND)
            own(page, address)
            page.close()
    assert {size: found for size, found in faults.items() if found} == {}
