"""Samples of a path closer to each other where no chain leads on: near a singularity axes turn far
within millimetres, and a slow tool has the time for it.
"""

from dataclasses import replace

import numpy as np

from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_planner.cartesian.asked import Asked
from ir_planner.cartesian.chains import JUMP, Chain, chains
from ir_planner.cartesian.dead_end import dead_end
from ir_planner.cartesian.layers import Layers, configurations_at
from ir_planner.cartesian.refusal import NoChainError, PathRefusedError
from ir_planner.cartesian.whole_turns import difference, turned_into_limits, with_all_turns

_PARTS = 4  # of an interval where axes jump
_FINEST = 2e-4  # m: what is shorter isn't divided
_ROUNDS = 16  # of dividing
_LOOKED_AT = 3  # chains that jump, whose intervals are divided


def chains_through(
    asked: Asked, layers: Layers, most: int, *, by_start: bool = False
) -> tuple[list[Chain], Layers]:
    """The cheapest chains as `chains` finds them, at finer samples where it takes them, and the
    layers with these. Raises PathRefusedError where no chain leads on.

    Where one leaves the limits in every turn, another one may lead to its end: all turns are looked
    at. They
    are too where none leads on from a start beyond half a turn: a limit may be what comes first.
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
    asked: Asked, layers: Layers, most: int, *, by_start: bool
) -> tuple[list[Chain], Layers]:
    """The same, without regard to the limits of axes whose whole turns are left out."""
    speed = asked.path.tool_speed
    space = asked.space
    try:
        return chains(layers, speed, space, most, by_start=by_start), layers
    except NoChainError:
        layers = _divided(asked, layers)
    try:
        return chains(layers, speed, space, most, by_start=by_start), layers
    except NoChainError as error:
        raise dead_end(asked, layers, error.reached) from error


def _divided(asked: Asked, layers: Layers) -> Layers:
    """The layers with finer samples wherever the cheapest chains jump, of those that may, until one
    jumps nowhere or nothing is left to divide.
    """
    for _ in range(_ROUNDS):
        asked.context.work.check()
        try:
            found = chains(layers, asked.path.tool_speed, asked.space, _LOOKED_AT, wide=_FINEST)
            steps = [_jumps(chain.q, layers.turning) for chain in found]
            open_ = np.logical_or.reduce(steps)
            if not all(step.any() for step in steps):
                break
        except NoChainError as error:
            open_ = np.arange(len(layers.s) - 1) == layers.layer[error.reached].max()
        between = _between(layers.s, open_ & (np.diff(layers.s) > _FINEST))
        if len(between) == 0:
            break
        layers = _with(layers, between, asked)
    return layers


def _jumps(q: FloatArray, turning: BoolArray) -> BoolArray:
    """Where (N - 1,) a chain (N, n) jumps."""
    return np.asarray(np.abs(difference(q[:-1], q[1:], turning)).max(axis=1) > JUMP)


def _between(s: FloatArray, open_: BoolArray) -> FloatArray:
    """Further samples (B,) m in the intervals of s (N,) m that are open (N - 1,)."""
    share = np.arange(1, _PARTS) / _PARTS
    return np.asarray((s[:-1, None] + share * np.diff(s)[:, None])[open_].ravel())


def _with(layers: Layers, between: FloatArray, asked: Asked) -> Layers:
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
