"""Cells full of boxes: a thousand of them at random around the robot, and movements between free
states.

The boxes stay out of a column around the robot's base, where nothing could move. Start and goal are
drawn until they keep CLEARANCE and their tools are APART; whether a path joins them is not known.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from _regional_tasks import Task, scene_of_cell
from _results import Claim, at_least, at_most, line_of

from ir_description import Body, Cell, Equipment, Zone, cell_to_yaml, load_cell
from ir_kernels.search import BidirectionalTree
from ir_msgs_py.options import PlanOptions
from ir_planner.planner import Planner
from ir_planner.request.goals import Goal
from ir_planner.scene.planning_scene import PlanningScene
from ir_values.arrays import FloatArray

BOXES = 1000
# m: around the base, above the floor, and what stays empty
REACH = 3.2
HEIGHT = 3.4
COLUMN = 0.7
EDGES = (0.05, 0.22)  # m
# m: S_m of the movements, and what their ends keep at least
MARGIN = 0.01
CLEARANCE = 0.015
APART = 0.8  # m between the tools at start and goal
DRAWN = 4096  # configurations at a time
TASKS = 5  # of each cell
WITHIN = 5.0  # s
EDGES_OF_A_REQUEST = 80_000  # certified edges: about so long on two cores that nobody else uses


def boxes_cell(seed: int, count: int = BOXES) -> Cell:
    """The open cell with `count` boxes in place of its machines."""
    rng = np.random.default_rng([seed, count])
    bodies = []
    while len(bodies) < count:
        x, y = rng.uniform(-REACH, REACH, 2)
        if not COLUMN < np.hypot(x, y) < REACH:
            continue
        pose = np.eye(4)
        pose[:3, :3] = _turned(rng)
        pose[:3, 3] = x, y, rng.uniform(0.0, HEIGHT)
        bodies.append(Body(f"box{len(bodies)}", "box", pose, rng.uniform(*EDGES, 3)))
    around = np.eye(4)
    around[2, 3] = 0.5 * HEIGHT
    zone = Zone("OPEN", around, np.array([2 * REACH, 2 * REACH, HEIGHT]))
    clutter = Equipment("clutter", np.eye(4), tuple(bodies), zone)
    cell = load_cell("open")
    return replace(
        cell,
        name=f"boxes_{seed}",
        equipment=(clutter,),
        stations=(),
        program=(),
        signals=(),
        tasks=(),
    )


def boxes_tasks(seed: int, count: int) -> list[Task]:
    """`count` tasks in the cell of a seed."""
    scene = scene_of_cell(boxes_cell(seed))
    rng = np.random.default_rng([seed, 1])
    found: list[Task] = []
    free = _free(scene, rng)
    for k in range(len(free) - 1):
        start = free[k]
        goal = free[k + 1]
        tools = scene.chain.tcp_poses(np.stack([start, goal]))[:, :3, 3]
        if np.linalg.norm(tools[1] - tools[0]) > APART and len(found) < count:
            found.append(Task(scene.cell.name, str(len(found)), scene, start, goal, MARGIN))
    return found


def boxes_rows(cells: int, first: int, more: int) -> list[dict[str, Any]]:
    """A row per task of so many cells. more: times the work of a request, which decides what is
    solvable.
    """
    rows = []
    for seed in range(first, first + cells):
        planner = Planner(clock=time.process_time)
        planner.set_cell(text=cell_to_yaml(boxes_cell(seed)))
        planner.settings = replace(planner.settings, max_iterations=EDGES_OF_A_REQUEST)
        for task in boxes_tasks(seed, TASKS):
            rows.append(_row(planner, task, more))
            print(line_of(rows[-1]), flush=True)
    return rows


def boxes_claims(rows: list[dict[str, Any]]) -> list[Claim]:
    """What the tasks say."""
    solvable = [row for row in rows if row["solvable"]]
    if not solvable:
        return []
    solved = [row for row in solvable if row["solved"]]
    name = (
        f"solved of {len(solvable)} solvable tasks ({len(rows)} drawn), {EDGES_OF_A_REQUEST} edges"
    )
    return [
        at_least(name, 100.0 * len(solved) / len(solvable), "%", 90.0),
        at_most(
            "longest of these, processor time", max(row["seconds"] for row in solved), "s", WITHIN
        ),
    ]


def _row(planner: Planner, task: Task, more: int) -> dict[str, Any]:
    options = PlanOptions(seed=1, safety_distance=task.margin, planning_time=600.0)
    begin = time.process_time()
    plan = planner.plan_regional(
        start=task.start, goal=Goal(configuration=task.goal), options=options
    )
    seconds = time.process_time() - begin
    enclosed = "is enclosed" in plan.status.message
    return {
        "cell": task.cell,
        "task": task.name,
        "solved": plan.status.ok and plan.report.certified,
        "seconds": seconds,
        "edges": plan.info.iterations,
        "enclosed": enclosed,
        "solvable": plan.status.ok or (not enclosed and _joined(task, more)),
    }


def _joined(task: Task, more: int) -> bool:
    """Whether trees of another seed meet, with `more` times the work of a request."""
    robot = task.scene.cell.robot
    model = task.scene.collision
    scale = np.maximum(np.sqrt(task.scene.weights / task.scene.weights[0]), 0.1)
    threshold = task.scene.thresholds(task.margin)
    low = robot.position_min
    high = robot.position_max
    search = BidirectionalTree(
        model, task.start, task.goal[None], threshold, low, high, scale, 1000
    )
    return search.grow(more * EDGES_OF_A_REQUEST)


def _free(scene: PlanningScene, rng: np.random.Generator) -> FloatArray:
    """Free configurations (F, n)."""
    robot = scene.cell.robot
    q = rng.uniform(robot.position_min, robot.position_max, (DRAWN, robot.n))
    return q[scene.collision.is_free(q, np.full(len(scene.collision.pairs), CLEARANCE))]


def _turned(rng: np.random.Generator) -> FloatArray:
    """A rotation (3, 3), evenly drawn."""
    q, r = np.linalg.qr(rng.standard_normal((3, 3)))
    q = q * np.sign(np.diag(r))
    return q if np.linalg.det(q) > 0.0 else q[:, ::-1]
