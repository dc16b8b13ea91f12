"""How fast is the simulated robot, and how regular is what the node publishes?

    python benchmarks/driver.py [--cell FILE]... [--seeds N] [--seconds S] [--quick] [--json FILE]

Each cell's robot carries its tool through random rest-to-rest movements within the limits, stepped
without ROS. Then the node runs as a process of its own, and a subscriber here counts its joint
states.

Periods are those of a machine that nobody else uses. Where others do, `chrt -f 10` before the
command keeps their turns out of the figures: beside 30 busy processes p99 was 2.4 ms then, at
2.07 ms of a bare sleep.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
from _driver_stream import streamed
from _results import Claim, at_least, at_most, command_line, finish, line_of

from ir_description import Cell, load_cell
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import (
    Simulation,
    TrajectoryGoal,
    TrajectoryRefusedError,
    make_simulation,
)

CELL = "demo"
DT = 0.001
MOVEMENTS = 4


def random_movements(
    simulation: Simulation, generator: np.random.Generator
) -> list[JointTrajectory]:
    """Quintic movements from rest to rest that the driver accepts, each starting where the last one
    ends.
    """
    robot = simulation.robot
    movements: list[JointTrajectory] = []
    q = simulation.executor.command
    while len(movements) < MOVEMENTS:
        reach = 0.35 * (robot.position_max - robot.position_min)
        target = np.clip(
            q + generator.uniform(-1.0, 1.0, 6) * np.minimum(reach, 0.8),
            robot.position_min + 0.05,
            robot.position_max - 0.05,
        )
        delta = np.abs(target - q)
        T = max(
            float((1.9 * delta / robot.velocity_max).max()),
            float(np.sqrt(6.0 * delta / robot.acceleration_max).max()),
        )
        for factor in (1.2, 1.5, 2.0, 3.0):  # the torque may need more time
            rest = np.zeros((2, 6))
            trajectory = JointTrajectory.from_seconds(
                robot.joint_names, [0.0, factor * T], [q, target], rest, rest
            )
            try:
                simulation.vet(TrajectoryGoal(trajectory), 0)
            except TrajectoryRefusedError:
                continue
            movements.append(trajectory)
            q = target
            break
    return movements


def stepped(cell: Cell, backend: str, seed: int) -> dict[str, Any]:
    """Drive random movements without ROS; factor over real time."""
    simulation = make_simulation(cell, backend=backend)
    movements = random_movements(simulation, np.random.default_rng(seed))
    seconds = 0.0
    cpu = 0.0
    for trajectory in movements:
        simulation.execute(simulation.vet(TrajectoryGoal(trajectory), 0), 0)
        began = simulation.time
        clock = time.process_time()
        outcomes: list[Any] = []
        while not outcomes:
            simulation.run(0.05)
            outcomes = simulation.take_outcomes()
        cpu += time.process_time() - clock
        seconds += simulation.time - began
    return {
        "case": f"stepped {backend}",
        "cell": cell.name,
        "seed": seed,
        "factor": seconds / cpu,
        "us_per_step": 1e6 * cpu * DT / seconds,
    }


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """The figures that were asked for, the worst over all rows."""

    def over(case: str, key: str, pick: Callable[[Iterator[float]], float] = max) -> float:
        return float(pick(row[key] for row in rows if row["case"] == case))

    bullet = "stepped pybullet"
    ideal = "stepped ideal"
    streams = "streamed pybullet"
    claims = [
        at_least("stepped with PyBullet, times real time", over(bullet, "factor", min), "", 10.0),
        at_least(
            "stepped with the ideal robot, times real time", over(ideal, "factor", min), "", 100.0
        ),
    ]
    if any(row["case"] == streams for row in rows):
        claims += [
            at_most("joint_states p99 period", over(streams, "p99_ms"), "ms", 2.5),
            at_most("joint_states lost", over(streams, "lost"), "", 0),
            at_most("CPU of the node", over(streams, "cpu_percent"), "% of a core", 50.0),
        ]
    return claims


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = command_line(__doc__, (CELL,), 3, "1 seed, 3 s of listening")
    heard = "of listening to the node; 0 leaves it out"
    parser.add_argument("--seconds", type=float, default=10.0, help=heard)
    given = parser.parse_args()
    if given.quick:
        given.seeds, given.seconds = min(given.seeds, 1), min(given.seconds, 3.0)
    return given


def main() -> None:
    """Measure, print, write."""
    given = arguments()
    rows: list[dict[str, Any]] = []
    cells = given.cell or [CELL]
    for name in cells:
        cell = load_cell(name)
        for seed in range(given.seeds):
            rows += [stepped(cell, backend, seed) for backend in ("pybullet", "ideal")]
    if given.seconds > 0.0:
        rows.append(streamed(cells[0], given.seconds))
    for row in rows:
        print(line_of(row))
    finish(given.json, rows, claims_of(rows))


if __name__ == "__main__":
    main()
