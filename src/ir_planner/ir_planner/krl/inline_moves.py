"""Movements written as inline forms: lines of the tool, or of the axes through a few points."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_krl import KrlError, Style, WrittenMove
from ir_msgs_py.arrays import FloatArray, IntArray
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError
from ir_planner.krl.geometry import Arm, status_turn, tool_in_flange
from ir_planner.krl.judged import Judge, ReadBack, called, points_of
from ir_planner.krl.strokes import one_after_the_other
from ir_planner.scene import PlanningScene

# Inline forms can't keep a planned spline. What they keep is that nothing is touched: as few points
# of the planned movement are taken as the chain of motions needs to be certified again, rounded
# where that is certified, with exact stops where it isn't. Then it is slowed to the planned time,
# where it is quicker and that costs less.

_AWAY = (np.inf, 0.4, 0.2, 0.1, 0.05, 0.025)  # rad, of a joint from the chain of axis motions
_SAMPLES = 400
_ROUNDED = 0.45  # share of the way to a neighbouring point within which a point is rounded
_TRIALS = 3
_QUICKER = 0.98
_TOP = 2.0  # m/s of the tool
_SERVICE = (MovementKind.SERVICE_ENTRY, MovementKind.SERVICE_EXIT)


@dataclass(frozen=True, eq=False)
class _Found:
    moves: list[WrittenMove]
    seconds: float
    joules: float


def fitted_moves(
    step: PlannedMovement, judge: Judge, back: ReadBack, style: Style
) -> list[WrittenMove]:
    """The forms of a movement. Raises RequestError where no chain of them is certified."""
    planned = points_of(step)
    reason = ""
    for moves in _chains(step, planned, judge.scene(step), style):
        found, why = _judged(moves, step, judge, back)
        if found is not None:
            return _slowed(found, step, planned, judge, back).moves
        reason = reason or why
    raise RequestError(
        StatusCode.INVALID_MOTION_PLAN,
        f"{called(step)} can't be written in style {style}: {reason}; style spline keeps the plan",
    )


def _chains(
    step: PlannedMovement, planned: JointTrajectory, scene: PlanningScene, style: Style
) -> Iterator[list[WrittenMove]]:
    """Chains of motions, the simplest first."""
    q = planned.sample(np.linspace(0.0, planned.duration, _SAMPLES)).q
    if step.kind in _SERVICE:
        yield [replace(one, velocity=_TOP) for one in _through(q[[-1]], scene, straight=True)]
    tried = 0
    for away in _AWAY:
        vias = _kept(q, away)
        if len(vias) == tried:
            continue
        tried = len(vias)
        moves = _through(q[vias], scene)
        if len(moves) > 1:
            yield _rounded(moves, q[0], scene, style)
        yield moves


def _kept(q: FloatArray, away: float) -> IntArray:
    """Rows of q (N, n) so that lines between them keep within `away` of all, the last included."""
    kept = {0, len(q) - 1}
    spans = [(0, len(q) - 1)]
    while spans:
        first, last = spans.pop()
        if last - first < 2 or not np.isfinite(away):
            continue
        share = np.linspace(0.0, 1.0, last - first + 1)[:, None]
        off = _off_the_line(q[first : last + 1], share)
        k = int(off.argmax())
        if off[k] > away:
            kept.add(first + k)
            spans += [(first, first + k), (first + k, last)]
    return np.array(sorted(kept)[1:])


def _off_the_line(q: FloatArray, share: FloatArray) -> FloatArray:
    """Distance (M,) of configurations from the line between the first and the last, wherever on
    it.
    """
    fine = q[0] + np.linspace(0.0, 1.0, len(share))[:, None] * (q[-1] - q[0])
    return np.asarray(np.abs(q[:, None] - fine[None]).max(axis=2).min(axis=1))


def _through(q: FloatArray, scene: PlanningScene, straight: bool = False) -> list[WrittenMove]:
    poses = portable.matmul(Arm(scene).flange(q), tool_in_flange(scene.cell.tcp))
    marks = [status_turn(scene.chain, row) for row in q]
    return [
        WrittenMove("", pose, *mark, straight=straight, velocity=100)
        for pose, mark in zip(poses, marks, strict=True)
    ]


def _rounded(
    moves: Sequence[WrittenMove], start: FloatArray, scene: PlanningScene, style: Style
) -> list[WrittenMove]:
    """The chain driven through: each point but the last is passed near it."""
    first = portable.matmul(Arm(scene).flange(start[None]), tool_in_flange(scene.cell.tcp))[0]
    places = np.array([first[:3, 3], *(one.pose[:3, 3] for one in moves)])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    near = 1e3 * _ROUNDED * np.minimum(steps[:-1], steps[1:])
    shares = np.full(len(near), 100.0) if style == "krc2" else np.maximum(np.floor(near), 1.0)
    return [
        *(replace(one, rounded=float(by)) for one, by in zip(moves[:-1], shares, strict=True)),
        moves[-1],
    ]


def _judged(
    moves: list[WrittenMove], step: PlannedMovement, judge: Judge, back: ReadBack
) -> tuple[_Found | None, str]:
    try:
        again = one_after_the_other(back(moves))
    except KrlError as error:
        return None, error.reason
    found = judge(again, step)
    if not found.verification.certified:
        return None, found.verification.status.message
    return _Found(moves, again.duration, found.report.energy), ""


def _slowed(
    found: _Found, step: PlannedMovement, planned: JointTrajectory, judge: Judge, back: ReadBack
) -> _Found:
    """The same motions at the planned time, where they are quicker, and that costs less."""
    best = found
    share = 1.0
    seconds = found.seconds
    for _ in range(_TRIALS):
        if seconds > _QUICKER * planned.duration:
            break
        share *= seconds / planned.duration
        slower, _why = _judged([_at(one, share) for one in found.moves], step, judge, back)
        if slower is None:
            break
        seconds = slower.seconds
        best = slower if slower.joules < best.joules else best
    return best


def _at(move: WrittenMove, share: float) -> WrittenMove:
    """A motion at a share of its speed, and at the square of it of its acceleration."""
    acceleration = int(np.clip(np.ceil(100.0 * share * share), 1, 100))
    if move.straight:
        velocity = float(np.clip(np.round(move.velocity * share, 3), 0.001, _TOP))
    else:
        velocity = float(np.clip(np.ceil(move.velocity * share), 1, 100))
    return replace(move, velocity=velocity, acceleration=acceleration)
