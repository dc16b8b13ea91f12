"""What a fit explains: the watts of a meter, and what a controller says of its motors.

Both are means over windows of 50 ms; each window of a meter, and each axis of each window of the
motors, is a row. Rows of one group share a noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ir_description import PowerParameters
from ir_description.robot import IDLE, IDLE_WATTS
from ir_recorder.measure import PowerModel, Samples
from ir_recorder.measure.power_model import Prepared
from ir_recorder.measure.samples import MOVING
from ir_values.arrays import BoolArray, FloatArray, IntArray

WINDOW = 5  # samples whose mean is one residual: 50 ms
MOVED = 0.05  # rad: a joint that moves
LEAST_WATTS = 0.5  # noise of a residual, at least: the resolution of meters
_LEAST_SHARE = 1e-3  # of the largest effort of an axis: the resolution of controllers
_OFFSET = 0.02  # of the largest effort: what a sensor or a centre of mass may add to an axis
_TRAVELS = (3e-5, 1e-4, 3e-4, 1e-3)  # rad: of gears and bearings that give way before they slide
_NEARER = 0.98  # of the error with friction that turns at once: with more, it does

FRICTION = ("viscous", "coulomb")


def by_window(values: FloatArray) -> FloatArray:
    """Means (M // WINDOW, ...) of consecutive samples (M, ...)."""
    count = len(values) // WINDOW
    return np.asarray(
        values[: count * WINDOW].reshape(count, WINDOW, *values.shape[1:]).mean(axis=1)
    )


@dataclass(frozen=True, eq=False)
class FittedRun:
    """One recording: its name, its samples, and these prepared for the model; first: the number of
    its first window among those of all recordings.
    """

    name: str
    samples: Samples
    prepared: Prepared
    first: int

    def whole(self, usable: BoolArray) -> IntArray:
        """Numbers of the windows all of whose samples (M,) are usable."""
        return np.flatnonzero(by_window(usable.astype(float)) > 1.0 - 1e-9)


def runs_of(
    recordings: Sequence[Samples], names: Sequence[str], model: PowerModel
) -> tuple[FittedRun, ...]:
    """The recordings with their places one behind another."""
    runs: list[FittedRun] = []
    first = 0
    for samples, name in zip(recordings, names, strict=True):
        runs.append(FittedRun(name, samples, model.prepare(samples), first))
        first += len(samples) // WINDOW
    return tuple(runs)


class Channel(Protocol):
    """measured (R,); window (R,): the number of each row's window; group (R,): whose noise it
    shares; least: of each group's noise.
    """

    measured: FloatArray
    window: IntArray
    group: IntArray
    least: FloatArray

    def predicted(self, x: FloatArray, softness: float) -> tuple[FloatArray, FloatArray]:
        """Rows (R,) for parameters x (P + E,), and their slopes (R, P + E)."""


class MeterChannel:
    """Watts at the mains; groups: at rest, and in motion."""

    def __init__(self, runs: Sequence[FittedRun], model: PowerModel, extra: int) -> None:
        self._runs = runs
        self._model = model
        self._extra = extra
        self._rows = [run.whole(run.samples.known & np.isfinite(run.samples.watts)) for run in runs]
        self.measured = self.reduced([run.samples.watts for run in runs])
        moving = self.reduced([run.samples.moving.astype(float) for run in runs]) > 0.0
        self.group = moving.astype(int)
        self.window = np.concatenate(
            [run.first + rows for run, rows in zip(runs, self._rows, strict=True)]
        )
        self.least = np.full(2, LEAST_WATTS)

    def predicted(self, x: FloatArray, softness: float) -> tuple[FloatArray, FloatArray]:
        """Watts (R,) and their slopes (R, P + E)."""
        mean = x[: len(x) - self._extra]
        watts = []
        slopes = []
        for run in self._runs:
            found = self._model.watts_and_slopes(mean, run.prepared, softness)
            watts.append(run.samples.metered(found[0]))
            slopes.append(run.samples.metered(found[1]))
        rows = self.reduced(slopes)
        return self.reduced(watts), np.hstack([rows, np.zeros((len(rows), self._extra))])

    def watts(self, mean: FloatArray) -> list[FloatArray]:
        """Watts (M,) of every sample of each recording, as its meter shows them."""
        return [run.samples.metered(self._model.watts(mean, run.prepared)) for run in self._runs]

    def missing(self, mean: FloatArray) -> FloatArray:
        """Watts (R,) that parameters `mean` leave open."""
        return self.measured - self.reduced(self.watts(mean))

    def time(self) -> FloatArray:
        """Seconds (R,) of the rows on their recordings' clocks."""
        return self.reduced([run.samples.time for run in self._runs])

    @property
    def level(self) -> float:
        """W that the meter shows at rest, about."""
        return max(float(np.median(self.measured)), 10.0 * LEAST_WATTS)

    def reduced(self, values: Sequence[FloatArray]) -> FloatArray:
        """Means over the rows of values (M, ...) of each recording."""
        parts = [by_window(each)[rows] for each, rows in zip(values, self._rows, strict=True)]
        return np.concatenate(parts)


_FACTORS = ("link_mass", "load_mass", "rotor_inertia", "counterbalance")


def _bodies(prepared: Prepared) -> FloatArray:
    """Nm (M, n, K) of what each of _FACTORS multiplies, then per metre of each centre of mass."""
    arm = prepared.torques
    bodies = np.stack([arm.links, arm.loads, arm.rotors, -arm.counterbalance], axis=2)
    return np.concatenate([bodies, np.moveaxis(prepared.centres, 0, 2)], axis=2)


class Motors:
    """Torques of the motors as seen at the joints, or their currents; a group per axis that moves,
    then one per axis that stands: there friction holds with whatever it is asked for, up to where
    it breaks away.

    The last 2 n values of x are an offset per axis in Nm (of a sensor, or of a centre of mass) and,
    per axis, units of what the controller says per Nm: about 1 for torques. Dry friction turns over
    `travel` (n,) rad, where that explains the torques better than at once.
    """

    def __init__(self, runs: Sequence[FittedRun], model: PowerModel) -> None:
        self._runs = tuple(runs)
        self._model = model
        self.n = len(model.layout.joints)
        self._rows = []  # of each run, the windows in which all torques are known
        efforts = []
        windows = []
        for run in runs:
            effort = run.samples.effort
            assert effort is not None  # asked before
            has_effort = np.isfinite(effort).all(axis=1)
            rows = run.whole(run.samples.known & run.samples.motors & has_effort)
            self._rows.append(rows)
            efforts.append(effort)
            windows.append(run.first + rows)
        self._table = self.reduced(efforts)  # (W, n)
        self.speed = self.reduced([run.prepared.speed for run in runs])
        self.measured = self._table.T.ravel()
        self.window = np.tile(np.concatenate(windows), self.n)
        # each joint has two groups of one noise each: moving, then standing
        stands = np.abs(self.speed.T) <= MOVING
        self.group = (np.arange(self.n)[:, None] + self.n * stands).ravel()
        largest = np.abs(self._table).max(axis=0, initial=0.0)
        self.largest = np.maximum(largest, 1e-9)
        self.least = np.tile(_LEAST_SHARE * self.largest, 2)
        self._columns = self.reduced([_bodies(run.prepared) for run in runs])
        self._turned = [self._sides(np.full(self.n, each)) for each in (0.0, *_TRAVELS)]
        self.turn(np.zeros(self.n))
        self.turn(self.found_travel())

    def turn(self, travel: FloatArray) -> None:
        """Let dry friction turn over a travel (n,) rad."""
        self.travel = travel
        sides = [run.prepared.turning_over(travel).side for run in self._runs]
        self._side = self.reduced(sides)
        self._sided = self.reduced(
            [
                _bodies(run.prepared) * side[:, :, None]
                for run, side in zip(self._runs, sides, strict=True)
            ]
        )

    def torque(self, mean: FloatArray) -> FloatArray:
        """Nm (W, n) of the motors in every window."""
        return self._torque(mean)[0]

    def _torque(self, mean: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The same, what a column of `_bodies` adds to it (W, n, K), and what a share lost in the
        gear does (W, n). Within a window the gear's torque keeps its sign.
        """
        of = self._model.layout.places
        weights = self._weights(mean)
        through = self._columns @ weights
        lost = np.sign(through) * (self._sided @ weights)
        gear = mean[of("gear")]
        by_column = self._columns + (gear * np.sign(through))[:, :, None] * self._sided
        friction = mean[of("viscous")] * self.speed + mean[of("coulomb")] * self._side
        return through + friction + gear * lost, by_column, lost

    def _weights(self, mean: FloatArray) -> FloatArray:
        """By what the columns of `_bodies` are multiplied (K,)."""
        layout = self._model.layout
        factors = [mean[layout.index(name)] for name in _FACTORS]
        return np.concatenate([factors, factors[0] * mean[layout.centre_places()]])

    def _slopes(self, mean: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Torques (W, n), and their derivatives (W, n, P) by all parameters."""
        layout = self._model.layout
        of = layout.places
        torque, columns, lost = self._torque(mean)
        slopes = np.zeros((*torque.shape, len(mean)))
        axis = np.arange(self.n)
        for term, values in (("viscous", self.speed), ("coulomb", self._side), ("gear", lost)):
            slopes[:, axis, of(term).start + axis] = values
        for k, name in enumerate(_FACTORS):
            slopes[:, :, layout.index(name)] = columns[:, :, k]
        centres = layout.centre_places()
        shifts = columns[:, :, len(_FACTORS) :]
        slopes[:, :, layout.index(_FACTORS[0])] += shifts @ mean[centres]
        slopes[:, :, centres] = mean[layout.index(_FACTORS[0])] * shifts
        return torque, slopes

    def found_travel(self, seen: BoolArray | None = None) -> FloatArray:
        """The travel (n,) rad by which a regression of each axis on its bodies' torque by the data
        sheet, speed, acceleration, friction of either kind and a constant is nearest, in the
        windows (W,) that were seen (None: in all).
        """
        rows = np.ones(len(self._table), bool) if seen is None else seen
        bodies = self.bodies(self._model.layout.mean)[rows]
        turns = self.accelerations()[rows]
        one = np.ones(len(bodies))
        found = np.zeros(self.n)
        for j in range(self.n):
            errors = []
            for sides in self._turned:
                side = sides[rows, j]
                body = bodies[:, j]
                speed = self.speed[rows, j]
                regressors = [body, speed, side, np.abs(body) * side, turns[:, j], one]
                columns = np.column_stack(regressors)
                size = np.maximum(np.sqrt((columns**2).mean(axis=0)), 1e-12)
                own = self._table[rows, j]
                solved = np.linalg.lstsq(columns / size, own, rcond=1e-6)[0]
                errors.append(float(np.square(own - columns / size @ solved).mean()))
            best = int(np.argmin(errors))
            if best and errors[best] < _NEARER**2 * errors[0]:
                found[j] = _TRAVELS[best - 1]
        return found

    def _sides(self, travel: FloatArray) -> FloatArray:
        """Sides (W, n) of dry friction that turns over a travel (n,) rad."""
        return self.reduced([run.prepared.turning_over(travel).side for run in self._runs])

    def bodies(self, mean: FloatArray) -> FloatArray:
        """Torques (W, n) by parameters `mean`, without friction."""
        return self._columns @ self._weights(mean)

    def accelerations(self) -> FloatArray:
        """Accelerations (W, n) of the joints, rad/s^2; 0 where the motion is unknown."""
        turns = [np.where(run.samples.known[:, None], run.samples.qdd, 0.0) for run in self._runs]
        return self.reduced(turns)

    @property
    def currents(self) -> bool:
        """Whether amperes were recorded, not torques."""
        return self._runs[0].samples.currents

    def scales(self, mean: FloatArray, seen: BoolArray | None = None) -> FloatArray:
        """Amperes per Nm (n,) that fit the torques of parameters `mean` best in the windows (W,)
        that were seen (None: in all); 1 for torques.
        """
        if not self.currents:
            return np.ones(self.n)
        torque = self.torque(mean)
        table = self._table
        if seen is not None:
            torque = torque[seen]
            table = table[seen]
        power = np.maximum((torque**2).sum(axis=0), 1e-12)
        return np.asarray((torque * table).sum(axis=0) / power)

    def doubts_of_scales(
        self, mean: FloatArray, link_mass: float, rotor_inertia: float
    ) -> FloatArray:
        """Variance (n,) of each scale, as a share, that doubts of single links and rotors leave, by
        the deviations of their factors; 0 for torques.

        The parameters are common factors of all links and of all rotors. Nothing parts the gain of
        one axis from a rotor or link of its own that is off: what of its torque hangs on these,
        beside friction and a constant, is so uncertain.
        """
        if not self.currents:
            return np.zeros(self.n)
        found = np.zeros(self.n)
        for j in range(self.n):
            by_column = self._columns[:, j] * self._weights(mean)
            bodies = by_column.sum(axis=1)
            side = self._side[:, j]
            beside = [self.speed[:, j], side, np.abs(bodies) * side, np.ones(len(side))]
            others = np.column_stack(beside)
            others /= np.maximum(np.sqrt((others**2).mean(axis=0)), 1e-12)
            wanted = np.column_stack([bodies, by_column[:, 0], by_column[:, 2]])
            left = wanted - others @ np.linalg.lstsq(others, wanted, rcond=1e-6)[0]
            power = max(float(left[:, 0] @ left[:, 0]), 1e-12)
            by_links, by_rotor = (left[:, 1:].T @ left[:, 0] / power).tolist()
            found[j] = (link_mass * by_links) ** 2 + (rotor_inertia * by_rotor) ** 2
        return found

    def own_prior(self, mean: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Values and deviations (2 n,) of offsets and scales before the fit."""
        scales = self.scales(mean)
        size = np.where(scales == 0.0, 1.0, np.abs(scales))
        spread = 0.5 * size if self.currents else np.zeros(self.n)
        return (
            np.concatenate([np.zeros(self.n), scales]),
            np.concatenate([_OFFSET * self.largest / size, spread]),
        )

    def predicted(self, x: FloatArray, softness: float) -> tuple[FloatArray, FloatArray]:
        """Efforts (R,) and their slopes (R, P + E)."""
        count = len(x) - 2 * self.n
        mean, offset, scale = np.split(x, [count, count + self.n])
        torque, by_mean = self._slopes(mean)
        slopes = np.zeros((*torque.shape, len(x)))
        slopes[:, :, :count] = by_mean * scale[None, :, None]
        axis = np.arange(self.n)
        slopes[:, axis, count + axis] = scale
        slopes[:, axis, count + self.n + axis] = torque + offset
        rows = slopes.transpose(1, 0, 2).reshape(-1, len(x))
        return ((torque + offset) * scale).T.ravel(), rows

    def reduced(self, values: Sequence[FloatArray]) -> FloatArray:
        """Means over the rows of values (M, ...) of each recording."""
        parts = [by_window(each)[rows] for each, rows in zip(values, self._rows, strict=True)]
        return np.concatenate(parts)


def open_prior(prior: PowerParameters, level: float) -> PowerParameters:
    """The prior of a fit with a meter that shows `level` [W] at rest. Where nobody knows what a
    controller draws at rest (`controller: none`), its watts are open. Where no data part what
    inverters take from the DC link from what they draw at rest, that is open too: as much as
    IDLE_WATTS says, at most all.
    """
    covariance = prior.covariance.copy()
    for mode in prior.modes:
        k = prior.index(f"watts.{mode}")
        if prior.deviation[k] == prior.mean[k] == 0.0:
            covariance[k, k] = level**2
    idle = prior.index(IDLE)
    if prior.deviation[idle] == prior.mean[idle] == 0.0:
        most = min(IDLE_WATTS * len(prior.joints), level)
        on = prior.index("watts.STAND_ON_MOTORS")
        covariance[idle, idle] = most**2
        covariance[on, on] += most**2
    return replace(prior, covariance=covariance)
