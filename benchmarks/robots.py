"""Does everything hold for every robot: inverse kinematics, certified plans, the set-up of a new
one?

    python benchmarks/robots.py [--cell FILE]... [--poses N] [--seeds N] [--quick] [--json FILE]

Inverse kinematics: the robot of each cell in N random configurations; a pose is missed where the
configuration it was made from is not among the answers. Beside the four robots an arm with offsets
at its wrist, which is solved by the search. Plans: the tasks of the cell, or from park along its
stations and back, each seed; every movement is judged again by Coal at configurations at most
0.0005 rad apart and by limits and torques with Pinocchio. Set-up: the commands of
docs/robot_guide.md on the URDF of each robot: a new robot, checked and planned in processor time,
then driven in real time and reported by `ir demo`, a process of its own. Closes with one line per
figure: measured value, bound, holds or falls short.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _second_opinion import SecondOpinion

from ir_cli.main import main as ir
from ir_description import Cell, RobotModel, load_cell, load_robot, robot_urdf
from ir_description.files.making import TEMPLATE
from ir_description.library import robot_named
from ir_kernels import Chain, inverse_kinematics
from ir_kernels.ik_set import InverseKinematics
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner, parse_goal
from ir_values.arrays import FloatArray

CELLS = ("open", "kr300_pallets", "kr6_bench", "ur10e_bench")
POSES = 10_000
QUICK_POSES = 300
SEARCHED = 1_000
NEAR = 1e-5  # rad: a configuration beside a singularity is known to half the digits
COAL = 2e-6  # m: what Coal's iterations leave between it and the true distance
CELL_OF_GUIDE = """\
format: ir_cell/1
name: first
robot: own.yaml
park_deg: {park}
program: [{{posture: park}}, {{posture: home}}]
"""
Row = dict[str, Any]


def offset_wrist() -> SimpleNamespace:
    """The KR 210 with a wrist whose axes do not meet."""
    robot = load_robot()
    origin = np.array(robot.joint_origin)
    origin[4, :3, 3] += [-0.1, 0.0, 0.1]
    origin[5, :3, 3] += [0.0, 0.05, 0.0]
    limits = np.full(6, np.pi)
    return SimpleNamespace(
        name="offset wrist",
        joint_origin=origin,
        joint_axis=robot.joint_axis,
        position_min=-limits,
        position_max=limits,
    )


def ik_row(robot: RobotModel | SimpleNamespace, poses: int) -> Row:
    """How many of random poses are missed, the largest errors [m, rad], and the time of a pose."""
    chain = Chain(robot)
    solver = inverse_kinematics(chain, robot.position_min, robot.position_max)
    q = np.random.default_rng(0).uniform(robot.position_min, robot.position_max, (poses, 6))
    wanted = chain.tcp_poses(q)
    missed = 0
    worst = np.zeros(2)
    begin = time.process_time()
    seconds = 0.0
    for first in range(0, poses, 500):
        part = slice(first, min(first + 500, poses))
        begin = time.process_time()
        found = solver.solve(wanted[part])
        seconds += time.process_time() - begin
        worst = np.maximum(worst, errors(chain.tcp_poses(found.q), wanted[part][found.pose_index]))
        missed += sum(not is_there(found.of_pose(k), made) for k, made in enumerate(q[part]))
    return {
        "robot": robot.name,
        "method": type(solver).__name__,
        "poses": poses,
        "missed": missed,
        "position_m": float(worst[0]),
        "rotation_rad": float(worst[1]),
        "us_per_pose": 1e6 * seconds / poses,
        "bound_m": bound_of(solver),
    }


def bound_of(solver: InverseKinematics) -> float:
    """The pose error [m] that was asked for."""
    return 1e-9 if isinstance(solver, SphericalWristIk) else 1e-6


def errors(reached: FloatArray, wanted: FloatArray) -> FloatArray:
    """Largest distance [m] and angle [rad] between poses (M, 4, 4)."""
    away = np.linalg.norm(reached[:, :3, 3] - wanted[:, :3, 3], axis=1)
    turn = np.swapaxes(reached[:, :3, :3], 1, 2) @ wanted[:, :3, :3] - np.eye(3)
    return np.array(
        [away.max(initial=0.0), np.linalg.norm(turn, axis=(1, 2)).max(initial=0.0) / np.sqrt(2)]
    )


def is_there(found: FloatArray, made: FloatArray) -> bool:
    """Whether a configuration (6,) is among the answers (m, 6)."""
    return bool(len(found) and np.abs(found - made).max(axis=1).min() < NEAR)


def plan_rows(cell: str, seeds: int) -> list[Row]:
    """A row per movement and seed: certified, and what Coal and Pinocchio say."""
    planner = Planner(cell)
    loaded = planner.cell
    opinion = SecondOpinion(planner.scene())
    rows = []
    for seed in range(seeds):
        q = np.array(loaded.posture("park"))
        for name, start, goal in asked_of(loaded):
            options = PlanOptions(seed=seed, planning_time=60.0)
            plan = planner.plan_regional(
                start=q if start is None else np.array(start), goal=goal, options=options
            )
            row: Row = {"cell": cell, "movement": name, "seed": seed, "solved": plan.status.ok}
            rows.append(row)
            if plan.trajectory is None:
                row["sentence"] = plan.status.message
                continue
            q = plan.trajectory.sample(plan.trajectory.times[-1:]).q[0]
            least, _ = opinion.least_distance(plan.trajectory)
            row |= {
                "certified": plan.report.certified,
                "clearance_mm": 1e3 * plan.report.min_clearance,
                "coal_mm": 1e3 * least,
                "limit_share": opinion.largest_share(plan.trajectory),
            }
    return rows


def asked_of(cell: Cell) -> Iterator[tuple[str, FloatArray | None, Goal]]:
    """Name, start (None: where the last one ended) and goal: the tasks, or along the stations and
    back.
    """
    for task in cell.tasks:
        yield task.name, task.start, Goal(configuration=task.goal, text=task.name)
    if not cell.tasks:
        for name in (*(station.name for station in cell.stations), "park"):
            yield f"to {name}", None, parse_goal(name, cell)


def guide_row(robot: RobotModel, folder: Path) -> Row:
    """The guide's commands on a robot's URDF: exit codes, seconds, and how well it came out."""
    home = np.degrees(robot.machine_home)
    moved = home + np.array([30.0, 10.0, -10.0, 20.0, -20.0, 30.0])
    sheet = TEMPLATE.replace("[0, -90, 90, 0, 0, 0]", str(np.round(home, 6).tolist()))
    (folder / "robot.urdf").write_text(robot_urdf(robot))
    (folder / "drives.yaml").write_text(sheet.replace("my_robot", "own"))
    (folder / "cell.yaml").write_text(CELL_OF_GUIDE.format(park=np.round(moved, 6).tolist()))
    own = str(folder / "own.yaml")
    cell = str(folder / "cell.yaml")
    goal = " ".join(f"A{k} {angle:.6f}" for k, angle in enumerate(moved, start=1))
    urdf = str(folder / "robot.urdf")
    drives = str(folder / "drives.yaml")
    begin = time.process_time()
    codes = [
        ir(["robot", "new", "--urdf", urdf, "--drives", drives, "-o", own]),
        ir(["robot", "check", own]),
        ir(["cell", "check", cell]),
        ir(["move", cell, "home", goal]),
        ir(["plan", cell]),
    ]
    seconds = time.process_time() - begin
    q = np.random.default_rng(0).uniform(robot.position_min, robot.position_max, (100, 6))
    copy = Chain(robot_named(own)).link_poses(q)[:, -1]
    off = float(np.abs(copy - Chain(robot).link_poses(q)[:, -1]).max())
    row = {
        "robot": robot.name,
        "codes": str(codes),
        "failed": sum(codes),
        "seconds": seconds,
        "off": off,
    }
    return row | driven(folder)


def driven(folder: Path) -> Row:
    """`ir demo` in the new robot's cell: its last line, elapsed seconds, whether it failed, pages
    written.
    """
    words = [sys.executable, "-m", "ir_cli.main", "demo", "--cell", "cell.yaml"]
    begin = time.monotonic()
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    said = (done.stdout + done.stderr).strip().splitlines()
    return {
        "demo": done.returncode,
        "demo_seconds": time.monotonic() - begin,
        "reports": int((folder / "out" / "report.html").is_file()),
        "said": said[-1] if said else "",
    }


def claims_of(ik: list[Row], plans: list[Row], guide: list[Row]) -> list[Claim]:
    """What was asked for, measured."""
    claims = []
    for row in ik:
        name = f"{row['robot']} ({row['method']}), of {row['poses']} poses"
        claims.append(at_most(f"missed, {name}", row["missed"], "", 0))
        claims.append(at_most(f"pose error, {name}", row["position_m"], "m", row["bound_m"]))
    for cell in dict.fromkeys(row["cell"] for row in plans):
        own = [row for row in plans if row["cell"] == cell]
        solved = [row for row in own if row["solved"]]
        share = 100.0 * sum(row["certified"] for row in solved) / len(own)
        claims.append(at_least(f"certified, {cell}, of {len(own)} movements", share, "%", 100))
        above = max((row["clearance_mm"] - row["coal_mm"] for row in solved), default=np.inf)
        claims.append(at_most(f"reported above Coal's distance, {cell}", 1e-3 * above, "m", COAL))
        torque = max((row["limit_share"] for row in solved), default=np.inf)
        claims.append(
            at_most(f"largest share of a limit, torque by Pinocchio, {cell}", torque, "", 1 + 1e-6)
        )
    for row in guide:
        claims.append(
            at_most(f"commands of the guide that fail, {row['robot']}", row["failed"], "", 0)
        )
        claims.append(
            at_most(f"processor time of the guide, {row['robot']}", row["seconds"], "s", 600)
        )
        claims.append(at_most(f"checks of the drive that fail, {row['robot']}", row["demo"], "", 0))
        claims.append(at_least(f"report of the drive, {row['robot']}", row["reports"], "", 1))
        claims.append(
            at_most(f"planned, driven, reported, {row['robot']}", row["demo_seconds"], "s", 600)
        )
    return claims


def main() -> None:
    """Measure, print, write."""
    parser = command_line(__doc__, CELLS, 5, f"{QUICK_POSES} poses, 1 seed")
    parser.add_argument("--poses", type=int, default=POSES, help=f"default: {POSES}")
    given = parser.parse_args()
    poses, seeds = (min(given.poses, QUICK_POSES), 1) if given.quick else (given.poses, given.seeds)
    cells = given.cell or list(CELLS)
    robots: dict[str, RobotModel] = {
        load_cell(cell).robot.name: load_cell(cell).robot for cell in cells
    }
    ik = []
    plans = list[Row]()
    guide = []
    for robot in robots.values():
        ik.append(ik_row(robot, poses))
        print(line_of(ik[-1]), flush=True)
    ik.append(ik_row(offset_wrist(), min(poses, SEARCHED)))
    print(line_of(ik[-1]), flush=True)
    for cell in cells:
        plans += plan_rows(cell, seeds)
        print("\n".join(line_of(row) for row in plans if row["cell"] == cell), flush=True)
    for robot in robots.values():
        with tempfile.TemporaryDirectory() as folder:
            guide.append(guide_row(robot, Path(folder)))
        print(line_of(guide[-1]), flush=True)
    finish(given.json, [*ik, *plans, *guide], claims_of(ik, plans, guide))


if __name__ == "__main__":
    main()
