"""The fastest law with levels: each level as high as the torque in its band of speed allows, found
by halving.
"""

import numpy as np

from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_planner.scene import STILL, Dynamics, MotionLimits, torque_use
from ir_planner.timing.ptp import fastest_law, free_law, path_limits
from ir_planner.timing.time_law import GRID_S, LEVELS, Law, LevelLaw, LevelLaws, level_laws

_SPEEDS = np.array([1.0, 0.96, 0.92, 0.87, 0.82, 0.76, 0.7, 0.62, 0.54, 0.45])
_HALVINGS = 7
_PER_PHASE = 6
_BACK = 0.94  # how much all levels are lowered where they don't fit together
_LOWEST = 0.02  # of the acceleration limit


def fastest(start: FloatArray, goal: FloatArray, limits: MotionLimits, dynamics: Dynamics) -> Law:
    """The shorter of the fastest law with one level per ramp and the fastest with several.

    start, goal (n,) [rad]. Raises TimingError when some joint's torque does not suffice however
    slowly.
    """
    plain = fastest_law(start, goal, limits, dynamics)
    delta = np.asarray(goal) - np.asarray(start)
    if np.abs(delta).max() < STILL:
        return plain
    bounds = path_limits(delta, limits)
    if plain.total <= free_law(bounds).total:  # torque bounds nothing
        return plain
    levels = fastest_levels(start, delta, bounds, limits.torque_share, dynamics)
    return levels if levels is not None and levels.total < plain.total else plain


def fastest_levels(
    start: FloatArray,
    delta: FloatArray,
    bounds: tuple[float, float, float],
    share: float,
    dynamics: Dynamics,
) -> LevelLaw | None:
    """Shortest law from `start` by `delta` (n,); None where none fits.

    `bounds`: of s' [1/s], s'' and s'''; `share` of the torque envelope that may be used.
    """
    speed, a, jerk = bounds
    speeds = speed * _SPEEDS
    low = np.full((len(speeds), 2 * LEVELS), _LOWEST * a)
    high = np.full_like(low, a)
    trial = high
    for k in range(_HALVINGS + 1):
        laws = level_laws(speeds, trial[:, :LEVELS], trial[:, LEVELS:], jerk)
        fits = _levels_fit(laws, start, delta, share, dynamics)
        low = np.where(fits, trial, low)
        high = np.where(fits & (k > 0), high, np.where(fits, a, trial))
        trial = 0.5 * (low + high)
    for _ in range(6):
        laws = level_laws(speeds, low[:, :LEVELS], low[:, LEVELS:], jerk)
        good = _within(laws, bounds) & (
            _use(laws, start, delta, dynamics).max(axis=(1, 2)) <= share
        )
        if good.any():
            k = int(np.argmin(np.where(good, laws.steps.sum(axis=1), np.iinfo(np.int64).max)))
            return LevelLaw(
                tuple(int(t) for t in laws.steps[k]), tuple(float(x) for x in laws.accelerations[k])
            )
        low = _BACK * low
    return None


def _within(laws: LevelLaws, bounds: tuple[float, float, float]) -> BoolArray:
    """Which laws keep the bounds of speed, acceleration and jerk."""
    tops = (laws.speeds, laws.accelerations, laws.jerks)
    kept = [np.abs(x).max(axis=1) <= b * (1 + 1e-9) for x, b in zip(tops, bounds, strict=True)]
    return np.asarray(np.all(kept, axis=0))


def _use(laws: LevelLaws, start: FloatArray, delta: FloatArray, dynamics: Dynamics) -> FloatArray:
    """Largest use of torque (K, PHASES, P) over the joints, at P instants of every phase."""
    t = (laws.steps * GRID_S)[:, :, None] * np.linspace(0.0, 1.0, _PER_PHASE)
    a, v, s = (x[:, :-1, None] for x in (laws.accelerations, laws.speeds, laws.path_parameters))
    j = laws.jerks[:, :, None]
    here = s + t * (v + t * (a / 2 + j * t / 6))
    sd = v + t * (a + j * t / 2)
    sdd = a + j * t
    flat = [x.reshape(-1, 1) * delta for x in (here, sd, sdd)]
    use = torque_use(dynamics, start + flat[0], flat[1], flat[2])
    return np.asarray(use.max(axis=1).reshape(t.shape))


def _levels_fit(
    laws: LevelLaws, start: FloatArray, delta: FloatArray, share: float, dynamics: Dynamics
) -> BoolArray:
    """Which levels (K, 2 LEVELS), up then down, keep their torque with the changes beside them."""
    use = _use(laws, start, delta, dynamics).max(axis=2)
    ramp = 2 * LEVELS + 1
    cruise = use[:, ramp] <= share
    down = use[:, :ramp:-1]  # as seen from the end, like the ramp up
    fits = []
    for side in (use[:, :ramp], down):
        for i in range(LEVELS):
            beside = side[:, 2 * i : 2 * i + 3].max(axis=1)
            fits.append((beside <= share) & cruise)
    return np.stack(fits, axis=1)
