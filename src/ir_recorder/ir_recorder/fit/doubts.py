"""What speaks against a fit: power that it leaves open, a clock that runs late, columns that were
taken for each other, something that changed half-way. Such data fit badly, but fit; so it is said.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from heapq import nsmallest
from itertools import combinations

import numpy as np

from ir_description import PowerParameters
from ir_description.robot import AXIS_UNITS, CENTRES, parameter_unit
from ir_recorder.errors import RecorderError
from ir_recorder.fit.changes import change
from ir_recorder.fit.channels import MOVED, FittedRun, by_window
from ir_recorder.fit.fit_data import DataSource, FitData, fit_data
from ir_recorder.fit.power_estimate import Estimate, Fit
from ir_recorder.measure import Samples
from ir_values.arrays import FloatArray, IntArray

EXPLAINED = 0.8  # of the variance of power, or of an axis' torque, in motion: less is a doubt
_STILL = 1e-3  # rad: one that doesn't
_LATE = 0.03  # s: less is not told apart
_LONGEST = 1.0  # s that are looked for
_GAIN = 0.9  # of the rms: what a later clock has to reach
_FEWEST = 50  # samples in motion
_USABLE = 0.5  # of a part's samples
_CLOCKS = 2  # times that a meter's clock is moved
_ON_TIME = 1e-3  # s: less changes nothing
_MOVED_AT_MOST = 0.1  # s at once: beyond it the first order says nothing


def result(estimate: Estimate, name: str) -> Fit:
    """What the estimate finds; RecorderError where data are refused, with what speaks against
    them.
    """
    try:
        return estimate.result(name)
    except RecorderError as error:
        raise RecorderError(". ".join([str(error), *doubts(estimate).sentences])) from error


def fit_sources(
    sources: Sequence[DataSource], prior: PowerParameters, by: str, name: str
) -> tuple[FitData, Estimate, Fit]:
    """A fit of files. Where a meter's clock was found by the power that the prior predicts, which
    is some ms off as that power is, it is found with the parameters. Errors as in `fit_data` and
    `result`.
    """
    data = fit_data(sources, prior, by)
    notes = list(data.notes)
    offsets = np.array(data.offsets)
    open_ones = np.isfinite(offsets)
    for moves in range(_CLOCKS + 1):
        estimate = Estimate(data.recordings, data.names, data.model, prior, motors=data.motors)
        found = result(estimate, name)
        if moves == _CLOCKS or estimate.meter is None or not open_ones.any():
            break
        late = estimate.lateness()
        if (np.abs(late[open_ones]) < _ON_TIME).all():
            break
        offsets = offsets - late.clip(-_MOVED_AT_MOST, _MOVED_AT_MOST)
        moved = [
            source.on_clock(float(offset)) if own else source
            for source, offset, own in zip(sources, offsets, open_ones, strict=True)
        ]
        data = fit_data(moved, prior, by)
    notes += [
        f"{run}: {offset:+.3f} s on its meter's clock agrees best with the power of the fit"
        for run, offset, own in zip(data.names, offsets, open_ones, strict=True)
        if own
    ]
    return replace(data, notes=tuple(notes)), estimate, found


@dataclass(frozen=True)
class Doubts:
    """sentences: on recordings whose power or torques the fit explains badly or by what can't be;
    each ends with what to look at. undecided: on columns of joints and shares of the watts that
    the power does not tell apart.
    """

    sentences: tuple[str, ...]
    undecided: tuple[str, ...] = ()


def doubts(estimate: Estimate, found: Fit | None = None) -> Doubts:
    """What speaks against a fit, after `result`; found: that result, None where it was refused."""
    said = list(_of_still_joints(estimate))
    open_ones: tuple[str, ...] = ()
    if found is not None:
        said += _of_factors(estimate, found)
    if found is not None and estimate.meter is not None:
        said += _of_gains(estimate, found)
        against, open_ones = _phases(estimate)
        said += against
        columns = _columns(estimate)
        if columns is not None:
            said += _of_columns(columns)
            open_ones += _undecided(columns)
    if estimate.meter is not None:
        fitted = estimate.meter.watts(estimate.found[: len(estimate.prior.names)])
        sheet = estimate.meter.watts(estimate.prior.mean)
        for run, both in zip(estimate.runs, zip(fitted, sheet, strict=True), strict=True):
            said += _of_power(estimate, run, *both)
    if estimate.motors is not None:
        said += _of_torques(estimate)
    moved = change(estimate)
    if moved is not None:
        said.append(moved.sentence)
    return Doubts(tuple(said), open_ones)


def _of_power(
    estimate: Estimate, run: FittedRun, predicted: FloatArray, sheet: FloatArray
) -> Iterator[str]:
    measured = np.where(run.samples.known, run.samples.watts, np.nan)
    moving = run.samples.moving & np.isfinite(measured)
    share = _explained(measured[moving], predicted[moving])
    # a fit to a clock that is far off explains nothing any more: then the data sheet tells
    late = _lateness(measured, predicted if share >= EXPLAINED else sheet, run.samples.step)
    if late:
        side = "later" if late > 0.0 else "earlier"
        yield (
            f"{run.name}: the meter shows power {abs(late):.2f} s {side} than the joints explain "
            f"it: add {-late:.2f} s to the clock_offset of its mapping"
        )
    if share < EXPLAINED:
        yield (
            f"{run.name}: in motion the fit explains {100.0 * max(share, 0.0):.0f} % of what the "
            "power varies by: look at clocks, columns, signs, units and loads before you plan "
            "with it"
        )


def _explained(measured: FloatArray, predicted: FloatArray) -> float:
    """Share of the variance of some samples (K,) that is explained; 1 where there are too few."""
    if len(measured) < _FEWEST or not measured.var() > 0.0:
        return 1.0
    return float(1.0 - (measured - predicted).var() / measured.var())


def _lateness(measured: FloatArray, predicted: FloatArray, step: float) -> float:
    """Seconds by which the measured power (M,) comes later than the predicted; 0 where none are
    told apart.
    """
    most = min(round(_LONGEST / step), len(measured) // 4)
    errors = {}
    for lag in range(-most, most + 1):
        later = measured[max(lag, 0) : len(measured) + min(lag, 0)]
        sooner = predicted[max(-lag, 0) : len(predicted) + min(-lag, 0)]
        known = np.isfinite(later)
        if np.count_nonzero(known) < _FEWEST:
            return 0.0
        errors[lag] = float((later - sooner)[known].std())
    best = min(errors, key=lambda lag: (errors[lag], abs(lag)))
    if abs(best) * step < _LATE or errors[best] > _GAIN * errors[0]:
        return 0.0
    return best * step


def _of_still_joints(estimate: Estimate) -> Iterator[str]:
    """Columns that never change while others do."""
    positions = [run.samples.q[run.samples.known] for run in estimate.runs]
    spans = np.max([np.ptp(q, axis=0) for q in positions if len(q)], axis=0, initial=0.0)
    if not (spans > MOVED).any():
        return
    for joint, span in zip(estimate.prior.joints, spans, strict=True):
        if span < _STILL:
            yield (
                f"{joint} never moves, other joints do: if it did move, its column is wrong; if it "
                "did not, nothing is known of it"
            )


# What a fit has to believe to explain the data: masses, centres of mass and inverter factors far
# from what is known of them, or a meter that shows a part of what the robot takes. A joint whose
# zero is elsewhere, or whose sign is another, is explained by a centre of mass outside its link.
#
# A model that takes g times the watts, with g times the masses and friction, predicts the same
# movements: whether the meter shows a share of the watts is seen only by what is known of masses,
# inertias and losses. So the fit is held against the same with every g. Where a share that a clamp
# left out would make explains the watts as well, that is said.

_FAR = 4.0  # deviations, of what was known and of what the fit leaves, together
_KNOWN_FACTORS = (
    "link_mass",
    "load_mass",
    "rotor_inertia",
    "counterbalance",
    "rectifier_efficiency",
)
_GAINS = {1.0 / 3.0: "a third", 0.5: "half", 2.0 / 3.0: "two thirds", 2.0: "twice", 3.0: "3 times"}
_PHASES = (1.0 / 3.0, 2.0 / 3.0)  # of _GAINS: clamps left out
_UNLIKELY = 9.0  # squared deviations more: three deviations
_LIKELIER = 3.0  # by how much the sum of squared deviations has to fall
_WITH_WATTS = ("viscous", "coulomb", "iron", "link_mass", "load_mass", "rotor_inertia")
_AGAINST_WATTS = ("copper",)


def _of_factors(estimate: Estimate, found: Fit) -> Iterator[str]:
    """Factors and centres of mass that lie where they are not believed."""
    before = estimate.prior
    for k, name in enumerate(before.names):
        if name.partition(".")[0] not in (*_KNOWN_FACTORS, *CENTRES):
            continue
        spread = float(np.hypot(before.deviation[k], found.parameters.deviation[k]))
        off = float(found.parameters.mean[k] - before.mean[k])
        if found.determined[k] and abs(off) > _FAR * spread:
            unit = parameter_unit(name)
            yield (
                f"{name} would be {found.parameters.mean[k]:.2f} {unit}".rstrip()
                + f", {abs(off) / spread:.1f} deviations from {before.mean[k]:.2f}: look at the "
                "meter (all phases, its unit), the zeros and signs of the joints, the load, and "
                "the masses of the robot file"
            )


def _of_gains(estimate: Estimate, found: Fit) -> Iterator[str]:
    """A meter that shows a share of the watts."""
    as_found = _strain(estimate, found, 1.0)
    gain = min(_GAINS, key=lambda each: _strain(estimate, found, 1.0 / each))
    with_gain = _strain(estimate, found, 1.0 / gain)
    if with_gain < as_found - _LIKELIER:
        yield (
            f"masses and losses are as known if the meter shows {_GAINS[gain]} of the watts "
            f"(squared deviations {with_gain:.1f}, as read {as_found:.1f}): are all phases in, and "
            "is the unit right?"
        )


def _phases(estimate: Estimate) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """What speaks against all phases being in, and what can't be decided of them: all is fitted
    again as if the meter showed a share of the watts.
    """
    as_read = _cost_of(estimate, 1.0)
    costs = {share: _cost_of(estimate, share) for share in _PHASES}
    likeliest = min(_PHASES, key=lambda each: costs[each])
    if costs[likeliest] < as_read - _UNLIKELY:
        said = (
            f"if the meter showed only {_GAINS[likeliest]} of the watts, they would be explained "
            f"better (squared deviations {costs[likeliest]:.0f}, as read {as_read:.0f}): are all "
            "three phases in?"
        )
        return (said,), ()
    alike = [
        f"{_GAINS[share]} ({costs[share]:.0f})"
        for share in _PHASES
        if costs[share] < as_read + _UNLIKELY
    ]
    if not alike:
        return (), ()
    said = (
        f"if the meter showed only {' or '.join(alike)} of the watts, they would be explained as "
        f"well (squared deviations; as read {as_read:.0f}): these watts do not prove that all "
        "three phases are in. Count them, or record with a heavy part of known mass and without it"
    )
    return (), (said,)


def _cost_of(estimate: Estimate, share: float) -> float:
    """Squared deviations of meter and parameters if the meter shows a share of the watts."""
    assert estimate.meter is not None  # asked before
    recordings = [replace(each.samples, watts=each.samples.watts / share) for each in estimate.runs]
    names = [each.name for each in estimate.runs]
    own = Estimate(recordings, names, estimate.model, estimate.given)
    count = len(own.prior.names)
    start = estimate.found[:count].copy()
    for k, name in enumerate(own.prior.names):
        kind = name.partition(".")[0]
        if kind in (*_WITH_WATTS, "watts"):
            start[k] /= share
        elif kind in _AGAINST_WATTS:
            start[k] *= share
    weight = share * estimate.weight[: len(estimate.meter.measured)]
    return min(
        own.least_cost(each, weight, estimate.wide[:count])
        for each in (start, estimate.found[:count])
    )


def _strain(estimate: Estimate, found: Fit, factor: float) -> float:
    """Squared deviations from what is known of what the data determine, if the robot took `factor`
    times the watts that the meter shows.
    """
    before = estimate.prior
    total = 0.0
    for k, name in enumerate(before.names):
        kind = name.partition(".")[0]
        if kind not in (*_WITH_WATTS, *_AGAINST_WATTS) or not found.determined[k]:
            continue
        power = -1.0 if kind in _AGAINST_WATTS else 1.0
        scale = factor**power
        wide = estimate.wide[k]
        spread = float(np.hypot(wide, scale * found.parameters.deviation[k]))
        total += float((scale * found.parameters.mean[k] - before.mean[k]) / spread) ** 2
    return total


# Columns that stand for each other.
#
# With two columns exchanged, or one with its sign changed, the parameters that were found (those of
# the two joints exchanged as well) are held against the same power. The likeliest such readings,
# and the columns as given, are then fitted to a part of the recording, by the noise of the meter
# alone: columns of a wrist that are exchanged leave errors that a widened noise would swallow.
# Readings that explain the power about as well as the columns as given are no doubt, but said: the
# watts do not tell them apart. So are zeros of a joint elsewhere tried, in steps of an eighth of a
# turn: gravity tells these where the joint does not turn about a vertical axis, and where it does
# they change nothing.

_SECONDS = 40.0  # of a recording that other columns are tried on
_STRIDE = 5.0  # s between parts that are looked at
_LIKELIEST = 5  # readings that are fitted, of columns and signs
_LIKELIEST_ZEROS = 1  # of the zeros of each joint
_ZEROS = {
    0.25 * np.pi: "45",
    -0.25 * np.pi: "-45",
    0.5 * np.pi: "90",
    -0.5 * np.pi: "-90",
    np.pi: "180",
}
_ODDS = 12.0  # by how much twice the log-likelihood has to rise, with noise as wide as the fit's
_BETTER = 0.5  # or: of the squares that are left as given, whatever they count
_AS_WELL = 1.1  # of the squares that are left as given: with at most so many it is no worse


@dataclass(frozen=True)
class _Columns:
    """Of a recording: the squares that are left by its columns as given, how many a reading must
    leave to be better, and those that the likeliest readings leave, by what was changed in them:
    columns or signs, and zeros.
    """

    name: str
    as_given: float
    better: float
    changed: tuple[tuple[str, float], ...]
    zeros: tuple[tuple[str, float], ...]


def _undecided(columns: _Columns) -> tuple[str, ...]:
    """A sentence on columns of joints that the power does not tell apart."""
    alike = [
        what
        for what, left in columns.changed
        if columns.better <= left <= _AS_WELL * columns.as_given
    ]
    if not alike:
        return ()
    return (
        f"{columns.name}: with {', or with '.join(alike)}, the power would be explained as well: "
        "the watts do not prove these columns; move each of these joints alone and see that its "
        "own column follows, with the right sign",
    )


def _of_columns(columns: _Columns) -> Iterator[str]:
    """Two columns of joints that explain the power better the other way round, or one that does
    with its sign changed.
    """
    what, left = min((*columns.changed, *columns.zeros), key=lambda each: each[1])
    if left < columns.better:
        yield (
            f"{columns.name}: with {what} the power is explained better "
            f"({left / columns.as_given:.2f} of the squares are left): look at the mapping"
        )


def _columns(estimate: Estimate) -> _Columns | None:
    """What other readings of the columns leave; None where there is too little to try them on."""
    if estimate.meter is None:
        return None
    run = max(estimate.runs, key=lambda each: len(each.samples))
    part = _liveliest(run.samples)
    usable = part.known & np.isfinite(part.watts)
    if np.count_nonzero(usable & part.moving) < _FEWEST or usable.mean() < _USABLE:
        return None
    n = len(estimate.prior.joints)
    as_given = _Reading(estimate, part, np.arange(n), np.ones(n), np.zeros(n)).fitted()
    sure = as_given - _ODDS * estimate.widened_by()
    return _Columns(
        run.name,
        as_given,
        max(sure, _BETTER * as_given),
        _fitted(_other_columns(estimate, part), _LIKELIEST),
        tuple(
            each
            for joint in range(n)
            for each in _fitted(_other_zeros(estimate, part, joint), _LIKELIEST_ZEROS)
        ),
    )


def _other_columns(estimate: Estimate, part: Samples) -> Iterator[tuple[str, _Reading]]:
    """Readings with the sign of a joint changed, or with the columns of two swapped."""
    joints = estimate.prior.joints
    given = np.arange(len(joints))
    up = np.ones(len(joints))
    here = np.zeros(len(joints))
    for j, joint in enumerate(joints):
        sign = np.where(given == j, -1.0, up)
        yield f"the sign of {joint} changed", _Reading(estimate, part, given, sign, here)
    for a, b in combinations(range(len(joints)), 2):
        order = given.copy()
        order[[a, b]] = b, a
        what = f"the columns of {joints[a]} and {joints[b]} swapped"
        yield what, _Reading(estimate, part, order, up, here)


def _other_zeros(estimate: Estimate, part: Samples, joint: int) -> Iterator[tuple[str, _Reading]]:
    """Readings with the zero of a joint elsewhere."""
    joints = estimate.prior.joints
    given = np.arange(len(joints))
    up = np.ones(len(joints))
    for angle, degrees in _ZEROS.items():
        zero = np.where(given == joint, angle, 0.0)
        what = f"{degrees} degrees, or about so many, added to {joints[joint]}"
        yield what, _Reading(estimate, part, given, up, zero)


def _fitted(readings: Iterator[tuple[str, _Reading]], count: int) -> tuple[tuple[str, float], ...]:
    """The likeliest readings, with the squares that they leave when they are fitted."""
    likeliest = nsmallest(count, readings, key=lambda each: each[1].cost())
    return tuple((what, each.fitted()) for what, each in likeliest)


def _liveliest(samples: Samples) -> Samples:
    """The part of _SECONDS in which the joint that moves least moves most."""
    if len(samples) * samples.step <= _SECONDS:
        return samples
    travel = np.abs(np.nan_to_num(samples.qd)).cumsum(axis=0)
    width = round(_SECONDS / samples.step)
    begins = np.arange(0, len(samples) - width, round(_STRIDE / samples.step))
    own = travel[begins + width] - travel[begins]
    least = (own / np.maximum(own.max(axis=0), 1e-12)).min(axis=1)
    first = int(begins[least.argmax()])
    return samples.part(samples.time[first], samples.time[first] + _SECONDS)


class _Reading:
    """The power of a part with its columns in another order, with other signs and with zeros
    elsewhere [rad], all (n,).
    """

    def __init__(
        self,
        estimate: Estimate,
        part: Samples,
        order: IntArray,
        sign: FloatArray,
        zero: FloatArray,
    ) -> None:
        motion = (each[:, order] * sign for each in (part.q, part.qd, part.qdd))
        q, qd, qdd = motion
        turned = replace(part, q=q + zero, qd=qd, qdd=qdd, effort=None)
        self._own = Estimate([turned], [""], estimate.model, estimate.given)
        assert self._own.meter is not None  # asked before
        found = estimate.found[: len(self._own.prior.names)].copy()
        standing = [k for k, name in enumerate(self._own.prior.names) if name.startswith("watts.")]
        known = estimate.prior.mean.copy()
        known[standing] = found[standing]
        for term in AXIS_UNITS:
            places = self._own.prior.places(term)
            found[places] = found[places][order]
        self._starts = (found, known)
        self._weight = estimate.meter_weights()[self._own.meter.group]
        self._wide = estimate.wide[: len(found)]

    def cost(self) -> float:
        """Twice the negative log-likelihood of the power, by the parameters that were found or by
        those that were known.
        """
        meter = self._own.meter
        assert meter is not None  # asked before
        return min(
            float(np.square(self._weight * meter.missing(start)).sum()) for start in self._starts
        )

    def fitted(self) -> float:
        """Cost of the best parameters, with what is known of them."""
        return min(self._own.least_cost(start, self._weight, self._wide) for start in self._starts)


def _of_torques(estimate: Estimate) -> Iterator[str]:
    motors = estimate.motors
    assert motors is not None  # asked before
    rows = len(motors.window) // motors.n
    predicted = motors.predicted(estimate.found, 0.0)[0].reshape(motors.n, rows)
    measured = motors.measured.reshape(motors.n, rows)
    moving = np.concatenate([by_window(run.samples.moving.astype(float)) for run in estimate.runs])
    inside = moving[motors.window[:rows]] > 0.0
    moves = motors.group.reshape(motors.n, rows) < motors.n
    for j, joint in enumerate(estimate.prior.joints):
        # where an axis stands, friction takes what it is asked for: nobody can explain that
        missing = (measured[j] - predicted[j])[inside & moves[j]]
        share = 1.0
        if len(missing) >= _FEWEST and measured[j][inside].var() > 0.0:
            share = float(1.0 - np.square(missing).mean() / measured[j][inside].var())
        if share < EXPLAINED:
            what = "current" if motors.currents else "torque"
            yield (
                f"{joint}: in motion the fit explains {100.0 * max(share, 0.0):.0f} % of what the "
                f"{what} of its motor varies by: look at its sign, unit and column"
            )
