"""Dead ends: where no chain leads on along a path, why, and finer samples that may lead on."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ir_kernels import portable
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.chains import (
    JUMP,
    ConfigurationChain,
    Layers,
    chains,
    configurations_at,
    difference,
    nearest_sentence,
    turned_into_limits,
    with_all_turns,
)
from ir_planner.cartesian.joint_curve import singularity
from ir_planner.cartesian.orientations import about_tool
from ir_planner.cartesian.tool_path import NoChainError, PathRefusedError, ToolPathRequest
from ir_planner.scene import PlanningScene
from ir_values.arrays import BoolArray, FloatArray, IntArray

# Why no chain of configurations leads on along a path: collisions, an axis limit or a
# singularity.

_DAMPED = 1e-6  # of the squared singular values


def dead_end(asked: ToolPathRequest, layers: Layers, reached: IntArray) -> PathRefusedError:
    """The refusal with place, axis and what may help; reached (M,): configurations that chains lead
    to.
    """
    if len(reached) == 0:
        return PathRefusedError(
            "no configuration at the beginning of the path is left", StatusCode.INVALID_MOTION_PLAN
        )
    last = int(layers.layer[reached].max())
    at = reached[layers.layer[reached] == last]
    here = layers.q[at]
    ahead = layers.q[layers.layer == last + 1]
    jumps = np.abs(difference(here[None], ahead[:, None], layers.turning))
    away = jumps.max(axis=2)
    if (near := away.min(axis=1) <= JUMP).any():
        return PathRefusedError(
            f"every configuration that leads up to {layers.s[last]:.3f} m collides at "
            f"{layers.s[last + 1]:.3f} m: {nearest_sentence(ahead[near], asked.space)}",
            StatusCode.INVALID_MOTION_PLAN,
        )
    scene = asked.context.scene
    step = _steps(asked, layers, at, last)
    why = _beyond_limit(here, step, scene) or _jump(here, jumps, scene)
    return PathRefusedError(
        f"no configuration leads past {layers.s[last]:.3f} m without a jump of an axis: {why}; "
        f"{_help(asked)}"
    )


def _steps(asked: ToolPathRequest, layers: Layers, at: IntArray, last: int) -> FloatArray:
    """What the axes (M, n) would turn from configurations `at` (M,) to the next sample, by the
    Jacobian.
    """
    poses = asked.whole.poses(layers.s[last : last + 2])
    turned = portable.matmul(poses[:, None, :3, :3], about_tool(layers.angle[at])[None])
    chain = asked.context.scene.chain
    twist = np.zeros((len(at), 6))
    twist[:, :3] = poses[1, :3, 3] - poses[0, :3, 3]
    rotation = portable.matmul(turned[1], turned[0].transpose(0, 2, 1))
    twist[:, 3:] = 0.5 * np.stack(
        [rotation[:, b, a] - rotation[:, a, b] for a, b in _CYCLIC], axis=1
    )
    jacobian = chain.jacobian(layers.q[at])
    square = portable.matmul(jacobian.transpose(0, 2, 1), jacobian) + _DAMPED * np.eye(
        jacobian.shape[2]
    )
    right = np.einsum("mji,mj->mi", jacobian, twist)
    return np.asarray(portable.solve(square, right[:, :, None])[:, :, 0])


_CYCLIC = ((1, 2), (2, 0), (0, 1))


def _beyond_limit(here: FloatArray, step: FloatArray, scene: PlanningScene) -> str:
    """The axis limit that the configuration with the smallest step (M, n) would pass, if it passes
    one.
    """
    robot = scene.cell.robot
    k = int(np.argmin(np.abs(step).max(axis=1)))
    there = here[k] + step[k]
    over = np.maximum(there - robot.position_max, robot.position_min - there)
    j = int(np.argmax(over))
    if over[j] <= 0.0:
        return ""
    limit = robot.position_max[j] if there[j] > robot.position_max[j] else robot.position_min[j]
    shown = f"{np.degrees(limit):.0f} deg" if j >= robot.base else robot.shown(j, limit)
    return f"{robot.joint_names[j]} reaches its limit of {shown} there"


def _jump(here: FloatArray, jumps: FloatArray, scene: PlanningScene) -> str:
    """The axis that would jump where configurations here (M, n) and those ahead differ least, by
    jumps (A, M, n).
    """
    away = jumps.max(axis=2)
    a, h = np.unravel_index(int(np.argmin(away)), away.shape)
    j = int(np.argmax(jumps[a, h]))
    jump = np.degrees(jumps[a, h, j])
    return f"{scene.cell.robot.joint_names[j]} by {jump:.0f} deg{singularity(here[h], scene)}"


def _help(asked: ToolPathRequest) -> str:
    angle = asked.path.free_angle
    helping = ["another orientation there"]
    if angle < np.pi - 1e-6:
        helping.append("a wider free_angle" if angle > 0.0 else "a free_angle")
    if asked.fixed:
        helping.append("no given start")
    return f"{' or '.join(helping)} may help"


# Samples of a path closer to each other where no chain leads on: near a singularity axes turn far
# within millimetres, and a slow tool has the time for it.

_PARTS = 4  # of an interval where axes jump
_FINEST = 2e-6  # m: what is shorter isn't divided
_ROUNDS = 16  # of dividing
_LOOKED_AT = 3  # chains that jump, whose intervals are divided


def chains_through(
    asked: ToolPathRequest, layers: Layers, most: int, *, by_start: bool = False
) -> tuple[list[ConfigurationChain], Layers]:
    """The cheapest chains as `chains` finds them, at finer samples where it takes them, and the
    layers with these. Raises PathRefusedError where no chain leads on.

    Where one leaves the limits in every turn, another one may lead to its end: all turns are looked
    at. They are too where none leads on from a start beyond half a turn: a limit may be what comes
    first.
    """
    scene = asked.context.scene
    fixed = asked.fixed
    try:
        found, finer = _chains_through(asked, layers, most, by_start=by_start)
    except PathRefusedError:
        if not (fixed and (layers.turning & (np.abs(layers.q[0]) > np.pi)).any()):
            raise
        found = []
        finer = layers
    turned = [turned_into_limits(chain.q, finer.turning, scene, fixed=fixed) for chain in found]
    within = [replace(chain, q=q) for chain, q in zip(found, turned, strict=True) if q is not None]
    if found and len(within) == len(found):
        return within, finer
    return chains_through(asked, with_all_turns(finer, scene, fixed=fixed), most, by_start=by_start)


def _chains_through(
    asked: ToolPathRequest, layers: Layers, most: int, *, by_start: bool
) -> tuple[list[ConfigurationChain], Layers]:
    """The same, without regard to the limits of axes whose whole turns are left out."""
    speed = asked.speed
    space = asked.space
    try:
        return chains(layers, speed, space, most, by_start=by_start), layers
    except NoChainError:
        layers = _divided(asked, layers)
    try:
        return chains(layers, speed, space, most, by_start=by_start), layers
    except NoChainError as error:
        raise dead_end(asked, layers, error.reached) from error


def _divided(asked: ToolPathRequest, layers: Layers) -> Layers:
    """The layers with finer samples wherever the cheapest chains jump, of those that may, until one
    jumps nowhere or nothing is left to divide.
    """
    for _ in range(_ROUNDS):
        asked.context.work.check()
        try:
            found = chains(layers, asked.speed, asked.space, _LOOKED_AT, wide=_FINEST)
            steps = [_jumps(chain.q, layers.turning) for chain in found]
            open_ = np.logical_or.reduce(steps)
            if not all(step.any() for step in steps):
                break
        except NoChainError as error:
            if len(error.reached) == 0:
                break
            open_ = np.arange(len(layers.s) - 1) == layers.layer[error.reached].max()
        between = _further_samples(layers.s, open_ & (np.diff(layers.s) > _FINEST))
        if len(between) == 0:
            break
        layers = _with(layers, between, asked)
    return layers


def closer_at(asked: ToolPathRequest, layers: Layers, places: Iterable[float]) -> Layers:
    """The layers with finer samples around places [m]; the same where nothing is left to divide."""
    last = len(layers.s) - 2
    open_ = np.zeros(last + 1, dtype=bool)
    for place in places:
        k = int(np.clip(np.searchsorted(layers.s, place) - 1, 0, last))
        open_[max(k - 1, 0) : k + 2] = True
    between = _further_samples(layers.s, open_ & (np.diff(layers.s) > _FINEST))
    return _with(layers, between, asked) if len(between) else layers


def _jumps(q: FloatArray, turning: BoolArray) -> BoolArray:
    """Where (N - 1,) a chain (N, n) jumps."""
    return np.asarray(np.abs(difference(q[:-1], q[1:], turning)).max(axis=1) > JUMP)


def _further_samples(s: FloatArray, open_: BoolArray) -> FloatArray:
    """Further samples (B,) m in the intervals of s (N,) m that are open (N - 1,)."""
    share = np.arange(1, _PARTS) / _PARTS
    return np.asarray((s[:-1, None] + share * np.diff(s)[:, None])[open_].ravel())


def _with(layers: Layers, between: FloatArray, asked: ToolPathRequest) -> Layers:
    """The layers with all configurations at further samples (B,) m."""
    s = np.union1d(layers.s, between)
    more = configurations_at(
        asked.whole, between, asked.path.free_angle, asked.space, layers.turning
    )
    layer = np.concatenate(
        [np.searchsorted(s, layers.s)[layers.layer], np.searchsorted(s, between)[more.layer]]
    )
    order = np.argsort(layer, kind="stable")

    def both(first: np.ndarray, second: np.ndarray) -> np.ndarray:
        return np.concatenate([first, second])[order]

    return replace(
        layers,
        s=s,
        q=both(layers.q, more.q),
        layer=layer[order],
        angle=both(layers.angle, more.angle),
        free=both(layers.free, more.free),
    )
