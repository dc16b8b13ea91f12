"""Power parameters from a power meter: regularised least squares with physical bounds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from ir_description import PowerParameters, physical_bounds
from ir_recorder.errors import RecorderError
from ir_recorder.fit.data import check_determined, check_explained
from ir_recorder.measure import PowerModel, Samples, movements
from ir_values.arrays import BoolArray, FloatArray

# What a fit needs of matrices and residuals: windows, correlation, inverses.

WINDOW = 5  # samples whose mean is one residual: 50 ms
_SHORTEST_REST = 0.3  # s


def rests(samples: Samples) -> list[tuple[int, int]]:
    """Rows (first, behind the last) of rests of at least 0.3 s: a posture's error is no noise
    either.
    """
    still = samples.known & ~samples.moving
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(int)))
    return [
        (a, b) for a, b in edges.reshape(-1, 2).tolist() if (b - a) * samples.step >= _SHORTEST_REST
    ]


def by_window(values: FloatArray) -> FloatArray:
    """Means (M // WINDOW, ...) of consecutive samples (M, ...)."""
    count = len(values) // WINDOW
    return np.asarray(
        values[: count * WINDOW].reshape(count, WINDOW, *values.shape[1:]).mean(axis=1)
    )


def safe(deviation: FloatArray) -> FloatArray:
    """Deviations (P,) to divide by: 1 for what is certain."""
    return np.where(deviation > 0.0, deviation, 1.0)


def scaled(prior: PowerParameters) -> FloatArray:
    """The correlation (P, P) of the prior; 1 on the diagonal for what is certain."""
    scale = safe(prior.deviation)
    matrix = prior.covariance / np.outer(scale, scale)
    matrix[np.diag_indices_from(matrix)] = 1.0
    return matrix


def inverse(precision: FloatArray, deviation: FloatArray) -> FloatArray:
    """The covariance (P, P), inverted where parameters have deviations of one size; 0 for what is
    certain.
    """
    scale = safe(deviation)
    inverse = np.linalg.inv(precision * np.outer(scale, scale)) * np.outer(scale, scale)
    certain = deviation <= 0.0
    inverse[certain] = 0.0
    inverse[:, certain] = 0.0
    return np.asarray(inverse)


def correlation_length(residual: FloatArray) -> float:
    """Residuals (W,) per independent one: 1 + 2 times the autocorrelations up to the first
    negative.
    """
    own = residual - residual.mean() if len(residual) else residual
    power = float(own @ own)
    if len(own) < 3 or power <= 0.0:
        return 1.0
    total = 1.0
    for lag in range(1, min(len(own) // 2, 400)):
        rho = float(own[:-lag] @ own[lag:]) / power
        if rho <= 0.0:
            break
        total += 2.0 * rho
    return total


# How much the noise must count so that a fit explains what it has not seen.
#
# What residuals of neighbouring windows share is no noise of the meter but what the model lacks;
# other movements will meet it too. So every movement and every rest is predicted without the part
# of the data that it belongs to, and the noise counts for more until the uncertainty of such
# predictions explains their errors.

FOLDS = 8  # of a recording, each left out once
_MOST = 1e4  # of the variance of the noise
_RATIO = 1.25  # from one factor to the next


@dataclass(frozen=True, eq=False)
class Stretch:
    """A movement or a rest: the fold it belongs to, the sum of what its samples miss, how that sum
    changes with the parameters (P,), and the variance that the meter alone gives it.
    """

    fold: int
    missing: float
    slope: FloatArray
    white: float


def fold_of(window: int, windows: int) -> int:
    """The part of a recording that window number `window` of so many belongs to: consecutive
    ones.
    """
    return min(window * FOLDS // max(windows, 1), FOLDS - 1)


def widening(
    slopes: FloatArray,
    residual: FloatArray,
    pull: FloatArray,
    deviation: FloatArray,
    stretches: Sequence[Stretch],
) -> float:
    """The least factor, 1 or more, on the variance of the noise; slopes (W, P) and residual (W,)
    are weighted by it, pull (P, P) is the prior's precision, deviation (P,) its deviations.
    """
    fold = np.array([fold_of(window, len(residual)) for window in range(len(residual))])
    parts = [
        (own.T @ own, own.T @ residual[fold == k])
        for k in range(FOLDS)
        for own in (slopes[fold == k],)
    ]
    whole = np.sum([information for information, _ in parts], axis=0)
    factor = 1.0
    while factor < _MOST:
        errors = []
        for k, (information, pulled) in enumerate(parts):
            without = inverse((whole - information) / factor + pull, deviation)
            shift = without @ pulled / factor
            errors += [
                (each.missing + each.slope @ shift) ** 2
                / (each.slope @ without @ each.slope + each.white)
                for each in stretches
                if each.fold == k
            ]
        if not errors or np.mean(errors) <= 1.0:
            break
        factor *= _RATIO
    return factor


# Power parameters from a power meter: regularised least squares with physical bounds, by Gauss
# and Newton.
#
# The prior pulls what the data say little about towards the data sheet. The forward model runs
# the DC link, so its switch and its capacitor are in every step. Residuals of neighbouring
# instants hang together; they count as the fewer independent ones that their autocorrelation
# leaves, standing and moving apart from each other.

DETERMINED = 0.8  # of the deviation before: what is left of it after the fit, at most
LEAST_WATTS = 0.5  # noise of a residual, at least: the resolution of meters
SOFTNESS = (
    10.0,
    2.0,
    0.3,
)  # J: of the DC link, where the descent begins; its kinks make local minima
_ROUNDS = 30
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)  # of a step: the DC link makes kinks
_DONE = 1e-4  # of a deviation: the largest change of a last step
_REWEIGHTED = 3  # times that the noise is estimated anew
_SHORTEST = 100  # residuals that a fit needs


@dataclass(frozen=True)
class FittedMovement:
    """A movement from `start` on for `seconds` [s]: energy [J] at the mains measured, and predicted
    by the parameters before and after the fit.
    """

    start: float
    seconds: float
    measured: float
    before: float
    after: float


@dataclass(frozen=True, eq=False)
class Fit:
    """What was found. parameters: with covariance; determined (P,): which of them the data
    determine; the others are as before. movements: residuals. time (W,) s, measured, before, after
    (W,) W: of windows. noise [W]: of a window at rest and in motion, with how many windows one
    independent residual takes.
    inflation: of the noise, so that the covariance explains the residuals of movements and rests.
    """

    parameters: PowerParameters
    determined: BoolArray
    movements: tuple[FittedMovement, ...]
    time: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    noise: tuple[float, float]
    correlated: tuple[float, float]
    inflation: float

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of what the data do not determine."""
        return tuple(
            name
            for name, own in zip(self.parameters.names, self.determined, strict=True)
            if not own
        )


def fit(samples: Samples, model: PowerModel, prior: PowerParameters, name: str = "fit") -> Fit:
    """Fit the parameters of `model` to the watts of the samples. RecorderError where they hold too
    little.
    """
    return _Estimate(samples, model, prior).result(name)


class _Estimate:
    def __init__(self, samples: Samples, model: PowerModel, prior: PowerParameters) -> None:
        usable = samples.known & np.isfinite(samples.watts)
        self._windows = np.flatnonzero(by_window(usable.astype(float)) > 1.0 - 1e-9)
        if len(self._windows) < _SHORTEST:
            raise RecorderError(
                f"{len(self._windows) * WINDOW * samples.step:.1f} s have watts, motion, mode "
                f"and load at once, at least {_SHORTEST * WINDOW * samples.step:.1f} s are needed"
            )
        self._samples = samples
        self._model = model
        self._prior = prior
        self._prepared = model.prepare(samples)
        self._watts = self._reduced(samples.watts)
        self._moving = self._reduced(samples.moving.astype(float)) > 0.0
        self._low, self._high = physical_bounds(prior.names)
        values, vectors = np.linalg.eigh(scaled(prior))
        if values.min() <= 1e-9:
            raise RecorderError("the covariance of the prior is singular")
        self._pull = (vectors / np.sqrt(values)).T / safe(
            prior.deviation
        )  # (P, P): whitens the parameters
        self._free = prior.deviation > 0.0

    def result(self, name: str) -> Fit:
        """Both noises and the parameters in turn, then with the noise that explains what was left
        out, and once more with what is not determined as before.
        """
        noise = (50.0, 50.0)
        correlated = (1.0, 1.0)
        mean = self._prior.mean.copy()
        for softness in SOFTNESS:
            mean, _ = self._solve(mean, self._weight(noise, correlated), self._free, softness)
        for _ in range(_REWEIGHTED):
            mean, _ = self._solve(mean, self._weight(noise, correlated), self._free)
            noise, correlated = self._noise(mean)
        weight = self._weight(noise, correlated)
        mean, _ = self._solve(mean, weight, self._free)
        inflation = self._widening(mean, weight)
        weight = weight / np.sqrt(inflation)
        mean, precision = self._solve(mean, weight, self._free)
        left = np.sqrt(np.diag(inverse(precision, self._prior.deviation))) / safe(
            self._prior.deviation
        )
        determined = np.asarray(self._free & (left < DETERMINED))
        check_explained(
            self._watts, self._reduced(self._model.watts(mean, self._prepared)), self._moving
        )
        check_determined(determined, self._moving, WINDOW * self._samples.step)
        mean, precision = self._solve(mean, weight, determined)
        covariance = inverse(precision, self._prior.deviation)
        sources = np.where(determined, "fit", self._prior.sources)
        found = replace(
            self._prior,
            name=name,
            mean=mean,
            covariance=0.5 * (covariance + covariance.T),
            sources=tuple(str(source) for source in sources),
        )
        before, after = (
            self._model.watts(each, self._prepared) for each in (self._prior.mean, mean)
        )
        return Fit(
            found,
            determined,
            self._movements(before, after),
            self._reduced(self._samples.time),
            self._watts,
            self._reduced(before),
            self._reduced(after),
            noise,
            correlated,
            inflation,
        )

    def _reduced(self, values: FloatArray) -> FloatArray:
        return np.asarray(by_window(values)[self._windows])

    def _weight(self, noise: tuple[float, float], correlated: tuple[float, float]) -> FloatArray:
        """One over the deviation (W,) [W] with which a window counts."""
        rest, moving = (n * np.sqrt(c) for n, c in zip(noise, correlated, strict=True))
        return np.asarray(1.0 / np.where(self._moving, moving, rest))

    def _solve(
        self, start: FloatArray, weight: FloatArray, free: BoolArray, softness: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """The parameters of least cost with those that are not free as in the prior; and the
        precision (P, P).
        """
        mean = np.where(free, start, self._prior.mean)
        cost, residual, slopes = self._at(mean, weight, softness)
        for _ in range(_ROUNDS):
            step = self._step(mean, residual, slopes, free)
            for share in _SHARES:
                trial = np.clip(mean + share * step, self._low, self._high)
                better = self._at(trial, weight, softness)
                if better[0] <= cost:
                    break
            else:
                break
            moved = np.abs((trial - mean) / safe(self._prior.deviation)).max()
            mean = trial
            (cost, residual, slopes) = better
            if moved < _DONE:
                break
        return mean, slopes.T @ slopes + self._pull.T @ self._pull

    def _at(
        self, mean: FloatArray, weight: FloatArray, softness: float
    ) -> tuple[float, FloatArray, FloatArray]:
        """Cost, weighted residuals (W,) and their slopes (W, P)."""
        watts, slopes = self._model.watts_and_slopes(mean, self._prepared, softness)
        residual = weight * (self._watts - self._reduced(watts))
        weighted = weight[:, None] * by_window(slopes)[self._windows]
        pulled = self._pull @ (mean - self._prior.mean)
        return float(residual @ residual + pulled @ pulled), residual, weighted

    def _step(
        self, mean: FloatArray, residual: FloatArray, slopes: FloatArray, free: BoolArray
    ) -> FloatArray:
        """The step of Gauss and Newton within the bounds; zero for what is not free."""
        scale = safe(self._prior.deviation)[free]
        reduced = np.asarray(
            np.linalg.qr(np.column_stack([slopes[:, free] * scale, residual]), mode="r")
        )
        matrix = np.concatenate([reduced[:, :-1], self._pull[:, free] * scale])
        target = np.concatenate([reduced[:, -1], self._pull @ (self._prior.mean - mean)])
        low, high = ((bound - mean)[free] / scale for bound in (self._low, self._high))
        solved = lsq_linear(matrix, target, (np.minimum(low, -1e-12), np.maximum(high, 1e-12)))
        step = np.zeros(len(mean))
        step[free] = solved.x * scale
        return step

    def _noise(self, mean: FloatArray) -> tuple[tuple[float, float], tuple[float, float]]:
        """Deviation of a residual [W], and residuals per independent one: at rest, and moving."""
        residual = self._watts - self._reduced(self._model.watts(mean, self._prepared))
        noise = []
        correlated = []
        for rows in (~self._moving, self._moving):
            own = residual[rows]
            noise.append(
                max(float(np.sqrt(np.mean(own**2))), LEAST_WATTS) if len(own) else LEAST_WATTS
            )
            correlated.append(correlation_length(own))
        return (noise[0], noise[1]), (correlated[0], correlated[1])

    def _movements(self, before: FloatArray, after: FloatArray) -> tuple[FittedMovement, ...]:
        step = self._samples.step
        watts = self._samples.watts
        return tuple(
            FittedMovement(
                float(self._samples.time[first]),
                (behind - first) * step,
                *(float(step * each[first:behind].sum()) for each in (watts, before, after)),
            )
            for first, behind in movements(self._samples)
            if np.isfinite(watts[first:behind]).all()
        )

    def _widening(self, mean: FloatArray, weight: FloatArray) -> float:
        """The factor on the noise that the residual energies of movements and rests take."""
        watts, slopes = self._model.watts_and_slopes(mean, self._prepared)
        missing = self._samples.watts - watts
        step = WINDOW
        residual = self._watts - self._reduced(watts)
        moved = residual[self._moving]
        white = 0.5 * float(np.mean(np.diff(moved) ** 2)) if len(moved) > 1 else 0.0
        stretches = [
            Stretch(
                fold_of(int(np.searchsorted(self._windows, (a + b) // 2 // step)), len(residual)),
                float(missing[a:b].sum()),
                slopes[a:b].sum(axis=0),
                white * step * (b - a),
            )
            for a, b in (*movements(self._samples), *rests(self._samples))
            if np.isfinite(missing[a:b]).all()
        ]
        weighted = weight[:, None] * by_window(slopes)[self._windows]
        pull = self._pull.T @ self._pull
        return widening(weighted, weight * residual, pull, self._prior.deviation, stretches)
