"""`ir view` in a real browser: it draws, its controls work, and nothing is asked of a network.

Needs Chromium. Without it this says `not checked: browser`; where CI=true it has to be there.
"""

from __future__ import annotations

import importlib.util
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from ir_cli.view.drawing import look_at
from ir_description import Cell, load_cell
from ir_values.arrays import FloatArray

TOOL = Path(__file__).resolve().parents[2] / "tools" / "_chromium.py"
PATIENCE = 60.0  # s: a busy machine
# px
SMALL = (500, 400)
LARGE = (900, 700)
says = "document.body.innerText.includes({!r})".format
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
    tool = sys.modules["_chromium"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    if tool.chromium() is None:
        pytest.skip("needs Chromium: apt install chromium")
    with tool.Browser() as started:
        yield started


@contextmanager
def viewed(browser: Any, path: Path, wide: int, high: int) -> Iterator[Any]:
    """The page of a cell file whose program is planned and drawn."""
    command = [sys.executable, "-m", "ir_cli.main", "view", str(path), "--port", "0"]
    view = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert view.stdout is not None
        address = view.stdout.readline().strip()
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/\?token=[\w-]{32}", address)
        page = browser.open(address, wide, high)
        page.wait(says("at the mains"), PATIENCE)
        page.wait("document.querySelector('canvas') !== null", PATIENCE)
        yield page
        assert [fault for fault in page.faults if "THREE.Clock" not in fault] == []
        assert [
            asked for asked in page.requests if not asked.startswith(address.split("?")[0])
        ] == []
        page.close()
    finally:
        view.send_signal(signal.SIGINT)
        assert view.wait(PATIENCE) == 130


@pytest.mark.long
def test_the_page_draws_plays_and_follows_the_file(browser: Any, tmp_path: Path) -> None:
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    with viewed(browser, path, *SMALL) as page:
        drawn = page.picture(tmp_path / "first.png").read_bytes()
        buttons = (
            "[...document.querySelectorAll('button')].find((b) => b.innerText === {!r})".format
        )
        page.run(f"{buttons('Play')}.click()")
        page.wait(says("kW"), PATIENCE)
        page.wait(f"Boolean({buttons('Stop')})", PATIENCE)
        deadline = time.monotonic() + PATIENCE
        while page.picture(tmp_path / "second.png").read_bytes() == drawn:
            assert time.monotonic() < deadline, "the robot is not drawn anew"
        path.write_text(CELL.replace("size: [0.4,", "size: [-0.4,"))
        page.wait(says("the last cell that could be read is shown"), PATIENCE)
        path.write_text(
            CELL.replace("name: pick", "name: place").replace("station: pick", "station: place")
        )
        page.wait(says("place with none"), PATIENCE)


def on_screen(cell: Cell, wide: int, high: int) -> Callable[[FloatArray], tuple[float, float]]:
    """Where the first view shows a point (3,) [m] of the cell [px]: a camera of three.js, 75
    degrees high.
    """
    server = SimpleNamespace(initial_camera=SimpleNamespace())
    look_at(server, cell)
    eye = server.initial_camera.position
    ahead = normalised(server.initial_camera.look_at - eye)
    right = normalised(np.cross(ahead, [0.0, 0.0, 1.0]))
    up = np.cross(right, ahead)
    pixels = 0.5 * high / np.tan(np.radians(75.0) / 2.0)

    def place(point: FloatArray) -> tuple[float, float]:
        ray = point - eye
        scale = pixels / (ray @ ahead)
        return 0.5 * wide + scale * float(ray @ right), 0.5 * high - scale * float(ray @ up)

    return place


def normalised(vector: FloatArray) -> FloatArray:
    return vector / np.linalg.norm(vector)


def choose_to_move(page: Any, what: str) -> None:
    """Open the folder Move, and choose a target there."""
    last = "[...document.querySelectorAll({!r})].filter((e) => {}).at(-1)".format
    page.run(last("*", "e.textContent.trim() === 'Move'") + ".click()")
    page.frame()
    page.run(last("input", "e.type === 'text' && e.value === 'nothing'") + ".click()")
    option = last("[role=option]", f"e.innerText === {what!r}")
    page.wait(option, PATIENCE)
    page.run(f"{option}.click()")
    page.wait(
        "document.body.textContent.includes('/drag')", PATIENCE
    )  # the handle, in the tree of the scene
    page.frame()


@pytest.mark.long
def test_a_station_that_the_mouse_drags_is_planned_anew(browser: Any, tmp_path: Path) -> None:
    """The arrow of its handle that points down, by 150 mm; nothing but its height changes."""
    path = tmp_path / "small.yaml"
    path.write_text(CELL)
    cell = load_cell(path)
    pose = cell.station("pick").pose
    with viewed(browser, path, *LARGE) as page:
        choose_to_move(page, "station pick")
        wide, high = page.run(
            "((c) => [c.clientWidth, c.clientHeight])(document.querySelector('canvas'))"
        )
        assert wide < LARGE[0] - 200  # the panel stands beside the picture
        at = on_screen(cell, wide, high)
        begin, end = (at(pose[:3, 3] + along * pose[:3, 0]) for along in (0.4, 0.55))
        before = page.run("document.body.innerText.match(/cycle ([0-9.]+) s/)[1]")
        page.pointer("mouseMoved", *begin)
        page.pointer("mousePressed", *begin)
        for share in np.linspace(0.1, 1.0, 10):
            step = np.add(begin, share * np.subtract(end, begin))
            page.pointer("mouseMoved", *step.tolist(), button="left", buttons=1)
            page.frame()
        page.pointer("mouseReleased", *end)
        page.wait(says("# station pick"), PATIENCE)
        page.wait(f"document.body.innerText.match(/cycle ([0-9.]+) s/)?.[1] > {before}", PATIENCE)
        page.picture(tmp_path / "dragged.png", whole=False)
        (x, y, z) = page.run(r"document.body.innerText.match(/pose: \{xyz: \[([^\]]*)/)[1]").split(
            ", "
        )
        assert (x, y) == ("-0.05", "0.1")
        assert float(z) == pytest.approx(0.45 - 0.15, abs=0.02)
        assert path.read_text() == CELL
