"""A change half-way through a recording: a payload put down, drives that are switched off, a clock
that moved, gears that get warm. No one set of parameters explains both parts, and a fit of the
whole is a mean of two robots.

Beside the parameters a mass at the flange and a lateness of the meter are open for the whole
recording, so that what was never stated is no change. Then the same with a change of one kind from
one instant on: where that explains the recording much better, it is named.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ir_description import Load
from ir_recorder.fit.channels import FRICTION, WINDOW, FittedRun, by_window
from ir_recorder.fit.power_estimate import Estimate, rests, safe
from ir_recorder.measure.power_model import PowerModel, Prepared
from ir_recorder.measure.samples import MOVING
from ir_values.arrays import BoolArray, FloatArray, IntArray

# Kinds of changes, and how each enters the prediction.

PAYLOAD = "payload"  # kg at the flange
FRICTION_FELL = "friction"  # of viscous friction, a share
CLOCK = "clock"  # s by which the meter is later
WATTS = "watts"  # W more

_NAMES = {
    PAYLOAD: "another payload",
    FRICTION_FELL: "other friction",
    CLOCK: "a clock that moved",
    WATTS: "other watts of the controller",
}
_TORQUES = (PAYLOAD, FRICTION_FELL)  # what the motors show
_FOREVER = np.inf


@dataclass(frozen=True)
class Change:
    """What changed in a recording at `start` (until `end`) [s] and by how much: kg at the flange, a
    share of viscous friction, s of lateness, or W. fading [s]: after which a change that begins at
    once is down to 1 / e; inf: it stays. likelier: by how much it raises the logarithm of the
    likelihood; others: kinds that raise it by nearly as much; number: of the recording.
    """

    run: str
    kind: str
    start: float
    end: float = _FOREVER
    fading: float = _FOREVER
    size: float = np.nan
    likelier: float = np.nan
    others: tuple[str, ...] = ()
    number: int = 0

    def shape(self, time: FloatArray) -> FloatArray:
        """How much of the change holds at times (M,) of its recording."""
        inside = (time >= self.start) & (time < self.end)
        return np.asarray(inside * np.exp(-(time - time[0]) / self.fading))

    @property
    def lasts(self) -> bool:
        """Whether it stays to the end of the recording."""
        return not (np.isfinite(self.end) or np.isfinite(self.fading))

    @property
    def sentence(self) -> str:
        """What changed, when, by how much, and what to do."""
        if self.kind == WATTS and np.isfinite(self.end):
            return (
                f"{self.run}: from {self.start:.1f} to {self.end:.1f} s, at rest, the meter shows "
                f"{self.size:+.0f} W beside other rests: brakes closed, drives switched off or "
                "another power mode? State it in a column mode, or leave these seconds out"
            )
        what, advice = {
            WATTS: (
                f"the meter shows {self.size:+.0f} W at rest and in motion alike",
                "another power mode, or something else on the supply? State it in a column mode, "
                "or fit the two parts one by one",
            ),
            PAYLOAD: (
                f"the robot moves as with {self.size:+.3g} kg at the flange",
                "a part taken or put down, or another tool? State it in a column load, or fit the "
                "two parts one by one",
            ),
            CLOCK: (
                f"the meter is {abs(self.size):.2f} s {'later' if self.size > 0.0 else 'earlier'}",
                "did a clock move, or are rows missing? Fit the two parts one by one, each with "
                "its clock_offset",
            ),
            FRICTION_FELL: (
                f"viscous friction is {100.0 * self.size:+.0f} %",
                "gears that got warm, or another speed of the fan? Warm up before you record",
            ),
        }[self.kind]
        if np.isfinite(self.fading):
            return (
                f"{self.run}: friction fell while it was recorded, at its begin viscous friction "
                f"was about {100.0 * self.size:+.0f} %, which fades in some {self.fading:.0f} s: "
                "gears that got warm? Warm up before you record, and fit warm and cold robots apart"
            )
        or_else = "".join(f", or {_NAMES[each]}" for each in self.others)
        return f"{self.run}: from about {self.start:.1f} s on {what}{or_else}: {advice}"


# The fit with more open: its parameters, then a mass at the flange [kg] and, with a meter, its
# lateness [s], of the whole recording; then the size of a change.

_OPEN_MASS = 0.25  # of the moving links: deviation of a payload that nobody stated
_OPEN_LATE = 1.0  # s
_OPEN_FRICTION = 3.0  # times its deviation before, at least
_OPEN_SIZE = {FRICTION_FELL: 3.0, CLOCK: 1.0, WATTS: 1e4}
_KG = 0.005  # of the moving links: a difference
_SHARE = 0.02  # of friction: a difference
_SOFTNESS = (2.0, 0.3)  # J, of the DC link, before its switches conduct at once
_ROUNDS = 10
_SHARES = (1.0, 0.5, 0.25, 0.1, 0.03)  # of a step
_LITTLE = 2e-3  # of the cost of a row: gains that end a descent
_BOUNDED = 4  # times that a step is found


@dataclass(frozen=True, eq=False)
class Explained:
    """What is left of a recording: the noise (G,) of each group, residuals per independent one (G,)
    and rows (G,); pulled: squared deviations of the parameters from what is known.
    """

    noise: FloatArray
    correlated: FloatArray
    rows: IntArray
    pulled: float

    @property
    def likelihood(self) -> float:
        """Its logarithm, up to a constant."""
        return float(-self.rows @ np.log(self.noise) - 0.5 * self.pulled)

    def likelier(self, before: Explained) -> float:
        """By how much the logarithm of the likelihood is above another's. Residuals that hang
        together, as what the model lacks in a posture or a movement does, count as fewer.
        """
        rows = self.rows / self.correlated
        return float(rows @ np.log(before.noise / self.noise) + 0.5 * (before.pulled - self.pulled))


@dataclass(frozen=True, eq=False)
class Opened:
    """A fit with these parameters beside its own, and a change of its recordings or none; all of
    them (P + E + ..,) have deviations `wide`, values `before` the fit, and bounds `low`, `high`.
    units: Nm (M, n) of each recording that a kilogram before the flange asks of the motors.
    """

    estimate: Estimate
    wide: FloatArray
    before: FloatArray
    low: FloatArray
    high: FloatArray
    units: tuple[FloatArray, ...]
    change: Change | None = None

    def with_change(self, change: Change) -> Opened:
        """The same with a change, the size of which is one more parameter."""
        if self.change is not None:
            return replace(self, change=change)
        return replace(
            self,
            wide=np.append(self.wide, _OPEN_SIZE.get(change.kind, self.wide[self._count])),
            before=np.append(self.before, 0.0),
            low=np.append(self.low, -np.inf),
            high=np.append(self.high, np.inf),
            change=change,
        )

    @property
    def _count(self) -> int:
        """Parameters of the fit itself."""
        return len(self.estimate.found)

    @property
    def _kg(self) -> float:
        return _KG * _moving_mass(self.estimate)

    def fitted(self, start: FloatArray) -> FloatArray:
        """The best parameters from a start."""
        begin = np.clip(start, self.low, self.high)
        x = begin
        for softness in _SOFTNESS if self.estimate.meter is not None else ():
            x = self._descended(x, softness)
        if self.explained(x).likelihood < self.explained(begin).likelihood:
            x = begin  # kinks of the DC link
        return self._descended(x, 0.0)

    def explained(self, x: FloatArray) -> Explained:
        """What parameters leave."""
        noise, correlated = self._noise(x)
        rows = np.bincount(self.estimate.group, minlength=len(noise))
        return Explained(noise, correlated, rows, self._cost(x, np.zeros(0)))

    def _descended(self, x: FloatArray, softness: float) -> FloatArray:
        """Steps of Gauss and Newton, until they gain little."""
        missing = self.missing(x, softness)
        for _ in range(_ROUNDS):
            weight = 1.0 / self.estimate.noise_of(missing)[0][self.estimate.group]
            cost = self._cost(x, weight * missing)
            step = self._bounded(x, weight, missing, self.rows(x, softness)[1])
            for share in _SHARES:
                trial = np.clip(x + share * step, self.low, self.high)
                left = self.missing(trial, softness)
                gained = cost - self._cost(trial, weight * left)
                if gained > 0.0:
                    break
            else:
                return x
            x = trial
            missing = left
            if gained < _LITTLE * len(weight):
                break
        return x

    def _cost(self, x: FloatArray, missing: FloatArray) -> float:
        pulled = (x - self.before) / safe(self.wide)
        return float(missing @ missing + pulled @ pulled)

    def _bounded(
        self, x: FloatArray, weight: FloatArray, missing: FloatArray, slopes: FloatArray
    ) -> FloatArray:
        """The step of least cost; what would leave its bounds goes to them, the rest once more."""
        free = self.wide > 0.0
        step = np.zeros(len(x))
        target = np.concatenate([weight * missing, (self.before - x) / safe(self.wide)])
        matrix = np.vstack([weight[:, None] * slopes * self.wide, np.eye(len(x))])
        triangle = np.asarray(np.linalg.qr(np.column_stack([matrix, target]), mode="r"))
        for _ in range(_BOUNDED):
            own = triangle[:, -1] - triangle[:, :-1] @ (step / safe(self.wide))
            step[free] += self.wide[free] * np.linalg.lstsq(triangle[:, :-1][:, free], own)[0]
            inside = np.clip(x + step, self.low, self.high) - x
            beyond = free & (np.abs(inside - step) > 1e-9 * self.wide)
            step = inside
            if not beyond.any():
                break
            free &= ~beyond
        return step

    def weights(self, x: FloatArray) -> FloatArray:
        """Weights (R,) of the rows by what they miss."""
        return np.asarray(1.0 / self._noise(x)[0][self.estimate.group])

    def _noise(self, x: FloatArray) -> tuple[FloatArray, FloatArray]:
        return self.estimate.noise_of(self.missing(x))

    def with_more(self, x: FloatArray) -> FloatArray:
        """Parameters of the fit with nothing more."""
        return np.concatenate([x, np.zeros(len(self.before) - len(x))])

    def with_lateness(self, x: FloatArray, late: float) -> FloatArray:
        """The same with a meter that is late [s]."""
        found = x.copy()
        found[self._count + 1] = late
        return found

    def shown_later(self, x: FloatArray, late: float) -> FloatArray:
        """Watts (R,) that a meter which is late [s] shows."""
        missing = self.missing(self.with_lateness(x, late))
        return np.asarray((self.estimate.measured - missing)[: self._metered])

    def times(self) -> tuple[IntArray, FloatArray]:
        """Which recording each row (R,) is of, and when [s] on its clock."""
        place = np.concatenate(
            [np.full(len(run.samples) // WINDOW, k) for k, run in enumerate(self.estimate.runs)]
        )
        time = np.concatenate([by_window(run.samples.time) for run in self.estimate.runs])
        return place[self.estimate.window], time[self.estimate.window]

    def slope_of(self, kind: str, x: FloatArray, slopes: FloatArray) -> FloatArray:
        """How the rows (R,) change with a change of a kind that holds all the time."""
        if kind == PAYLOAD:
            return slopes[:, self._count]
        if kind == CLOCK:
            return slopes[:, self._count + 1]
        if kind == FRICTION_FELL:
            places = self.estimate.prior.places("viscous")
            return np.asarray(slopes[:, places] @ x[places])
        return (np.arange(len(slopes)) < self._metered).astype(float)

    @property
    def _metered(self) -> int:
        return 0 if self.estimate.meter is None else len(self.estimate.meter.measured)

    def rows(self, x: FloatArray, softness: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """What the rows miss (R,), and the slopes (R, ...) of what is predicted."""
        asked = [self._asked(k, x) for k in range(len(self.estimate.runs))]
        parts = []
        if self.estimate.meter is not None:
            parts.append(self._watts_and_slopes(x, asked, softness))
        if self.estimate.motors is not None:
            parts.append(self._efforts(x, asked))
        predicted = np.concatenate([each for each, _ in parts])
        return self.estimate.measured - predicted, np.concatenate([each for _, each in parts])

    def missing(self, x: FloatArray, softness: float = 0.0) -> FloatArray:
        """What the rows miss (R,)."""
        asked = [self._asked(k, x) for k in range(len(self.estimate.runs))]
        parts = []
        if self.estimate.meter is not None:
            mean = x[: len(self.estimate.prior.names)]
            shown = []
            for k, (run, (more, _, shape)) in enumerate(
                zip(self.estimate.runs, asked, strict=True)
            ):
                asked_for = self._with_more(run.prepared, mean, more)
                watts = self.estimate.model.watts(mean, asked_for, softness)
                shown.append(self._shown(k, x, run.samples.metered(watts), shape))
            parts.append(self.estimate.meter.reduced(shown))
        if self.estimate.motors is not None:
            parts.append(self._efforts(x, asked)[0])
        return np.asarray(self.estimate.measured - np.concatenate(parts))

    def _shown(self, k: int, x: FloatArray, watts: FloatArray, shape: FloatArray) -> FloatArray:
        """What a late meter shows of watts (M,), with a change of the watts."""
        kind = "" if self.change is None else self.change.kind
        late = np.full(len(watts), x[self._count + 1])
        if kind == CLOCK:
            late += x[-1] * shape
        time = self.estimate.runs[k].samples.time
        shown = np.interp(time - late, time, watts)
        return np.asarray(shown + x[-1] * shape if kind == WATTS else shown)

    def _asked(self, k: int, x: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """What is asked of the motors of a recording beyond the loads [Nm] (M, n), what a unit of
        the change asks of them, and its shape (M,).
        """
        run = self.estimate.runs[k]
        shape = np.zeros(len(run.samples))
        per = np.zeros_like(run.prepared.speed)
        more = x[self._count] * self.units[k]
        if self.change is None or self.change.number != k:
            return more, per, shape
        shape = self.change.shape(run.samples.time)
        if self.change.kind == PAYLOAD:
            per = shape[:, None] * self.units[k]
        elif self.change.kind == FRICTION_FELL:
            viscous = x[self.estimate.prior.places("viscous")]
            per = shape[:, None] * viscous * run.prepared.speed
        return more + x[-1] * per, per, shape

    def _watts_and_slopes(
        self,
        x: FloatArray,
        asked: Sequence[tuple[FloatArray, FloatArray, FloatArray]],
        softness: float,
    ) -> tuple[FloatArray, FloatArray]:
        """Watts (R,) that the meter would show with unknowns x (K,), and their slopes (R, K).

        `asked`: of each recording the torques (M, n) beside those of its loads, how they grow with
        the change, and its shape over time (M,). Slopes by a mass or a torque are differences.
        """
        assert self.estimate.meter is not None  # asked before
        model = self.estimate.model
        mean = x[: len(self.estimate.prior.names)]
        kind = "" if self.change is None else self.change.kind
        watts = []
        slopes = []
        for k, (run, (more, per, shape)) in enumerate(zip(self.estimate.runs, asked, strict=True)):
            with_more = partial(self._with_more, run.prepared, mean)
            as_asked = with_more(more)
            power, own = model.watts_and_slopes(mean, as_asked, softness)
            heavier = with_more(more + self._kg * self.units[k])
            by_mass = (model.watts(mean, heavier, softness) - power) / self._kg
            by_change = np.zeros(len(power))
            if kind in _TORQUES:
                step = self._kg if kind == PAYLOAD else _SHARE
                raised = with_more(more + step * per)
                by_change = (model.watts(mean, raised, softness) - power) / step

            # as the meter sees them, and how they change with its clock
            columns = run.samples.metered(np.column_stack([power, own, by_mass, by_change]))
            seen = columns[:, 0]
            rate = -np.gradient(seen, run.samples.step)
            if kind == CLOCK:
                columns[:, -1] = rate * shape
            elif kind == WATTS:
                columns[:, -1] = shape
            none = np.zeros((len(power), self._count - len(mean)))
            wider = [columns[:, 1:-2], none, columns[:, -2:-1], rate[:, None]]
            if kind:
                wider.append(columns[:, -1:])
            watts.append(self._shown(k, x, seen, shape))
            slopes.append(np.hstack(wider))
        return self.estimate.meter.reduced(watts), self.estimate.meter.reduced(slopes)

    def _with_more(self, prepared: Prepared, mean: FloatArray, more: FloatArray) -> Prepared:
        """With more (M, n) Nm asked of the motors, whatever the factor of the loads."""
        factor = float(mean[self.estimate.prior.index("load_mass")])
        loads = prepared.torques.loads + more / factor
        return replace(prepared, torques=replace(prepared.torques, loads=loads))

    def _efforts(
        self, x: FloatArray, asked: Sequence[tuple[FloatArray, FloatArray, FloatArray]]
    ) -> tuple[FloatArray, FloatArray]:
        assert self.estimate.motors is not None  # asked before
        n = self.estimate.motors.n
        scale = x[self._count - n : self._count]
        efforts, slopes = self.estimate.motors.predicted(x[: self._count], 0.0)
        more = self.estimate.motors.reduced([each for each, _, _ in asked])
        tail = [self.estimate.motors.reduced(self.units)]
        if self.estimate.meter is not None:
            tail.append(np.zeros_like(more))
        if self.change is not None:
            tail.append(self.estimate.motors.reduced([each for _, each, _ in asked]))
        rows = len(more)
        for j in range(n):
            slopes[j * rows : (j + 1) * rows, self._count - n + j] += more[:, j]
        wider = np.column_stack([(scale * each).T.ravel() for each in tail])
        return efforts + (scale * more).T.ravel(), np.hstack([slopes, wider])


def opened(estimate: Estimate) -> Opened:
    """A fit with these parameters beside its own, and no change."""
    wide = [_OPEN_MASS * _moving_mass(estimate)]
    if estimate.meter is not None:
        wide.append(_OPEN_LATE)
    usual = estimate.wide.copy()
    for term in FRICTION:
        places = estimate.prior.places(term)
        usual[places] = np.maximum(usual[places], _OPEN_FRICTION * estimate.deviation[places])
    more = len(wide)
    return Opened(
        estimate,
        np.concatenate([usual, wide]),
        np.concatenate([estimate.before, np.zeros(more)]),
        np.concatenate([estimate.low, np.full(more, -np.inf)]),
        np.concatenate([estimate.high, np.full(more, np.inf)]),
        tuple(_unit(estimate.model, run) for run in estimate.runs),
    )


def _moving_mass(estimate: Estimate) -> float:
    """Kilograms of the moving links."""
    return float(estimate.model.robot.link_mass[1:].sum())


def _unit(model: PowerModel, run: FittedRun) -> FloatArray:
    """Nm (M, n) that a kilogram before the flange asks of the motors."""
    robot = model.robot
    out = 0.5 * float(np.linalg.norm(robot.joint_origin[-1][:3, 3]))
    size = max(out, 0.01) ** 2 * np.eye(3)
    held = Load("more", "tool", 1.0, np.array([out, 0.0, 0.0]), size)
    loads = tuple((*each, held) for each in run.samples.loads)
    more = model.prepare(replace(run.samples, loads=loads))
    return np.asarray(more.torques.loads - run.prepared.torques.loads)


# Where a change would explain most, to first order: every instant of a raster is tried.

_NEAR_END = 2.0  # s: what has changed so near to an end is not told from its movements
_INSTANTS = 100  # of each recording
_RASTER = 0.25  # s, at least
_SHORTEST_REST = 0.75  # s
_IN_A_REST = 12  # instants
_FADES = (0.2, 0.5)  # of a recording
_PARTS = 3
_FIRST = 0.02  # of the squares: to first order, at least
_SEEN = 1e-3  # of a change: what is left beside all other parameters, at least


@dataclass(frozen=True, eq=False)
class _FirstOrder:
    """The fit about parameters x: weight (R,) of its rows, slopes (R, ..), an orthonormal basis
    (R + F, F) of what the parameters that are free explain of rows and pulls, and what is left of
    both (R + F,).
    """

    usual: Opened
    x: FloatArray
    weight: FloatArray
    slopes: FloatArray
    basis: FloatArray
    left: FloatArray

    @classmethod
    def of(cls, usual: Opened, x: FloatArray) -> _FirstOrder:
        """About x (P + E + ..,)."""
        missing, slopes = usual.rows(x)
        weight = usual.weights(x)
        free = usual.wide > 0.0
        own = weight[:, None] * slopes[:, free] * usual.wide[free]
        basis = np.linalg.qr(np.vstack([own, np.eye(own.shape[1])]))[0]
        pulled = ((usual.before - x) / safe(usual.wide))[free]
        target = np.concatenate([weight * missing, pulled])
        return cls(usual, x, weight, slopes, basis, target - basis @ (basis.T @ target))

    def along(self, kind: str) -> FloatArray:
        """How the weighted rows (R,) change with a change of a kind that holds all the time."""
        return np.asarray(self.weight * self.usual.slope_of(kind, self.x, self.slopes))


def _candidates(kind: str, usual: Opened) -> Iterator[Change]:
    for number, run in enumerate(usual.estimate.runs):
        time = run.samples.time
        at = partial(Change, run.name, kind, number=number)
        raster = max(_RASTER, (time[-1] - time[0]) / _INSTANTS)
        for start in np.arange(time[0] + _NEAR_END, time[-1] - _NEAR_END, raster).tolist():
            yield at(start)
        if len(usual.estimate.runs) > 1:
            yield at(float(time[0]))
        if kind == FRICTION_FELL:
            for share in _FADES:
                fading = share * float(time[-1] - time[0])
                yield at(float(time[0]), fading=fading)
        if kind == WATTS:
            for first, behind in rests(run.samples):
                yield from _stretches_of_rest(at, time[first], time[behind - 1])


def _stretches_of_rest(at: Callable[..., Change], first: float, last: float) -> Iterator[Change]:
    """Stretches of a rest."""
    if last - first < _SHORTEST_REST:
        return
    count = min(int((last - first) / _RASTER), _IN_A_REST)
    instants = np.linspace(first, last, count + 1).tolist()
    for k, start in enumerate(instants):
        for end in instants[k + 1 :]:
            if end - start >= _SHORTEST_REST - 1e-9:
                yield at(start, end)


def _likeliest(kind: str, usual: Opened, x: FloatArray) -> list[Change]:
    """The changes of a kind that explain most to first order: of a payload, which first order tells
    least well, the best of each part of the recordings; none where that is little.

    Each candidate adds one column to the least squares of the usual fit, after what the other
    parameters can explain of it.
    """
    about = _FirstOrder.of(usual, x)
    rows = len(about.weight)
    along = about.along(kind)
    places, times = usual.times()
    least = _FIRST * rows
    best: dict[int, tuple[float, Change]] = {}
    candidates = list(_candidates(kind, usual))
    parts = _PARTS if kind == PAYLOAD else 1
    for k, candidate in enumerate(candidates):
        inside = places == candidate.number
        column = np.zeros(rows)
        column[inside] = (along * candidate.shape(times))[inside]
        size = float(column @ column)
        explained = float(np.square(about.basis[:rows].T @ column).sum())
        alone = size - explained
        if not alone > _SEEN * size:
            continue
        projected = float(column @ about.left[:rows])
        gain = projected**2 / alone
        part = k * parts // len(candidates)
        best_gain, _ = best.get(part, (least, candidate))
        if gain > best_gain:
            best[part] = gain, replace(candidate, size=projected / alone)
    return [change for _, change in best.values()]


# A clock that moves by more than the robot takes to accelerate is not seen to first order: every
# pair of latenesses is tried, before and behind every instant.

_LAGS = np.arange(-1.0, 1.01, 0.05)  # s
_NEARER = 0.9  # of the squares that one lateness leaves


def _moved_clock(usual: Opened, x: FloatArray) -> tuple[Change, FloatArray] | None:
    """The step of the meter's clock that leaves least, and where a fit with it begins: at the
    parameters that were found or, as a fit to a clock that moved explains little, at those known
    before.
    """
    assert usual.estimate.meter is not None  # asked before
    meter = usual.estimate.meter
    places, times = usual.times()
    places = places[: len(meter.measured)]
    times = times[: len(places)]
    found = []
    for begin in (x, usual.before):
        shown = np.array([usual.shown_later(begin, lag) for lag in _LAGS])
        for k, run in enumerate(usual.estimate.runs):
            own = places == k
            step = _clock_step(meter.measured[own], shown[:, own], times[own])
            if step is None:
                continue
            left, instant, first, then = step
            change = Change(run.name, CLOCK, instant, size=float(then - first), number=k)
            found.append((left, change, usual.with_lateness(begin, first)))
    if not found:
        return None
    _, change, start = min(found, key=lambda each: each[0])
    return None if change.size == 0.0 else (change, start)


def _clock_step(
    measured: FloatArray, shown: FloatArray, times: FloatArray
) -> tuple[float, float, float, float] | None:
    """The squares [W^2] that are left of measured watts (R,) where the clock steps once, its
    instant [s], and the lags [s] before and from then on; None where that explains hardly more than
    one lag. shown: watts (LAGS, R) with each lag.
    """
    after_begin = times > times.min(initial=np.inf) + _NEAR_END
    before_end = times < times.max(initial=-np.inf) - _NEAR_END
    inside = np.flatnonzero(after_begin & before_end)
    if not len(inside):
        return None
    befores = []
    behinds = []
    for with_lag in shown:
        before, behind = _unlike(measured, with_lag, inside)
        befores.append(before)
        behinds.append(behind)
    left_before = np.array(befores)
    left_behind = np.array(behinds)
    least = left_before.min(axis=0) + left_behind.min(axis=0)
    whole = (left_before[:, -1] + left_behind[:, -1]).min()
    best = int(least.argmin())
    if least[best] > _NEARER * whole:
        return None
    first = _LAGS[left_before[:, best].argmin()]
    then = _LAGS[left_behind[:, best].argmin()]
    return float(least[best]), float(times[inside[best]]), first, then


def _unlike(
    measured: FloatArray, shown: FloatArray, rows: IntArray
) -> tuple[FloatArray, FloatArray]:
    """The squares (K,) of measured watts (R,) that others (R,), times a factor and with a constant,
    leave before each of some rows (K,) and from there on, each part with its own.
    """
    one = np.ones(len(shown))
    moments = np.array([one, shown, measured, shown**2, shown * measured, measured**2])
    until = moments.cumsum(axis=1)
    before = until[:, rows - 1]
    return _left(before), _left(until[:, -1:] - before)


def _left(sums: FloatArray) -> FloatArray:
    """Squares (K,) that a straight line leaves, by sums (6, K) of 1, x, y, x^2, x y, y^2."""
    count, x, y, xx, xy, yy = sums
    slope = np.maximum(xy - x * y / count, 0.0)
    return np.asarray(yy - y**2 / count - slope**2 / np.maximum(xx - x**2 / count, 1e-9))


# Gears that get warm while it is recorded.
#
# Axes that move one after the other hide friction that fades by degrees: each has its own, and to
# first order a hundredth of the change is left beside all other parameters. What the model lacks
# leaves as much in some movement or other, but it does not know which came first. So the movements
# are shuffled: of friction that fades in their own order more is seen than in nearly all others.

_FADING = 0.6  # of a recording: seconds after which the change is down to 1 / e
_SHUFFLED = 500  # times
_AT_ONCE = 50  # of them
_SELDOM = 0.02  # of the shuffled orders show as much, at most: so many false alarms
_ENOUGH = 40.0  # of the squares, in units of the noise
_WARMED = (
    0.25,
    1.5,
)  # of viscous friction: less is not told from what the model lacks, nor is more


def warming(usual: Opened, x: FloatArray) -> Change | None:
    """Viscous friction that fades while a meter records, as gears get warm; None where it doesn't,
    or too little. It is looked for with a meter alone: motors show friction itself.
    """
    if usual.estimate.meter is None or usual.estimate.motors is not None:
        return None
    about = _FirstOrder.of(usual, x)
    along = about.along(FRICTION_FELL)
    places, times = usual.times()
    found = []
    for number, run in enumerate(usual.estimate.runs):
        rows = np.flatnonzero(places == number)
        if not len(rows):
            continue
        begin = float(times[rows[0]])
        fading = _FADING * (float(times[rows[-1]]) - begin)
        if not fading > 0.0:
            continue
        stretch, moves = _stretches(usual, rows)
        middle = np.bincount(stretch, times[rows]) / np.bincount(stretch)
        fades = np.exp(-(middle - begin) / fading)
        size, squares = _seen(about, along, rows, fades[stretch][:, None])
        change = Change(run.name, FRICTION_FELL, begin, fading=fading, number=number)
        change = replace(change, size=float(size[0]), likelier=0.5 * float(squares[0]))
        low, high = _WARMED
        if squares[0] < _ENOUGH or not low <= size[0] <= high:
            continue
        orders = shuffled(fades, moves)
        as_much = np.concatenate(
            [
                _seen(about, along, rows, part.T[stretch])[1] >= squares[0]
                for part in np.array_split(orders, _SHUFFLED // _AT_ONCE)
            ]
        )
        if as_much.mean() <= _SELDOM:
            found.append(change)
    return max(found, key=lambda each: each.likelier, default=None)


def shuffled(fades: FloatArray, moves: BoolArray) -> FloatArray:
    """How much of the change holds in each stretch (S,), with the movements in other orders
    (_SHUFFLED, S); rests stay.
    """
    rng = np.random.default_rng(0)
    orders = np.tile(fades, (_SHUFFLED, 1))
    orders[:, moves] = rng.permuted(orders[:, moves], axis=1)
    return orders


def _seen(
    about: _FirstOrder, along: FloatArray, rows: IntArray, fades: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Sizes (K,) of changes that hold by fades (R, K) in some rows (R,), to first order, and by how
    many squares they are nearer; negative ones where it is a rise.
    """
    columns = along[rows][:, None] * fades
    power = np.square(columns).sum(axis=0)
    alone = power - np.square(about.basis[rows].T @ columns).sum(axis=0)
    projected = columns.T @ about.left[rows]
    told = alone > 1e-9 * np.maximum(power, 1e-12)
    size = np.divide(projected, alone, out=np.zeros_like(alone), where=told)
    return size, np.asarray(size * np.abs(projected))


def _stretches(usual: Opened, rows: IntArray) -> tuple[IntArray, BoolArray]:
    """Numbers (R,) of the movements and rests that some rows lie in, from 0 on, and whether each of
    these (S,) is a movement.
    """
    speeds = [by_window(run.prepared.speed) for run in usual.estimate.runs]
    moves = np.any(np.abs(np.concatenate(speeds)) > MOVING, axis=1)
    moving = np.asarray(moves)[usual.estimate.window[rows]]
    stretch = np.cumsum(np.diff(moving, prepend=moving[:1]) != 0)
    is_movement = np.zeros(int(stretch[-1]) + 1, bool)
    is_movement[stretch] = moving
    return stretch, is_movement


# What is named: what makes the whole much likelier, and the rows of its smaller part as well.

_KINDS = (WATTS, PAYLOAD, FRICTION_FELL)
_BEGIN = 0.5  # of a size to first order
_BEGUN_AGAIN = 3
_INSTANTS_AGAIN = 2  # times that the instant is looked for again
_INSTANTS_OF = 3  # of the likeliest changes
_NEAR = 0.05  # s: steps of the edges of a change within a rest
_STEPS = 20
_PLAIN = 1.1  # so much likelier are other watts than what only resembles them
_LIKELIER = {WATTS: 60.0, CLOCK: 60.0, PAYLOAD: 90.0, FRICTION_FELL: 90.0}
_NEARLY = 0.6  # of the likeliest: another kind that is named beside it
_LEAST_MASS = 0.04  # of the moving links: less is not told from what the model lacks
_BY_ROW = 0.25  # of the smaller part: e^-0.5 of its squares are left


def change(estimate: Estimate) -> Change | None:
    """What changed half-way; None where one set of parameters explains the recordings as well."""
    usual = opened(estimate)
    x = usual.fitted(usual.with_more(estimate.found))
    found = changes(usual, x)
    return _named(estimate, found) or warming(usual, x)


def _named(estimate: Estimate, found: Sequence[Change]) -> Change | None:
    """The likeliest of the changes that were found, with what else it may be; None where it is too
    unlikely or too small.
    """
    if not found or found[0].likelier < _LIKELIER[found[0].kind]:
        return None
    first = found[0]
    if first.likelier < _BY_ROW * _smaller(estimate, first):
        return None
    if first.kind == PAYLOAD and abs(first.size) < _LEAST_MASS * _moving_mass(estimate):
        return None
    others = {each.kind for each in found if each.likelier > _NEARLY * first.likelier}
    return replace(first, others=tuple(sorted(others - {first.kind})))


def _smaller(estimate: Estimate, change: Change) -> int:
    """Rows of a recording that a change touches, or those that it doesn't where these are fewer."""
    run = estimate.runs[change.number]
    windows = run.first + np.arange(len(run.samples) // WINDOW)
    touched = by_window(run.samples.time) >= change.start
    touched &= by_window(run.samples.time) < change.end
    inside = np.count_nonzero(np.isin(estimate.window, windows[touched]))
    return int(min(inside, len(estimate.window) - inside))


def changes(usual: Opened, x: FloatArray) -> list[Change]:
    """The likeliest changes of each kind to a fit with parameters x, the likeliest first."""
    estimate = usual.estimate
    starts = []
    for kind in _KINDS if estimate.meter is not None else _TORQUES:
        likeliest = _likeliest(kind, usual, x)
        starts += [(each, np.append(x, _BEGIN * each.size)) for each in likeliest]
    moved = None if estimate.meter is None else _moved_clock(usual, x)
    if moved is not None:
        starts.append((moved[0], np.append(moved[1], moved[0].size)))
    tried = [_Tried.fitted(usual, each, begin) for each, begin in starts]
    tried.sort(key=lambda each: -each.after.likelihood)
    least = usual.explained(x).likelihood + min(_LIKELIER.values())
    tried[:_INSTANTS_OF] = [
        each.at_its_instant(usual) if each.after.likelihood > least else each
        for each in tried[:_INSTANTS_OF]
    ]
    before = _best(usual, x, tried)
    found = [replace(each.change, likelier=each.after.likelier(before)) for each in tried]
    return sorted(found, key=_preferred)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A change, the parameters (P + E + 3,) of the fit with it, and what these leave."""

    change: Change
    x: FloatArray
    after: Explained

    @classmethod
    def fitted(cls, usual: Opened, change: Change, begin: FloatArray) -> _Tried:
        """A fit with a change, from a start."""
        changed = usual.with_change(change)
        x = changed.fitted(begin)
        return cls(replace(change, size=float(x[-1])), x, changed.explained(x))

    def at_its_instant(self, usual: Opened) -> _Tried:
        """The same where it explains most with the parameters that it leads to."""
        best = self
        for _ in range(_INSTANTS_AGAIN):
            other = best.change
            for edge in ("start", "end") if np.isfinite(other.end) else ("start",):
                steps = _at_other_instants(other, edge, usual)
                left = [usual.with_change(each).explained(best.x).likelihood for each in steps]
                other = steps[int(np.argmax(left))]
            if other == best.change:
                break
            again = _Tried.fitted(usual, other, best.x)
            if again.after.likelihood <= best.after.likelihood:
                break
            best = again
        return best


def _at_other_instants(change: Change, edge: str, usual: Opened) -> list[Change]:
    """The same change at other instants: within a rest nearby, else anywhere; first as it is."""
    if np.isfinite(change.end):
        near = _NEAR * np.arange(-_STEPS, _STEPS + 1)
        others = [replace(change, **{edge: getattr(change, edge) + late}) for late in near.tolist()]
        return [change, *(each for each in others if each.end - each.start > _NEAR)]
    if np.isfinite(change.fading):
        return [change]
    every = (each for each in _candidates(change.kind, usual) if each.lasts)
    return [
        change,
        *(replace(change, run=each.run, number=each.number, start=each.start) for each in every),
    ]


def _best(usual: Opened, x: FloatArray, tried: Sequence[_Tried]) -> Explained:
    """What the best fit without a change leaves: it may have stopped too soon, so it begins where
    those with one ended as well.
    """
    found = [usual.explained(x)]
    likeliest = sorted(tried, key=lambda each: -each.after.likelihood)
    for each in likeliest[:_BEGUN_AGAIN]:
        again = usual.fitted(each.x[:-1])
        found.append(usual.explained(again))
    return max(found, key=lambda each: each.likelihood)


def _preferred(change: Change) -> float:
    """What comes first: the likeliest, and other watts where they explain nearly as much."""
    return -change.likelier * (_PLAIN if change.kind == WATTS else 1.0)
