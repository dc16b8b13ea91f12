"""Writes docs/mistakes.md: what people get wrong in a cell file, and the sentence that each mistake
gets.

Each mistake is made in examples/first_cell.yaml, and `ir check` is asked.
"""

from __future__ import annotations

import contextlib
import io
import tempfile
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from pathlib import Path

from ir_cli.main import main as ir

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "mistakes.md"
CELL = ROOT / "examples" / "first_cell.yaml"
HEAD = """\
# Mistakes, and what the check says

Written by `make docs` from the answers of `ir check`; a test compares. Each mistake is made in
`examples/first_cell.yaml`, the cell of [the tutorial](tutorial.md). *deep*: asked with `--deep`.
"""


@dataclass(frozen=True)
class Mistake:
    """What stands in the file, what was typed instead, and a part of the sentence that must
    come.
    """

    kind: str
    meant: str
    typed: str
    word: str
    deep: bool = False


MISTAKES = (
    Mistake("Units", "size: [0.8, 1.2, 0.5]", "size: [800, 900, 500]", "0.9 for 900 mm?"),
    Mistake("Units", "size: [0.8, 1.2, 0.5]", "size: [800, 1200, 500]", "1.2 for 1200 mm?"),
    Mistake(
        "Units", "pose: {xyz: [1.7, 0.6, 0]}", "pose: {xyz: [1700, 600, 0]}", "1.7 for 1700 mm?"
    ),
    Mistake(
        "Units", "pose: {xyz: [0.3, -1.9, 0]}", "pose: {xyz: [300, -900, 0]}", "in m, not in mm"
    ),
    Mistake("Units", "approach_distance: 0.7", "approach_distance: 700", "0.7 for 700 mm?"),
    Mistake("Units", "mass: 60", "mass: 60000", "60 for 60000 g?"),
    Mistake("Units", "mass: 60", "mass: 60 kg", "must be a number"),
    Mistake("Units", "radius: 0.09", "radius: 0,09", "decimals have a point"),
    Mistake(
        "Units",
        "park_deg: [0, -125, 120, 0, 80, 0]",
        "park_deg: [0, -2.18, 2.09, 0, 1.4, 0]",
        "write park?",
    ),
    Mistake(
        "Units",
        "park_deg: [0, -125, 120, 0, 80, 0]",
        "park: [0, -125, 120, 0, 80, 0]",
        "write park_deg?",
    ),
    Mistake("Units", "abc_deg: [0, 90, 0]}", "abc_deg: [0, 1.5708, 0]}", "90 for 1.5708 rad?"),
    Mistake("Names", "robot: kr210_r2700_extra", "robot: kr210", "known are kr210_r2700_extra"),
    Mistake("Names", "{station: form, wait", "{station: from, wait", "known are pick, form"),
    Mistake("Names", "name: press_head", "name: press_bed", "is there twice"),
    Mistake("Names", "zone: SEMI_CLOSED", "zoone: SEMI_CLOSED", "unknown key 'zoone'"),
    Mistake("Names", "[finger_left, blank_lying]", "[finger_l, blank_lying]", "known are base"),
    Mistake("Names", "abc_deg: [0, 90, 0]}", "abc: [0, 90, 0]}", "abc_deg"),
    Mistake("Names", "    station: pick\n", "    station: pallet\n", "known are pick, form"),
    Mistake("Reach", "pose: {xyz: [0.3, 0, 1.0]}", "pose: {xyz: [1.8, 0, 1.0]}", "the arm reaches"),
    Mistake("Reach", "pose: {xyz: [0, 0, 0.6]", "pose: {xyz: [0, 0, 0.4]", "inside pallet_deck"),
    Mistake(
        "Reach", "pose: {xyz: [0.3, -1.9, 0]}", "pose: {xyz: [0.3, -0.4, 0]}", "in the robot's base"
    ),
    Mistake(
        "Reach",
        "abc_deg: [0, 90, 0]}",
        "abc_deg: [0, -90, 0]}",
        "can't be reached in this orientation",
    ),
    Mistake(
        "Contacts",
        "          - {between: [blank_held, pallet_deck], safety_distance: 0.0025}\n",
        "",
        "in the best of them blank_held is 5.0 mm from pallet_deck",
        deep=True,
    ),
    Mistake(
        "Zones",
        "size: [0.8, 1.2, 0.9], xyz: [0, 0, 0.45]",
        "size: [0.8, 1.2, 0.5], xyz: [0, 0, 0.25]",
        "allowed contacts hold in its zone only",
        deep=True,
    ),
    Mistake("Zones", "kind: OPEN", "kind: TABLE", "must be one of OPEN"),
    Mistake(
        "Doors",
        "wait_for: [door_is_open], ",
        "",
        "change that before by signal open_door",
        deep=True,
    ),
    Mistake("Doors", ", set_signals: [open_door]", "", "which nothing in the cell brings about"),
    Mistake("Doors", "    state: door_closed\n", "", "must say its state"),
    Mistake(
        "Doors", "on: door_open, off", "on: open, off", "must be one of door_open, door_closed"
    ),
    Mistake(
        "Doors",
        "wait_for: [door_is_open]",
        "wait_for: [door_open]",
        "known are open_door, door_is_open",
    ),
    Mistake("Writing", "  - name: press\n", "\t- name: press\n", "a tab; indent by spaces"),
    Mistake("Writing", "p1: [0.42, 0.11, 0]", "p1: [0.42, 0.11]", "has 2 entries, must have 3"),
    Mistake("Missing", "  com: [0.2, 0, 0]\n", "", "tool has no com"),
    Mistake("Missing", "robot: kr210_r2700_extra\n", "", "the file has no robot"),
    Mistake("Program", "attach: blank, ", "", "no part is held"),
    Mistake("Program", "{pause: 60}", "{pause: 60, power_mode: SLEEP}", "BUS_POWER_OFF"),
    Mistake(
        "Program", "{pause: 60}", "{pause: 60, power_mode: HIBERNATION}", "needs at least 300 s"
    ),
    Mistake("Program", "mass: 20", "mass: 200", "carries at most 210 kg"),
)


@cache
def answer(mistake: Mistake) -> str:
    """The line of the check that names the mistake. Raises LookupError where none does."""
    text = CELL.read_text("utf-8")
    if mistake.meant not in text:
        raise LookupError(f"{CELL.name} has no {mistake.meant!r}")
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        Path(CELL.name).write_text(text.replace(mistake.meant, mistake.typed, 1), "utf-8")
        out = io.StringIO()
        with contextlib.redirect_stdout(out), contextlib.redirect_stderr(out):
            ir(["cell", "check", CELL.name, *(["--deep"] if mistake.deep else [])])
    for line in out.getvalue().splitlines():
        if mistake.word in line:
            return line.strip().removeprefix("ir: ")
    raise LookupError(f"nothing says {mistake.word!r}:\n{out.getvalue()}")


def page() -> str:
    """The page as it has to be."""
    rows = []
    for kind, mistakes in groupby(MISTAKES, key=lambda each: each.kind):
        rows += [f"\n## {kind}\n", "| meant | typed | the check says |", "|---|---|---|"]
        rows += [_row(each) for each in mistakes]
    return HEAD + "\n".join(rows) + "\n"


def _row(mistake: Mistake) -> str:
    shown = mistake.typed.strip(" \n").replace("\t", "⇥ ")
    typed = f"`{shown}`" if shown else "nothing"
    said = " ".join(answer(mistake).split())
    return f"| `{mistake.meant.strip()}` | {typed} | {'*deep* ' if mistake.deep else ''}{said} |"


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.relative_to(ROOT))


if __name__ == "__main__":
    main()
