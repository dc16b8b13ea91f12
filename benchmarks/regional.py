"""What does a regional movement cost, how fast is it known, and what do OMPL and TOPP-RA reach
beside it?

    python benchmarks/regional.py [--cell FILE]... [--task NAME]... [--seeds N] [--peers N] [--coal
    N]
                                  [--variants N [--variant-seed N]] [--best-seconds S]
                                  [--quick] [--json FILE] [--plot FILE]

Every task there and back with J = drive energy without base load + 500 W x T, with the default
budget; then OMPL's RRTConnect and BKPIECE1 (validity by the project's own kernel every 0.01 rad,
PathSimplifier; paths are not proved) with TOPP-RA over their paths (speed, acceleration and torque,
no limit of jerk) and the uniform slow-down of least J. The best known J is what any method finds in
some seconds per task. --variants: instead of the cells, N of each that nobody tuned for. Coal looks
at the first N different movements of a task.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from _regional_best import best_of
from _regional_figures import Figures, PeerRun, claims_of
from _regional_ompl import PLANNERS, SEARCH_S, ompl_path
from _regional_ours import Run, runs
from _regional_plot import plot
from _regional_tasks import CELLS, Task, tasks_of
from _regional_toppra import timed
from _results import command_line, finish, line_of
from _second_opinion import SecondOpinion
from _variants import variant_files

from ir_planner.planner import Planner

VARIANTS = Path("out/variants")
METHODS = 3  # of the best known J


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
    parser.add_argument(
        "--peers", type=int, default=5, help="searches of each of OMPL's planners per task"
    )
    parser.add_argument("--coal", type=int, default=1, help="movements per task that Coal checks")
    parser.add_argument(
        "--best-seconds", type=float, default=5.0, help="per task for the best known J"
    )
    parser.add_argument("--plot", type=Path, default=Path("out/regional.png"))
    given = parser.parse_args()
    if given.quick:
        given.seeds, given.peers, given.best_seconds = min(given.seeds, 2), min(given.peers, 1), 0.3
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
) -> tuple[str, float]:
    """Method and least J of these runs, and of longer ones of each method."""
    found = (
        [(name, cost.J) for name, cost in best_of(planner, task, seconds).items()]
        if seconds
        else []
    )
    found += [("planner", one.cost.J) for one in mine if one.cost is not None]
    found += [("OMPL", one.cost.J) for one in peers if one.cost is not None]
    return min(found, key=lambda entry: entry[1], default=("", float("inf")))


def measured(
    planner: Planner,
    task: Task,
    opinion: SecondOpinion,
    given: argparse.Namespace,
) -> Figures:
    """All figures of one task."""
    mine = runs(planner, task, given.seeds)
    peers = peer_runs(task, given.peers)
    by, J = best_known(planner, task, given.best_seconds / METHODS, mine, peers)
    different = {one.trajectory_id: one.trajectory for one in mine if one.trajectory is not None}
    coal = [
        opinion.clearance_left(one, task.margin) for one in list(different.values())[: given.coal]
    ]
    return Figures(
        task,
        tuple(mine),
        peers,
        by,
        J,
        left=min((left for left, _ in coal), default=float("nan")),
        asked=sum(count for _, count in coal),
        share=max((opinion.largest_share(one) for one in different.values()), default=float("nan")),
        trajectories=len(different),
    )


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
    columns += ["ompl_J", "ompl_T", "ompl_E", "best_J", "near_best", "best_by"]
    rows = [["-" if f.row().get(c) is None else str(f.row()[c]) for c in columns] for f in figures]
    heads = [c.replace("RRTConnect", "RRTC").replace("BKPIECE1", "BKP") for c in columns]
    widths = [max(len(line[k]) for line in [heads, *rows]) for k in range(len(columns))]
    for line in [heads, *rows]:
        print("  ".join(word.rjust(width) for word, width in zip(line, widths, strict=True)))


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    figures: list[Figures] = []
    for cell, tasks in chosen_tasks(given).items():
        planner = Planner(cell)
        opinion = SecondOpinion(tasks[0].scene)
        for task in tasks:
            figures.append(measured(planner, task, opinion, given))
            row = figures[-1].row()
            shown = ("task", "solved", "first_ms", "final_ms", "J", "ompl_J", "best_J")
            print(line_of({key: row.get(key, "-") for key in shown}), flush=True)
    print()
    tables(figures)
    plot(figures, given.plot)
    finish(given.json, [figure.row() for figure in figures], claims_of(figures))


if __name__ == "__main__":
    main()
