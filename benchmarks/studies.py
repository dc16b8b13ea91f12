"""Does every planner solve what it is asked, certified? Is an arena that was killed the same
afterwards? Do layout studies find the best?

    python benchmarks/studies.py [--only PART]... [--out FOLDER] [--cell NAME]... [--seeds N]
                                 [--planner NAME]... [--coal N] [--quick] [--json FILE]

Every planner is asked for every task of the cells, there and back, until it has solved it with one
of the seeds; Coal looks at its answers every 0.0005 rad, at so many per planner and cell. Then `ir
arena` runs the cells with one request per run, is killed with SIGKILL once it has made a third, and
goes on; its table is held against that of an arena which ran through, without the columns of times
and without planners that can't promise the same bytes. The statistics of `ir study statistics
--example` are computed once more from their rows; robots drawn for each pair are held against the
predicted interval, and asynchronous joints with the objective time against synchronous ones. Layout
studies of the demonstration: the bounds against an exhaustive grid, free and in a cycle time, and
again on variants of bundled cells; at least 1,000 placements against the given one; and how many
programs one, two and four processes plan per second. --only runs one of these parts; a study that
was interrupted goes on where it ended when the same --out is given.
"""

from __future__ import annotations

import argparse
import csv
import math
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from _layout_study import LAYOUT_PARTS, layout_claims
from _regional_ours import asked
from _regional_tasks import Task, tasks_of
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _second_opinion import SecondOpinion
from _statistics_study import STATISTICS_PARTS, statistics_claims

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.planner import Planner
from ir_planner.request.goals import Goal
from ir_planner.search import SEARCHES, repeatable
from ir_studies.arena import PORTFOLIO
from ir_studies.arena.figures import TIMES
from ir_studies.work.results import NAME

CELLS = ("open",)
PLANNERS = (PORTFOLIO, "genetic", "tree", "sbl", "kpiece", "bkpiece", "lbkpiece", "prm", "rrt", "rrt_connect",  # noqa: E501
            "aorrtc")  # fmt: skip
# s of a request: the work ends it, not the clock, also on a machine that others use
CEILING_S = 60.0
WAIT_S = 600.0
PARTS = ("planners", "killed", *STATISTICS_PARTS, *LAYOUT_PARTS)
IN_BOTH = (
    "portfolio",
    "sbl",
    "kpiece",
    "bkpiece",
    "lbkpiece",
    "rrt_connect",
)  # of the arena that is killed


@dataclass(frozen=True, eq=False)
class Answer:
    """What a planner found for a task, with the seed that solved it; certified, or None."""

    task: Task
    trajectory: JointTrajectory | None
    certified: bool
    seed: int
    milliseconds: float


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(
        __doc__,
        CELLS,
        3,
        "2 answers per planner that Coal checks, 1 seed and 3 planners of the arena, 8 pairs",
    )
    parser.add_argument(
        "--only", action="append", choices=PARTS, metavar="PART", help=", ".join(PARTS)
    )
    parser.add_argument(
        "--out", type=Path, help="where layout studies are kept; default: a folder for now"
    )
    parser.add_argument("--planner", action="append", help=f"default: {', '.join(PLANNERS)}")
    parser.add_argument(
        "--coal", type=int, default=24, help="answers per planner and cell that Coal checks"
    )
    given = parser.parse_args()
    if given.quick:
        given.coal = min(given.coal, 2)
    return given


def answer(planner: Planner, task: Task, name: str, seeds: int) -> Answer:
    """Ask with seed after seed until the task is solved; whatever is returned uncertified ends
    it.
    """
    begin = time.perf_counter()
    for seed in range(seeds):
        options = asked(task, seed)
        options = type(options)(
            **{
                **vars(options),
                "planner_id": "" if name == PORTFOLIO else name,
                "planning_time": CEILING_S,
            }
        )
        plan = planner.plan_regional(
            start=task.start, goal=Goal(configuration=task.goal), options=options
        )
        if plan.trajectory is not None:
            break
    took = 1e3 * (time.perf_counter() - begin)
    return Answer(
        task, plan.trajectory, plan.trajectory is None or plan.report.certified, seed, took
    )


def answers_of(
    cell: str, planners: Sequence[str], given: argparse.Namespace
) -> list[dict[str, object]]:
    """A row per planner: what it solved, what is not certified, and the least that Coal leaves."""
    tasks = tasks_of(cell)
    planner = Planner(cell)
    opinion = SecondOpinion(tasks[0].scene)
    rows = []
    for name in planners:
        found = [answer(planner, task, name, given.seeds) for task in tasks]
        solved = [one for one in found if one.trajectory is not None]
        seen = solved[:: max(len(solved) // given.coal, 1)][: given.coal]
        coal = [
            opinion.clearance_left(one.trajectory, one.task.margin)
            for one in seen
            if one.trajectory
        ]
        row: dict[str, object] = {
            "cell": cell,
            "planner": name,
            "solved": len(solved),
            "tasks": len(tasks),
        }
        row |= {"uncertified": sum(not one.certified for one in found), "coal": len(seen)}
        row |= {"left_mm": 1e3 * min((left for left, _ in coal), default=math.nan)}
        row |= {
            "asked": sum(count for _, count in coal),
            "most_seeds": 1 + max(one.seed for one in found),
        }
        row |= {"median_ms": sorted(one.milliseconds for one in found)[len(found) // 2]}
        rows.append(row)
        print(line_of(row), flush=True)
    return rows


def settings_file(folder: Path, cells: Sequence[str], planners: Sequence[str], seeds: int) -> Path:
    """An arena with one request per run."""
    path = folder / "arena.yaml"
    path.write_text(
        f"format: ir_arena/1\ncells: [{', '.join(cells)}]\nplanners: [{', '.join(planners)}]\n"
        f"seeds: {seeds}\nseconds: {CEILING_S}\nrequests: 1\nhang_after: 600\n"
    )
    return path


def arena(settings: Path, folder: Path) -> subprocess.Popen[bytes]:
    """Start the command."""
    words = ("study", "arena", str(settings), "-o", str(folder))
    command = (sys.executable, "-m", "ir_cli.main", *words)
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, start_new_session=True)


def killed_when(process: subprocess.Popen[bytes], results: Path, lines: int) -> int:
    """Kill the program with SIGKILL once so many lines are there; how many there were."""
    until = time.monotonic() + WAIT_S
    while time.monotonic() < until and process.poll() is None:
        count = results.read_bytes().count(b"\n") if results.exists() else 0
        if count >= lines:
            break
        time.sleep(0.02)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    return results.read_bytes().count(b"\n")


def table(folder: Path) -> list[dict[str, str]]:
    """The table without what a clock wrote, and without planners that can't promise the same
    bytes.
    """
    with (folder / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    free = {name for name, search in SEARCHES.items() if not repeatable(search)}
    return [
        {k: v for k, v in row.items() if k not in TIMES}
        for row in rows
        if row["planner"] not in free
    ]


def killed_and_resumed(cells: Sequence[str], planners: Sequence[str], seeds: int) -> list[Claim]:
    """Claims about an arena that was killed."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        settings = settings_file(folder, cells, planners, seeds)
        count = len(planners) * seeds * sum(len(tasks_of(cell)) for cell in cells)
        before = killed_when(arena(settings, folder / "a"), folder / "a" / NAME, 2 + count // 3)
        for name in ("a", "b"):
            if arena(settings, folder / name).wait(3600.0) != 0:
                return [at_least("the arena ends after it was killed", 0.0, "", 1.0)]
        one = table(folder / "a")
        other = table(folder / "b")
    print(f"killed after {before - 2} of {count} runs")
    differing = sum(a != b for a, b in zip(one, other, strict=True))
    return [
        at_least("killed and resumed: runs in the table", len(one), "", count),
        at_most("runs that differ from an arena that ran through", differing, "", 0.0),
    ]


def claims_of(rows: Sequence[dict[str, object]]) -> list[Claim]:
    """Claims about all planners."""
    total = {
        key: sum(float(str(row[key])) for row in rows) for key in ("solved", "tasks", "uncertified")
    }
    worst = min(
        float(str(row["solved"])) / float(str(row["tasks"]))
        for row in rows
        if row["cell"] == "open"
    )
    left = min(float(str(row["left_mm"])) for row in rows)
    seen, asked_ = (sum(int(str(row[key])) for row in rows) for key in ("coal", "asked"))
    return [
        at_least("tasks of `open` that the worst planner solves", 100.0 * worst, "%", 100.0),
        at_most(
            f"answers that are not certified, of {total['solved']:g}", total["uncertified"], "", 0.0
        ),
        at_least(
            f"Coal, {seen} answers at {asked_} places: distance over its bound", left, "mm", -1e-3
        ),
    ]


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    cells = given.cell or list(CELLS)
    planners = given.planner or list(PLANNERS)
    parts = given.only or PARTS
    rows = []
    claims = []
    if "planners" in parts:
        rows = [row for cell in cells for row in answers_of(cell, planners, given)]
        claims += claims_of(rows) if "open" in cells else []
    if "killed" in parts:
        both = [name for name in planners if name in IN_BOTH][
            : 3 if given.quick else None
        ] or planners
        claims += killed_and_resumed(cells[:1], both, 1 if given.quick else given.seeds)
    claims += statistics_claims(parts, given.out, quick=given.quick)
    claims += layout_claims("demo", parts, given.out, quick=given.quick)
    finish(given.json, rows, claims)


if __name__ == "__main__":
    main()
