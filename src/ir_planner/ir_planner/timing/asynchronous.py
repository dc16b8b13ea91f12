"""Asynchronous PTP: every joint takes its own time and stops when it has arrived.

Each joint has its own fastest law. Where all of them together ask too much of some joint's torque,
single
joints keep to the synchronous law of the step, as few as possible: the movement never takes longer
than the synchronous one. The joints leave the straight line between start and goal. Where that is
not free, joints keep to the synchronous law too, those first that leave the line most.
"""

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_planner.scene import STILL, Dynamics, MotionLimits, torque_use
from ir_planner.timing.time_law import Law, LawLimits, StepLaws, TimeLaw, phase_steps

_SAMPLE = 4  # grid steps


def own_laws(
    start: FloatArray, delta: FloatArray, common: Law, limits: MotionLimits, dynamics: Dynamics
) -> tuple[StepLaws, frozenset[int]]:
    """Laws of the joints from `start` by `delta` (n,), each as fast as it can with all torques
    within their share, and the joints that keep to the `common` law instead.

    From the joint that gains least by it to the one that gains most, each takes its own law where
    torque allows.
    """
    own = _fastest(delta, limits)
    if _within(start, delta, own, limits, dynamics):
        return own, frozenset()
    moving = np.flatnonzero(np.abs(delta) >= STILL)
    joined = frozenset(int(j) for j in moving)
    for joint in sorted(moving, key=lambda j: -own.laws[j].total):
        fewer = joined - {int(joint)}
        if _within(start, delta, _mixed(own, common, fewer), limits, dynamics):
            joined = fewer
    return _mixed(own, common, joined), joined


def farthest_from_line(
    laws: StepLaws, common: Law, delta: FloatArray, step: int, joined: frozenset[int]
) -> int | None:
    """The joint of delta (n,) that is farthest from where the `common` law has it at grid step
    `step`, of those that haven't `joined` it; None where none is left.
    """
    s, _, _ = laws.at(np.array([step]))
    on_line, _, _ = common.at(np.array([step]))
    away = np.abs((s[0] - on_line[0]) * delta)
    away[list(joined)] = -1.0
    away[np.abs(delta) < STILL] = -1.0
    joint = int(np.argmax(away))
    return joint if away[joint] >= 0.0 else None


def joining(laws: StepLaws, common: Law, joint: int) -> StepLaws:
    """The laws (one per joint) with one joint more on the common law."""
    return _mixed(laws, common, frozenset({joint}))


def _mixed(own: StepLaws, common: Law, joined: frozenset[int]) -> StepLaws:
    return StepLaws(tuple(common if j in joined else law for j, law in enumerate(own.laws)))


def _fastest(delta: FloatArray, limits: MotionLimits) -> StepLaws:
    """The fastest law of each joint alone, whatever the torque."""
    size = np.maximum(np.abs(delta), STILL)
    acceleration = limits.acceleration / size
    bounds = LawLimits(limits.velocity / size, acceleration, acceleration, limits.jerk / size)
    return StepLaws(tuple(TimeLaw(tuple(int(k) for k in row)) for row in phase_steps(bounds)))


def _within(
    start: FloatArray, delta: FloatArray, laws: StepLaws, limits: MotionLimits, dynamics: Dynamics
) -> bool:
    """Whether torque stays within its share at samples of the laws."""
    switches = laws.switches()
    at = np.unique(np.concatenate([np.arange(0, laws.total, _SAMPLE), switches, switches[1:] - 1]))
    s, sd, sdd = laws.at(at.astype(np.int64))
    use = torque_use(dynamics, start + s * delta, sd * delta, sdd * delta)
    return bool(use.max() <= limits.torque_share)
