"""Axes that turn twice: configurations along a path are looked for without their whole turns, and
what is found is turned into the limits. Where such an axis moves by at most a whole turn, that
always works.
"""

from dataclasses import replace

import numpy as np

from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_planner.cartesian.layers import Layers
from ir_planner.scene import PlanningScene

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
