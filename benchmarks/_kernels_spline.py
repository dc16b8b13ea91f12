"""Descent along a spline, for `benchmarks/kernels.py`: time per evaluation of cost and gradient."""

from __future__ import annotations

import numpy as np
from _kernels_geometry import model_of
from _kernels_rows import Row, Tool, best

from ir_description import load_cell
from ir_kernels import DynamicsModel, SplineCost, SplineDescent
from ir_kernels.spline_terms import SplineTerms

# control points: 70 samples
CONTROL = 38
EVALUATIONS = 200


def _rows(name: str, rng: np.random.Generator) -> list[Row]:
    cell = load_cell(name)
    robot = cell.robot
    model = model_of(cell)[0]
    dynamics = DynamicsModel(robot, (Tool(),), cell.base_pose)
    limits = (robot.velocity_max, robot.acceleration_max, robot.jerk_max)
    threshold = np.full((1, len(model.pairs)), 0.02)
    terms = SplineTerms(
        *limits,
        robot.position_min,
        robot.position_max,
        np.zeros(robot.n),
        threshold,
        time_value=robot.time_value,
    )
    u = np.clip((np.arange(CONTROL) - 2.0) / (CONTROL - 5.0), 0.0, 1.0)[:, None]
    span = rng.uniform(-0.2, 0.2, robot.n)
    span[0] = 1.5
    middle = np.radians([0.0, -90.0, 100.0, 0.0, 60.0, 0.0])
    control = middle + (u * u * (3.0 - 2.0 * u) - 0.5) * span
    cost = SplineCost(model, dynamics, terms)
    plain = SplineCost(model, dynamics, terms, core=None)

    def descend() -> SplineDescent:
        return cost.descend(control, 0.1, evaluations=EVALUATIONS, tolerance=0.0)

    end = descend()
    ours = best(lambda: cost.value(end.control, end.interval), 1, 2000)
    theirs = best(lambda: plain.value(end.control, end.interval), 1, 3)
    what = f"{name}: cost along a spline and its gradient"
    samples = 2 * (CONTROL - 3)
    return [
        Row(what, "", ours * 1e6, "us"),
        Row(f"{what}, per sample", "", ours / samples * 1e9, "ns"),
        Row(
            f"{name}: descent along a spline",
            "",
            best(descend, end.evaluations, 10) * 1e6,
            "us per evaluation",
        ),
        Row(what, "NumPy reference", theirs * 1e6, "us"),
        Row(f"{what}, against NumPy", "", theirs / ours, "times faster"),
    ]


def measure(cells: list[str], seed: int) -> list[Row]:
    """Rows of each cell: a swing of the first axis, where a descent has brought it."""
    rng = np.random.default_rng(seed)
    return [row for name in cells for row in _rows(name, rng)]
