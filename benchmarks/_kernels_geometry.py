"""Geometry half of `benchmarks/kernels.py`: distances, checks and proofs of motion, per cell and
beside the peers.

Path-like batches: straight edges of 0.8 rad (largest joint) between configurations drawn within the
limits, 40 configurations each. Random batches: every configuration drawn anew.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from _coal_model import Coal
from _kernels_peers import Bullet
from _kernels_rows import Row, best
from _results import Claim, at_least, at_most

from ir_description import Cell, load_cell
from ir_kernels import FREE, UNDECIDED, Chain, CollisionModel
from ir_values.arrays import BoolArray, FloatArray

SAMPLES = 4000  # configurations per batch: a hundred edges
# rad, m, m
EDGE = 0.8
SAFETY = 0.02
MARGIN = 0.005
FINE = 0.0005  # rad
COAL_SAMPLES = 200
BULLET_SAMPLES = 40
NS = "ns per configuration"


@dataclass(frozen=True)
class Effort:
    """How often a batch is timed, in how many turns with Coal; edges and compared configurations
    per cell.
    """

    repetitions: int = 60
    turns: int = 10
    edges: int = 2500
    compared: int = 25_000


FULL = Effort()
QUICK = Effort(10, 2, 300, 1000)


@dataclass(frozen=True)
class Body:
    """A body of the scene of 1,000 boxes."""

    name: str
    kind: str
    pose: FloatArray
    size: FloatArray
    vertices: FloatArray


def model_of(
    cell: Cell, bodies: Sequence[Any] | None = None
) -> tuple[CollisionModel, list[Any], list[Any]]:
    """The cell's collision model, its capsules and its bodies."""
    robot = cell.robot
    tool = cell.tool
    held = list(tool.capsules) if tool else []
    capsules = [*robot.capsules, *held]
    own = [
        *robot.self_pairs,
        *((c.name, other) for c in held for other in robot.load_self_capsules),
    ]
    scene = list(cell.bodies() if bodies is None else bodies)
    return (
        CollisionModel(Chain(robot, cell.base_pose, cell.tcp), capsules, scene, own),
        capsules,
        scene,
    )


def uniform(cell: Cell, rng: np.random.Generator, count: int) -> FloatArray:
    return rng.uniform(cell.robot.position_min, cell.robot.position_max, (count, cell.robot.n))


def edges(cell: Cell, rng: np.random.Generator, count: int) -> tuple[FloatArray, FloatArray]:
    start = uniform(cell, rng, count)
    step = rng.uniform(-1.0, 1.0, start.shape)
    goal = start + EDGE * step / np.abs(step).max(axis=1, keepdims=True)
    return start, np.clip(goal, cell.robot.position_min, cell.robot.position_max)


def path_like(cell: Cell, rng: np.random.Generator, count: int = SAMPLES) -> FloatArray:
    q0, q1 = edges(cell, rng, count // 40)
    t = np.linspace(0.0, 1.0, 40)[None, :, None]
    return np.ascontiguousarray((q0[:, None] + t * (q1 - q0)[:, None]).reshape(-1, q0.shape[1]))


def threaded(model: CollisionModel, q: FloatArray, repetitions: int) -> float:
    """Seconds per configuration with two threads, each with its half."""
    halves = np.ascontiguousarray(q[: len(q) // 2]), np.ascontiguousarray(q[len(q) // 2 :])
    with ThreadPoolExecutor(2) as pool:
        return best(lambda: list(pool.map(model.min_distance, halves)), len(q), repetitions)


def _speed(cell: Cell, rng: np.random.Generator, effort: Effort) -> tuple[list[Row], list[Claim]]:
    """Distances and checks, beside Coal and PyBullet."""
    model, capsules, bodies = model_of(cell)
    path = path_like(cell, rng)
    name = cell.name
    coal = Coal(model, capsules, bodies)
    bullet = Bullet(cell, model, bodies)
    ours = np.inf
    theirs = np.inf
    for _ in range(effort.turns):  # in turns: the processor's clock changes
        ours = min(ours, best(lambda: model.min_distance(path), SAMPLES, effort.repetitions))
        theirs = min(theirs, best(lambda: coal.compute_all(path[:COAL_SAMPLES]), COAL_SAMPLES, 5))
    pybullet = best(lambda: [bullet.compute(q) for q in path[:BULLET_SAMPLES]], BULLET_SAMPLES, 2)
    what = f"{name}: minimum distance, path"
    rows = [
        Row(what, "", ours * 1e9, NS),
        *_batches(name, model, path, uniform(cell, rng, SAMPLES), effort.repetitions),
        Row(what, "Coal through Pinocchio", theirs * 1e9, NS),
        Row(what, "PyBullet", pybullet * 1e9, NS),
        Row(f"{name}: against Coal through Pinocchio", "", theirs / ours, "times faster"),
        Row(f"{name}: against PyBullet", "", pybullet / ours, "times faster"),
    ]
    bound = 100.0 if name == "open" else 150.0
    claims = [
        at_most(f"{name}: minimum distance, path-like", ours * 1e9, NS, bound),
        at_least(f"{name}: against Coal through Pinocchio", theirs / ours, "times faster", 300.0),
    ]
    return rows, claims


def _batches(
    name: str, model: CollisionModel, path: FloatArray, random: FloatArray, repetitions: int
) -> list[Row]:
    """Every other question about a batch of configurations."""
    timed = {
        "minimum distance, random": best(lambda: model.min_distance(random), SAMPLES, repetitions),
        "minimum distance, path, two threads": threaded(model, path, repetitions),
        "check against 20 mm, path": best(
            lambda: model.is_free(path, SAFETY), SAMPLES, repetitions
        ),
        "check against 20 mm, random": best(
            lambda: model.is_free(random, SAFETY), SAMPLES, repetitions
        ),
        f"all {len(model.pairs)} distances": best(lambda: model.distances(path), SAMPLES, 10),
        "link poses": best(lambda: model.chain.link_poses(path), SAMPLES, repetitions),
    }
    return [Row(f"{name}: {what}", "", seconds * 1e9, NS) for what, seconds in timed.items()]


def _agreement(cell: Cell, rng: np.random.Generator, count: int) -> list[Claim]:
    """Least distances beside Coal's."""
    model, capsules, bodies = model_of(cell)
    coal = Coal(model, capsules, bodies)
    coal.precise()
    q = uniform(cell, rng, count)
    ours = model.min_distance(q).distance
    theirs = np.array([coal.distances(row).min() for row in q])
    apart = theirs > 0.0
    worst = float(np.abs(ours - theirs)[apart].max())
    signs = int(((ours > 1e-6) & (theirs < -1e-6)).sum() + ((ours < -1e-6) & (theirs > 1e-6)).sum())
    different = f"{cell.name}: difference from Coal where apart"
    return [
        at_most(different, worst, f"m of {int(apart.sum())}", 1e-6),
        at_most(f"{cell.name}: other sign than Coal", signs, f"of {count}", 0),
    ]


def _clear(model: CollisionModel, q0: FloatArray, q1: FloatArray) -> BoolArray:
    """Edges whose 81 samples all keep the safety distance and MARGIN."""
    free = np.ones(len(q0), bool)
    for t in np.linspace(0.0, 1.0, 81):
        free &= model.is_free(np.ascontiguousarray(q0 + t * (q1 - q0)), SAFETY + MARGIN)
    return free


def _refuted(model: CollisionModel, q0: FloatArray, q1: FloatArray) -> int:
    """Edges among those called free with a sample, every FINE rad, that isn't."""
    count = 0
    for a, b in zip(q0, q1, strict=True):
        t = np.linspace(0.0, 1.0, int(np.ceil(np.abs(b - a).max() / FINE)) + 1)
        count += not model.is_free(a + t[:, None] * (b - a), SAFETY - 1e-6).all()
    return count


def _edges(cell: Cell, rng: np.random.Generator, count: int) -> tuple[list[Row], list[Claim]]:
    """Certified edges: their time, those left undecided, and whether a fine sample refutes one."""
    model = model_of(cell)[0]
    name = cell.name
    q0, q1 = edges(cell, rng, 12 * count)
    clear = _clear(model, q0, q1)
    a = q0[clear][:count]
    b = q1[clear][:count]
    found = model.certify_edges(a, b, SAFETY)
    everything = model.certify_edges(q0[:count], q1[:count], SAFETY)
    free = everything.verdict == FREE
    refuted = _refuted(model, q0[:count][free], q1[:count][free])
    refuted += _refuted(model, a[found.verdict == FREE], b[found.verdict == FREE])
    checked = int(free.sum() + (found.verdict == FREE).sum())
    rows = _edge_times(name, model, a, b)
    undecided = 100.0 * float((found.verdict == UNDECIDED).mean())
    claims = [
        at_most(f"{name}: certified edge, in batches of 50, median", rows[0].value, "us", 10.0),
        at_most(f"{name}: undecided edges", undecided, "%", 1.0),
        at_most(f"{name}: edges called free with a colliding sample", refuted, f"of {checked}", 0),
    ]
    return rows, claims


def _edge_times(name: str, model: CollisionModel, a: FloatArray, b: FloatArray) -> list[Row]:
    """Microseconds per edge from a to b (N, n): in batches, alone, and sampled instead of
    certified.
    """
    few = [(a[k : k + 50], b[k : k + 50]) for k in range(0, len(a) - 49, 50)]
    per_edge = [best(partial(model.certify_edges, *pair, SAFETY), 50, 5) for pair in few]
    single = [(a[k : k + 1], b[k : k + 1]) for k in range(min(200, len(a)))]
    alone = [best(partial(model.certify_edges, *pair, SAFETY), 1, 3) for pair in single]
    t = np.linspace(0.0, 1.0, 40)[None, :, None]
    samples = (a[:200, None] + t * (b - a)[:200, None]).reshape(-1, a.shape[1])
    sampled = best(lambda: model.is_free(samples, SAFETY), len(samples) // 40, 10)
    timed = {
        "certified edge, in batches of 50, median": float(np.median(per_edge)),
        "certified edge, one per call from Python, median": float(np.median(alone)),
        "sampled edge, 40 configurations, in a batch": sampled,
    }
    return [Row(f"{name}: {what}", "", seconds * 1e6, "us") for what, seconds in timed.items()]


def _boxes(cell: Cell, rng: np.random.Generator) -> tuple[list[Row], list[Claim]]:
    """A thousand boxes around the robot, in any orientation, 5 to 30 cm long."""
    bodies: list[Any] = []
    while len(bodies) < 1000:
        pose = np.eye(4)
        rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
        pose[:3, :3] = rotation * np.linalg.det(rotation)
        pose[:3, 3] = rng.uniform(-2.5, 2.5, 3)
        if np.linalg.norm(pose[:2, 3]) > 1.0 and pose[2, 3] > 0.0:
            size = rng.uniform(0.05, 0.3, 3)
            bodies.append(Body(f"box {len(bodies)}", "box", pose, size, np.zeros((0, 3))))
    model, _, _ = model_of(cell, bodies)
    path = path_like(cell, rng)
    random = uniform(cell, rng, 400)
    ours = best(lambda: model.min_distance(path), len(path), 20) * 1e6
    other = best(lambda: model.min_distance(random), 400, 10) * 1e6
    us = "us per configuration"
    rows = [
        Row("1,000 boxes: minimum distance, path", "", ours, us),
        Row("1,000 boxes: minimum distance, random", "", other, us),
    ]
    return rows, [at_most("1,000 boxes: minimum distance, path-like", ours, us, 1.5)]


def _construction(cell: Cell) -> Row:
    """What a door that opens costs."""
    begin = time.perf_counter()
    for _ in range(20):
        model_of(cell)
    return Row(
        f"{cell.name}: a new collision model", "", (time.perf_counter() - begin) / 20 * 1e6, "us"
    )


def measure(
    cells: Sequence[str], seed: int = 0, effort: Effort = FULL
) -> tuple[list[Row], list[Claim]]:
    """All rows and claims of this half over the cells."""
    rng = np.random.default_rng(seed)
    rows: list[Row] = []
    claims: list[Claim] = []
    for name in cells:
        cell = load_cell(name)
        for part in (_speed(cell, rng, effort), _edges(cell, rng, effort.edges)):
            rows += part[0]
            claims += part[1]
        claims += _agreement(cell, rng, effort.compared)
        rows.append(_construction(cell))
    part = _boxes(load_cell(cells[0]), rng)
    return rows + part[0], claims + part[1]
