"""Programs of the corpus, driven, written as KRL, read back and driven again: how near the points
come.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from _results import Claim, at_least, at_most

from ir_krl import Followed, KrlError, follow, parse
from ir_krl.write import WrittenPause, WrittenSignals, WrittenSpline, written
from ir_planner import Planner
from ir_planner.krl import follow_krl, tool_in_flange
from ir_planner.krl.execution import DrivenStep, drive
from ir_planner.krl.export import attached
from ir_values.arrays import FloatArray

CORPUS = Path(__file__).parents[1] / "tests" / "krl" / "programs"
CELL = "open"
# s between the points that are written, and how many at least
_SPACING = 0.2
_FEWEST = 6
# that a point may be off
_DEG = 1e-4
_MM = 1e-3


@dataclass(frozen=True)
class CorpusRow:
    """A program: movements, points that were written, how far they are off when they are driven
    again [deg], [mm] of the tcp; the sentence of one that is refused, else "".
    """

    program: str
    movements: int
    points: int
    off_deg: float
    off_mm: float
    refused: str


def programs() -> list[Path]:
    """All of them, by name."""
    return sorted(CORPUS.glob("*.src"))


def read(path: Path, planner: Planner) -> tuple[Followed, tuple[DrivenStep, ...]]:
    """A program followed and driven with the inputs that its comments give. Raises KrlError."""
    text = path.read_text(encoding="utf-8")
    inputs = {int(n): value == "true" for n, value in re.findall(r";input (\d+) (\w+)", text)}
    others = [
        path.parent / "with" / name
        for line in re.findall(r";with (.+)", text)
        for name in line.split()
    ]
    files = [path, *([data] if (data := path.with_suffix(".dat")).exists() else []), *others]
    cell = planner.cell
    sources = [parse(one.read_text(encoding="utf-8"), one.name) for one in files]
    program = follow_krl(planner, sources, inputs=inputs)
    return program, drive(program, planner.scene("none"), cell.machine_home)[0]


def round_trip(steps: Sequence[DrivenStep], planner: Planner) -> tuple[int, float, float]:
    """How many points are written for driven steps, and the largest error [deg], [mm] of one of
    them when the text is read and driven again.
    """
    moving = [step.trajectory for step in steps if step.moves]
    if not moving:
        return 0, 0.0, 0.0
    scene = planner.scene("none")
    cell = planner.cell
    shares = [_shares(one.duration) for one in moving]
    points = [one.sample(share * one.duration).q for one, share in zip(moving, shares, strict=True)]
    parts = list[Any]()
    left = iter(zip(moving, points, strict=True))
    for step in steps:
        if step.moves:
            one, reached = next(left)
            even = np.full(len(reached), 100.0 / len(reached))
            parts.append(WrittenSpline("moves", reached, even, one.duration))
        elif step.trajectory.duration > 0.0:
            parts.append(WrittenPause("stands", step.trajectory.duration))
        if step.outputs:
            named = tuple((f"OUTPUT_{n}", on) for n, on, _ in step.outputs)
            parts.append(WrittenSignals((), named))
    again_text = written("AGAIN", moving[0].positions[0], parts, attached(scene), [])
    texts = [parse(again_text.source, "again.src"), parse(again_text.data, "again.dat")]
    again = drive(
        follow(texts, cell.machine_home, tool_in_flange(cell.tcp)), scene, cell.machine_home
    )[0]
    driven = [step.trajectory for step in again if step.moves]
    passed = [
        one.sample(np.minimum(share * one.duration, one.duration)).q
        for one, share in zip(driven, shares, strict=True)
    ]
    return _apart(np.concatenate(points), np.concatenate(passed), planner)


def _shares(seconds: float) -> FloatArray:
    count = max(int(np.ceil(seconds / _SPACING)), _FEWEST)
    return np.linspace(0.0, 1.0, count + 1)[1:]


def _apart(first: FloatArray, second: FloatArray, planner: Planner) -> tuple[int, float, float]:
    chain = planner.scene("none").chain
    away = chain.tcp_poses(first)[:, :3, 3] - chain.tcp_poses(second)[:, :3, 3]
    degrees = float(np.degrees(np.abs(first - second)).max())
    return len(first), degrees, 1e3 * float(np.linalg.norm(away, axis=1).max())


def corpus() -> tuple[list[dict[str, Any]], list[Claim]]:
    """All programs, printed as a table, and what is claimed of them."""
    planner = Planner(CELL)
    rows = [_row(path, planner) for path in programs()]
    print(f"{'program':<44} movements  points  off deg   off mm  refused")
    for row in rows:
        figures = f"{row.movements:>9}  {row.points:>6}  {row.off_deg:>7.1e}  {row.off_mm:>7.1e}"
        print(f"{row.program:<44} {figures}  {row.refused}")
    driven = [row for row in rows if not row.refused]
    claims = [
        at_least("programs of the corpus", len(rows), "programs", 40),
        at_least("of them driven", len(driven), "programs", 25),
        at_most(
            "points after writing and reading", max(row.off_deg for row in driven), "deg", _DEG
        ),
        at_most("points after writing and reading", max(row.off_mm for row in driven), "mm", _MM),
    ]
    return [asdict(row) for row in rows], claims


def _row(path: Path, planner: Planner) -> CorpusRow:
    try:
        _, steps = read(path, planner)
    except KrlError as error:
        return CorpusRow(path.stem, 0, 0, 0.0, 0.0, str(error))
    points, degrees, millimetres = round_trip(steps, planner)
    return CorpusRow(path.stem, sum(step.moves for step in steps), points, degrees, millimetres, "")
