"""Power parameters from a power meter, from the motors' torques or currents, or from both:
regularised least squares with physical bounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from ir_description import PowerParameters
from ir_description.robot import physical_bounds
from ir_recorder.errors import RecorderError
from ir_recorder.fit.channels import (
    FRICTION,
    WINDOW,
    Channel,
    FittedRun,
    MeterChannel,
    Motors,
    by_window,
    open_prior,
    runs_of,
)
from ir_recorder.fit.fit_data import check_determined, check_explained
from ir_recorder.measure import PowerModel, Samples, movements
from ir_values.arrays import BoolArray, FloatArray, IntArray

# What a fit needs of matrices and residuals: windows, correlation, inverses.

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
class EnergyStretch:
    """A movement or a rest: the fold it belongs to, the sum of what its samples miss, how that sum
    changes with the parameters (P,), and the variance that the meter alone gives it.
    """

    moving: bool
    fold: int
    missing: float
    slope: FloatArray
    white: float


def widening(
    slopes: FloatArray,
    residual: FloatArray,
    fold: IntArray,
    pull: FloatArray,
    deviation: FloatArray,
    stretches: Sequence[EnergyStretch],
    *,
    stay: bool = False,
) -> float:
    """The least factor, 1 or more, on the variance of the noise that explains the stretches, else
    the likeliest. Movements and rests are explained each: many rests, which are easy, say nothing
    of how well movements are known. slopes (R, P) and residual (R,) are weighted by it, fold (R,)
    says what is left out together, pull (P, P) is the prior's precision, deviation (P,) its
    deviations. stay: the parameters are those of the weights that are given, only what is said of
    their uncertainty takes the factor.
    """
    parts = [
        (own.T @ own, own.T @ residual[fold == k])
        for k in range(FOLDS)
        for own in (slopes[fold == k],)
    ]
    whole = np.sum([information for information, _ in parts], axis=0)
    factor = 1.0
    best = 1.0
    least = np.inf
    while factor < _MOST:
        errors = []
        variances = []
        moving = []
        for k, (information, pulled) in enumerate(parts):
            without = inverse((whole - information) / factor + pull, deviation)
            shift = without @ pulled / factor
            if stay:
                shift = inverse(whole - information + pull, deviation) @ pulled
            own = [each for each in stretches if each.fold == k]
            errors += [(each.missing + each.slope @ shift) ** 2 for each in own]
            moving += [each.moving for each in own]
            variances += [each.slope @ without @ each.slope + each.white for each in own]
        ratios = np.divide(errors, variances)
        kinds = (ratios[np.array(moving, bool) == kind] for kind in (True, False))
        if all(own.mean() <= 1.0 for own in kinds if len(own)):
            return factor
        unlikely = float((ratios + np.log(variances)).mean())
        if unlikely < least:
            best = factor
            least = unlikely
        factor *= _RATIO
    return best  # no noise explains them: the factor under which they are likeliest


# Parameters by Gauss and Newton.
#
# The prior pulls what the data say little about towards the data sheet. The forward model runs
# the DC link, so its switch and its capacitor are in every step. Residuals of neighbouring
# instants hang together; they count as the fewer independent ones that their autocorrelation
# leaves, standing and moving apart from each other.
#
# How far friction may be from the data sheet is not known beforehand: of several widths of its
# prior that one is taken by which what is left out is predicted best.

DETERMINED = 0.8  # of the deviation before: what is left of it after the fit, at most
# J: of the DC link, where the descent begins; its kinks make local minima
SOFTNESS = (
    10.0,
    2.0,
    0.3,
)
FRICTION_SCALES = (1.0, 3.0, 10.0, 30.0)  # times the deviation of friction before any measurement
_WIDER = 0.98  # of the error of what is left out: with more, a wider prior is not taken
_ROUNDS = 30
_BOUNDS_TRIED = 10  # per parameter, in a step
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.03, 0.01)  # of a step: the DC link makes kinks
_DONE = 1e-4  # of a deviation: the largest change of a last step
_SCALED = 3  # times that the scale of friction is chosen, each with the noise of the one before
_REWEIGHTED = 3  # times that the noise is estimated anew
_SHORTEST = 100  # windows that a fit needs
_FIRST_WATTS = 50.0
_FIRST_SHARE = 0.1  # of the largest effort of an axis


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
    (W,) W: of windows with watts. noise [W]: of a window at rest and in motion (NaN without a
    meter), torque_noise (n,) of each axis in motion, in what the controller says (none
    without).
    inflation: of the noise, so that the covariance explains the residuals of movements and rests.
    friction_scale: times the deviation of friction before. offsets (n,) Nm, scales (n,) with their
    deviations and travel (n,) rad of the motors, where these were fitted; scales: amperes per Nm of
    what the controller says, 1 where it says Nm; travel: over which dry friction turns.
    """

    parameters: PowerParameters
    determined: BoolArray
    movements: tuple[FittedMovement, ...]
    time: FloatArray
    measured: FloatArray
    before: FloatArray
    after: FloatArray
    noise: tuple[float, float]
    torque_noise: tuple[float, ...]
    inflation: float
    friction_scale: float
    offsets: tuple[float, ...]
    scales: tuple[float, ...]
    scale_deviations: tuple[float, ...]
    travel: tuple[float, ...]
    currents: bool

    @property
    def kept(self) -> tuple[str, ...]:
        """Names of what the data do not determine."""
        return tuple(
            name
            for name, own in zip(self.parameters.names, self.determined, strict=True)
            if not own
        )


def fit(
    recordings: Samples | Sequence[Samples],
    model: PowerModel,
    prior: PowerParameters,
    name: str = "fit",
    *,
    motors: bool = False,
) -> Fit:
    """The parameters that explain the recordings best, pulled towards the prior. motors: by the
    motors' torques or currents too; alone where no recording has watts. RecorderError where there
    is too little, or what no parameters explain.
    """
    given = [recordings] if isinstance(recordings, Samples) else list(recordings)
    return Estimate(given, [""] * len(given), model, prior, motors=motors).result(name)


class Estimate:
    """A fit at work: its recordings and channels, and the parameters of any part of them.

    measured, window, group (R,): what each row shows, the number of its window, whose noise it
    shares. before, low, high (P + E,): parameters before the fit, and their physical bounds.
    """

    def __init__(
        self,
        recordings: Sequence[Samples],
        names: Sequence[str],
        model: PowerModel,
        prior: PowerParameters,
        *,
        motors: bool = False,
    ) -> None:
        self.model = model
        self.runs = runs_of(recordings, names, model)
        self.motors = Motors(self.runs, model) if motors else None
        extra = 0 if self.motors is None else 2 * self.motors.n
        meter = MeterChannel(self.runs, model, extra)
        self.meter = meter if len(meter.window) else None
        channels = (self.meter, self.motors)
        self._channels: list[Channel] = [each for each in channels if each is not None]
        self._check_length(recordings)
        self.prior = prior if self.meter is None else open_prior(prior, self.meter.level)
        self.given = prior
        own = (np.zeros(0), np.zeros(0))
        if self.motors is not None:
            own = self.motors.own_prior(self.prior.mean)
        self.before = np.concatenate([self.prior.mean, own[0]])
        self.found = self.before  # as far as the fit is
        self.deviation = np.concatenate([self.prior.deviation, own[1]])
        low, high = physical_bounds(prior.names)
        self.low = np.concatenate([low, np.full(extra, -np.inf)])
        self.high = np.concatenate([high, np.full(extra, np.inf)])
        self.measured = np.concatenate([each.measured for each in self._channels])
        self.window = np.concatenate([each.window for each in self._channels])
        firsts = np.cumsum([0, *(len(each.least) for each in self._channels)])
        groups = zip(self._channels, firsts[:-1], strict=True)
        self.group = np.concatenate([each.group + first for each, first in groups])
        self._least = np.concatenate([each.least for each in self._channels])
        self._friction_scale = 1.0
        self._set_pull()

    def _check_length(self, recordings: Sequence[Samples]) -> None:
        windows = max((len(np.unique(each.window)) for each in self._channels), default=0)
        if windows < _SHORTEST:
            step = recordings[0].step
            what = "torques" if self.meter is None and self.motors is not None else "watts"
            raise RecorderError(
                f"{windows * WINDOW * step:.1f} s have {what}, motion, mode "
                f"and load at once, at least {_SHORTEST * WINDOW * step:.1f} s are needed"
            )

    def _set_pull(self) -> None:
        """What whitens the parameters, (P + E, P + E), with friction as wide as its scale says."""
        count = len(self.prior.names)
        wide = np.ones(len(self.before))
        for term in FRICTION:
            wide[self.prior.places(term)] = self._friction_scale
        values, vectors = np.linalg.eigh(scaled(self.prior))
        if values.min() <= 1e-9:
            raise RecorderError("the covariance of the prior is singular")
        root = np.eye(len(self.before))
        root[:count, :count] = (vectors / np.sqrt(values)).T
        self.wide = self.deviation * wide
        self._pull = root / safe(self.wide)
        self._free = self.wide > 0.0

    def result(self, name: str) -> Fit:
        """Both noises and the parameters in turn, then with the noise that explains what was left
        out; what is said of their uncertainty explains what these parameters leave.
        """
        weight = 1.0 / self._first_noise()[self.group]
        x = self.before.copy()
        for softness in SOFTNESS if self.meter is not None else ():
            x, _ = self.solve(x, weight, self._free, softness)
        x, weight, noise = self._reweighted(x, weight)
        for _ in range(_SCALED if self.meter is not None else 1):
            before = self._friction_scale
            self._friction_scale = self._chosen_scale(x, weight)
            self._set_pull()
            if self._friction_scale == before:
                break
            x, weight, noise = self._reweighted(x, weight)
        x, precision = self.solve(x, weight, self._free)
        fitted_with = 1.0
        inflation = 1.0
        if self.meter is not None:
            fitted_with = self._widening(x, weight)
            weight = weight / np.sqrt(fitted_with)
            x, _ = self.solve(x, weight, self._free)
            inflation = self._widening(x, weight, stay=True)
            precision = self.precision(x, weight / np.sqrt(inflation))
        left = np.sqrt(np.diag(inverse(precision, self.wide))) / safe(self.wide)
        determined = np.asarray(self._free & (left < DETERMINED))
        count = len(self.prior.names)
        self.found = x
        self.weight = weight
        self.inflation = inflation
        if self.meter is not None:
            moving = self.meter.group > 0
            check_explained(self.meter.measured, self.meter.predicted(x, 0.0)[0], moving)
        seconds = WINDOW * self.runs[0].samples.step
        check_determined(determined[:count], self._moving(), seconds)
        self.covariance = inverse(precision, self.wide)
        if self.meter is None:
            inflation = self._torque_widening(x, weight)
            least = np.minimum(inflation * np.diag(self.covariance), self.wide**2)
            factor = np.sqrt(least / safe(np.diag(self.covariance)))
            self.covariance = self.covariance * np.outer(factor, factor)
            if self.motors is not None:
                self.covariance += self._doubted_scales(self.motors, x)
        return self._fit(name, determined[:count], noise, fitted_with * inflation)

    def _doubted_scales(self, motors: Motors, x: FloatArray) -> FloatArray:
        """Covariance (P + E, P + E) of gains by what is not known of single links and rotors, and
        of friction with them: in amperes it is known better than in Nm.
        """
        prior = self.prior
        known = [prior.deviation[prior.index(name)] for name in ("link_mass", "rotor_inertia")]
        shares = motors.doubts_of_scales(x[: len(prior.names)], *known)
        found = np.zeros((len(x), len(x)))
        for j, share in enumerate(shares):
            along = np.zeros(len(x))
            scale = len(x) - motors.n + j
            along[scale] = x[scale]
            for term in FRICTION:
                along[prior.places(term).start + j] = -x[prior.places(term).start + j]
            found += share * np.outer(along, along)
        return found

    def _fit(self, name: str, determined: BoolArray, noise: FloatArray, inflation: float) -> Fit:
        """The fit as it is handed out: parameters that the data don't tell are as certain as
        before. noise: of the meter in motion and at rest [W], then of the motors [Nm].
        """
        count = len(self.prior.names)
        mean = self.found[:count]
        covariance = self.covariance[:count, :count]
        known = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        kept = np.minimum(self.prior.deviation / safe(known), 1.0)  # what is kept is as certain
        factor = np.where(determined, 1.0, kept)
        covariance = covariance * np.outer(factor, factor)
        sources = np.where(determined, "fit", self.prior.sources)
        found = replace(
            self.given,
            name=name,
            mean=mean,
            covariance=0.5 * (covariance + covariance.T),
            sources=tuple(str(source) for source in sources),
        )
        time = measured = before = after = np.zeros(0)
        moves: tuple[FittedMovement, ...] = ()
        meter_noise = (np.nan, np.nan)
        own_noise = noise
        if self.meter is not None:
            extra = self.found[count:]
            time = self.meter.time()
            measured = self.meter.measured
            before = self.meter.predicted(np.concatenate([self.prior.mean, extra]), 0.0)[0]
            after = self.meter.predicted(np.concatenate([mean, extra]), 0.0)[0]
            moves = self._movements(self.prior.mean, mean)
            meter_noise = (float(noise[0]), float(noise[1]))
            own_noise = noise[2:]
        n = len(self.prior.joints)
        offsets = self.found[count : count + n]
        scales = self.found[count + n :]
        scale_deviations = np.sqrt(np.diag(self.covariance)[count + n :])
        has_motors = self.motors is not None
        return Fit(
            parameters=found,
            determined=determined,
            movements=moves,
            time=time,
            measured=measured,
            before=before,
            after=after,
            noise=meter_noise,
            torque_noise=tuple(own_noise[:n].tolist()) if has_motors else (),
            inflation=inflation,
            friction_scale=self._friction_scale,
            offsets=tuple(offsets.tolist()),
            scales=tuple(scales.tolist()),
            scale_deviations=tuple(scale_deviations.tolist()),
            travel=() if self.motors is None else tuple(self.motors.travel.tolist()),
            currents=self.motors is not None and self.motors.currents,
        )

    def _first_noise(self) -> FloatArray:
        first = [
            np.full(2, _FIRST_WATTS) if each is self.meter else _FIRST_SHARE * each.least * 1e3
            for each in self._channels
        ]
        return np.concatenate(first)

    def _reweighted(
        self, x: FloatArray, weight: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Parameters and noise in turn: both, and the weights that the noise gives."""
        noise = self._least
        for _ in range(_REWEIGHTED):
            x, _ = self.solve(x, weight, self._free)
            noise, correlated = self._noise(x)
            if self.meter is None:  # all axes alike: what an axis lacks is bias, not noise
                correlated = np.ones(len(noise))
            weight = 1.0 / (noise * np.sqrt(correlated))[self.group]
        return x, weight, noise

    def solve(
        self, start: FloatArray, weight: FloatArray, free: BoolArray, softness: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """The parameters of least cost with those that are not free as in the prior; and the
        precision. weight (R,): of the rows, 0 for those that are left out.
        """
        x = np.where(free, start, self.before)
        cost, residual, slopes = self._at(x, weight, softness)
        for _ in range(_ROUNDS):
            step = self._step(x, residual, slopes, free)
            for share in _SHARES:
                trial = np.clip(x + share * step, self.low, self.high)
                better = self._at(trial, weight, softness)
                if better[0] <= cost:
                    break
            else:
                break
            moved = np.abs((trial - x) / safe(self.wide)).max()
            x = trial
            (cost, residual, slopes) = better
            if moved < _DONE:
                break
        return x, slopes.T @ slopes + self._pull.T @ self._pull

    def lateness(self) -> FloatArray:
        """Seconds (recordings,) by which each meter shows power later than the joints explain it,
        beside what the parameters can take of that; to first order, after `result`.
        """
        assert self.meter is not None  # asked before
        missing, slopes = self.rows(self.found)
        powers = self.meter.watts(self.found[: len(self.prior.names)])
        late = np.zeros((len(missing), len(self.runs)))
        for k, run in enumerate(self.runs):
            each = [np.zeros(len(other.samples)) for other in self.runs]
            each[k] = -np.gradient(powers[k], run.samples.step)
            late[: len(self.meter.measured), k] = self.meter.reduced(each)
        scale = safe(self.wide)
        weighted = self.weight[:, None] * np.hstack([slopes * scale, late])
        pull = np.hstack([self._pull * scale, np.zeros((len(scale), len(self.runs)))])
        target = [self.weight * missing, self._pull @ (self.before - self.found)]
        solved = np.linalg.lstsq(
            np.concatenate([weighted, pull]), np.concatenate(target), rcond=None
        )
        return np.asarray(solved[0][len(scale) :])

    def meter_weights(self) -> FloatArray:
        """What a residual of the meter at rest and one in motion (2,) weigh by what they don't
        share with their neighbours, which is noise and not what the model lacks.
        """
        assert self.meter is not None  # asked before
        missing = self.meter.missing(self.found[: len(self.prior.names)])
        return np.asarray(1.0 / np.sqrt(self._white(self.meter, missing)))

    def widened_by(self) -> float:
        """How much more than by `meter_weights` a squared residual in motion counts as noise, with
        what it shares with its neighbours and what the model lacks; after `result`.
        """
        assert self.meter is not None  # asked before
        moving = np.flatnonzero(self.meter.group == 1)
        if not len(moving):
            return 1.0
        own = self.weight[moving[0]] ** 2 / self.inflation
        return max(float(self.meter_weights()[1] ** 2 / own), 1.0)

    def least_cost(self, start: FloatArray, weight: FloatArray, wide: FloatArray) -> float:
        """The cost of the best parameters from a start (P + E,), with priors as wide as `wide`
        (P + E,); weight (R,): of the rows.
        """
        self.wide = wide
        self._pull = np.diag(1.0 / safe(wide))
        inside = np.clip(start, self.low, self.high)
        x, _ = self.solve(inside, weight, wide > 0.0)
        return self._at(x, weight, 0.0)[0]

    def precision(self, x: FloatArray, weight: FloatArray) -> FloatArray:
        """Precision (P + E, P + E) of parameters that rows of these weights (R,) leave."""
        slopes = weight[:, None] * self.rows(x)[1]
        return np.asarray(slopes.T @ slopes + self._pull.T @ self._pull)

    def rows(self, x: FloatArray, softness: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """What the rows miss (R,), and the slopes (R, P + E) of what is predicted."""
        parts = [each.predicted(x, softness) for each in self._channels]
        predicted = np.concatenate([each for each, _ in parts])
        return self.measured - predicted, np.concatenate([each for _, each in parts])

    def _at(
        self, x: FloatArray, weight: FloatArray, softness: float
    ) -> tuple[float, FloatArray, FloatArray]:
        """Cost, weighted residuals (R,) and their slopes (R, P + E)."""
        missing, slopes = self.rows(x, softness)
        residual = weight * missing
        pulled = self._pull @ (x - self.before)
        cost = float(residual @ residual + pulled @ pulled)
        return cost, residual, weight[:, None] * slopes

    def _step(
        self, x: FloatArray, residual: FloatArray, slopes: FloatArray, free: BoolArray
    ) -> FloatArray:
        """The step of Gauss and Newton within the bounds; zero for what is not free."""
        scale = safe(self.wide)[free]
        reduced = np.asarray(
            np.linalg.qr(np.column_stack([slopes[:, free] * scale, residual]), mode="r")
        )
        matrix = np.concatenate([reduced[:, :-1], self._pull[:, free] * scale])
        target = np.concatenate([reduced[:, -1], self._pull @ (self.before - x)])
        low, high = ((bound - x)[free] / scale for bound in (self.low, self.high))
        bounds = (np.minimum(low, -1e-12), np.maximum(high, 1e-12))
        # few bounds are met: the active set is found several times sooner than an interior point
        solved = lsq_linear(
            matrix, target, bounds, method="bvls", max_iter=_BOUNDS_TRIED * len(low)
        )
        step = np.zeros(len(x))
        step[free] = solved.x * scale
        return step

    def _noise(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.noise_of(self.rows(x)[0])

    def noise_of(self, missing: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Deviation of a residual of each group, and residuals per independent one, of what the
        rows miss (R,).
        """
        noise = self._least.copy()
        correlated = np.ones(len(noise))
        for k in range(len(noise)):
            own = missing[self.group == k]
            if len(own):
                noise[k] = max(float(np.sqrt(np.mean(own**2))), self._least[k])
            correlated[k] = correlation_length(own)
        if self.motors is not None:
            moving, standing = noise[-2 * self.motors.n :].reshape(2, -1)
            np.maximum(moving, standing, out=standing)
        return noise, correlated

    def _folds(self) -> IntArray:
        """Which part of all the data each row (R,) belongs to: consecutive ones."""
        known, place = np.unique(self.window, return_inverse=True)
        return np.minimum(place * FOLDS // max(len(known), 1), FOLDS - 1)

    def _chosen_scale(self, x: FloatArray, weight: FloatArray) -> float:
        """The scale of friction's deviation by which what is left out is predicted best."""
        if self.motors is not None:
            return FRICTION_SCALES[-1]  # torques show it axis by axis: it is open
        if sum(len(movements(run.samples)) for run in self.runs) < FOLDS:
            return FRICTION_SCALES[0]  # too few to leave any out
        fold = self._folds()
        best = FRICTION_SCALES[0]
        least = np.inf
        for scale in FRICTION_SCALES:
            self._friction_scale = scale
            self._set_pull()
            x, _ = self.solve(x, weight, self._free)
            _, residual, slopes = self._at(x, weight, 0.0)
            error = self._left_out_error(residual, slopes, fold)
            if error < _WIDER * least:
                best = scale
                least = error
        return best

    def _left_out_error(self, residual: FloatArray, slopes: FloatArray, fold: IntArray) -> float:
        """Sum of squares of weighted residuals (R,), each of a fit without its fold, to first
        order.
        """
        whole = slopes.T @ slopes + self._pull.T @ self._pull
        total = 0.0
        for k in range(FOLDS):
            own = slopes[fold == k]
            if not len(own):
                continue
            without = inverse(whole - own.T @ own, self.wide)
            left = residual[fold == k] + own @ (without @ (own.T @ residual[fold == k]))
            total += float(left @ left)
        return total

    def _torque_widening(self, x: FloatArray, weight: FloatArray) -> float:
        """How much less than they seem to the rows of torques say: neighbours share what the model
        lacks, and what is left out is missed by more.
        """
        _, residual, slopes = self._at(x, weight, 0.0)
        left_out = self._left_out_error(residual, slopes, self._folds())
        missed = left_out / max(float(residual @ residual), 1e-12)
        return max(missed, 1.0) * float(self._noise(x)[1].mean())

    def _moving(self) -> BoolArray:
        moving = [by_window(run.samples.moving.astype(float)) > 0.0 for run in self.runs]
        windows = np.unique(self.window)
        return np.asarray(np.concatenate(moving)[windows])

    def _movements(self, before: FloatArray, after: FloatArray) -> tuple[FittedMovement, ...]:
        assert self.meter is not None  # asked before
        found = []
        pairs = zip(self.meter.watts(before), self.meter.watts(after), strict=True)
        for run, predicted in zip(self.runs, pairs, strict=True):
            samples = run.samples
            powers = (samples.watts, *predicted)
            found += [
                FittedMovement(
                    float(samples.time[first]),
                    (behind - first) * samples.step,
                    *(float(samples.step * each[first:behind].sum()) for each in powers),
                )
                for first, behind in movements(samples)
                if np.isfinite(samples.watts[first:behind]).all()
            ]
        return tuple(found)

    def _widening(self, x: FloatArray, weight: FloatArray, *, stay: bool = False) -> float:
        """The factor on the noise that the residual energies of movements and rests take."""
        missing, slopes = self.rows(x)
        fold = self._folds()
        stretches: list[EnergyStretch] = []
        for run in self.runs:
            inside = run.samples
            spans = [(span, True) for span in movements(inside)]
            spans += [(span, False) for span in rests(inside)]
            for span, moving in spans:
                found = self._stretches(run, span, missing, slopes, fold)
                stretches += [replace(each, moving=moving) for each in found]
        pull = self._pull.T @ self._pull
        whole = weight[:, None] * slopes
        return widening(whole, weight * missing, fold, pull, self.wide, stretches, stay=stay)

    def _stretches(
        self,
        run: FittedRun,
        span: tuple[int, int],
        missing: FloatArray,
        slopes: FloatArray,
        fold: IntArray,
    ) -> list[EnergyStretch]:
        """What a movement or a rest misses: its energy at the mains, and the work of its motors."""
        first = run.first + span[0] // WINDOW
        last = run.first + span[1] // WINDOW
        found = []
        begin = 0
        for channel in self._channels:
            count = len(channel.measured)
            within = (channel.window >= first) & (channel.window < last)
            rows = begin + np.flatnonzero(within)
            begin += count
            if not len(rows):
                continue
            by = np.full(len(rows), float(WINDOW))
            if isinstance(channel, Motors):
                by = WINDOW * channel.speed.T.ravel()[within]
            white = self._white(channel, missing[begin - count : begin])[channel.group[within]]
            found += [
                EnergyStretch(
                    True,
                    int(np.median(fold[rows[part]])),
                    float(by[part] @ missing[rows[part]]),
                    by[part] @ slopes[rows[part]],
                    float((by[part] ** 2 * white[part]).sum()),
                )
                for part in self._within_folds(fold[rows], channel.window[within])
            ]
        return [each for each in found if each.white > 0.0]

    def _within_folds(self, fold: IntArray, window: IntArray) -> list[IntArray]:
        """The rows (R,) of a stretch; of one that is longer than a fold those of each fold."""
        longest = len(np.unique(self.window)) // FOLDS
        if int(np.ptp(window)) <= longest:
            return [np.arange(len(fold))]
        return [np.flatnonzero(fold == k) for k in np.unique(fold)]

    @staticmethod
    def _white(channel: Channel, missing: FloatArray) -> FloatArray:
        """Variance of each group that neighbours do not share."""
        found = channel.least**2 * 1e-6
        for k in range(len(found)):
            own = missing[channel.group == k]
            if len(own) > 1:
                found[k] += 0.5 * float(np.mean(np.diff(own) ** 2))
        return found
