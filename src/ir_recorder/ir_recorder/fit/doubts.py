"""What speaks against a fit: power that it leaves open, a clock that runs late, columns that were
taken for each other. Such data fit badly, but fit; so it is said.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np

from ir_recorder.errors import RecorderError
from ir_recorder.fit.channels import Run, by_window
from ir_recorder.fit.estimate import Estimate, Fit
from ir_recorder.measure import PowerModel
from ir_values.arrays import FloatArray, IntArray

EXPLAINED = 0.8  # of the variance of power, or of an axis' torque, in motion: less is a doubt
_SURE = 0.95  # with more, columns are where they belong
_BETTER = 0.1  # of the variance: by so much another order of columns has to explain more
_LATE = 0.03  # s: less is not told apart
_LONGEST = 1.0  # s that are looked for
_GAIN = 0.9  # of the rms: what a later clock has to reach
_SECONDS = 60.0  # of a recording that other columns are tried on
_FEWEST = 50  # samples in motion


def result(estimate: Estimate, name: str) -> Fit:
    """What the estimate finds; RecorderError where data are refused, with what speaks against
    them.
    """
    try:
        return estimate.result(name)
    except RecorderError as error:
        raise RecorderError(". ".join([str(error), *doubts(estimate)])) from error


def doubts(estimate: Estimate) -> tuple[str, ...]:
    """Sentences on recordings whose power or torques the fit explains badly, after `result`; each
    ends with what to look at.
    """
    said: list[str] = []
    if estimate.meter is not None:
        fitted = estimate.meter.watts(estimate.found[: len(estimate.prior.names)])
        sheet = estimate.meter.watts(estimate.prior.mean)
        for run, both in zip(estimate.runs, zip(fitted, sheet, strict=True), strict=True):
            said += _of_power(estimate, run, *both)
    if estimate.motors is not None:
        said += _of_torques(estimate)
    return tuple(said)


def _of_power(
    estimate: Estimate, run: Run, predicted: FloatArray, sheet: FloatArray
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
    if share < _SURE:
        yield from _of_columns(estimate.model, estimate.prior.mean, run)


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


def _of_columns(model: PowerModel, mean: FloatArray, run: Run) -> Iterator[str]:
    """Two columns of joints that explain the power better the other way round, or one that does
    with its sign changed, by the data sheet.
    """
    samples = run.samples
    first = int(np.argmax(samples.moving & np.isfinite(samples.watts)))
    begin = samples.time[first] if len(samples) else 0.0
    part = samples.part(begin, begin + _SECONDS)
    moving = part.moving & part.known & np.isfinite(part.watts)
    if np.count_nonzero(moving) < _FEWEST:
        return
    joints = model.layout.joints

    def share(order: IntArray, sign: FloatArray) -> float:
        turned = replace(
            part,
            q=part.q[:, order] * sign,
            qd=part.qd[:, order] * sign,
            qdd=part.qdd[:, order] * sign,
        )
        predicted = part.metered(model.watts(mean, model.prepare(turned)))
        both = np.corrcoef(predicted[moving], part.watts[moving])
        return float(np.nan_to_num(both[0, 1]))

    n = len(joints)
    given = np.arange(n)
    as_given = share(given, np.ones(n))
    found: list[tuple[float, str]] = []
    for a, b in combinations(range(n), 2):
        order = given.copy()
        order[[a, b]] = b, a
        what = f"the columns of {joints[a]} and {joints[b]} swapped"
        found.append((share(order, np.ones(n)), what))
    for j in range(n):
        sign = np.where(given == j, -1.0, 1.0)
        found.append((share(given, sign), f"the sign of {joints[j]} changed"))
    best, what = max(found)
    if best > as_given + _BETTER:
        yield (
            f"{run.name}: with {what} the data sheet's power agrees with the meter by {best:.2f}, "
            f"as given by {as_given:.2f}: look at the mapping"
        )


def _of_torques(estimate: Estimate) -> Iterator[str]:
    motors = estimate.motors
    assert motors is not None  # asked before
    rows = len(motors.window) // motors.n
    predicted = motors.predicted(estimate.found, 0.0)[0].reshape(motors.n, rows)
    measured = motors.measured.reshape(motors.n, rows)
    moving = np.concatenate([by_window(run.samples.moving.astype(float)) for run in estimate.runs])
    inside = moving[motors.window[:rows]] > 0.0
    for joint, own, theirs in zip(estimate.prior.joints, measured, predicted, strict=True):
        share = _explained(own[inside], theirs[inside])
        if share < EXPLAINED:
            what = "current" if motors.currents else "torque"
            yield (
                f"{joint}: in motion the fit explains {100.0 * max(share, 0.0):.0f} % of what the "
                f"{what} of its motor varies by: look at its sign, unit and column"
            )
