"""What does a regional movement cost, how fast is it known, and what do OMPL and TOPP-RA reach
beside it?

    python benchmarks/regional.py [--cell FILE]... [--task NAME]... [--seeds N] [--peers N] [--coal
    N]
                                  [--variants N [--variant-seed N]]
                                  [--patient N] [--best-seconds S | --minute] [--best FILE]
                                  [--quick] [--json FILE] [--plot FILE]

Every task there and back with J = drive energy without base load + 500 W x T, with the default
budget and with 1 s of work; then OMPL's RRTConnect and
BKPIECE1 (validity by the project's own kernel every 0.01 rad, PathSimplifier) with TOPP-RA over
their paths (speed, acceleration and torque, no limit of jerk) and the uniform slow-down of least J.
The best known J
is what any method finds in longer time: some seconds per task, or --minute for 60 s of each method;
an earlier run's JSON adds what it found by --best. --variants: instead of the cells, N of each that
nobody tuned for. Coal looks at the first N different movements of a task.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from _regional_best import best_of, read
from _regional_figures import Figures, PeerRun, claims_of
from _regional_ompl import PLANNERS, SEARCH_S, ompl_path
from _regional_ours import (
    Run,
    asked,
    knows,
    notes_first,
    patient_runs,
    planner_of,
    repeats,
    runs,
    solved_alone,
)
from _regional_plot import plot
from _regional_tasks import CELLS, Task, tasks_of
from _regional_toppra import timed
from _results import Claim, at_least, command_line, finish, line_of
from _second_opinion import SecondOpinion
from _variants import variant_files

from ir_planner.planner import Planner
from ir_planner.request.goals import Goal

VARIANTS = Path("out/variants")
METHODS = 3  # of the best known J
GENETIC = "genetic"
GENETIC_CELLS = ("open", "table_columns")


def arguments() -> argparse.Namespace:
    """The command line."""
    quick = "2 tasks per cell there and back, 2 seeds, 1 search, 0.3 s for the best known J"
    parser = command_line(__doc__, CELLS, 30, quick)
    parser.add_argument("--task", action="append", help="only tasks of this name, as home->p1")
    parser.add_argument(
        "--variants", type=int, default=0, help="mirrored, turned and jittered ones per cell"
    )
    parser.add_argument(
        "--variant-seed", type=int, default=0, help="what the variants are drawn from"
    )
    parser.add_argument("--patient", type=int, default=3, help="seeds with 1 s of work per task")
    parser.add_argument(
        "--peers", type=int, default=5, help="searches of each of OMPL's planners per task"
    )
    parser.add_argument("--coal", type=int, default=1, help="movements per task that Coal checks")
    parser.add_argument(
        "--best-seconds", type=float, default=5.0, help="per task for the best known J"
    )
    parser.add_argument(
        "--minute", action="store_true", help="60 s of each method for the best known J"
    )
    parser.add_argument(
        "--best", type=Path, help="JSON of an earlier run whose best J count as well"
    )
    parser.add_argument("--plot", type=Path, default=Path("out/regional.png"))
    given = parser.parse_args()
    if given.quick:
        given.seeds, given.peers, given.best_seconds = min(given.seeds, 2), min(given.peers, 1), 0.3
        given.patient = min(given.patient, 1)
    return given


def chosen_tasks(given: argparse.Namespace) -> dict[str, list[Task]]:
    """The tasks of each cell that are asked for."""
    cells = list(given.cell or CELLS)
    if given.variants:
        cells = variant_files(cells, given.variants, given.variant_seed, VARIANTS)
    chosen = {cell: tasks_of(cell) for cell in cells}
    if given.task:
        chosen = {
            cell: [t for t in tasks if t.name in given.task] for cell, tasks in chosen.items()
        }
    elif given.quick:
        chosen = {cell: tasks[:4] for cell, tasks in chosen.items()}
    chosen = {cell: tasks for cell, tasks in chosen.items() if tasks}
    if not chosen:
        raise SystemExit("no cell has such a task")
    return chosen


def peer_runs(task: Task, count: int) -> tuple[PeerRun, ...]:
    """Searches of OMPL with their times by TOPP-RA."""
    found = []
    for planner in PLANNERS:
        for _ in range(count):
            begin = time.perf_counter()
            path = ompl_path(task, planner)
            done = timed(path, task) if path is not None else None
            took = 1e3 * (time.perf_counter() - begin)
            first = 1e3 * path.first_s if path is not None else 1e3 * SEARCH_S
            cost, how = (done[1], done[2]) if done is not None else (None, "")
            found.append(PeerRun(planner, first, took, cost, how))
    return tuple(found)


def best_known(
    planner: Planner,
    task: Task,
    seconds: float,
    mine: list[Run],
    peers: tuple[PeerRun, ...],
    earlier: dict[str, tuple[str, float]],
) -> tuple[str, float]:
    """Method and least J of these runs, of longer ones of each method, and of an earlier
    benchmark.
    """
    found = (
        [(name, cost.J) for name, cost in best_of(planner, task, seconds).items()]
        if seconds
        else []
    )
    found += [("planner", one.cost.J) for one in mine if one.cost is not None]
    found += [("OMPL", one.cost.J) for one in peers if one.cost is not None]
    found += [earlier[task.label]] if task.label in earlier else []
    return min(found, key=lambda entry: entry[1], default=("", float("inf")))


def measured(
    planner: Planner,
    task: Task,
    opinion: SecondOpinion,
    given: argparse.Namespace,
    earlier: dict[str, tuple[str, float]],
) -> Figures:
    """All figures of one task."""
    mine = runs(planner, task, given.seeds)
    patient = patient_runs(planner, task, given.patient)
    peers = peer_runs(task, given.peers)
    seconds = 60.0 if given.minute else given.best_seconds / METHODS
    by, J = best_known(planner, task, seconds, [*mine, *patient], peers, earlier)
    different = {one.trajectory_id: one.trajectory for one in mine if one.trajectory is not None}
    coal = [
        opinion.clearance_left(one, task.margin) for one in list(different.values())[: given.coal]
    ]
    return Figures(
        task,
        tuple(mine),
        tuple(patient),
        peers,
        by,
        J,
        left=min((left for left, _ in coal), default=float("nan")),
        asked=sum(count for _, count in coal),
        share=max((opinion.largest_share(one) for one in different.values()), default=float("nan")),
        trajectories=len(different),
    )


def genetic_claims(asked_tasks: dict[str, list[Task]], seeds: int) -> list[Claim]:
    """What the genetic search solves alone, per cell."""
    solved = 0
    count = 0
    for cell, tasks in asked_tasks.items():
        planner = planner_of(cell)
        if not knows(planner, tasks[0], GENETIC):
            print(f"planner_id {GENETIC!r} is unknown to this planner: its claim is left out")
            return []
        found, of = solved_alone(planner, tasks, GENETIC, seeds)
        print(f"planner_id {GENETIC!r} alone, {cell}: {found} of {of} answers certified")
        if tasks[0].cell in GENETIC_CELLS:
            solved = solved + found
            count = count + of
    if not count:
        return []
    return [
        at_least(
            f"{GENETIC} alone, {' and '.join(GENETIC_CELLS)}", 100.0 * solved / count, "%", 100.0
        )
    ]


def repeat_claim(asked_tasks: dict[str, list[Task]]) -> Claim:
    """Whether the same seed gives the same trajectory_id, also when two threads plan at once."""
    found = [repeats(planner_of(cell), tasks) for cell, tasks in asked_tasks.items()]
    same, count = (sum(column) for column in zip(*found, strict=True))
    name = f"same seed, same trajectory_id, also in two threads, {count} answers"
    return at_least(name, 100.0 * same / count, "%", 100.0)


def tables(figures: list[Figures]) -> None:
    """Print what was measured, OMPL beside the planner."""
    planners = list(dict.fromkeys(peer.planner for f in figures for peer in f.peers))
    columns = [
        "task",
        "S_m_mm",
        "solved",
        "truncated",
        "first_ms",
        "final_ms",
        "J",
        "T",
        "E",
        "clearance_mm",
    ]
    columns += [
        f"{name}_{what}" for name in planners for what in ("solved", "first_ms", "final_ms", "J")
    ]
    columns += ["ompl_J", "ompl_T", "ompl_E", "best_J", "near_best", "near_best_1s", "best_by"]
    rows = [["-" if f.row().get(c) is None else str(f.row()[c]) for c in columns] for f in figures]
    heads = [c.replace("RRTConnect", "RRTC").replace("BKPIECE1", "BKP") for c in columns]
    widths = [max(len(line[k]) for line in [heads, *rows]) for k in range(len(columns))]
    for line in [heads, *rows]:
        print("  ".join(word.rjust(width) for word, width in zip(line, widths, strict=True)))


def remarks(given: argparse.Namespace, noted: bool, earlier: bool) -> None:
    """Print how the figures were found."""
    print()
    if not noted:
        print(
            "no stage notes the first feasible path: its time is that of the whole stage that "
            "found it"
        )
    spent = (
        "60 s of each method"
        if given.minute
        else f"{given.best_seconds:g} s per task for all methods"
    )
    print(f"best known J: these runs, {spent}{', an earlier run' if earlier else ''}")
    print("OMPL: paths sampled every 0.01 rad, not proved; TOPP-RA: no limit of jerk")


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    earlier = read(given.best) if given.best else {}
    chosen = chosen_tasks(given)
    figures: list[Figures] = []
    noted = True
    for cell, tasks in chosen.items():
        planner = planner_of(cell)
        opinion = SecondOpinion(tasks[0].scene)
        for task in tasks:
            figures.append(measured(planner, task, opinion, given, earlier))
            row = figures[-1].row()
            shown = ("task", "solved", "first_ms", "final_ms", "J", "ompl_J", "best_J")
            print(line_of({key: row.get(key, "-") for key in shown}), flush=True)
        plan = planner.plan_regional(
            start=tasks[0].start, goal=Goal(configuration=tasks[0].goal), options=asked(tasks[0])
        )
        noted &= notes_first(plan.info)
    print()
    tables(figures)
    remarks(given, noted, bool(earlier))
    claims = [
        *claims_of(figures),
        *genetic_claims(chosen, min(given.seeds, 5)),
        repeat_claim(chosen),
    ]
    plot(figures, given.plot)
    finish(given.json, [figure.row() for figure in figures], claims)


if __name__ == "__main__":
    main()
