"""The changes from one program to another: which movement, which pause, how, and how much that
saves.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import MovementKind
from ir_msgs_py.savings import Change
from ir_planner.before_after.costs_of import Costed, CostedHop, hops_of, saving

MOST = 5
# the work of a change
MODE = 1
TIMES = 2
PATH = 3
_WORTH_IT = 1.0  # J
_SAME_PATH = 0.05  # rad: within this a joint follows the same path
_SAME_TIME = 0.005  # s
_SAMPLES = 200


def changes(today: Costed, planned: Costed, most: int = MOST) -> tuple[Change, ...]:
    """The changes that save most from today's program to the planned one, those of least work
    first.
    """
    before = dict(_keyed(hops_of(today)))
    after = dict(_keyed(hops_of(planned)))
    found = [_change(before[key], after[key]) for key in before if key in after]
    worth = sorted(
        (one for one in found if one.saving.saved >= _WORTH_IT), key=lambda one: -one.saving.saved
    )
    return tuple(sorted(worth[:most], key=lambda one: (one.work, -one.saving.saved)))


def _keyed(hops: Sequence[CostedHop]) -> Iterator[tuple[tuple[str, int], CostedHop]]:
    """By the stops, and how often the same was before."""
    times: dict[str, int] = {}
    for hop in hops:
        times[hop.title] = times.get(hop.title, 0) + 1
        yield (hop.title, times[hop.title]), hop


def _change(before: CostedHop, after: CostedHop) -> Change:
    work, words = _paused(before, after) if before.is_pause else _moved(before, after)
    return Change(before.title, work, words, (before.seconds, after.seconds), saving(before, after))


def _paused(before: CostedHop, after: CostedHop) -> tuple[int, str]:
    modes = [hop.steps[0].power_mode for hop in (before, after)]
    shown = [mode.replace(">", ", then ").replace("_", " ").lower() for mode in modes]
    if modes[0] == modes[1]:
        return TIMES, f"{after.seconds:.2f} s instead of {before.seconds:.2f} s"
    today = shown[0] or "what the controller does by itself"
    return MODE, f"{shown[1] or 'stand on motors'} instead of {today}"


def _moved(before: CostedHop, after: CostedHop) -> tuple[int, str]:
    times = f"{after.seconds:.2f} s instead of {before.seconds:.2f} s"
    along = (
        before.steps[0].kind == MovementKind.CARTESIAN
    )  # one movement, at rest at its corners as well
    passed = 0 if along else len(before.steps) - len(after.steps)
    if passed > 0:
        times += f", {passed} stop{'s' if passed > 1 else ''} less on it"
    first = _path(before)
    second = _path(after)
    if np.abs(first[-1] - second[-1]).max() > _SAME_PATH:
        return PATH, f"another configuration at its end, {times}"
    away = _distance(second, first)
    if away > _SAME_PATH:
        return (
            PATH,
            f"another path (a joint up to {np.degrees(away):.0f} deg from today's), {times}",
        )
    if abs(after.seconds - before.seconds) > _SAME_TIME or passed > 0:
        return TIMES, f"the same path in {times}"
    return TIMES, "the same path in the same time, other speeds along it"


def _path(hop: CostedHop) -> FloatArray:
    """Points (M, n) along all movements of a hop."""
    points = [
        step.trajectory.sample(
            np.linspace(step.trajectory.times[0], step.trajectory.duration, _SAMPLES)
        ).q
        for step in hop.steps
        if step.trajectory is not None
    ]
    return np.concatenate(points)


def _distance(points: FloatArray, path: FloatArray) -> float:
    """How far [rad] points (M, n) get from a path (K, n), by their farthest joint."""
    return max(float(np.abs(path - point).max(axis=1).min()) for point in points)
