"""A programme as a folder: `programme.yaml` names the steps in their order, each movement a CSV
file that `ir evaluate` reads.
"""

from __future__ import annotations

from pathlib import Path

import yaml

from ir_cli.errors import InputError
from ir_cli.excitation.programme import MODES, Programme, Step
from ir_cli.offline.trace_file import read_trace, write_trace
from ir_description import Cell, DescriptionError, DescriptionFileError, load_cell
from ir_description.files import read_regular_file
from ir_msgs_py.errors import InvalidValueError
from ir_values.yaml_items import Item, read_items

FORMAT = "ir_programme/1"
FILE = "programme.yaml"
_BYTES_MAX = 10_000_000
_STEPS_MAX = 100_000
_LONGEST = 86400.0  # s: a stay of a day


def write_programme(programme: Programme, folder: Path, cell: str) -> Path:
    """Write all steps into a folder; the path of its `programme.yaml`."""
    rows: list[dict[str, object]] = []
    for number, step in enumerate(programme.steps, start=1):
        row: dict[str, object] = {"name": step.name, "load": step.load}
        if step.trajectory is None:
            row |= {"mode": step.mode, "seconds": step.seconds}
        else:
            row["trajectory"] = f"{number:03d}.csv"
            write_trace(folder / f"{number:03d}.csv", step.trajectory)
        rows.append(row)
    page = {"format": FORMAT, "cell": cell, "seconds": round(programme.seconds, 1), "steps": rows}
    path = folder / "programme.yaml"
    path.write_text(yaml.safe_dump(page, sort_keys=False), encoding="utf-8")
    return path


def read_programme(folder: Path) -> tuple[Cell, tuple[Step, ...]]:
    """The cell and the steps of a folder that `write_programme` wrote. InputError with file and
    line.
    """
    path = folder / FILE
    try:
        text = read_regular_file(path, _BYTES_MAX).decode("utf-8", "replace")
        top = read_items(text, str(path), DescriptionFileError).table(
            ("format", "cell", "steps"), ("seconds",)
        )
        top["format"].choice((FORMAT,))
        cell = load_cell(top["cell"].text())
        return cell, tuple(_step(each, cell, folder) for each in top["steps"].list(1, _STEPS_MAX))
    except (DescriptionError, InvalidValueError) as error:
        raise InputError(str(error)) from error


def _step(item: Item, cell: Cell, folder: Path) -> Step:
    row = item.table(("name", "load"), ("trajectory", "mode", "seconds"))
    name = row["name"].text()
    load = row["load"].text()
    if "trajectory" not in row:
        if "mode" not in row or "seconds" not in row:
            item.fail("must have a trajectory, or a mode and seconds")
        return Step(
            name, load, mode=row["mode"].choice(MODES), seconds=row["seconds"].number(0.0, _LONGEST)
        )
    file = row["trajectory"].text()
    if Path(file).name != file:
        row["trajectory"].fail("must be the name of a file in the same folder")
    return Step(name, load, read_trace(folder / file, cell.robot.joint_names))
