"""How near is a movement of a requested duration to the least energy, and what does the baseline
cost?

    python benchmarks/energy.py [--cell FILE]... [--movements N] [--starts N] [--seeds N] [--quick]
                                [--json FILE]

Free movements between random configurations, in turn with the cell's tool and without load, at 1.2
and 1.5 times the fastest that the planner finds. Drive energy of the planner's answer beside the
best of N starts of IPOPT (CasADi; mesh of 60 intervals, Coulomb friction smoothed over 0.01 rad/s),
whose answers are put on the same interpolant and slowed down until they are certified; and beside
the baseline movement. Both keep the planner's reserve of torque. All energies by the implementation
on Pinocchio, which shares no code with the compiled core. Planning takes processor time.
"""

from __future__ import annotations

import argparse
import importlib
import importlib.util
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Protocol

import numpy as np
from _baseline import baseline, fastest_baseline
from _drives import Drives
from _results import Claim, at_least, at_most, command_line, finish, line_of

from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Goal, Planner
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

FACTORS = (1.2, 1.5)
CEILING = 120.0  # s: work ends a request, never the clock
# m: safety distance; clearance of the straight movement, so that peers stay free
S_M = 0.02
AROUND = 0.08
REACH = (0.4, 1.6)  # rad: largest joint of a movement
# steps of the slow-down of a peer's answer, and how much of it at most
SLOWER = 1.002
MOST = 1.03
TIMED = 3  # answers whose median time counts


@dataclass(frozen=True, eq=False)
class Case:
    """A free movement q0 -> q1 (n,) with a load and a requested duration [s]."""

    q0: FloatArray
    q1: FloatArray
    load: str
    factor: float
    duration: float


@dataclass(frozen=True)
class Row:
    """Drive energies [J] at one duration [s]; best: of the peers; nan where there is none."""

    cell: str
    movement: int
    load: str
    factor: float
    duration: float
    planner: float
    best: float
    baseline: float
    peers: int
    starts: int
    planning_ms: float
    disagreement: float

    @property
    def above_best(self) -> float:
        """How far the planner is above the best peer [%]."""
        return 100.0 * (self.planner / self.best - 1.0)


class Peer(Protocol):
    """Another method for the least energy at a duration."""

    def solve(
        self, q0: FloatArray, q1: FloatArray, duration: float, seed: int
    ) -> JointTrajectory | None:
        """A movement q0 -> q1 (n,) in `duration` [s], None where it finds none."""


def peer_of(scene: PlanningScene) -> Peer:
    """IPOPT for a scene."""
    if importlib.util.find_spec("casadi") is None:
        raise SystemExit(
            "CasADi is not installed: run make setup, or leave its starts out with --starts 0"
        )
    peer: Peer = importlib.import_module("_energy_peer").EnergyPeer(scene)
    return peer


def movements(
    scene: PlanningScene, count: int, seed: int
) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Ends (n,) of straight movements that keep AROUND, in mixed directions."""
    robot = scene.cell.robot
    rng = np.random.default_rng(seed)
    t = np.linspace(0.0, 1.0, 60)[:, None]
    while count:
        q0 = rng.uniform(robot.position_min, robot.position_max)
        step = rng.normal(size=robot.n)
        q1 = q0 + rng.uniform(*REACH) * step / np.abs(step).max()
        inside = (q1 > robot.position_min).all() and (q1 < robot.position_max).all()
        if inside and scene.collision.is_free(q0 + t * (q1 - q0), AROUND).all():
            yield q0, q1
            count -= 1


def certified(
    planner: Planner, trajectory: JointTrajectory, scene: PlanningScene, load: str
) -> JointTrajectory | None:
    """A peer's answer, slowed down uniformly until it is certified; None where that does not
    help.
    """
    factor = 1.0
    while factor <= MOST:
        slower = _slowed(trajectory, factor)
        if planner.evaluate(slower, safety_distance=S_M, load=load).verification.certified:
            return slower
        factor *= SLOWER
    return None


def _slowed(trajectory: JointTrajectory, factor: float) -> JointTrajectory:
    assert trajectory.velocities is not None
    assert trajectory.accelerations is not None
    return JointTrajectory.from_seconds(
        trajectory.joint_names,
        factor * trajectory.times,
        trajectory.positions,
        trajectory.velocities / factor,
        trajectory.accelerations / factor**2,
    )


def measured(
    cell: str,
    number: int,
    case: Case,
    planner: Planner,
    drives: Drives,
    peer: Peer | None,
    starts: int,
) -> Row:
    """The planner, its peers and the baseline at one duration."""
    scene = planner.scene(case.load)
    options = PlanOptions(
        objective="energy",
        duration=case.duration,
        load=case.load,
        planning_time=CEILING,
        safety_distance=S_M,
    )
    took = []
    for _ in range(TIMED):
        begin = time.process_time()
        plan = planner.plan_regional(
            start=case.q0, goal=Goal(configuration=case.q1), options=options
        )
        took.append(1e3 * (time.process_time() - begin))
    mine = float("nan")
    disagreement = 0.0
    if plan.trajectory is not None:
        mine = drives.energy(plan.trajectory)
        disagreement = abs(mine / (plan.report.energy - plan.report.base_energy) - 1.0)
    solved = (
        []
        if peer is None
        else [peer.solve(case.q0, case.q1, case.duration, k) for k in range(starts)]
    )
    kept = [certified(planner, one, scene, case.load) for one in solved if one is not None]
    costs = [drives.energy(one) for one in kept if one is not None]
    plain = float("nan")
    if fastest_baseline(case.q0, case.q1, scene, drives) <= case.duration:
        plain = drives.energy(baseline(case.q0, case.q1, scene, case.duration))
    return Row(
        cell=cell,
        movement=number,
        load=case.load or "tool",
        factor=case.factor,
        duration=case.duration,
        planner=mine,
        best=min(costs, default=float("nan")),
        baseline=plain,
        peers=len(costs),
        starts=starts,
        planning_ms=float(np.median(took)),
        disagreement=disagreement,
    )


def rows_of(cell: str, count: int, starts: int, seed: int) -> Iterator[Row]:
    """All durations of every movement of a cell."""
    planner = Planner(cell)
    loads = ("", NO_LOAD)
    drives = {load: Drives(planner.scene(load)) for load in loads}
    peers = {load: peer_of(planner.scene(load)) if starts else None for load in loads}
    for number, (q0, q1) in enumerate(movements(planner.scene(""), count, seed)):
        load = loads[number % len(loads)]
        options = PlanOptions(
            objective="time", load=load, planning_time=CEILING, safety_distance=S_M
        )
        fastest = planner.plan_regional(
            start=q0, goal=Goal(configuration=q1), options=options
        ).report.duration
        for factor in FACTORS:
            case = Case(q0, q1, load, factor, factor * fastest)
            yield measured(cell, number, case, planner, drives[load], peers[load], starts)


def claims_of(rows: list[Row]) -> list[Claim]:
    """What the movements are held to."""
    beside = [row.above_best for row in rows if np.isfinite(row.best)]
    against = [row for row in rows if np.isfinite(row.baseline)]
    unsolved = sum(not np.isfinite(row.planner) for row in rows)
    above = sum(not row.planner <= row.baseline for row in against)
    saved = [100.0 * (1.0 - row.planner / row.baseline) for row in against]
    claims = [at_most(f"requested durations that are refused, of {len(rows)}", unsolved, "", 0)]
    if beside:
        claims += [
            at_most(
                f"drive energy above the best peer, median of {len(beside)}",
                np.median(beside),
                "%",
                1.0,
            ),
            at_most("drive energy above the best peer, worst", max(beside), "%", 3.0),
        ]
    if against:
        claims += [
            at_most(f"answers above the baseline movement, of {len(against)}", above, "", 0),
            at_least(
                "saved against the baseline movement, median", float(np.median(saved)), "%", 0.0
            ),
        ]
    slowest = float(np.median([row.planning_ms for row in rows]))
    different = max(row.disagreement for row in rows)
    return [
        *claims,
        at_most("processor time of planning, median", slowest, "ms", 50.0),
        at_most("reported energy against the independent one", different, "1", 1e-6),
    ]


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, ("open",), 1, "2 movements, 1 start of IPOPT")
    parser.add_argument("--movements", type=int, default=10, help="per cell; default: 10")
    parser.add_argument(
        "--starts", type=int, default=10, help="of IPOPT per duration; default: 10; 0: none"
    )
    given = parser.parse_args()
    if given.quick:
        given.movements, given.starts = min(given.movements, 2), min(given.starts, 1)
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows: list[Row] = []
    for cell in given.cell or ("open",):
        for seed in range(given.seeds):
            for row in rows_of(cell, given.movements, given.starts, seed):
                rows.append(row)
                print(line_of({**asdict(row), "above_best_%": row.above_best}), flush=True)
    finish(given.json, [asdict(row) for row in rows], claims_of(rows))


if __name__ == "__main__":
    main()
