"""Time for a straight movement of all joints (PTP): as fast as speed, acceleration, jerk and torque
allow.

All joints follow one law s(t) (synchronous). The limits of the joints bound s'; the torque envelope
is not a bound of s' alone: it depends on where the arm is and what it carries. So laws of several
cruising speeds are tried, and for each the acceleration and the braking are raised, by halving, as
far as the torque of every joint stays within its share of the envelope along the whole law; the
shortest wins.
"""

import numpy as np

from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import TimingError
from ir_planner.scene import STILL, Dynamics, MotionLimits, torque_use
from ir_planner.timing.jerk_limited_laws import (
    GRID_S,
    LEVELS,
    Law,
    LawLimits,
    LevelLaw,
    LevelLaws,
    TimeLaw,
    law_states,
    level_laws,
    phase_steps,
)
from ir_values.arrays import BoolArray, FloatArray, IntArray

_SPEEDS = np.array([1.0, 0.93, 0.86, 0.78, 0.7, 0.6, 0.5, 0.4, 0.28, 0.15])
_REFINED = np.array([-0.045, -0.03, -0.015, 0.0, 0.015, 0.03, 0.045])
_HALVINGS = 7
_PER_PHASE = 7
_PER_SEGMENT = 9


def torque_per_segment(trajectory: JointTrajectory, dynamics: Dynamics) -> FloatArray:
    """Largest sampled use of the torque envelope in each segment, (S, n); no proof."""
    _, durations = trajectory.coefficients()
    shares = np.linspace(0.0, 1.0, _PER_SEGMENT)
    t = trajectory.times[:-1, None] + durations[:, None] * shares
    motion = trajectory.sample(t.ravel())
    use = torque_use(dynamics, motion.q, motion.qd, motion.qdd)
    return np.asarray(use.reshape(len(durations), _PER_SEGMENT, -1).max(axis=1))


def _law_samples(steps: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """s, sd, sdd (K, 7, P) at P instants of every phase, ends included."""
    states = law_states(steps)
    t = (steps * GRID_S)[:, :, None] * np.linspace(0.0, 1.0, _PER_PHASE)
    j = states.jerk[:, :, None]
    a0, v0, s0 = (x[:, :7, None] for x in (states.sdd, states.sd, states.s))
    return s0 + t * (v0 + t * (a0 / 2 + j * t / 6)), v0 + t * (a0 + j * t / 2), a0 + j * t


def _torque_of_laws(
    dynamics: Dynamics, start: FloatArray, delta: FloatArray, steps: IntArray
) -> FloatArray:
    """Largest use of torque (K, 2, n): while speeding up and cruising, and while braking."""
    s, sd, sdd = _law_samples(steps)
    shape = (*s.shape, len(start))
    flat = [x.reshape(-1, 1) * delta for x in (s, sd, sdd)]
    use = torque_use(dynamics, start + flat[0], flat[1], flat[2]).reshape(shape)
    return np.stack([use[:, :4].max(axis=(1, 2)), use[:, 4:].max(axis=(1, 2))], axis=1)


def path_limits(delta: FloatArray, limits: MotionLimits) -> tuple[float, float, float]:
    """Bounds of s' [1/s], s'' and s''' for the movement by `delta` (n,)."""
    size = np.maximum(np.abs(delta), 1e-300)
    return tuple(
        float(np.min(bound / size)) for bound in (limits.velocity, limits.acceleration, limits.jerk)
    )  # type: ignore[return-value]


def free_law(bounds: tuple[float, float, float]) -> TimeLaw:
    """The fastest law within bounds of the speed of s and its derivatives alone, whatever the
    torque.
    """
    v, a, j = (np.array([bound]) for bound in bounds)
    return TimeLaw(tuple(int(k) for k in phase_steps(LawLimits(v, a, a, j))[0]))


def fastest_law(
    start: FloatArray, goal: FloatArray, limits: MotionLimits, dynamics: Dynamics
) -> TimeLaw:
    """Law of the shortest synchronous movement from `start` to `goal` (n,).

    Raises TimingError when some joint's torque does not suffice however slowly.
    """
    delta = np.asarray(goal) - np.asarray(start)
    if np.max(np.abs(delta)) < STILL:
        return TimeLaw((1, 0, 1, 0, 1, 0, 1))
    v, a, j = path_limits(delta, limits)
    free = free_law((v, a, j))
    use = _torque_of_laws(dynamics, start, delta, np.array([free.steps]))
    if use.max() <= limits.torque_share:
        return free
    top = float(law_states(np.array([free.steps])).sd[0, 3])
    slower: FloatArray = top / 2 ** np.arange(3, 9)
    best = _best_law(start, delta, top * _SPEEDS, (a, j), limits.torque_share, dynamics)
    if best is None:
        best = _best_law(start, delta, slower, (a, j), limits.torque_share, dynamics)
    if best is None:
        gentle = np.array([0.01 * a])
        slow = phase_steps(_limits(slower[-1:], gentle, gentle, j))
        need = _torque_of_laws(dynamics, start, delta, slow).max(axis=(0, 1))
        joint = int(np.argmax(need))
        kept = f", {limits.torque_reserve:g} is its reserve" if limits.torque_reserve > 0.0 else ""
        raise TimingError(
            f"joint {joint + 1} needs {need[joint]:.3f} of its torque at 1/256 of full speed, at "
            f"most {limits.torque_share:.3f} may be used{kept}: "
            "the load is too heavy for this movement",
            joint,
            too_heavy=True,
        )
    return _refined(best, start, delta, (a, j), limits.torque_share, dynamics)


def _refined(
    best: TimeLaw,
    start: FloatArray,
    delta: FloatArray,
    aj: tuple[float, float],
    share: float,
    dynamics: Dynamics,
) -> TimeLaw:
    speed = float(law_states(np.array([best.steps])).sd[0, 3])
    better = _best_law(start, delta, speed * (1.0 + _REFINED), aj, share, dynamics)
    return better if better is not None and better.total < best.total else best


def _limits(
    speed: FloatArray, acceleration: FloatArray, braking: FloatArray, jerk: float
) -> LawLimits:
    return LawLimits(speed, acceleration, braking, np.full(len(speed), jerk))


def _best_law(
    start: FloatArray,
    delta: FloatArray,
    speeds: FloatArray,
    aj: tuple[float, float],
    share: float,
    dynamics: Dynamics,
) -> TimeLaw | None:
    """Shortest law over cruising `speeds` (K,) [1/s] whose torque stays within `share`; None when
    there is none.

    aj: the limits of s'' [1/s^2] and s''' [1/s^3]. For every speed the accelerations of both ramps
    are found by bisection at once; then all shrink until the whole law fits.
    """
    most, jerk = aj
    count = len(speeds)

    def steps_of(accelerations: FloatArray) -> IntArray:
        """Phases (K, 7) of the laws with accelerations (K, 2) of their ramps."""
        return phase_steps(_limits(speeds, accelerations[:, 0], accelerations[:, 1], jerk))

    low = np.full((count, 2), 0.01 * most)
    high = np.full((count, 2), most)
    trial = high
    for k in range(_HALVINGS + 1):
        use = _torque_of_laws(dynamics, start, delta, steps_of(trial))
        fits = use.max(axis=2) <= share
        low = np.where(fits, trial, low)
        # the first trial is the limit itself: where it does not fit, it is the upper end
        high = np.where(fits & (k > 0), high, np.where(fits, most, trial))
        trial = 0.5 * (low + high)
    steps = steps_of(low)
    for _ in range(4):
        use = _torque_of_laws(dynamics, start, delta, steps)
        fits_whole = use.max(axis=(1, 2)) <= share
        if fits_whole.any():
            totals = np.where(fits_whole, steps.sum(axis=1), np.iinfo(np.int64).max)
            shortest = steps[int(np.argmin(totals))]
            return TimeLaw(tuple(int(k) for k in shortest))
        low = 0.85 * low
        steps = steps_of(low)
    return None


# Several levels per ramp: each as high as the torque in its band of speed allows, found by halving.

_SPEEDS_LEVEL_TIMING = np.array([1.0, 0.96, 0.92, 0.87, 0.82, 0.76, 0.7, 0.62, 0.54, 0.45])
_PER_PHASE_LEVEL_TIMING = 6
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

    `bounds`: of s' [1/s], s'' and s'''; `share` of the torque envelope that may be used. For every
    speed the acceleration of each level is found by bisection; then all shrink until the law fits.
    """
    speed, most, jerk = bounds
    speeds = speed * _SPEEDS_LEVEL_TIMING

    def laws_of(accelerations: FloatArray) -> LevelLaws:
        """Laws with accelerations (K, 2 LEVELS): first those that speed up."""
        return level_laws(speeds, accelerations[:, :LEVELS], accelerations[:, LEVELS:], jerk)

    low = np.full((len(speeds), 2 * LEVELS), _LOWEST * most)
    high = np.full_like(low, most)
    trial = high
    for k in range(_HALVINGS + 1):
        fits = _levels_fit(laws_of(trial), start, delta, share, dynamics)
        low = np.where(fits, trial, low)
        # the first trial is the limit itself: where it does not fit, it is the upper end
        high = np.where(fits & (k > 0), high, np.where(fits, most, trial))
        trial = 0.5 * (low + high)
    for _ in range(6):
        laws = laws_of(low)
        use = _use(laws, start, delta, dynamics).max(axis=(1, 2))
        good = _which_keep(laws, bounds) & (use <= share)
        if good.any():
            totals = np.where(good, laws.steps.sum(axis=1), np.iinfo(np.int64).max)
            shortest = int(np.argmin(totals))
            return LevelLaw(
                steps=tuple(int(t) for t in laws.steps[shortest]),
                accelerations=tuple(float(a) for a in laws.accelerations[shortest]),
            )
        low = _BACK * low
    return None


def _which_keep(laws: LevelLaws, bounds: tuple[float, float, float]) -> BoolArray:
    """Which laws keep the bounds of speed, acceleration and jerk."""
    tops = (laws.speeds, laws.accelerations, laws.jerks)
    kept = [np.abs(x).max(axis=1) <= b * (1 + 1e-9) for x, b in zip(tops, bounds, strict=True)]
    return np.asarray(np.all(kept, axis=0))


def _use(laws: LevelLaws, start: FloatArray, delta: FloatArray, dynamics: Dynamics) -> FloatArray:
    """Largest use of torque (K, PHASES, P) over the joints, at P instants of every phase."""
    shares = np.linspace(0.0, 1.0, _PER_PHASE_LEVEL_TIMING)
    t = (laws.steps * GRID_S)[:, :, None] * shares
    a = laws.accelerations[:, :-1, None]
    v = laws.speeds[:, :-1, None]
    begin = laws.path_parameters[:, :-1, None]
    j = laws.jerks[:, :, None]
    s = begin + t * (v + t * (a / 2 + j * t / 6))
    sd = v + t * (a + j * t / 2)
    sdd = a + j * t
    q = start + s.reshape(-1, 1) * delta
    qd = sd.reshape(-1, 1) * delta
    qdd = sdd.reshape(-1, 1) * delta
    use = torque_use(dynamics, q, qd, qdd)
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
