"""The movement along a path: the cheapest chains of configurations with their times, certified."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ir_msgs_py.cartesian import SPEED_TOLERANCE_MIN
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.chains import ConfigurationChain, Layers, difference
from ir_planner.cartesian.dead_ends import chains_through, closer_at
from ir_planner.cartesian.joint_curve import Angle, JointCurve, angle_along, curve_of
from ir_planner.cartesian.path_times import SentPath, TimedStroke, sent, timed_stroke
from ir_planner.cartesian.slowing import slower_between, unhurried
from ir_planner.cartesian.speed_ramps import StrokeSpan
from ir_planner.cartesian.tool_path import PathRefusedError, ToolPath, ToolPathRequest
from ir_planner.checks import ToolUse
from ir_planner.curves import extremes
from ir_planner.request import DURATION_MAX
from ir_planner.scene import MotionLimits, PlanningScene, lasting_longer
from ir_planner.timing import Movement, within_torque
from ir_values.arrays import FloatArray

T1_SPEED = 0.25  # m/s at the tcp and at the centre of the flange
COMPARED = 3  # movements, over the cheapest chains by the estimate
_SAME = 1e-6  # relative joules
# estimates of joules leave out ramps, which cost about the same in all
_COSTLIER = 1.2
_COSTLIER_J = 100.0
_TRIED = 12  # chains at most: where one can't keep the speed, the next is tried
_ROUNDS = 6  # of chains that aren't certified
_CLOSER = 12  # times that samples are closer where axes turn between them
_AROUND = 0.02  # m along the path, and
_NEAR = 0.3  # rad around a configuration that isn't certified: not asked again
_SHRUNK = 0.999
_REST = 0.1  # of the tolerance of the speed, for single places, where all are slower
_LIMITS = ("velocity", "acceleration", "jerk")
_FARTHER = 0.93


class DrivenPath(NamedTuple):
    """A chain as a movement, and what it keeps of the path; slower: the share of its speed that T1
    leaves;
    longer: its ramps reach as far as it takes.
    """

    movement: Movement
    sent: SentPath
    angle: Angle | None
    chain: ConfigurationChain
    slower: float = 1.0
    longer: bool = False

    @property
    def top_speed(self) -> float:
        """The highest [m/s] for which it is laid out."""
        return max(float(stroke.law.last.max()) for stroke in self.sent.strokes)


def best_along(asked: ToolPathRequest, layers: Layers) -> DrivenPath:
    """The certified movement of least cost by the request's objective over the cheapest chains;
    where no speed has to be kept, the shortest of those that are laid out for it and for less.

    Raises PathRefusedError with the reason of the cheapest one where none is certified.
    """
    if asked.path.speed_tolerance < 1.0:
        return _best_within_tolerance(asked, layers)
    best: DrivenPath | None = None
    reason: PathRefusedError | None = None
    for rate in _rates(asked.fastest):
        trial = replace(asked, rate=rate)
        if best is not None and (
            asked.context.work.exhausted or trial.least_duration >= _duration(best)
        ):
            break
        try:
            driven = _best_at(trial, layers)
        except PathRefusedError as error:
            if error.code != StatusCode.INVALID_MOTION_PLAN:
                raise
            reason = reason or error
            continue
        if best is None or _duration(driven) < _duration(best):
            best = driven
    if best is None:
        assert reason is not None  # of the first rate
        raise reason
    return best


def _best_within_tolerance(asked: ToolPathRequest, layers: Layers) -> DrivenPath:
    """The best movement at the speed asked for; where that isn't found, evenly as much slower as
    may be.
    """
    try:
        return _best_at(asked, layers)
    except PathRefusedError as error:
        if error.code != StatusCode.INVALID_MOTION_PLAN:
            raise
        lost = asked.path.speed_tolerance
        rest = replace(asked.path, speed_tolerance=max(_REST * lost, SPEED_TOLERANCE_MIN))
        slower = replace(asked, path=rest, rate=1.0 - (1.0 - 2.0 * _REST) * lost)
        try:
            return _best_at(slower, layers)
        except PathRefusedError:
            raise error from None


def _duration(one: DrivenPath) -> float:
    return one.movement.trajectory.duration


def _rates(fastest: float) -> list[float]:
    """Shares of the speeds that are asked for, the highest [m/s] of which is given, that make it
    the speeds of one list whatever is asked: so whoever asks for more never waits longer.
    """
    speeds = [step * 10.0**k for k in range(-6, 2) for step in _STEPS]
    above = min(speed for speed in speeds if speed >= fastest * (1.0 - 1e-12))
    return [speed / fastest for speed in sorted(speeds, reverse=True) if speed <= above]


_STEPS = (1.0, 1.25, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0)


def _best_at(asked: ToolPathRequest, layers: Layers) -> DrivenPath:
    """The best movement at one speed. Raises PathRefusedError."""
    reason: PathRefusedError | None = None
    journal = asked.context.journal
    for _ in range(_ROUNDS):
        asked.context.work.check()
        try:
            driven, layers = _driven_chains(asked, layers)
        except PathRefusedError as error:
            raise reason or error from error
        with journal.stage("proof") as notes:
            for candidate in sorted(driven, key=lambda candidate: candidate.movement.coarse_cost):
                candidate = farther_from_limits(asked, candidate)
                violation = candidate.movement.prove().violation
                if violation is None:
                    return candidate
                notes.append(violation.sentence)
                reason = reason or _uncertified(candidate)
                layers = _without(layers, candidate)
    assert reason is not None  # of the first round
    raise reason


def _driven_chains(asked: ToolPathRequest, layers: Layers) -> tuple[list[DrivenPath], Layers]:
    """The cheapest chains that keep the speed, and the layers with the samples that it took. Raises
    PathRefusedError.

    Where the axes turn between two samples other than those make believe, samples are closer.
    """
    journal = asked.context.journal
    for _ in range(_CLOSER):
        with journal.stage("search") as notes:
            chains, layers = chains_through(asked, layers, _TRIED)
            notes.append(f"{len(chains)} chains")
        with journal.stage("timing") as notes:
            driven, reasons = _first_driven(asked, chains)
            notes.append(f"{len(driven)} within the limits")
        if driven:
            return driven, layers
        strayed = [error.strayed for error in reasons if error.strayed is not None]
        closer = closer_at(asked, layers, strayed)
        if closer is layers:
            break
        layers = closer
    raise reasons[0]  # each chain that isn't driven gave one


def _first_driven(
    asked: ToolPathRequest, found: list[ConfigurationChain]
) -> tuple[list[DrivenPath], list[PathRefusedError]]:
    """The first chains that keep the speed, by longer ramps if none does with short ones, and why
    the others don't.
    """
    driven, reasons = _driven_with(asked, found, longer=False)
    if driven or asked.path.speed_tolerance >= 1.0:
        return driven, reasons
    return _driven_with(asked, found, longer=True)[0], reasons


def _driven_with(
    asked: ToolPathRequest, found: list[ConfigurationChain], *, longer: bool
) -> tuple[list[DrivenPath], list[PathRefusedError]]:
    driven: list[DrivenPath] = []
    reasons: list[PathRefusedError] = []
    for chain in found:
        if len(driven) == COMPARED or (driven and asked.context.work.exhausted):
            break
        if not _is_worth_driving(chain, driven, asked.context.options.objective):
            continue
        try:
            driven.append(timed(asked, chain, longer=longer))
        except PathRefusedError as error:
            if not longer:
                asked.context.journal.reject(str(error))
            reasons.append(error)
    return driven, reasons


def _is_worth_driving(chain: ConfigurationChain, driven: list[DrivenPath], objective: str) -> bool:
    """Whether a chain may be cheaper than those that are driven. One of the same joules is their
    mirror image with the wrist turned over; where joules decide, those that cost far more lose.
    """
    known = [path.chain.joules for path in driven]
    if any(abs(chain.joules - joules) <= _SAME * joules for joules in known):
        return False
    by_joules = objective in ("time_and_energy", "energy")
    return not (by_joules and known and chain.joules > min(known) * _COSTLIER + _COSTLIER_J)


def farther_from_limits(asked: ToolPathRequest, one: DrivenPath) -> DrivenPath:
    """The same with more distance from the limits where the interpolant between points exceeds
    one.
    """
    violation = one.movement.prove().violation
    if violation is None or violation.what not in _LIMITS:
        return one
    try:
        return timed(asked, one.chain, _FARTHER, longer=one.longer)
    except PathRefusedError:
        return one


def _uncertified(one: DrivenPath) -> PathRefusedError:
    violation = one.movement.prove().violation
    assert violation is not None  # that is why it is asked
    place = _place_at(one.sent, violation.time)
    return PathRefusedError(
        f"at {place:.3f} m: {violation.sentence}", StatusCode.INVALID_MOTION_PLAN
    )


def _place_at(path: SentPath, time: float) -> float:
    """Arc length [m] that is passed at a time [s]."""
    k = int(np.clip(np.searchsorted(path.begins, time, side="right") - 1, 0, len(path.begins) - 1))
    motion = path.strokes[k].at(path.instants[k])
    return float(np.interp(time - path.begins[k], motion.t, motion.s))


def _without(layers: Layers, one: DrivenPath) -> Layers:
    """The layers without the configurations near where a movement isn't certified."""
    violation = one.movement.prove().violation
    assert violation is not None  # that is why it is asked
    place = _place_at(one.sent, violation.time)
    q = one.movement.trajectory.sample([violation.time]).q[0]
    away = np.abs(difference(layers.q, q, layers.turning)).max(axis=1)
    near = (np.abs(layers.s[layers.layer] - place) <= _AROUND) & (away <= _NEAR)
    return replace(layers, free=layers.free & ~near)


def timed(
    asked: ToolPathRequest, chain: ConfigurationChain, share: float = 1.0, *, longer: bool = False
) -> DrivenPath:
    """A chain with its time, within a share of the limits; longer: ramps reach as far as it takes.
    Raises PathRefusedError.
    """
    path = asked.path
    whole = asked.whole
    scene = asked.context.scene
    angle, chain = angle_along(whole, chain, path.free_angle, asked.space, asked.fixed)
    curves = []
    for first, last in whole.strokes:
        span = (whole.ends[first], whole.ends[last])
        curves.append(curve_of(whole, chain, angle, span, scene))
    slower = _flange_share(asked, curves) if asked.t1 else 1.0
    along = [_spans(whole, first, last, slower * asked.rate) for first, last in whole.strokes]
    any_speed = path.speed_tolerance >= 1.0
    paths: list[DrivenPath] = []

    def stroke_of(
        curve: JointCurve, spans: tuple[StrokeSpan, ...], limits: MotionLimits
    ) -> TimedStroke:
        """One stroke from rest to rest, at the speeds of its spans where they are asked for."""
        if any_speed:
            return unhurried(curve, spans, limits, scene).stretched(max(asked.rate, 1.0))
        return timed_stroke(curve, spans, path.speed_tolerance, limits, scene, longer=longer)

    def within(limits: MotionLimits) -> Movement:
        """The movement within other limits; `paths` keeps what belongs to it."""
        limits = limits.scaled(share, share)
        strokes = tuple(
            stroke_of(curve, spans, limits) for curve, spans in zip(curves, along, strict=True)
        )
        _check_duration(sum(stroke.duration for stroke in strokes), asked)
        points = sent(strokes, limits, scene)
        if any_speed:
            points = _as_slow_as_sent(points, limits, scene)
        movement = Movement(chain.q, points.trajectory, asked.context, fixed_time=True)
        paths.append(DrivenPath(movement, points, angle, chain, slower, longer))
        return movement

    within_torque(within, asked.context)
    return paths[-1]


def _as_slow_as_sent(path: SentPath, limits: MotionLimits, scene: PlanningScene) -> SentPath:
    """The path with more time where what is sent exceeds a limit between its points."""
    for _ in range(_ROUNDS):
        largest = extremes(*path.trajectory.coefficients())
        use = lasting_longer(
            limits,
            largest.velocity,
            largest.acceleration,
            largest.jerk,
            np.zeros_like(largest.velocity),
        )
        if limits.tool.asked:
            use = np.maximum(use, ToolUse(path.trajectory, scene, limits.tool, largest).longer)
        if use.max() <= 1.0:
            break
        counts = np.cumsum([0, *(len(tau) - 1 for tau in path.instants)])
        strokes = tuple(
            _stroke_with_time(stroke, tau, use[first:last], limits, scene)
            if use[first:last].max() > 1.0
            else stroke
            for stroke, tau, first, last in zip(
                path.strokes, path.instants, counts[:-1], counts[1:], strict=True
            )
        )
        path = sent(strokes, limits, scene)
    return path


def _stroke_with_time(
    stroke: TimedStroke,
    points: FloatArray,
    use: FloatArray,
    limits: MotionLimits,
    scene: PlanningScene,
) -> TimedStroke:
    """The stroke with more time between points at instants (P,) s of its law where it uses more
    than the limits (P - 1,), or with more time all along, whichever is shorter.
    """
    there = slower_between(stroke, points, use, limits, scene)
    evenly = stroke.stretched(_EVENLY * float(use.max()))
    return min(there, evenly, key=lambda one: one.duration)


_EVENLY = 1.0 + 1e-6  # of what is exceeded


def _check_duration(duration: float, asked: ToolPathRequest) -> None:
    if duration > DURATION_MAX:
        raise PathRefusedError(
            f"tool_speed {asked.path.tool_speed:g} m/s makes a movement of {duration:.4g} s along "
            f"{asked.whole.length:.3f} m: it must be at most {DURATION_MAX:g} s",
            StatusCode.INVALID_GOAL_CONSTRAINTS,
        )


def _spans(whole: ToolPath, first: int, last: int, slower: float) -> tuple[StrokeSpan, ...]:
    """Parts of a stroke; those that follow each other at one speed are one, so that ramps may reach
    over them.
    """
    spans: list[StrokeSpan] = []
    for part, length in zip(whole.parts[first:last], np.diff(whole.ends)[first:last], strict=True):
        span = StrokeSpan(float(length), part.speed * slower, part.kept)
        if spans and (spans[-1].speed, spans[-1].kept) == (span.speed, span.kept):
            span = replace(span, length=spans.pop().length + span.length)
        spans.append(span)
    return tuple(spans)


def _flange_share(asked: ToolPathRequest, curves: list[JointCurve]) -> float:
    """What share of the speed keeps the centre of the flange at T1's speed too."""
    path = asked.path
    context = asked.context
    linear = max([path.tool_speed, *(segment.tool_speed for segment in path.segments)])
    fastest = 0.0
    for curve, (first_part, _) in zip(curves, asked.whole.strokes, strict=True):
        part = asked.whole.parts[first_part]
        top = part.speed if part.in_place else linear
        s = np.linspace(curve.begin, curve.end, _FLANGE_SAMPLES)
        q, first, _, _ = curve.at(s)
        here, ahead = (
            context.scene.chain.link_poses(at)[:, -1, :3, 3] for at in (q, q + _STEP * first)
        )
        rate = float(np.linalg.norm(ahead - here, axis=1).max()) / _STEP
        fastest = max(fastest, rate * top)
    return min(1.0, _SHRUNK * T1_SPEED / max(fastest, 1e-12))


# of a stroke; m of a difference quotient along the path
_FLANGE_SAMPLES = 400
_STEP = 1e-6
