"""Chains of configurations along a path: layers at samples, and the cheapest chains."""

import itertools
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.orientations import about_tool
from ir_planner.cartesian.tool_path import NoChainError, PathRefusedError, ToolPath
from ir_planner.checks import FreeSpace, pair_value
from ir_planner.presentation import in_mm
from ir_planner.scene import PlanningScene
from ir_values.arrays import BoolArray, FloatArray, IntArray

# Configurations along a path: at samples of it, for angles about the tool's axis, all of them.

SPACING = 0.01  # m between samples of the path
SPACING_TURN = np.radians(2.0)  # of the tool between them
ANGLE_STEP = np.radians(15.0)  # of the free angle
_SPACING_FREE = 0.02  # m, where the angle is free
_NODES_MAX = 400_000
_FEWEST = 8


@dataclass(frozen=True, eq=False)
class Layers:
    """s (N,): samples; q (M, n), layer (M,), angle (M,) rad: configurations within the limits; free
    (M,). turning (n,): axes whose whole turns are left out.
    """

    s: FloatArray
    q: FloatArray
    layer: IntArray
    angle: FloatArray
    free: BoolArray
    turning: BoolArray


def samples(path: ToolPath, spacing: float) -> FloatArray:
    """Arc lengths (N,) of samples of a path, closer where the tool turns and in rounded corners."""
    breaks = path.breaks
    rough = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in itertools.pairwise(breaks)]))
    rotations = path.poses(rough)[:, :3, :3]
    turned = np.einsum("mji,mjk->mik", rotations[:-1], rotations[1:])
    turns = portable.arccos(np.clip(0.5 * (np.trace(turned, axis1=1, axis2=2) - 1.0), -1.0, 1.0))
    steps = np.ceil(np.maximum(np.diff(rough) / spacing, turns / SPACING_TURN) - 1e-9).astype(int)
    steps = np.maximum(steps, 1)
    parts = [
        np.linspace(a, b, k + 1)[:-1] for a, b, k in zip(rough[:-1], rough[1:], steps, strict=True)
    ]
    return np.append(np.concatenate(parts), rough[-1])


def angles_of(free_angle: float) -> FloatArray:
    """Angles (A,) rad that are looked at; pi: the whole circle."""
    if free_angle == 0.0:
        return np.zeros(1)
    if free_angle >= np.pi - 1e-6:
        return np.arange(-np.pi, np.pi - 1e-9, ANGLE_STEP)
    count = int(np.ceil(free_angle / ANGLE_STEP))
    return np.linspace(-free_angle, free_angle, 2 * count + 1)


def layers_of(
    path: ToolPath, free_angle: float, space: FreeSpace, start: FloatArray | None
) -> Layers:
    """All configurations along a path, but for whole turns. start (n,): the only one at its
    beginning. Raises PathRefusedError where the path leaves the reach or every configuration
    collides.
    """
    angles = angles_of(free_angle)
    s = samples(path, SPACING if len(angles) == 1 else _SPACING_FREE)
    if len(s) * len(angles) * _FEWEST > _NODES_MAX:
        raise PathRefusedError(
            f"the path has {len(s)} samples of {len(angles)} angles: it must be at most "
            f"{_NODES_MAX // _FEWEST} poses in all; divide the path"
        )
    result = configurations_at(path, s, free_angle, space, space.scene.turning)
    if start is not None:
        result = _begun(result, path, free_angle, space, start)
    _check_reached(result, space)
    return result


def configurations_at(
    path: ToolPath, s: FloatArray, free_angle: float, space: FreeSpace, turning: BoolArray
) -> Layers:
    """All configurations at arc lengths s (N,) m of a path, but for whole turns of the axes
    `turning` (n,): all that turn twice, or none.
    """
    angles = angles_of(free_angle)
    poses = np.repeat(path.poses(s), len(angles), axis=0)
    poses[:, :3, :3] = portable.matmul(poses[:, :3, :3], about_tool(np.tile(angles, len(s))))
    scene = space.scene
    found = (scene.inverse_kinematics_once if turning.any() else scene.inverse_kinematics).solve(
        poses
    )
    layer = found.pose_index // len(angles)
    angle = angles[found.pose_index % len(angles)]
    return Layers(s, found.q, layer, angle, space.states_free(found.q), turning)


def _begun(
    layers: Layers, path: ToolPath, free_angle: float, space: FreeSpace, start: FloatArray
) -> Layers:
    """The layers with one configuration in the first: the start (n,). PathRefusedError where the
    tcp isn't at the begin of the path there; turned about its axis by at most `free_angle` rad.
    """
    wanted = path.poses(layers.s[:1])[0]
    there = space.scene.chain.tcp_poses(start[None])[0]
    away = float(portable.norm(there[:3, 3] - wanted[:3, 3]))
    turned = portable.matmul(wanted[:3, :3].T, there[:3, :3])
    angle = float(portable.arctan2(turned[2, 1], turned[1, 1]))
    tilt = float(portable.arccos(np.clip(turned[0, 0], -1.0, 1.0)))
    if away > _START_M or tilt > _START_RAD or abs(angle) > free_angle + _START_RAD:
        off_deg = np.degrees(max(tilt, abs(angle)))
        raise PathRefusedError(
            f"the tcp of start is {away * 1e3:.3g} mm and "
            f"{off_deg:.3g} deg from where the path begins: it must be "
            f"within {_START_M * 1e3:g} mm and {np.degrees(_START_RAD):.2g} deg",
            StatusCode.START_STATE_INVALID,
        )
    later = layers.layer > 0
    is_free = space.states_free(start[None])
    return replace(
        layers,
        q=np.concatenate([start[None], layers.q[later]]),
        layer=np.concatenate([[0], layers.layer[later]]),
        angle=np.concatenate([[angle], layers.angle[later]]),
        free=np.concatenate([is_free, layers.free[later]]),
    )


# how near the start must be to the path's beginning
_START_M = 1e-5
_START_RAD = 1e-5


def _check_reached(layers: Layers, space: FreeSpace) -> None:
    """Raise PathRefusedError at the first place that no configuration reaches, or none that is
    free.
    """
    count = np.bincount(layers.layer, minlength=len(layers.s))
    free = np.bincount(layers.layer[layers.free], minlength=len(layers.s))
    if count.all() and free.all():
        return
    k = int(np.argmin(free > 0))
    at = f"at {layers.s[k]:.3f} m"
    if count[k] == 0:
        raise PathRefusedError(
            f"the path leaves the reach or an axis limit {at}: no configuration brings the tool "
            "there in the orientation asked for",
            StatusCode.NO_IK_SOLUTION,
        )
    raise PathRefusedError(
        f"all {count[k]} configurations collide {at}: "
        f"{nearest_sentence(layers.q[layers.layer == k], space)}",
        StatusCode.INVALID_MOTION_PLAN,
    )


def nearest_sentence(q: FloatArray, space: FreeSpace) -> str:
    """The pair of the configuration of q (M, n) that lacks least clearance."""
    near = space.scene.collision.min_distance(q, space.threshold)
    lacking = space.threshold[near.pair] - near.distance
    k = int(np.argmin(lacking))
    pair = pair_value(space.scene, q[k], int(near.pair[k]))
    distance, bound = in_mm(pair.distance, float(space.threshold[near.pair[k]]))
    return (
        f"in the best of them {pair.body_a} and {pair.body_b} ({pair.kind}) come to "
        f"{distance} mm, they must keep {bound} mm"
    )


# Axes that turn twice: configurations along a path are looked for without their whole turns, and
# what is found is turned into the limits. Where such an axis moves by at most a whole turn, that
# always works.

TURN = 2.0 * np.pi
_ROUNDED = 1e-10  # rad beyond a limit that still counts as on it


def difference(first: FloatArray, second: FloatArray, turning: BoolArray) -> FloatArray:
    """second - first, of the axes that turn (n,) the smaller of what differs by whole turns."""
    step = second - first
    if not turning.any():
        return step
    return np.asarray(step - np.where(turning, TURN * np.rint(step / TURN), 0.0))


def without_turns(q: FloatArray, turning: BoolArray) -> FloatArray:
    """q (M, n) with the axes that turn (n,) in [0, 2 pi)."""
    turned = np.mod(q, TURN)
    return np.where(turning, np.where(turned < TURN, turned, 0.0), q)


def turned_towards(q: FloatArray, near: FloatArray, scene: PlanningScene) -> FloatArray:
    """q (M, n) with the axes that turn twice in the turns nearest to `near` (M, n); inf where these
    lie beyond the limits.
    """
    if not scene.turning.any():
        return q
    low = scene.cell.robot.position_min
    high = scene.cell.robot.position_max
    turned = near + difference(near, q, scene.turning)
    beyond = (turned < low - _ROUNDED) | (turned > high + _ROUNDED)
    turned = np.where(scene.turning, np.where(beyond, np.inf, np.clip(turned, low, high)), q)
    return np.asarray(turned)


def turned_into_limits(
    q: FloatArray, turning: BoolArray, scene: PlanningScene, *, fixed: bool
) -> FloatArray | None:
    """A chain q (N, n) joined over whole turns of the axes that turn (n,): from its first
    configuration if that is fixed, else where it is most within the limits. None: it leaves them in
    every turn.
    """
    if not turning.any():
        return q
    low = scene.cell.robot.position_min
    high = scene.cell.robot.position_max
    joined = np.where(turning, np.unwrap(q, axis=0), q)
    least = joined.min(axis=0)
    most = joined.max(axis=0)
    shift = TURN * np.rint(0.5 * (low + high - least - most) / TURN) * (turning & (not fixed))
    beyond = (least + shift < low - _ROUNDED) | (most + shift > high + _ROUNDED)
    return None if (turning & beyond).any() else np.clip(joined + shift, low, high)


def with_all_turns(layers: Layers, scene: PlanningScene, *, fixed: bool) -> Layers:
    """The layers with all whole turns within the limits; fixed: the first one stays as it is."""
    low = scene.cell.robot.position_min
    high = scene.cell.robot.position_max
    q = layers.q
    node = np.arange(len(layers.q))
    for axis in np.flatnonzero(layers.turning):
        most = int(np.ceil((high[axis] - low[axis]) / TURN))
        shifts = TURN * np.arange(-most, most + 1)
        values = q[:, axis, None] + shifts
        within = (values >= low[axis] - _ROUNDED) & (values <= high[axis] + _ROUNDED)
        if fixed:
            within[layers.layer[node] == 0] = shifts == 0.0
        row, _ = np.nonzero(within)
        q = q[row]
        node = node[row]
        q[:, axis] = np.clip(values[within], low[axis], high[axis])
    return replace(
        layers,
        q=q,
        layer=layers.layer[node],
        angle=layers.angle[node],
        free=layers.free[node],
        turning=np.zeros_like(layers.turning),
    )


# The cheapest chains of configurations along a path: edges from sample to sample where no axis
# jumps.
#
# Complete up to its resolution: what passes no sample without a jump isn't found. Joules of an edge
# are those of its even motion at the tool's speed; accelerations are left out, they come with the
# timing.

JUMP = 0.35  # rad from sample to sample: more is another branch, or a singularity
# rad that a chain may jump where samples can be closer: many and few edges
_WIDE = 1.0
_WIDE_FEW = 3.3
_SAME = 1e-6  # relative cost of chains that differ by whole turns only
_APART = 0.3  # rad: ends of chains with a free angle that are nearer are smoothed to one
_OVERSPEED_WATTS = 2000.0  # what an axis at its speed limit costs in the search; far more beyond
_A_JUMP = 1e9  # J that count for a jump where samples could be closer
_FEW = 100  # configurations of a layer, up to which all pairs are compared
_LAYER = 10.0  # between layers in the tree of neighbours, further than any jump


@dataclass(frozen=True, eq=False)
class ConfigurationChain:
    """Configurations q (N, n) and angles (N,) rad about the tool's axis at the samples s (N,) m;
    joules as estimated.
    """

    s: FloatArray
    q: FloatArray
    angles: FloatArray
    joules: float


def chains(
    layers: Layers,
    speed: float,
    space: FreeSpace,
    most: int,
    *,
    by_start: bool = False,
    wide: float = 0.0,
) -> list[ConfigurationChain]:
    """The cheapest chains through all layers, at most `most`, each with another end, or start
    (whole turns apart count once), at the tool's speed [m/s]. Raises NoChainError where none leads
    through.

    wide: samples that are farther apart than this [m] may be joined by far larger steps, 0: none.
    """
    nodes = np.flatnonzero(layers.free)
    scene = space.scene
    count = len(layers.s)
    q = layers.q[nodes]
    layer = layers.layer[nodes]
    turning = layers.turning
    gaps = np.diff(layers.s)
    before, after = _neighbours(q, layer, turning, gaps > wide if wide else None)
    family = _families(len(q), before, after)
    seconds = (gaps / speed)[layer[before]]
    steps = difference(q[before], q[after], turning)
    joules = _edge_joules(q[before], steps, seconds, scene)
    jumps = np.flatnonzero(np.abs(steps).max(axis=1) > JUMP)
    if len(jumps):  # only where samples could be closer; any jump costs more than none
        joules = np.minimum(joules, _A_JUMP / count)
        joules[jumps] = _A_JUMP * (1.0 + _strays(q[before[jumps]], steps[jumps], scene))
    apart = _SAME if len(np.unique(layers.angle)) == 1 else _APART
    if by_start:  # the same edges from the end
        layer = count - 1 - layer
        before, after = after, before
        order = np.lexsort((before, after, layer[after]))
        before = before[order]
        after = after[order]
        joules = joules[order]
    cost, parent = _cheapest(layer, before, after, joules, count)
    is_reached = np.isfinite(cost)
    last = np.flatnonzero((layer == count - 1) & is_reached)
    if len(last) == 0:
        raise NoChainError(nodes[is_reached])
    found: list[ConfigurationChain] = []
    for node in _different(last, cost, q, family, scene, (apart, most)):
        trace = [int(node)]
        while parent[trace[-1]] >= 0:
            trace.append(int(parent[trace[-1]]))
        order = nodes[trace if by_start else trace[::-1]]
        chain = ConfigurationChain(
            layers.s, layers.q[order], layers.angle[order], float(cost[node])
        )
        found.append(chain)
    return found


def _strays(q: FloatArray, steps: FloatArray, scene: PlanningScene) -> FloatArray:
    """How far (E,) the tool is off its way, in 0.1 m or rad, halfway along steps (E, n) from q (E,
    n): near a singularity far less than elsewhere, so that is where samples should be closer.
    """
    first, middle, last = (
        scene.chain.tcp_poses(q + share * steps)[:, :3] for share in (0.0, 0.5, 1.0)
    )
    off = np.square(middle - 0.5 * (first + last))
    return np.asarray(np.sqrt(100.0 * off[:, :, 3].sum(axis=1) + off[:, :, :3].sum(axis=(1, 2))))


def _neighbours(
    q: FloatArray, layer: IntArray, turning: BoolArray, wide: BoolArray | None
) -> tuple[IntArray, IntArray]:
    """Edges (E,) from one layer to the next with no axis beyond JUMP, ordered by where they lead.
    wide (N - 1,): where they may be longer.
    """
    few = int(np.bincount(layer).max(initial=0)) <= _FEW
    jump = JUMP if wide is None else _WIDE_FEW if few else _WIDE
    before, after = (_by_pairs if few else _by_tree)(q, layer, turning, jump)
    if wide is not None:
        kept = wide[layer[before]] | (
            np.abs(difference(q[before], q[after], turning)).max(axis=1) <= JUMP
        )
        before = before[kept]
        after = after[kept]
    order = np.lexsort((before, after))
    return before[order], after[order]


def _families(count: int, before: IntArray, after: IntArray) -> IntArray:
    """Which of `count` configurations are joined (M,), by the number of their family."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges = coo_array((np.ones(len(before), dtype=bool), (before, after)), shape=(count, count))
    return np.asarray(connected_components(edges, directed=False)[1])


def _by_pairs(
    q: FloatArray, layer: IntArray, turning: BoolArray, jump: float
) -> tuple[IntArray, IntArray]:
    """Edges in any order, all pairs compared axis by axis: quicker where layers are small."""
    count = np.bincount(layer)
    begin = np.cumsum(count) - count
    number = np.full((len(count), count.max(initial=0)), -1)
    number[layer, np.arange(len(layer)) - begin[layer]] = np.arange(len(layer))
    axes = np.argsort(-q.std(axis=0))
    first = np.where(number >= 0, q[number, axes[0]], np.nan)
    step = difference(first[:-1, :, None], first[1:, None, :], turning[axes[0]])
    k, i, j = np.nonzero(np.abs(step) <= jump)
    before = number[k, i]
    after = number[k + 1, j]
    for axis in axes[1:]:
        near = np.abs(difference(q[before, axis], q[after, axis], turning[axis])) <= jump
        before = before[near]
        after = after[near]
    return before, after


def _by_tree(
    q: FloatArray, layer: IntArray, turning: BoolArray, jump: float
) -> tuple[IntArray, IntArray]:
    """Edges in any order, by a tree of all configurations: where layers are large."""
    from scipy.spatial import cKDTree

    box = np.append(np.where(turning, TURN / jump, 0.0), 0.0)  # 0: not periodic
    ahead, place = (
        cKDTree(np.column_stack([without_turns(q, turning) / jump, number * _LAYER]), boxsize=box)
        for number in (layer + 1, layer)
    )
    near = ahead.sparse_distance_matrix(place, 1.0, p=np.inf, output_type="ndarray")
    return near["i"].astype(np.int64), near["j"].astype(np.int64)


def _edge_joules(
    q: FloatArray, steps: FloatArray, seconds: FloatArray, scene: PlanningScene
) -> FloatArray:
    """What the drives take along edges (E,) from q (E, n) by steps (E, n) in seconds (E,) [J], and
    what keeps the search from too fast ones.
    """
    if len(q) == 0:
        return np.zeros(0)
    qd = steps / seconds[:, None]
    power = scene.dynamics.drive_power(q + 0.5 * steps, qd, np.zeros_like(qd)).sum(axis=1)
    share = (np.abs(qd) / scene.limits.velocity).max(axis=1)
    return np.asarray(
        (np.maximum(power, 0.0) + _OVERSPEED_WATTS * portable.power(share, 8)) * seconds
    )


def _cheapest(
    layer: IntArray, before: IntArray, after: IntArray, joules: FloatArray, count: int
) -> tuple[FloatArray, IntArray]:
    """Least joules (M,) to each node, inf where none leads there, and the node before (M,), -1:
    none.
    """
    cost = np.where(layer == 0, 0.0, np.inf)
    parent = np.full(len(layer), -1, dtype=np.int64)
    bounds = np.searchsorted(layer[after], np.arange(count + 1))
    for k in range(1, count):
        edges = slice(bounds[k], bounds[k + 1])
        if edges.start == edges.stop:
            break
        to = after[edges]
        total = cost[before[edges]] + joules[edges]
        order = np.lexsort((before[edges], total, to))
        first = order[np.concatenate([[True], np.diff(to[order]) > 0])]
        kept = first[np.isfinite(total[first])]
        cost[to[kept]] = total[kept]
        parent[to[kept]] = before[edges][kept]
    return cost, parent


def _different(
    last: IntArray,
    cost: FloatArray,
    q: FloatArray,
    family: IntArray,
    scene: PlanningScene,
    bounds: tuple[float, int],
) -> IntArray:
    """Ends (K,) of chains: the cheapest of each family, then the others, cheapest first; of those
    that differ by whole turns, the one most within the axis limits. bounds: about how many rad they
    are apart, and how many at most.
    """
    robot = scene.cell.robot
    middle = 0.5 * (robot.position_min + robot.position_max)
    away = (np.abs(q[last] - middle) / (robot.position_max - robot.position_min)).max(axis=1)
    digits = np.round(portable.log(np.maximum(cost[last], 1e-12)) / _SAME)
    order = last[np.lexsort((away, digits))]
    firsts = np.sort(np.unique(family[order], return_index=True)[1])
    apart, most = bounds
    kept = list[int]()
    for node in [*order[firsts], *np.delete(order, firsts)]:
        if len(kept) == most:
            break
        if all(np.abs(portable.sin(0.5 * (q[node] - q[other]))).max() > apart for other in kept):
            kept.append(int(node))
    return np.array(kept, dtype=np.int64)
