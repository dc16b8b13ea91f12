"""How fast is the simulated robot, how well does it follow, and how regular is what the node publishes?

    python benchmarks/driver.py [--cell FILE]... [--seeds N] [--seconds S] [--json FILE]

Each cell's robot carries its tool through random rest-to-rest movements within the limits, stepped without
ROS; then the node runs as a process of its own, and a subscriber in this process counts its joint states.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from ir_kernels.power import DcBusParameters, dc_bus
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver.assembly import make_simulation
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.goal import TrajectoryGoal
from ir_sim_driver.simulation import Simulation

from ir_description import Cell, load_cell

DT = 0.001
MOVEMENTS = 4


@dataclass(frozen=True)
class Claim:
    """One figure with its bound."""

    name: str
    value: float
    unit: str
    bound: float
    at_least: bool

    @property
    def holds(self) -> bool:
        """Whether the figure keeps its bound."""
        return self.value >= self.bound if self.at_least else self.value <= self.bound


def random_movements(simulation: Simulation, generator: np.random.Generator) -> list[JointTrajectory]:
    """Quintic movements from rest to rest that the driver accepts, each starting where the last one ends."""
    robot, movements = simulation.robot, []
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


def model_energy(simulation: Simulation, trajectory: JointTrajectory) -> float:
    """Joules at the mains of a movement by the kernels' dynamics, base load included."""
    t = np.arange(0.0, trajectory.duration, DT) + 0.5 * DT
    s = trajectory.sample(t)
    power = simulation.dynamics.drive_power(s.q, s.qd, s.qdd)
    bus = dc_bus(power, DT, DcBusParameters(106.0))
    base = simulation.base.of(simulation.modes.level)
    return float(DT * bus.mains.sum() + base * trajectory.duration)


def stepped(cell: Cell, backend: str, seed: int) -> dict[str, Any]:
    """Drive random movements without ROS; factor over real time, deviation, energy against the model."""
    simulation = make_simulation(cell, backend=backend)
    movements = random_movements(simulation, np.random.default_rng(seed))
    worst_energy, deviation, seconds, cpu = 0.0, 0.0, 0.0, 0.0
    for trajectory in movements:
        simulation.execute(simulation.vet(TrajectoryGoal(trajectory), 0), 0)
        began, clock = simulation.time, time.process_time()
        outcomes: list[Any] = []
        while not outcomes:
            simulation.run(0.05)
            outcomes = simulation.take_outcomes()
        cpu += time.process_time() - clock
        seconds += simulation.time - began
        deviation = max(deviation, outcomes[0].max_tool_deviation)
        planned = model_energy(simulation, trajectory)
        error = abs(outcomes[0].energy - planned)
        worst_energy = max(worst_energy, 0.0 if error < 200.0 else error / planned)
    return {
        "case": f"stepped {backend}",
        "cell": cell.name,
        "seed": seed,
        "factor": seconds / cpu,
        "us_per_step": 1e6 * cpu * DT / seconds,
        "deviation_mm": 1e3 * deviation,
        "energy_error": worst_energy,
    }


def streamed(cell: str, seconds: float) -> dict[str, Any]:
    """Run the node as a process and listen to joint_states for so long."""
    os.environ.setdefault("ROS_DOMAIN_ID", "83")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    import rclpy
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import JointState

    command = [
        sys.executable,
        "-m",
        "ir_sim_driver.node",
        "--ros-args",
        "-p",
        f"cell:={cell}",
        "-p",
        "wake_port:=0",
    ]
    node_process = subprocess.Popen(command)
    rclpy.init()
    node = rclpy.create_node("driver_benchmark")
    arrivals: list[float] = []
    stamps: list[int] = []

    def heard(msg: JointState) -> None:
        arrivals.append(time.monotonic())
        stamps.append(msg.header.stamp.sec * 1_000_000_000 + msg.header.stamp.nanosec)

    node.create_subscription(JointState, "joint_states", heard, QoSProfile(depth=2000))
    try:
        limit = time.monotonic() + 60.0
        while len(arrivals) < 500 and time.monotonic() < limit:
            rclpy.spin_once(node, timeout_sec=0.1)
        arrivals.clear()
        stamps.clear()
        before, began = process_cpu(node_process.pid), time.monotonic()
        while time.monotonic() - began < seconds:
            rclpy.spin_once(node, timeout_sec=0.1)
        cpu = (process_cpu(node_process.pid) - before) / (time.monotonic() - began)
    finally:
        node_process.send_signal(signal.SIGINT)
        node_process.wait(10.0)
        node.destroy_node()
        rclpy.try_shutdown()
    periods = np.diff(arrivals) * 1e3
    return {
        "case": "streamed pybullet",
        "cell": cell,
        "messages": len(stamps),
        "lost": round((stamps[-1] - stamps[0]) / 2_000_000) + 1 - len(stamps),
        "rate_hz": (len(arrivals) - 1) / (arrivals[-1] - arrivals[0]),
        "p50_ms": float(np.percentile(periods, 50)),
        "p99_ms": float(np.percentile(periods, 99)),
        "worst_ms": float(periods.max()),
        "cpu_percent": 100.0 * cpu,
    }


def process_cpu(pid: int) -> float:
    """User and system seconds that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def claims_of(rows: list[dict[str, Any]]) -> list[Claim]:
    """The figures that were asked for, the worst over all rows."""

    def over(case: str, key: str, pick: Any) -> float:
        return float(pick(row[key] for row in rows if row["case"] == case))

    claims = [
        Claim(
            "stepped with PyBullet, times real time", over("stepped pybullet", "factor", min), "", 15.0, True
        ),
        Claim(
            "stepped with the ideal robot, times real time",
            over("stepped ideal", "factor", min),
            "",
            100.0,
            True,
        ),
        Claim("tool deviation, PyBullet", over("stepped pybullet", "deviation_mm", max), "mm", 1.0, False),
        Claim(
            "energy against the model, beyond 200 J",
            100.0 * over("stepped pybullet", "energy_error", max),
            "%",
            5.0,
            False,
        ),
    ]
    if any(row["case"] == "streamed pybullet" for row in rows):
        claims += [
            Claim("joint_states p99 period", over("streamed pybullet", "p99_ms", max), "ms", 2.5, False),
            Claim("joint_states lost", over("streamed pybullet", "lost", max), "", 0.0, False),
            Claim(
                "CPU of the node", over("streamed pybullet", "cpu_percent", max), "% of a core", 40.0, False
            ),
        ]
    return claims


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--cell", action="append", help="cell file or name of a bundled cell (default: demo)")
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument(
        "--seconds", type=float, default=10.0, help="of listening to the node; 0 leaves it out"
    )
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    rows: list[dict[str, Any]] = []
    cells = options.cell or ["demo"]
    for name in cells:
        cell = load_cell(name)
        for seed in range(options.seeds):
            rows += [stepped(cell, backend, seed) for backend in ("pybullet", "ideal")]
    if options.seconds > 0.0:
        rows.append(streamed(cells[0], options.seconds))
    for row in rows:
        print(
            "  ".join(
                f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
                for key, value in row.items()
            )
        )
    claims = claims_of(rows)
    print()
    for claim in claims:
        sign = ">=" if claim.at_least else "<="
        print(
            f"{claim.name}: {claim.value:.4g} {claim.unit} (bound {sign} {claim.bound:g}): "
            f"{'holds' if claim.holds else 'FALLS SHORT'}"
        )
    if options.json:
        options.json.write_text(
            json.dumps(
                {
                    "machine": machine(),
                    "commit": commit(),
                    "rows": rows,
                    "claims": [
                        {"name": c.name, "value": c.value, "unit": c.unit, "bound": c.bound, "holds": c.holds}
                        for c in claims
                    ],
                },
                indent=2,
            )
        )


def machine() -> dict[str, Any]:
    """What the figures were measured on."""
    model = next(
        (
            line.partition(":")[2].strip()
            for line in Path("/proc/cpuinfo").read_text().splitlines()
            if "model name" in line
        ),
        platform.processor(),
    )
    return {
        "cpu": model,
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "load": os.getloadavg()[0],
    }


def commit() -> str:
    """Commit of the working tree, "" outside a repository."""
    answer = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"],
        cwd=Path(__file__).parent,
        capture_output=True,
        text=True,
        check=False,
    )
    return answer.stdout.strip()


if __name__ == "__main__":
    main()
