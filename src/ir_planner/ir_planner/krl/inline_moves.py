"""Movements written as inline forms: lines of the tool, or of the axes through a few points."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ir_description.cell import POSTURES
from ir_kernels import portable
from ir_krl import KrlError
from ir_krl.write import Style, WrittenMove
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import StatusCode
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.errors import RequestError
from ir_planner.krl.geometry import Arm, status_turn, tool_in_flange
from ir_planner.krl.step_evaluation import ReadBack, StepEvaluator, called, points_of
from ir_planner.krl.strokes import one_after_the_other
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

# Inline forms can't keep a planned spline. What they keep is that nothing is touched: as few points
# of the planned movement are taken as the chain of motions needs to be certified again: wherever it
# comes too near to something, one more. It is driven through, with exact stops where that isn't
# certified. Then it is slowed to the planned time, where it is quicker and that costs less. Stops
# that the movement passes are points of the chain, passed as near as planned or stopped at.

_SAMPLES = 800
_POINTS_MAX = 40
_ROUNDED = 0.45  # share of the way to a neighbouring point within which a point is rounded
_TRIALS = 3
_QUICKER = 0.98
_TOP = 2.0  # m/s of the tool
_FARTHER = 0.01  # m, that a stop is passed farther away than planned
_SERVICE = (MovementKind.SERVICE_ENTRY, MovementKind.SERVICE_EXIT)


@dataclass(frozen=True, eq=False)
class _Driven:
    """A chain and what becomes of it; reason: why it isn't certified, "" where it is; violation:
    where it comes too near to something [rad] (n,), None: something else is wrong, everywhere.
    missed: a stop isn't passed.
    """

    moves: list[WrittenMove]
    seconds: float = 0.0
    joules: float = 0.0
    reason: str = ""
    violation: FloatArray | None = None
    missed: bool = False


def fitted_moves(
    step: PlannedMovement, evaluator: StepEvaluator, back: ReadBack, style: Style
) -> list[WrittenMove]:
    """The forms of a movement. Raises RequestError where no chain of them is certified."""
    planned = points_of(step)
    scene = evaluator.scene(step)
    q = planned.sample(np.linspace(0.0, planned.duration, _SAMPLES)).q
    reasons = []
    if step.kind in _SERVICE and step.from_station == step.to_station and not step.passes:
        line = [replace(one, velocity=_TOP) for one in _through(q[[-1]], scene, straight=True)]
        driven = _evaluated(line, step, evaluator, back)
        if not driven.reason:
            return _at_planned_time(driven, step, planned, evaluator, back).moves
    for through in (True, False):
        driven = _refined(q, step, evaluator, back, style, through=through)
        if not driven.reason:
            return _at_planned_time(driven, step, planned, evaluator, back).moves
        reasons.append(driven.reason)
    raise RequestError(
        StatusCode.INVALID_MOTION_PLAN,
        f"{called(step)} can't be written in style {style} with {_POINTS_MAX} points: "
        f"{reasons[-1]}; style spline keeps the plan",
    )


def _refined(
    q: FloatArray,
    step: PlannedMovement,
    evaluator: StepEvaluator,
    back: ReadBack,
    style: Style,
    *,
    through: bool,
) -> _Driven:
    """The chain of fewest points of q (N, n) that is certified, driven through or with stops."""
    scene = evaluator.scene(step)
    near = nearest_to(q, step.passes, scene)
    rows = sorted({0, *(row for row, _ in near), len(q) - 1})
    while True:
        moves = _through(q[rows[1:]], scene)
        if through and len(moves) > 1:
            moves = _rounded(moves, q[0], scene, style)
        driven = _evaluated(moves, step, evaluator, back)
        if not driven.reason or len(rows) > _POINTS_MAX:
            return driven
        if driven.missed:
            return driven
        if driven.violation is None:
            more = max(
                (_farthest_from_line(q, *span) for span in pairwise(rows)), key=lambda one: one[1]
            )[0]
        else:
            row = int(np.abs(q - driven.violation).max(axis=1).argmin())
            k = int(np.clip(np.searchsorted(rows, row, side="right"), 1, len(rows) - 1))
            more = _farthest_from_line(q, rows[k - 1], rows[k])[0]
        if more in rows:
            return driven
        rows = sorted([*rows, more])


def nearest_to(
    q: FloatArray, stops: Sequence[str], scene: PlanningScene
) -> list[tuple[int, float]]:
    """The rows of q (N, n) at which the tool comes nearest to stops, one after the other, and how
    near [m].
    """
    tools = scene.chain.tcp_poses(q)[:, :3, 3]
    found = []
    first = 0
    for name in stops:
        if name in POSTURES:
            posture = np.array(scene.cell.posture(name))
            place = scene.chain.tcp_poses(posture[None])[0, :3, 3]
        else:
            place = scene.cell.station(name).pose[:3, 3]
        away = np.linalg.norm(tools[first:] - place, axis=1)
        first += int(away.argmin())
        found.append((first, float(away.min())))
    return found


def _missed(again: JointTrajectory, step: PlannedMovement, scene: PlanningScene) -> str:
    """Why a stop isn't passed as planned, "" where all are."""
    if not step.passes:
        return ""
    planned, driven = (
        nearest_to(one.sample(np.linspace(0.0, one.duration, _SAMPLES)).q, step.passes, scene)
        for one in (points_of(step), again)
    )
    for name, (_, wanted), (_, away) in zip(step.passes, planned, driven, strict=True):
        if away > wanted + _FARTHER:
            return (
                f"{name} is passed at {1e3 * away:.1f} mm, it must be at most "
                f"{1e3 * (wanted + _FARTHER):.1f} mm"
            )
    return ""


def _farthest_from_line(q: FloatArray, first: int, last: int) -> tuple[int, float]:
    """The row of q (N, n) farthest from the line between two others, and how far [rad]."""
    if last - first < 2:
        return first, 0.0
    line = q[first] + np.linspace(0.0, 1.0, last - first + 1)[:, None] * (q[last] - q[first])
    off = np.abs(q[first : last + 1, None] - line[None]).max(axis=2).min(axis=1)
    farthest = first + int(off.argmax())
    return (farthest if first < farthest < last else (first + last) // 2), float(off.max())


def _through(q: FloatArray, scene: PlanningScene, straight: bool = False) -> list[WrittenMove]:
    poses = portable.matmul(Arm(scene).flange(q), tool_in_flange(scene.cell.tcp))
    marks = [status_turn(scene.chain, row) for row in q]
    return [
        WrittenMove("", pose, *mark, straight=straight, velocity=100, joints=row)
        for pose, mark, row in zip(poses, marks, q, strict=True)
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


def _evaluated(
    moves: list[WrittenMove], step: PlannedMovement, evaluator: StepEvaluator, back: ReadBack
) -> _Driven:
    try:
        again = one_after_the_other(back(moves))
    except KrlError as error:
        return _Driven(moves, reason=error.reason)
    found = evaluator(again, step)
    violation = found.verification.violation
    if violation is None:
        missed = _missed(again, step, evaluator.scene(step))
        return _Driven(moves, again.duration, found.report.energy, missed, missed=missed != "")
    near = violation.what == "clearance"
    at = again.sample([violation.time]).q[0] if near else None
    return _Driven(moves, reason=violation.sentence, violation=at)


def _at_planned_time(
    found: _Driven,
    step: PlannedMovement,
    planned: JointTrajectory,
    evaluator: StepEvaluator,
    back: ReadBack,
) -> _Driven:
    """The same motions at the planned time, where they are quicker, and that costs less."""
    best = found
    share = 1.0
    seconds = found.seconds
    for _ in range(_TRIALS):
        if seconds > _QUICKER * planned.duration:
            break
        share *= seconds / planned.duration
        slower = _evaluated([_at(one, share) for one in found.moves], step, evaluator, back)
        if slower.reason:
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
