"""Are paths of the tool driven as asked for, whenever somebody could, and how soon is that known?

    python benchmarks/cartesian.py [--cell FILE]... [--seeds N] [--first SEED] [--quick] [--json
    FILE]
Random lines, circles, splines and rounded corners in every cell, with and without a free angle
about the tool's axis. What is certified is judged by Pinocchio (places, speed), Coal (distances at
0.0005 rad) and 10 kHz samples (limits); what is refused is put to an oracle that draws
configurations and angles.
"""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass

import numpy as np
from _results import at_least, at_most, command_line, finish, line_of
from _second_opinion import SecondOpinion
from _tool_path_cases import MARGIN, oracle, random_path
from _tool_path_judge import seen

from ir_description import bundled_cells
from ir_msgs_py.cartesian import CartesianPath, CartesianSegment
from ir_msgs_py.options import PlanOptions
from ir_planner import CartesianPlan, Planner
from ir_planner.scene import PlanningScene

SEEDS = 200
QUICK_SEEDS = 8
CELLS = tuple(sorted(bundled_cells()))
# share of a limit, m of a distance, that rounding may cost
_LIMIT = 1.0 + 1e-6
_NEAR = 2e-6


@dataclass(frozen=True)
class Row:
    """One path: what it is, how it was answered in `process_s`, what the judges saw of a certified
    one.
    """

    cell: str
    seed: int
    kind: str
    free_angle: float
    process_s: float
    certified: bool
    oracle: bool
    tool_error_mm: float = 0.0
    claimed_mm: float = 0.0
    speed_off: float = 0.0
    clearance_left_mm: float = 0.0
    largest_share: float = 0.0
    refused: str = ""


def row_of(cell: str, seed: int, planner: Planner, judge: SecondOpinion) -> Row:
    """Plan a random path and judge the answer."""
    scene = planner.scene()
    rng = np.random.default_rng(seed)
    path = random_path(rng, scene)
    plan, took = timed(planner, path)
    kind = "corner" if len(path.segments) > 1 else path.segments[0].kind
    if plan.trajectory is None:
        can = oracle(path, scene, rng)
        return Row(cell, seed, kind, path.free_angle, took, False, can, refused=plan.status.message)
    found = seen(plan.trajectory, path, scene)
    left = 1e3 * judge.clearance_left(plan.trajectory, MARGIN)[0]
    share = judge.largest_share(plan.trajectory)
    figures = (1e3 * found.error, 1e3 * plan.tool_error, found.speed, left, share)
    return Row(cell, seed, kind, path.free_angle, took, plan.report.certified, True, *figures)


def timed(planner: Planner, path: CartesianPath) -> tuple[CartesianPlan, float]:
    """The answer, and its seconds of processor time."""
    began = time.process_time()
    plan = planner.plan_cartesian(path, options=PlanOptions(safety_distance=MARGIN))
    return plan, time.process_time() - began


def line_seconds(planner: Planner, scene: PlanningScene, count: int) -> list[float]:
    """Processor time of lines of 1 m that are certified."""
    took: list[float] = []
    rng = np.random.default_rng(1)
    while len(took) < count:
        start = np.array(random_path(rng, scene).start)
        end = np.array(start)
        ahead = rng.normal(size=3)
        end[:3, 3] += ahead / np.linalg.norm(ahead)
        path = CartesianPath(start, (CartesianSegment("line", (end,)),), tool_speed=0.25)
        plan, seconds = timed(planner, path)
        if plan.status.ok:
            took.append(seconds)
    return took


def main() -> None:
    """Run all cells and seeds."""
    parser = command_line(__doc__, CELLS, SEEDS, f"{QUICK_SEEDS} paths of each cell")
    parser.add_argument("--first", type=int, default=0, metavar="SEED", help="of the paths (0)")
    arguments = parser.parse_args()
    seeds = QUICK_SEEDS if arguments.quick else arguments.seeds
    rows: list[Row] = []
    lines: list[float] = []
    for cell in arguments.cell or CELLS:
        planner = Planner(cell)
        judge = SecondOpinion(planner.scene())
        for seed in range(arguments.first, arguments.first + seeds):
            rows.append(row_of(cell, seed, planner, judge))
            print(line_of(asdict(rows[-1])), flush=True)
        lines += line_seconds(planner, planner.scene(), max(seeds // 10, 2))
    certified = [row for row in rows if row.certified]
    objected = [
        r for r in certified if r.clearance_left_mm < -1e3 * _NEAR or r.largest_share > _LIMIT
    ]
    beyond = max(row.tool_error_mm - row.claimed_mm for row in certified)
    missed = [row for row in rows if row.oracle and not row.certified]
    claims = [
        at_least("paths certified", len(certified) / len(rows), "share", 0.5),
        at_most("refused that the oracle drives", len(missed), "paths", 0),
        at_most("tool error", max(row.tool_error_mm for row in certified), "mm", 0.1),
        at_most("tool error above its bound", beyond, "mm", 1e-3),
        at_most("speed off", max(row.speed_off for row in certified), "share", 0.01),
        at_most("certified that a judge objects to", len(objected), "paths", 0),
        at_most("line of 1 m, median", 1e3 * float(np.median(lines)), "ms", 50.0),
    ]
    finish(arguments.json, [asdict(row) for row in rows], claims, lines_s=lines)


if __name__ == "__main__":
    main()
