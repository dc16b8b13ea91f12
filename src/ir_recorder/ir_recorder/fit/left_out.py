"""What a fit is worth on what it has not seen, beside the data sheet and a plain regression.

Each part is left out once: a recording where every joint that moves does so in others too, else a
quarter of each, for nobody can predict an axis that was never seen to move. The data sheet is given
what it can't know, from the other parts: the watts at rest of a controller without a table, and the
gains of currents.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_recorder.fit.channels import MOVED, WINDOW, FittedRun
from ir_recorder.fit.power_estimate import Estimate
from ir_recorder.measure import movements
from ir_values.arrays import BoolArray, FloatArray, IntArray

QUARTERS = 4  # parts of each recording
METHODS = ("fit", "data sheet", "regression")
_NINETY = 1.645  # standard deviations


@dataclass(frozen=True)
class LeftOut:
    """How a method predicts what it has not seen. part: what was left out; method: one of METHODS;
    rms [W]: of the power over 50 ms, without a meter of all motors at their shafts; errors: of the
    energy of each movement, or (without a meter) of the motors' work, shares; covered: how many of
    these lie in the 90 % interval, None for a method without one.
    """

    part: str
    method: str
    rms: float
    errors: tuple[float, ...]
    covered: int | None


def left_out(estimate: Estimate) -> tuple[LeftOut, ...]:
    """Every part by every method, after a fit (`Estimate.result`)."""
    parts = _parts_to_leave_out(estimate)
    if estimate.meter is not None:
        return _metered(estimate, parts)
    return _worked(estimate, parts)


def recommendation(
    rows: Sequence[LeftOut], *, doubted: bool = False, begun: str = "the data sheet"
) -> str:
    """Which of fit and data sheet to plan with, as a sentence with the medians; doubted: whether
    something speaks against the data; begun: the name of what the fit began with.
    """
    medians = {name: 100.0 * median_error(rows, name) for name in METHODS}
    fitted, sheet, regression = (medians[name] for name in METHODS)
    if not np.isfinite(fitted):
        return "no movement could be left out: how far this fit can be trusted is not known"
    said = (
        f"what was left out is predicted within {fitted:.1f} % (median) by the fit, {sheet:.1f} % "
        f"by {begun}, {regression:.1f} % by a plain regression"
    )
    if fitted > sheet:
        return f"{said}: plan with {begun}, this fit is worse on this robot"
    if doubted:
        return f"{said}: settle what speaks against the data before you plan with the fit"
    if regression < fitted:
        return (
            f"{said}: plan with the fit only if {fitted:.1f} % is near enough; the regression, "
            "which no plan can use, is nearer, so the model may lack something of this robot (a "
            "load, a coupling, other losses)"
        )
    return f"{said}: plan with the fit"


def median_error(rows: Sequence[LeftOut], method: str) -> float:
    """The median size of all errors of a method, a share; NaN without any."""
    errors = [abs(each) for row in rows if row.method == method for each in row.errors]
    return float(np.median(errors)) if errors else np.nan


@dataclass(frozen=True, eq=False)
class _Part:
    """A name, and which rows of the fit and windows of all recordings belong to it."""

    name: str
    windows: IntArray


def _parts_to_leave_out(estimate: Estimate) -> list[_Part]:
    """Each run where its joints move in other runs too; else quarters of all runs."""
    known = np.unique(estimate.window)
    own = [known[(known >= run.first) & (known < _end(run))] for run in estimate.runs]
    if _all_move_elsewhere(estimate.runs):
        return [_Part(run.name, windows) for run, windows in zip(estimate.runs, own, strict=True)]
    quarters = zip(*(np.array_split(windows, QUARTERS) for windows in own), strict=True)
    return [
        _Part(f"part {k} of {QUARTERS}", np.concatenate(shares))
        for k, shares in enumerate(quarters, 1)
    ]


def _all_move_elsewhere(runs: Sequence[FittedRun]) -> bool:
    """Whether every joint that moves in one recording moves in another as well."""
    positions = [run.samples.q[run.samples.known] for run in runs]
    spans = np.array([np.ptp(q, axis=0) if len(q) else np.zeros(q.shape[1]) for q in positions])
    return len(runs) > 1 and bool((np.count_nonzero(spans > MOVED, axis=0) != 1).all())


def _end(run: FittedRun) -> int:
    return run.first + len(run.samples) // WINDOW


def _without(estimate: Estimate, part: _Part) -> tuple[FloatArray, FloatArray]:
    """Parameters and covariance of a fit that has not seen a part."""
    weight = np.where(np.isin(estimate.window, part.windows), 0.0, estimate.weight)
    x, _ = estimate.solve(estimate.found, weight, estimate.deviation > 0.0)
    precision = estimate.precision(x, weight / np.sqrt(estimate.inflation))
    return x, np.asarray(np.linalg.pinv(precision, hermitian=True))


def _metered(estimate: Estimate, parts: Sequence[_Part]) -> tuple[LeftOut, ...]:
    """Watts of each part, predicted without it: by the fit, the data sheet, a regression."""
    assert estimate.meter is not None  # asked before
    found = []
    count = len(estimate.prior.names)
    features = [_features(estimate, run) for run in estimate.runs]
    sheet = estimate.meter.watts(estimate.prior.mean)
    open_rest = bool((estimate.prior.deviation != estimate.given.deviation).any())
    for part in parts:
        x, covariance = _without(estimate, part)
        own = estimate.meter.watts(x[:count])
        train = [_rows(run, part, inside=False) for run in estimate.runs]
        coefficients = _solved(
            np.concatenate([each[rows] for each, rows in zip(features, train, strict=True)]),
            np.concatenate(
                [run.samples.watts[rows] for run, rows in zip(estimate.runs, train, strict=True)]
            ),
            np.concatenate(features),
        )
        plain = [each @ coefficients for each in features]
        level = 0.0
        if open_rest:
            level = float(
                np.mean(
                    np.concatenate(
                        [
                            (run.samples.watts - watts)[rows]
                            for run, watts, rows in zip(estimate.runs, sheet, train, strict=True)
                        ]
                    )
                )
            )
        raised = [watts + level for watts in sheet]
        for method, predicted in zip(METHODS, (own, raised, plain), strict=True):
            rows = [_rows(run, part, inside=True) for run in estimate.runs]
            missing = np.concatenate(
                [
                    (run.samples.watts - watts)[inside]
                    for run, watts, inside in zip(estimate.runs, predicted, rows, strict=True)
                ]
            )
            errors, covered = _energies(
                estimate, part, predicted, covariance if method == METHODS[0] else None, x
            )
            windows = missing[: len(missing) // WINDOW * WINDOW].reshape(-1, WINDOW).mean(axis=1)
            rms = float(np.sqrt(np.mean(windows**2))) if len(windows) else np.nan
            found.append(LeftOut(part.name, method, rms, tuple(errors), covered))
    return tuple(found)


def _rows(run: FittedRun, part: _Part, *, inside: bool) -> IntArray:
    """Samples of a recording that have watts and belong to a part, or (not inside) do not."""
    window = run.first + np.arange(len(run.samples)) // WINDOW
    usable = run.samples.known & np.isfinite(run.samples.watts)
    return np.flatnonzero(usable & (np.isin(window, part.windows) == inside))


def _energies(
    estimate: Estimate,
    part: _Part,
    predicted: Sequence[FloatArray],
    covariance: FloatArray | None,
    x: FloatArray,
) -> tuple[list[float], int | None]:
    """Errors of the energies of the part's movements, and how many intervals hold them."""
    errors = []
    covered = 0
    _, slopes = estimate.rows(x)
    for run, watts in zip(estimate.runs, predicted, strict=True):
        samples = run.samples
        for first, behind in movements(samples):
            energy = float(samples.watts[first:behind].sum())
            middle = run.first + (first + behind) // 2 // WINDOW
            if middle not in part.windows or not energy > 0.0:
                continue
            off = float(watts[first:behind].sum()) - energy
            errors.append(off / energy)
            if covariance is not None:
                begin = run.first + first // WINDOW
                end = run.first + behind // WINDOW
                rows = (estimate.window >= begin) & (estimate.window < end)
                rows &= np.arange(len(rows)) < len(estimate.meter.measured)  # type: ignore[union-attr]
                slope = WINDOW * slopes[rows].sum(axis=0)
                deviation = np.sqrt(
                    slope @ covariance @ slope
                    + WINDOW**2 * (estimate.inflation / estimate.weight[rows] ** 2).sum()
                )
                covered += int(abs(off) <= _NINETY * deviation)
    return errors, covered if covariance is not None else None


def _features(estimate: Estimate, run: FittedRun) -> FloatArray:
    """What a regression of the watts takes (M, K): per axis torque of the bodies times speed, its
    square, size and square of the speed, acceleration times speed; and a level for each mode.
    """
    samples = run.samples
    known = samples.known[:, None]
    qd = run.prepared.speed
    qdd = np.where(known, samples.qdd, 0.0)
    arm = run.prepared.torques
    torque = arm.links + arm.loads + arm.rotors - arm.counterbalance
    modes = samples.mode[:, None] == np.arange(len(estimate.prior.modes))
    features = np.hstack([torque * qd, torque**2, np.abs(qd), qd**2, qdd * qd, modes])
    return samples.metered(features)


_SEEN = 0.01  # of a feature's size: with less of it nothing is learnt of it


def _solved(features: FloatArray, measured: FloatArray, whole: FloatArray) -> FloatArray:
    """Least squares of columns of one size; 0 for those of which the data show next to nothing
    beside the whole (N, K).
    """
    size = np.sqrt((whole**2).mean(axis=0))
    seen = np.sqrt((features**2).mean(axis=0)) > _SEEN * size
    found = np.zeros(features.shape[1])
    scaled = features[:, seen] / size[seen]
    found[seen] = np.linalg.lstsq(scaled, measured, rcond=1e-6)[0] / size[seen]
    return found


def _worked(estimate: Estimate, parts: Sequence[_Part]) -> tuple[LeftOut, ...]:
    """The same for work at the shafts, by the motors' measured torques."""
    motors = estimate.motors
    assert motors is not None  # asked before
    n = motors.n
    rows = len(motors.window) // n
    window = motors.window[:rows]
    speed = motors.speed
    measured = motors.measured.reshape(n, rows).T
    found = []
    travel = motors.travel
    for part in parts:
        inside = np.isin(window, part.windows)
        motors.turn(motors.found_travel(~inside))
        x, _ = _without(estimate, part)
        own = motors.predicted(x, 0.0)[0].reshape(n, rows).T
        motors.turn(travel)
        gains = motors.scales(estimate.prior.mean, ~inside)
        start = np.concatenate([estimate.prior.mean, np.zeros(n), gains])
        sheet = motors.predicted(start, 0.0)[0].reshape(n, rows).T
        plain = plain_torques(estimate, inside)
        work = shaft_work(measured[inside], speed[inside])
        for method, predicted in zip(METHODS, (own, sheet, plain), strict=True):
            error = shaft_work(predicted[inside], speed[inside]) / work - 1.0
            missing = (predicted - measured)[inside] / x[-n:]
            rms = shaft_power_rms(missing, speed[inside])
            found.append(LeftOut(part.name, method, rms, (error,), None))
    return tuple(found)


def plain_torques(estimate: Estimate, unseen: BoolArray) -> FloatArray:
    """Torques (W, n) by a regression per axis on the bodies' torque of the data sheet, speed, its
    side, acceleration and a constant, which has not seen some of the windows (W,).
    """
    motors = estimate.motors
    assert motors is not None  # asked before
    bodies = motors.bodies(estimate.prior.mean)
    sides = [np.tanh(run.prepared.speed / 1e-3) for run in estimate.runs]
    regressors = (motors.speed, motors.reduced(sides), motors.accelerations())
    rows = len(bodies)
    measured = motors.measured.reshape(motors.n, rows).T
    plain = np.empty_like(measured)
    for j in range(motors.n):
        columns = np.column_stack(
            [bodies[:, j], *(each[:, j] for each in regressors), np.ones(rows)]
        )
        plain[:, j] = columns @ _solved(columns[~unseen], measured[~unseen, j], columns)
    return plain


def shaft_power_rms(missing: FloatArray, speed: FloatArray) -> float:
    """W by which the power of all motors together is off (rms), by what their torques miss [Nm]
    and their speeds (W, n).
    """
    if not len(missing):
        return np.nan
    return float(np.sqrt(np.mean(np.square((missing * speed).sum(axis=1)))))


def shaft_work(torque: FloatArray, speed: FloatArray) -> float:
    """What the motors give, by torques and speeds (W, n): the sum of all that is positive, axis by
    axis.
    """
    return float(np.maximum(torque * speed, 0.0).sum())
