"""Power parameters from a power meter: regularised least squares with physical bounds, by Gauss and
Newton.

The prior pulls what the data say little about towards the data sheet. The forward model runs the DC
link, so its switch and its capacitor are in every step. Residuals of neighbouring instants hang
together; they count as the fewer independent ones that their autocorrelation leaves, standing and
moving apart from each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from ir_description import PowerParameters, physical_bounds
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_recorder.errors import FitError
from ir_recorder.fit.plausible import check_determined, check_explained
from ir_recorder.fit.residuals import (
    WINDOW,
    by_window,
    correlation_length,
    inverse,
    rests,
    safe,
    scaled,
)
from ir_recorder.fit.widening import Stretch, fold_of, widening
from ir_recorder.measure import PowerModel, Samples, movements

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
    """Fit the parameters of `model` to the watts of the samples. FitError where they hold too
    little.
    """
    return _Estimate(samples, model, prior).result(name)


class _Estimate:
    def __init__(self, samples: Samples, model: PowerModel, prior: PowerParameters) -> None:
        usable = samples.known & np.isfinite(samples.watts)
        self._windows = np.flatnonzero(by_window(usable.astype(float)) > 1.0 - 1e-9)
        if len(self._windows) < _SHORTEST:
            raise FitError(
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
            raise FitError("the covariance of the prior is singular")
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
