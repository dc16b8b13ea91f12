"""Configurations along a path as a graph: at samples of the path, for angles about the tool's axis, all of
them; edges where no axis jumps. The cheapest chains through all samples are candidates.

Complete up to its resolution: what passes no sample without a jump isn't found. Joules of an edge are those
of its even motion at the tool's speed; accelerations are left out, they come with the timing.
"""

import itertools
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ir_msgs_py.arrays import BoolArray, FloatArray, IntArray
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.orientations import about_tool
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.checks import FreeSpace, pair_value
from ir_planner.scene import PlanningScene

JUMP = 0.35  # rad from sample to sample: more is another branch, or a singularity
SPACING = 0.01  # m between samples of the path
SPACING_TURN = np.radians(2.0)  # of the tool between them
ANGLE_STEP = np.radians(15.0)  # of the free angle
_SPACING_FREE = 0.02  # m, where the angle is free
_NODES_MAX = 400_000
_FEWEST = 8
_SAME = 1e-6  # relative cost of chains that differ by whole turns only
_APART = 0.3  # rad: ends of chains with a free angle that are nearer are smoothed to one
_OVERSPEED_WATTS = 2000.0  # what an axis at its speed limit costs in the search; far more beyond
_FEW = 100  # configurations of a layer, up to which all pairs are compared
_LAYER = 10.0  # between layers in the tree of neighbours, further than any jump


@dataclass(frozen=True, eq=False)
class Chain:
    """Configurations q (N, n) and angles (N,) rad about the tool's axis at the samples s (N,) m; joules as
    estimated.
    """

    s: FloatArray
    q: FloatArray
    angles: FloatArray
    joules: float


@dataclass(frozen=True, eq=False)
class Layers:
    """s (N,): samples; q (M, n), layer (M,), angle (M,) rad: configurations within the limits; free (M,)."""

    s: FloatArray
    q: FloatArray
    layer: IntArray
    angle: FloatArray
    free: BoolArray


def samples(path: ToolPath, spacing: float) -> FloatArray:
    """Arc lengths (N,) of samples of a path, closer where the tool turns and in rounded corners."""
    breaks = path.breaks
    rough = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in itertools.pairwise(breaks)]))
    rotations = path.poses(rough)[:, :3, :3]
    turned = np.einsum("mji,mjk->mik", rotations[:-1], rotations[1:])
    turns = np.arccos(np.clip(0.5 * (np.trace(turned, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
    steps = np.ceil(np.maximum(np.diff(rough) / spacing, turns / SPACING_TURN) - 1e-9).astype(int)
    steps = np.maximum(steps, 1)
    parts = [np.linspace(a, b, k + 1)[:-1] for a, b, k in zip(rough[:-1], rough[1:], steps, strict=True)]
    return np.append(np.concatenate(parts), rough[-1])


def angles_of(free_angle: float) -> FloatArray:
    """Angles (A,) rad that are looked at; pi: the whole circle."""
    if free_angle == 0.0:
        return np.zeros(1)
    if free_angle >= np.pi - 1e-6:
        return np.arange(-np.pi, np.pi - 1e-9, ANGLE_STEP)
    count = int(np.ceil(free_angle / ANGLE_STEP))
    return np.linspace(-free_angle, free_angle, 2 * count + 1)


def layers_of(path: ToolPath, free_angle: float, space: FreeSpace, start: FloatArray | None) -> Layers:
    """All configurations along a path. start (n,): the only one at its beginning. Raises PathRefusedError
    where the path leaves the reach or every configuration collides.
    """
    scene, angles = space.scene, angles_of(free_angle)
    s = samples(path, SPACING if len(angles) == 1 else _SPACING_FREE)
    if len(s) * len(angles) * _FEWEST > _NODES_MAX:
        raise PathRefusedError(
            f"the path has {len(s)} samples of {len(angles)} angles: it must be at most "
            f"{_NODES_MAX // _FEWEST} poses in all; divide the path"
        )
    poses = np.repeat(path.poses(s), len(angles), axis=0)
    poses[:, :3, :3] = poses[:, :3, :3] @ about_tool(np.tile(angles, len(s)))
    found = scene.inverse_kinematics.solve(poses)
    layer, angle = found.pose_index // len(angles), angles[found.pose_index % len(angles)]
    result = Layers(s, found.q, layer, angle, space.states_free(found.q))
    if start is not None:
        result = _begun(result, path, free_angle, space, start)
    _check_reached(result, space)
    return result


def _begun(layers: Layers, path: ToolPath, free_angle: float, space: FreeSpace, start: FloatArray) -> Layers:
    """The layers with one configuration in the first: the start."""
    wanted = path.poses(layers.s[:1])[0]
    there = space.scene.chain.tcp_poses(start[None])[0]
    away = float(np.linalg.norm(there[:3, 3] - wanted[:3, 3]))
    turned = wanted[:3, :3].T @ there[:3, :3]
    angle = float(np.arctan2(turned[2, 1], turned[1, 1]))
    tilt = float(np.arccos(np.clip(turned[0, 0], -1.0, 1.0)))
    if away > _START_M or tilt > _START_RAD or abs(angle) > free_angle + _START_RAD:
        raise PathRefusedError(
            f"the tcp of start is {away * 1e3:.3g} mm and {np.degrees(max(tilt, abs(angle))):.3g} deg from "
            f"where the path begins: it must be within {_START_M * 1e3:g} mm and "
            f"{np.degrees(_START_RAD):.2g} deg",
            StatusCode.START_STATE_INVALID,
        )
    later = layers.layer > 0
    return Layers(
        layers.s,
        np.concatenate([start[None], layers.q[later]]),
        np.concatenate([[0], layers.layer[later]]),
        np.concatenate([[angle], layers.angle[later]]),
        np.concatenate([space.states_free(start[None]), layers.free[later]]),
    )


_START_M, _START_RAD = 1e-5, 1e-5  # how near the start must be to the path's beginning


def _check_reached(layers: Layers, space: FreeSpace) -> None:
    """Raise PathRefusedError at the first place that no configuration reaches, or none that is free."""
    count = np.bincount(layers.layer, minlength=len(layers.s))
    free = np.bincount(layers.layer[layers.free], minlength=len(layers.s))
    if count.all() and free.all():
        return
    k = int(np.argmin(free > 0))
    at = f"at {layers.s[k]:.3f} m"
    if count[k] == 0:
        raise PathRefusedError(
            f"the path leaves the reach or an axis limit {at}: no configuration brings the tool there in the "
            "orientation asked for",
            StatusCode.NO_IK_SOLUTION,
        )
    raise PathRefusedError(
        f"all {count[k]} configurations collide {at}: {nearest_sentence(layers.q[layers.layer == k], space)}",
        StatusCode.INVALID_MOTION_PLAN,
    )


def nearest_sentence(q: FloatArray, space: FreeSpace) -> str:
    """The pair of the configuration of q (M, n) that lacks least clearance."""
    near = space.scene.collision.min_distance(q, space.threshold)
    lacking = space.threshold[near.pair] - near.distance
    k = int(np.argmin(lacking))
    pair = pair_value(space.scene, q[k], int(near.pair[k]))
    return (
        f"in the best of them {pair.body_a} and {pair.body_b} ({pair.kind}) come to "
        f"{pair.distance * 1e3:.1f} mm, they must keep {space.threshold[near.pair[k]] * 1e3:.1f} mm"
    )


def chains(
    layers: Layers, speed: float, space: FreeSpace, most: int, *, by_start: bool = False
) -> list[Chain]:
    """The cheapest chains through all layers, at most `most`, each with another end, or start (whole turns
    apart count once), at the tool's speed [m/s]. Raises PathRefusedError where none leads through.
    """
    nodes, scene = np.flatnonzero(layers.free), space.scene
    q, layer = layers.q[nodes], layers.layer[nodes]
    before, after = _neighbours(q, layer)
    joules = _edge_joules(q, layer, before, after, layers.s, speed, scene)
    apart = _SAME if len(np.unique(layers.angle)) == 1 else _APART
    if by_start:  # the same edges from the end
        before, after, layer = after, before, len(layers.s) - 1 - layer
        order = np.lexsort((before, after, layer[after]))
        before, after, joules = before[order], after[order], joules[order]
    cost, parent = _cheapest(layer, before, after, joules, len(layers.s))
    last = np.flatnonzero((layer == len(layers.s) - 1) & np.isfinite(cost))
    if len(last) == 0:
        raise _no_further(layers, q[np.isfinite(cost)], layer[np.isfinite(cost)], space)
    found: list[Chain] = []
    for node in _different(last, cost, q, scene, (apart, most)):
        trace = [int(node)]
        while parent[trace[-1]] >= 0:
            trace.append(int(parent[trace[-1]]))
        order = nodes[trace if by_start else trace[::-1]]
        found.append(Chain(layers.s, layers.q[order], layers.angle[order], float(cost[node])))
    return found


def _no_further(layers: Layers, q: FloatArray, layer: IntArray, space: FreeSpace) -> PathRefusedError:
    """Why no chain goes on: q (M, n) in layer (M,) were reached."""
    last = int(layer.max())
    ahead = layers.q[layers.layer == last + 1]
    joined = np.abs(ahead[:, None] - q[layer == last][None]).max(axis=2).min(axis=1) <= JUMP
    if joined.any():
        return PathRefusedError(
            f"every configuration that leads up to {layers.s[last]:.3f} m collides at "
            f"{layers.s[last + 1]:.3f} m: {nearest_sentence(ahead[joined], space)}",
            StatusCode.INVALID_MOTION_PLAN,
        )
    return PathRefusedError(
        f"no configuration leads past {layers.s[last]:.3f} m without a jump of an axis: a singularity, or an "
        "axis limit that asks for another configuration"
    )


def _neighbours(q: FloatArray, layer: IntArray) -> tuple[IntArray, IntArray]:
    """Edges (E,) from one layer to the next with no axis beyond JUMP, ordered by where they lead."""
    widest = int(np.bincount(layer).max(initial=0))
    before, after = (_by_pairs if widest <= _FEW else _by_tree)(q, layer)
    order = np.lexsort((before, after))
    return before[order], after[order]


def _by_pairs(q: FloatArray, layer: IntArray) -> tuple[IntArray, IntArray]:
    """The same in any order, all pairs compared axis by axis: quicker where layers are small."""
    count = np.bincount(layer)
    begin = np.cumsum(count) - count
    number = np.full((len(count), count.max(initial=0)), -1)
    number[layer, np.arange(len(layer)) - begin[layer]] = np.arange(len(layer))
    axes = np.argsort(-q.std(axis=0))
    first = np.where(number >= 0, q[number, axes[0]], np.nan)
    k, i, j = np.nonzero(np.abs(first[:-1, :, None] - first[1:, None, :]) <= JUMP)
    before, after = number[k, i], number[k + 1, j]
    for axis in axes[1:]:
        near = np.abs(q[before, axis] - q[after, axis]) <= JUMP
        before, after = before[near], after[near]
    return before, after


def _by_tree(q: FloatArray, layer: IntArray) -> tuple[IntArray, IntArray]:
    """The same by a tree of all configurations: where layers are large."""
    place = np.column_stack([q / JUMP, layer * _LAYER])
    ahead = np.column_stack([q / JUMP, (layer + 1) * _LAYER])
    near = cKDTree(ahead).sparse_distance_matrix(cKDTree(place), 1.0, p=np.inf, output_type="ndarray")
    return near["i"].astype(np.int64), near["j"].astype(np.int64)


def _edge_joules(
    q: FloatArray,
    layer: IntArray,
    before: IntArray,
    after: IntArray,
    s: FloatArray,
    speed: float,
    scene: PlanningScene,
) -> FloatArray:
    """What the drives take along each edge (E,) [J], and what keeps the search from too fast ones."""
    if len(before) == 0:
        return np.zeros(0)
    seconds = (np.diff(s) / speed)[layer[before]]
    first, second = q[before], q[after]
    qd = (second - first) / seconds[:, None]
    power = scene.dynamics.drive_power(0.5 * (first + second), qd, np.zeros_like(qd)).sum(axis=1)
    share = (np.abs(qd) / scene.limits.velocity).max(axis=1)
    return np.asarray((np.maximum(power, 0.0) + _OVERSPEED_WATTS * share**8) * seconds)


def _cheapest(
    layer: IntArray, before: IntArray, after: IntArray, joules: FloatArray, count: int
) -> tuple[FloatArray, IntArray]:
    """Least joules (M,) to each node, inf where none leads there, and the node before (M,), -1: none."""
    cost = np.where(layer == 0, 0.0, np.inf)
    parent = np.full(len(layer), -1, dtype=np.int64)
    bounds = np.searchsorted(layer[after], np.arange(count + 1))
    for k in range(1, count):
        edges = slice(bounds[k], bounds[k + 1])
        if edges.start == edges.stop:
            break
        to, total = after[edges], cost[before[edges]] + joules[edges]
        order = np.lexsort((before[edges], total, to))
        first = order[np.concatenate([[True], np.diff(to[order]) > 0])]
        kept = first[np.isfinite(total[first])]
        cost[to[kept]], parent[to[kept]] = total[kept], before[edges][kept]
    return cost, parent


def _different(
    last: IntArray, cost: FloatArray, q: FloatArray, scene: PlanningScene, bounds: tuple[float, int]
) -> IntArray:
    """Ends (K,) of chains, cheapest first; of those that differ by whole turns, the one most within the axis
    limits. bounds: about how many rad they are apart, and how many at most.
    """
    robot = scene.cell.robot
    middle = 0.5 * (robot.position_min + robot.position_max)
    away = (np.abs(q[last] - middle) / (robot.position_max - robot.position_min)).max(axis=1)
    digits = np.round(np.log(np.maximum(cost[last], 1e-12)) / _SAME)
    order = last[np.lexsort((away, digits))]
    (apart, most), kept = bounds, list[int]()
    for node in order:
        if len(kept) == most:
            break
        if all(np.abs(np.sin(0.5 * (q[node] - q[other]))).max() > apart for other in kept):
            kept.append(int(node))
    return np.array(kept, dtype=np.int64)
