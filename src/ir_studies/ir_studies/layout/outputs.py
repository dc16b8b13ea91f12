"""What a layout study leaves behind: the table, the best placements as cell files, the page."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TypeAlias

from ir_description import Cell, cell_to_yaml
from ir_msgs_py.file_roots import ANYWHERE
from ir_recorder.report.files import write_output
from ir_recorder.report.step_table import write_columns
from ir_studies.layout.finals import Final
from ir_studies.layout.page import write_page
from ir_studies.layout.placement import Known
from ir_studies.layout.settings import Condition, LayoutSettings
from ir_studies.layout.summary import ends, of_condition

_TABLE_START = b"placement,"
_CELL_START = b"format: ir_cell/1"
NUMBERS = (
    "cost_j", "energy_j", "energy_low_j", "energy_high_j", "duration_s", "moving_j", "moving_s", "drives_j",  # noqa: E501
    "clearance_m",
)  # fmt: skip
_BEST_HEADS = (
    "rank,placement,condition,energy_j,low_j,high_j,spread_j,duration_s,moving_j,"
    "saved_j,saved_low_j,saved_high_j"
)
Value: TypeAlias = "str | float | int"


def write_outputs(
    known: Sequence[Known],
    finals: Sequence[Sequence[Final]],
    settings: LayoutSettings,
    given: Cell,
    folder: Path,
) -> tuple[tuple[Path, ...], str]:
    """Write table.csv, best_1.yaml and so on, index.html; the files, and the best as CSV. given:
    the cell as it was when the study began.

    Raises RecorderError for files that can't be written, or replaced.
    """
    rows = [_row(k, one, c, settings) for k, one in enumerate(known) for c in settings.conditions]
    columns = {name: [row[name] for row in rows] for name in rows[0]}
    written = [write_columns(columns, folder / "table.csv", _TABLE_START, ANYWHERE)]
    others = [own for own in finals if not own[0].is_given]
    for rank, own in enumerate(others, start=1):
        cell = settings.placing.cell(given, own[0].placement.values)
        content = cell_to_yaml(replace(cell, name=f"{cell.name}_best_{rank}")).encode()
        written.append(write_output(folder / f"best_{rank}.yaml", content, _CELL_START, ANYWHERE))
    _remove_best(folder, given.name, len(others))
    written.append(write_page(known, finals, settings, given, folder / "index.html"))
    return tuple(written), best_table(finals)


def _remove_best(folder: Path, name: str, kept: int) -> None:
    """Remove the best of a study in this folder that kept more; other cells stay."""
    for path in folder.glob("best_*.yaml"):
        rank = path.stem.removeprefix("best_")
        if rank.isdecimal() and int(rank) > kept and _named(path, f"{name}_best_{rank}"):
            path.unlink()


def _named(path: Path, name: str) -> bool:
    """Whether a file is a cell of that name, as it was written here."""
    if path.is_symlink() or not path.is_file():
        return False
    content = path.read_bytes()
    return content.startswith(_CELL_START) and f"name: {name}".encode() in content.splitlines()


def _row(k: int, known: Known, condition: Condition, settings: LayoutSettings) -> dict[str, Value]:
    plan = known.plans.get(condition, {})
    kind, sentence = known.reason
    state = "impossible" if known.cost == math.inf else "planned" if known.planned else "looked at"
    return {
        "placement": k,
        **{
            variable.name: known.placement.values.get(variable.name, 0.0)
            for variable in settings.variables
        },
        "condition": condition.text,
        "state": state,
        "reason": kind,
        "sentence": sentence,
        "coarse_j": known.coarse if math.isfinite(known.coarse) else math.nan,
        **{name: float(plan.get(name, math.nan)) for name in NUMBERS},
        "program_id": str(plan.get("program_id", "")),
    }


def best_table(finals: Sequence[Sequence[Final]]) -> str:
    """CSV: the given placement and the best by condition, with their error bars."""
    given, _ = ends(finals)
    lines = [_BEST_HEADS]
    rank = 0
    for own in finals:
        rank += not own[0].is_given
        for one in own:
            if not one.solved:
                continue
            within = one.interval
            figures = [
                one.mean(),
                within.low,
                within.high,
                one.spread(),
                one.mean("duration_s"),
                one.mean("moving_j"),
            ]
            if given is not None:
                less, saved = one.saving(of_condition(given, one))
                figures += [less, saved.low, saved.high]
            else:
                figures += [math.nan] * 3
            texts = (str(rank if not one.is_given else 0), one.placement.key, one.condition.text)
            lines.append(",".join([*texts, *(f"{value:.3f}" for value in figures)]))
    return "\n".join(lines) + "\n"
