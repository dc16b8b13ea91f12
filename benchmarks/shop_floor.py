"""What is left of a program that goes through KRL, what do today's programs lose, what is a trace
worth?

    python benchmarks/shop_floor.py [--cell FILE]... [--seeds N] [--quick] [--json FILE]

Every cell's program, or a random visit of its stations for each seed, is planned, written as KRL,
read back, driven by the controller's model and certified again: what that costs, how near the ends
come, and what Coal at 0.0005 rad and limits at 10 kHz say of it. These cells and cells drawn at
random are written in every style and read back, each step beside what its comment says. Programs
made around motions that are known are read. The programs of the tests' corpus make the same trip.
Four programs of today, one of them with a seam, are held against the planner's. Motions of known
energy are sampled with noise and judged from positions alone.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np
from _results import at_least, at_most, command_line, finish, line_of
from _second_opinion import SecondOpinion
from _shop_baselines import baselines
from _shop_corpus import corpus
from _shop_hidden import PROGRAMS, QUICK_PROGRAMS, hidden_truths
from _shop_round_trip import DRAWN, QUICK_DRAWN, STOPPED, round_trips
from _shop_traces import traces

from ir_description import bundled_cells, load_cell
from ir_krl import follow, parse
from ir_krl.write import plc_input
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, ProgramPlan, RequestError
from ir_planner.krl import KrlExport, evaluate_krl, export_krl, tool_in_flange
from ir_planner.krl.step_evaluation import contacts_at, scenes_of

SEEDS = 3
QUICK_SEEDS = 1
VISITS = 3
MARGIN = 0.02  # m, the default of a request
PROOF_MM = -0.1  # what a proof may leave: its tolerance, and Coal's own
CELLS = tuple(sorted(bundled_cells()))


@dataclass(frozen=True)
class Row:
    """One program: movements; seconds and joules of the movements before and after; the largest
    deviation of a joint [rad], the largest error of an end that is read back [deg, mm]; by Coal the
    least distance above what its pair must keep [mm], at 10 kHz the largest share of a limit; why
    it was refused, else "".
    """

    cell: str
    seed: int
    movements: int
    planned_s: float
    exported_s: float
    planned_joules: float
    exported_joules: float
    deviation_rad: float
    end_deg: float
    end_mm: float
    certified: bool
    coal_left_mm: float
    limit_share: float
    refused: str
    process_s: float


def stations_for(planner: Planner, seed: int) -> tuple[str, ...]:
    """Seed 0 asks for the cell's program where it has one, the others for stations drawn at
    random.
    """
    cell = planner.cell
    if seed == 0 and cell.program:
        return ()
    names = sorted(station.name for station in cell.stations)
    drawn = np.random.default_rng(seed).choice(names, min(VISITS, len(names)), replace=False)
    return (*(str(name) for name in drawn), "home")


def row_of(cell: str, seed: int, planner: Planner) -> Row | None:
    """Plan, export, read back; None where the planner finds no program."""
    plan = planner.plan_program(
        stations=stations_for(planner, seed), start=planner.cell.posture("park")
    )
    if not plan.status.ok:
        return None
    moving = [step for step in plan.movements if not step.is_pause]
    began = time.process_time()
    try:
        export = export_krl(planner, plan.movements, "shop_floor")
    except RequestError as error:
        took = time.process_time() - began
        return Row(cell, seed, len(moving), 0, 0, 0, 0, 0, 0, 0, False, 0, 0, str(error), took)
    took = time.process_time() - began
    driven = driven_again(planner, export)
    degrees, millimetres = ends_apart(planner, plan, driven)
    left, share = second_opinion(planner, plan, driven)
    before = export.planned
    after = export.exported
    figures = (before.duration, after.duration, before.energy, after.energy, export.deviation)
    judged = (export.exported.certified, left, share)
    return Row(cell, seed, len(moving), *figures, degrees, millimetres, *judged, "", took)


def driven_again(planner: Planner, export: KrlExport) -> list[JointTrajectory]:
    """The movements of what is read back."""
    cell = planner.cell
    texts = [parse(export.source, "shop_floor.src"), parse(export.data, "shop_floor.dat")]
    inputs = plc_input(texts, there=False)
    program = follow(texts, cell.machine_home, tool_in_flange(cell.tcp), inputs=inputs)
    return [one.step.trajectory for one in evaluate_krl(planner, program).steps if one.step.moves]


def ends_apart(
    planner: Planner, plan: ProgramPlan, driven: Sequence[JointTrajectory]
) -> tuple[float, float]:
    """Largest error of an end of a movement [deg], [mm] of the tcp."""
    planned = [step.trajectory for step in plan.movements if step.trajectory is not None]
    pairs = list(zip(driven, planned, strict=True))
    first, second = (
        np.array([pair[side].positions[k] for pair in pairs for k in (0, -1)]) for side in (0, 1)
    )
    chain = planner.scene("").chain
    away = chain.tcp_poses(first)[:, :3, 3] - chain.tcp_poses(second)[:, :3, 3]
    return float(np.degrees(np.abs(first - second)).max()), 1e3 * float(
        np.linalg.norm(away, axis=1).max()
    )


def second_opinion(
    planner: Planner, plan: ProgramPlan, driven: Sequence[JointTrajectory]
) -> tuple[float, float]:
    """By Coal the least distance above what is kept [mm]; the largest share of a limit at 10
    kHz.
    """
    scenes = scenes_of(
        plan.movements, planner.cell, planner.scene("").power, planner.scene("").drives
    )
    moving = [(s, scene) for s, scene in zip(plan.movements, scenes, strict=True) if not s.is_pause]
    left = np.inf
    share = 0.0
    for trajectory, (step, scene) in zip(driven, moving, strict=True):
        opinion = SecondOpinion(scene)
        left = min(left, opinion.clearance_left(trajectory, MARGIN, contacts_at(step))[0])
        share = max(share, opinion.largest_share(trajectory))
    return 1e3 * float(left), share


def main() -> None:
    """Run all cells and seeds."""
    parser = command_line(__doc__, CELLS, SEEDS, "one program of each cell")
    arguments = parser.parse_args()
    seeds = QUICK_SEEDS if arguments.quick else arguments.seeds
    rows: list[Row] = []
    for cell in arguments.cell or CELLS:
        load_cell(cell)
        planner = Planner(cell, clock=STOPPED)
        for seed in range(seeds):
            row = row_of(cell, seed, planner)
            if row is not None:
                rows.append(row)
                print(line_of(asdict(row)), flush=True)
    written = [row for row in rows if not row.refused]
    slower = [row.exported_s / row.planned_s - 1.0 for row in written]
    dearer = [row.exported_joules / row.planned_joules - 1.0 for row in written]
    claims = [
        at_least("programs written", len(written) / len(rows), "share", 1.0),
        at_least(
            "of them certified again",
            float(np.mean([row.certified for row in written])),
            "share",
            1.0,
        ),
        at_most("ends that are read back", max(row.end_deg for row in written), "deg", 1e-4),
        at_most("ends that are read back", max(row.end_mm for row in written), "mm", 1e-3),
        at_most(
            "joints apart from the plan", max(row.deviation_rad for row in written), "rad", 2e-3
        ),
        at_most("slower than planned, median", 100.0 * float(np.median(slower)), "%", 5.0),
        at_most("dearer than planned, median", 100.0 * float(np.median(dearer)), "%", 2.0),
        at_least(
            "by Coal, above what is kept", min(row.coal_left_mm for row in written), "mm", PROOF_MM
        ),
        at_most("limits at 10 kHz", max(row.limit_share for row in written), "share", 1.0 + 1e-6),
    ]
    found = [
        ([asdict(row) for row in rows], claims),
        round_trips(QUICK_DRAWN if arguments.quick else DRAWN),
        hidden_truths(QUICK_PROGRAMS if arguments.quick else PROGRAMS),
        corpus(),
        baselines(),
        traces(),
    ]
    everything = [row for of_one, _ in found for row in of_one]
    finish(arguments.json, everything, [claim for _, of_one in found for claim in of_one])


if __name__ == "__main__":
    main()
