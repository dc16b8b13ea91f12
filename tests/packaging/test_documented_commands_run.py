"""The commands and snippets of README and docs do what their pages promise: run, in the order of
the page.

A page is walked in an empty folder that holds what its reader would have: a cell, a KUKA program, a
trace, prices, recordings. What is not run, and why, is `NOT_RUN` in `_documented.py`.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import pytest
from _documented import PAGES, ROOT, walked

from ir_description import load_robot, robot_urdf
from ir_studies.cells import written

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # drawn cells
from _cells_drawn import drawn

CELLS = Path(str(files("ir_description") / "data" / "cells"))
KRL = "DEF OLD( )\nPTP XHOME\nPTP {A1 30,A5 40}\nWAIT SEC 5\nPTP XHOME\nEND\n"
CUBE = [(x, y, z) for x in (0, 400) for y in (0, 300) for z in (0, 200)]
FACES = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
Prepare = Callable[[Path], None]


def cell(folder: Path) -> None:
    for name in ("my_cell.yaml", "your_cell.yaml"):
        shutil.copy(CELLS / "demo.yaml", folder / name)


def krl(folder: Path) -> None:
    (folder / "old.src").write_text(KRL)
    (folder / "old.dat").write_text("DEFDAT OLD\nENDDAT\n")


def exported(folder: Path) -> None:
    """A program whose stops are stations of the cell."""
    shell(folder, "ir krl export demo -o old.src")


def robots_folder(folder: Path) -> None:
    """A program that calls another, its data lists, and the same as a controller keeps them."""
    lists = "$TOOL={X 0,Y 0,Z 100,A 0,B 0,C 0}\n$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}\n"
    inside = folder / "KRC" / "R1" / "Program"
    inside.mkdir(parents=True)
    for place in (folder, inside):
        (place / "main.src").write_text(
            f"DEF main()\n{lists}PTP {{A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}}\nsub()\nEND\n"
        )
        (place / "sub.src").write_text("DEF sub()\nPTP {A1 10,A2 -90,A3 90,A4 0,A5 10,A6 0}\nEND\n")
        (place / "$config.dat").write_text("DEFDAT $CONFIG PUBLIC\nENDDAT\n")


def public_cells(folder: Path) -> None:
    (folder / "cells.xml").write_text(written([drawn(1, 3, 3)]))


def costs(folder: Path) -> None:
    (folder / "costs.yaml").write_text("format: ir_costs/1\nprice: 0.24\ncurrency: EUR\n")


def trace(folder: Path) -> None:
    for ending in ("csv", "yaml"):
        shutil.copy(
            ROOT / "examples" / "traces" / f"kuka_trace.{ending}", folder / f"trace.{ending}"
        )


def recordings(folder: Path) -> None:
    """One plan as the recordings of a run, of two days, of a week, and of a factory."""
    cell(folder)
    shell(folder, "ir plan my_cell.yaml --saving -o made.mcap")
    for name in ("out/demo", "monday", "friday", "out/week/1", "out/week/2", "out/factory/a/1"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(folder / "made.mcap", folder / f"{name}.mcap")


def mesh(folder: Path) -> None:
    """A box of 400 x 300 x 200 mm as a mesh, and its corners as a cloud."""
    text = ["solid press"]
    for a, b, c, d in FACES:
        for corners in ((a, b, c), (a, c, d)):
            places = "".join(f"vertex {CUBE[k][0]} {CUBE[k][1]} {CUBE[k][2]}\n" for k in corners)
            text.append(f"facet normal 0 0 0\nouter loop\n{places}endloop\nendfacet")
    (folder / "press.stl").write_text("\n".join([*text, "endsolid press\n"]))
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(CUBE)}\n"
        "property float x\nproperty float y\nproperty float z\nend_header\n"
    )
    (folder / "bin.ply").write_text(head + "".join(f"{x} {y} {z}\n" for x, y, z in CUBE))


def world(folder: Path) -> None:
    shell(folder, "ir cell export open -o world.sdf")


def robot(folder: Path) -> None:
    """A URDF, and the cell file that the page shows."""
    (folder / "robot.urdf").write_text(robot_urdf(load_robot()))
    (text,) = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "robot_guide.md").read_text(), re.S)
    (folder / "first.yaml").write_text(text)


PREPARED: dict[str, tuple[Prepare, ...]] = {
    "README.md": (cell, krl),
    "cad.md": (mesh, world),
    "compare.md": (cell, krl, costs, trace),
    "flexible.md": (public_cells,),
    "krl.md": (exported, robots_folder, costs),
    "recording.md": (recordings,),
    "report.md": (recordings, costs),
    "robot_guide.md": (robot,),
}


def shell(folder: Path, line: str) -> None:
    """Run a line as a reader types it; its output is shown where it fails."""
    command = folder / ".bin" / "ir"
    if not command.exists():
        command.parent.mkdir()
        command.write_text(f'#!/bin/sh\nexec "{sys.executable}" -m ir_cli.main "$@"\n')
        command.chmod(0o755)
    path = f"{command.parent}{os.pathsep}{os.environ['PATH']}"
    ran = subprocess.run(
        ["bash", "-c", line],
        cwd=folder,
        env={**os.environ, "PATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, f"{line}\n{ran.stdout}{ran.stderr}"


@pytest.mark.long
@pytest.mark.parametrize(
    "page", [page for page in PAGES if walked(page)], ids=lambda page: page.name
)
def test_the_commands_of_a_page_run_in_their_order(page: Path, tmp_path: Path) -> None:
    for prepare in PREPARED.get(page.name, ()):
        prepare(tmp_path)
    for line in walked(page):
        shell(tmp_path, line.shell)


@pytest.mark.long
@pytest.mark.parametrize(("page", "prepare"), [("cad.md", mesh), ("compare.md", cell)])
def test_the_snippets_that_no_other_test_runs(page: str, prepare: Prepare, tmp_path: Path) -> None:
    prepare(tmp_path)
    (snippet,) = re.findall(r"```python\n(.*?)```", (ROOT / "docs" / page).read_text("utf-8"), re.S)
    ran = subprocess.run(
        [sys.executable, "-c", snippet], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stderr
