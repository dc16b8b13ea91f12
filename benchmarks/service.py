"""How fast and how surely does the robot get into and out of machines?

    python benchmarks/service.py [--cell FILE]... [--seeds N] [--coal N] [--no-ros] [--quick]
                                 [--json FILE]

At every station: configurations in closed form and by CCD from 32 starts; eq. (7) alone with
literal and inverse weighting; the whole movement. "path": found, shortened and proved as a path;
"answer": with its time, energy and the proof of the trajectory. Then Coal checks distances, the
limits are sampled at 10 kHz, and the node is asked.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from _node_process import running
from _regional_tasks import scene_of
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _second_opinion import SecondOpinion
from _service_stations import StationFigures, measured

from ir_msgs.srv import PlanServiceMovement
from ir_msgs_py import names
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.ros.client import Client
from ir_planner.scene.planning_scene import PlanningScene

# The node beside the core: what an answer over ROS takes longer, and whether ids repeat.


def over_ros(cell: str, stations: list[str], seeds: int) -> tuple[FloatArray, bool]:
    """Milliseconds that an answer of the node takes beyond its own planning_time, and whether ids
    repeat.
    """
    extra = []
    repeats = True
    with running("ir_planner.node", cell=cell), Client(timeout=60.0) as client:
        for station in stations:
            for seed in range(seeds):
                request = PlanServiceMovement.Request(station=station, max_candidates=1)
                request.options.seed = seed
                ids = []
                for _ in range(2):
                    begin = time.perf_counter()
                    answer = client.ask(names.PLAN_SERVICE_MOVEMENT, request)
                    took = time.perf_counter() - begin
                    extra.append((took - answer.info.planning_time) * 1e3)
                    ids.append(answer.candidates[0].trajectory_id)
                repeats &= ids[0] == ids[1]
    return np.array(extra[1:]), repeats  # the first one finds its service


CELLS = ("cnc_door", "deep_box", "demo")


def claims_of(figures: list[StationFigures]) -> list[Claim]:
    """What the stations say."""
    free = [f for f in figures if f.free]
    runs = sum(len(f.ccd_ms) for f in free)
    claims = [
        at_most(
            "closed form with clearances, per pose", max(f.analytic_ms for f in figures), "ms", 0.1
        ),
        at_least("ccd finds a free one", 100.0 * sum(f.ccd_found for f in free) / runs, "%", 98.0),
        at_most("ccd, median", float(np.median([f.ccd_ms for f in free])), "ms", 20.0),
        at_least("withdrawals certified", 100.0 * sum(f.found for f in free) / runs, "%", 100.0),
    ]
    for what, kinds, bound in (
        ("semi-closed", ("SEMI_CLOSED",), 10.0),
        ("closed", ("CLOSED",), 50.0),
        ("open", ("OPEN",), 10.0),
    ):
        there = [f for f in free if f.zone in kinds]
        if there:
            path = float(np.median([f.path_ms for f in there]))
            answer = float(np.median([f.answer_ms for f in there]))
            claims.append(at_most(f"path found and proved, {what}, median", path, "ms", bound))
            claims.append(
                at_most(f"answer with time and energy, {what}, median", answer, "ms", bound)
            )
    paths = np.concatenate([f.path_ms for f in free])
    answers = np.concatenate([f.answer_ms for f in free])
    claims.append(
        at_most("path found and proved, p95", float(np.percentile(paths, 95)), "ms", 250.0)
    )
    claims.append(
        at_most("answer with time and energy, p95", float(np.percentile(answers, 95)), "ms", 250.0)
    )
    return claims


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, CELLS, 5, "1 seed, the first cell, Coal at one station")
    parser.add_argument(
        "--coal", type=int, default=1, help="movements per station that Coal checks"
    )
    parser.add_argument("--no-ros", action="store_true", help="leave the node out")
    given = parser.parse_args()
    if given.quick:
        given.seeds = min(given.seeds, 1)
    given.cell = given.cell or CELLS[: 1 if given.quick else None]
    return given


def checked(
    figures: list[StationFigures], scenes: dict[str, PlanningScene], coal: int
) -> list[Claim]:
    """Second opinions: Coal looks at so many movements of a station, the limits are sampled in
    all.
    """
    opinions = {name: SecondOpinion(scene) for name, scene in scenes.items()}
    left: list[tuple[float, int]] = []
    shares: list[float] = []
    for figure in figures:
        opinion = opinions[figure.cell]
        shares += [opinion.largest_share(one) for one in figure.trajectories]
        asked = figure.trajectories[:coal]
        left += [opinion.clearance_left(one, figure.margin, figure.station) for one in asked]
    claims = []
    if left:
        name = (
            f"least distance beyond S_m by Coal, {sum(count for _, count in left)} configurations"
        )
        claims.append(at_least(name, min(least for least, _ in left), "m", -1e-6))
    if shares:
        claims.append(at_most("largest share of a limit at 10 kHz", max(shares), "1", 1.0 + 1e-6))
    return claims


def node_claims(figures: list[StationFigures], cell: str, seeds: int) -> list[Claim]:
    """What the node says at the stations of one cell."""
    stations = [figure.station for figure in figures if figure.cell == figures[0].cell]
    extra, repeats = over_ros(cell, stations, min(seeds, 3))
    return [
        at_most("over ROS, beyond the core's time, median", float(np.median(extra)), "ms", 20.0),
        at_least("same seed, same trajectory_id", 100.0 * repeats, "%", 100.0),
    ]


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    figures: list[StationFigures] = []
    scenes: dict[str, PlanningScene] = {}
    for name in given.cell:
        scene = scene_of(name)
        scenes[scene.cell.name] = scene
        for station in scene.cell.stations:
            figures.append(measured(scene, station, given.seeds))
            print(line_of(figures[-1].row()), flush=True)
    claims = [
        *claims_of(figures),
        *checked(figures[: 1 if given.quick else None], scenes, given.coal),
    ]
    if not given.no_ros:
        claims += node_claims(figures, given.cell[0], given.seeds)
    finish(given.json, [figure.row() for figure in figures], claims)


if __name__ == "__main__":
    main()
