"""Cost of a motion along a uniform cubic B-spline, with its derivatives: the oracle of the compiled
core.

Each interval between knots is sampled at the middles of SAMPLES equal parts. There the drives are
looked at (torque, speed, power) and the clearance; accelerations at the knots, jerks between them
and positions by the control points. Derivatives go backwards: by the samples' q, qd, qdd first,
then by the control points and by the interval.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels.dynamics_data import DynamicsData
from ir_kernels.geometry import Geometry
from ir_kernels.reference import collision, dynamics
from ir_kernels.reference.descent import bending_metric, descend
from ir_kernels.spline_terms import SplineTerms, end_points, end_slopes
from ir_values.arrays import FloatArray, IntArray

SAMPLES = 2  # per interval
STILL = 0.01  # [rad/s] friction and |qd| are smoothed below
RAMP = 0.05  # share of the speed over which the step of the torque limit is smoothed
ABOUT = 100.0  # 1 / rad: a position limit overrun by 0.01 rad counts like a limit used twice
INTERVAL_WEIGHT = 4.0  # of the logarithm of the interval in the metric, against (rad/s)^2
HOLDING = 0.02  # against bending
STRAIGHT = 1e-12  # sine of a tilt at which no way back is nearer than another


@dataclass
class CostSamples:
    """q, qd, qdd (N, n) at N places, and derivatives of the cost by them and by the time between
    two.
    """

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray
    of_q: FloatArray
    of_qd: FloatArray
    of_qdd: FloatArray
    of_step: float = 0.0


def basis() -> FloatArray:
    """(3, SAMPLES, 4): weights of an interval's control points for position and two derivatives by
    u.
    """
    u = np.arange(SAMPLES) / SAMPLES
    v = 1.0 - u
    position = [
        v**3 / 6,
        (3 * u**3 - 6 * u**2 + 4) / 6,
        (-3 * u**3 + 3 * u**2 + 3 * u + 1) / 6,
        u**3 / 6,
    ]
    first = [-(v**2) / 2, (3 * u**2 - 4 * u) / 2, (-3 * u**2 + 2 * u + 1) / 2, u**2 / 2]
    second = [v, 3 * u - 2, 1 - 3 * u, u]
    weights: FloatArray = np.array([position, first, second]).transpose(0, 2, 1)
    return weights


def sampling(K: int) -> FloatArray:
    """(3, N, K): what the samples of all K - 3 intervals take of each control point."""
    weights = np.zeros((3, (K - 3) * SAMPLES, K))
    for i in range(K - 3):
        weights[:, i * SAMPLES : (i + 1) * SAMPLES, i : i + 4] = basis()
    return weights


def torque_limit(data: DynamicsData, speed: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Torque limit (N, n) at |speed|, and its slope; the step at the first speed is a ramp below
    it.
    """
    limit = np.empty_like(speed)
    slope = np.empty_like(speed)
    for j, (v, t) in enumerate(zip(data.envelope_speed, data.envelope_torque, strict=True)):
        at = np.append(v[0] * (1.0 - RAMP), v)
        torque = t
        if v[0] == 0.0:
            at = v
            torque = t[1:]
        limit[:, j] = np.interp(speed[:, j], at, torque)
        slopes = np.concatenate([[0.0], np.diff(torque) / np.diff(at), [0.0]])
        slope[:, j] = slopes[np.searchsorted(at, speed[:, j])]
    return limit, slope


def torques(data: DynamicsData, s: CostSamples) -> FloatArray:
    """Torque (N, n) of the motors, with friction that turns round smoothly."""
    speed = dynamics.motor_speed(data, s.qd)
    friction = data.viscous * speed + data.coulomb * speed / np.hypot(speed, STILL)
    arm = dynamics.rigid(data, s.q, s.qd, s.qdd) - dynamics.counterbalance(data, s.q)
    through = arm @ data.coupling.inverse if data.coupling.coupled else arm
    return through + data.rotor_inertia * dynamics.motor_speed(data, s.qdd) + friction


def torques_back(data: DynamicsData, s: CostSamples, of_torque: FloatArray) -> None:
    """Hand derivatives of the cost by the torques (N, n) on to positions, speeds and
    accelerations.
    """
    of_q, of_qd, of_qdd = dynamics.torque_gradients(data, s.q, s.qd, s.qdd)  # with viscous friction
    s.of_q += np.einsum("ki,kij->kj", of_torque, of_q)
    s.of_qd += np.einsum("ki,kij->kj", of_torque, of_qd)
    speed = dynamics.motor_speed(data, s.qd)
    of_speed = of_torque * data.coulomb * STILL**2 / np.hypot(speed, STILL) ** 3
    s.of_qd += of_speed @ data.coupling.turns
    s.of_qdd += np.einsum("ki,kij->kj", of_torque, of_qdd)


def bus(power: FloatArray, step: float, terms: SplineTerms) -> tuple[float, FloatArray, float]:
    """Joules at the mains for axis powers (N, n) held for `step` each, what a joule more adds (N,
    n), and what the smoothing adds per second of `step`.
    """
    if terms.regeneration == "none":
        value, slope, _ = above(power, terms.smoothing)
        return float(value.sum() * step), slope, 0.0
    wanted = power.sum(axis=1) * step
    back = float(terms.regeneration == "fed_back")
    most = terms.smoothing * step
    stored = 0.0
    mains = 0.0
    left = np.empty(len(power))  # in the capacitor, if it had no ends
    for k, joules in enumerate(wanted):
        left[k] = stored - joules
        lack = above(-left[k], most)[0]
        surplus = above(left[k] - terms.capacity_energy, most)[0]
        mains += float(lack - back * surplus)
        stored = float(left[k] + lack - surplus)
    # worth: of a joule more in the capacitor
    adds = np.empty(len(power))
    worth = 0.0
    of_most = 0.0
    lacks = above(-left, most)
    surpluses = above(left - terms.capacity_energy, most)
    for k in reversed(range(len(power))):
        of_most += float(lacks[2][k] * (1.0 - worth) - surpluses[2][k] * (back - worth))
        worth = float(
            worth * (1.0 - lacks[1][k] - surpluses[1][k]) + lacks[1][k] + back * surpluses[1][k]
        )
        adds[k] = worth
    return mains, np.repeat(adds[:, None], power.shape[1], axis=1), of_most * terms.smoothing


def above(x: FloatArray, smoothing: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """max(x, 0), a hyperbola that is `smoothing` above it at 0; its slope, derivative by the
    smoothing.
    """
    if smoothing == 0.0:
        return np.maximum(x, 0.0), (x > 0.0).astype(float), np.zeros_like(x)
    root = np.sqrt(x * x + 4.0 * smoothing * smoothing)
    return 0.5 * (x + root), 0.5 + 0.5 * x / root, 2.0 * smoothing / root


class SplineCost:
    """Cost of one robot in one scene. See ir_kernels.spline.SplineCost for what the methods
    promise.
    """

    def __init__(self, geometry: Geometry, data: DynamicsData, terms: SplineTerms) -> None:
        self.geometry = geometry
        self.data = data
        self.terms = terms

    def value(
        self, control: FloatArray, row: IntArray, interval: float
    ) -> tuple[float, FloatArray, float, float]:
        """Cost, gradient (K, n), derivative by the interval, energy [J].

        control (K, n): control points; row: of each interval that of its clearance terms;
        interval: between knots [s].
        """
        t = self.terms
        count = len(control) - 3
        step = interval / SAMPLES
        weights = sampling(len(control))
        weights[1] /= interval
        weights[2] /= interval**2
        zeros = np.zeros((count * SAMPLES, control.shape[1]))
        q, qd, qdd = weights @ control
        s = CostSamples(q, qd, qdd, zeros, zeros.copy(), zeros.copy())
        # as in the compiled core: inf and nan say it
        with np.errstate(over="ignore", invalid="ignore"):
            value, energy = self._drives(s, step)
            value += self._clearance(s, np.repeat(row, SAMPLES), step)
            value += self._tilt(s, step)
            gradient = weights[0].T @ s.of_q + weights[1].T @ s.of_qd + weights[2].T @ s.of_qdd

            # a longer interval: more steps' time, and slower by it
            of_interval = s.of_step / SAMPLES + t.time_value * count
            slower = float(np.sum(s.of_qd * s.qd + 2.0 * s.of_qdd * s.qdd))
            of_interval -= slower / interval
            value += t.time_value * count * interval
            for order, limit in ((3, t.jerk), (2, t.acceleration)):
                cost, slope, slope_of_interval = self._beyond(control, order, limit, interval)
                value = value + cost
                gradient = gradient + slope
                of_interval = of_interval + slope_of_interval

            # control points beyond the joint limits
            missing = np.maximum(t.low - control, control - t.high)
            over = ABOUT * np.maximum(missing, 0.0)
            squares = float(np.sum(over**2))
            value += t.penalty * interval * squares
            gradient += 2.0 * t.penalty * interval * ABOUT * over * np.sign(control - t.high)
            of_interval += t.penalty * squares
        return value, gradient, of_interval, energy

    def descend(
        self,
        control: FloatArray,
        row: IntArray,
        interval: float,
        fixed: bool,
        evaluations: int,
        tolerance: float,
        ends: FloatArray,
    ) -> tuple[FloatArray, float, float, int]:
        """New control (K, n), interval [s], value, evaluations; ends (2, 3, n), or none.

        ends: q, qd, qdd at both ends of a movement that starts or ends in motion, whose outer
        control points depend on the interval. fixed: the interval stays. The variables are the
        inner control points and the logarithm of the interval's ratio, which keeps it positive.
        """
        m = len(control) - 6
        n = control.shape[1]
        metric = bending_metric(m, HOLDING)

        def spline(x: FloatArray) -> tuple[FloatArray, float]:
            """All control points and the interval [s] of the variables."""
            with np.errstate(over="ignore"):
                now = interval * np.exp(x[-1])
            begin = control[:3]
            end = control[-3:]
            if ends.size:
                begin = end_points(ends[0], float(now))
                end = end_points(ends[1], float(now))
            return np.concatenate([begin, x[:-1].reshape(m, n), end]), float(now)

        def function(x: FloatArray) -> tuple[float, FloatArray]:
            """Cost of the variables, and its gradient by them."""
            points, now = spline(x)
            with np.errstate(divide="ignore", invalid="ignore"):
                value, gradient, of_interval, _ = self.value(points, row, now)
                for state, of_end in zip(ends, (gradient[:3], gradient[-3:]), strict=False):
                    of_interval += float(np.sum(end_slopes(state, now) * of_end))
            of_logarithm = 0.0 if fixed else of_interval * now
            return value, np.append(gradient[3:-3], of_logarithm)

        def solve(v: FloatArray) -> FloatArray:
            """A gradient as a step: by the metric of bending, not by single control points."""
            bent = np.linalg.solve(metric, v[:-1].reshape(m, n)) * self.terms.velocity**2
            return np.append(bent, v[-1] * INTERVAL_WEIGHT)

        start = np.append(control[3:-3], 0.0)
        x, value, used = descend(start, function, solve, evaluations, tolerance)
        points, now = spline(x)
        return points, now, value, used

    def _drives(self, s: CostSamples, step: float) -> tuple[float, float]:
        """Cost of energy and travel, of torque and speed beyond their limits; and the energy [J].

        Adds their slopes to those of the samples `s`, which are `step` s apart. One pass forward
        to the cost, then back: slopes by torque and motor speed, from these by q, qd and qdd.
        """
        t = self.terms
        data = self.data
        torque = torques(data, s)
        turning = dynamics.motor_speed(data, s.qd)
        limit, falls = torque_limit(data, np.abs(turning))
        allowed = limit * t.torque_share
        # near standstill friction may be as much more than it is with its smoothed sign
        unsure = data.coulomb * (STILL / np.hypot(turning, STILL)) ** 2
        use = (np.abs(torque) + unsure) / allowed
        too_much = np.maximum(use - 1.0, 0.0)
        too_fast = np.maximum(np.abs(s.qd) / t.velocity - 1.0, 0.0)
        travelled = t.travel * (np.hypot(s.qd, STILL) - STILL)
        rate = t.penalty * float(np.sum(too_much**2 + too_fast**2)) + float(np.sum(travelled))

        # slopes of the penalties and of travel
        weight = 2.0 * t.penalty * step * too_much
        of_torque = weight * np.sign(torque) / allowed
        s.of_qd += np.sign(s.qd) * (2.0 * t.penalty * step * too_fast / t.velocity)
        of_speed = -np.sign(turning) * (weight * use / limit * falls)
        slow = turning / np.hypot(turning, STILL) ** 2
        of_speed -= 2.0 * weight / allowed * unsure * slow
        s.of_qd += step * t.travel * s.qd / np.hypot(s.qd, STILL)

        # slopes of the energy
        power = dynamics.axis_power(data, s.qd, torque)
        energy, adds, of_step = bus(power, step, t)
        of_power = t.energy_value * step * adds
        copper_slope = 2.0 * data.copper_loss / data.gear_ratio**2 * torque
        of_torque += of_power * (turning + copper_slope)
        of_speed += of_power * torque
        s.of_qd += of_speed @ data.coupling.turns
        torques_back(data, s, of_torque)
        # without a common bus a slope stands for the share of its axis that counts, not for its
        # joules
        supplied = energy / step if t.regeneration == "none" else float(np.sum(adds * power))
        s.of_step += rate + t.energy_value * (supplied + of_step)
        return rate * step + t.energy_value * energy, energy

    def _clearance(self, s: CostSamples, row: IntArray, step: float) -> float:
        """Cost of pairs nearer than their threshold and the margin."""
        t = self.terms
        model = self.geometry
        if t.threshold.shape[1] == 0 or not np.isfinite(s.q).all():
            return 0.0
        poses = collision.poses(model, s.q)
        ends = collision.ends(model, poses)
        kept = t.threshold[row] + t.clearance_margin
        sample, pair = np.nonzero(collision.distances(model, ends) < kept)
        if len(sample) == 0:
            return 0.0
        found = collision.witnesses(model, ends[sample], pair)
        lacks = (kept[sample, pair] - found.distance) / t.clearance_scale
        slopes = collision.gradient(model, poses[sample], found, pair)
        weight = 2.0 * t.clearance_penalty * step * lacks / t.clearance_scale
        np.subtract.at(s.of_q, sample, weight[:, None] * slopes)
        rate = t.clearance_penalty * float(np.sum(lacks**2))
        s.of_step += rate
        return rate * step

    def _tilt(self, s: CostSamples, step: float) -> float:
        """Cost of an axis of the last link that leans too far from a direction of the world."""
        t = self.terms
        if t.tilt_max >= np.pi or not np.isfinite(s.q).all():
            return 0.0
        poses = collision.poses(self.geometry, s.q)
        axis = poses[:, -1, :3, :3] @ t.tilt_axis
        around = np.cross(axis, t.tilt_direction)
        sine = np.linalg.norm(around, axis=1)
        lacks = np.maximum(np.arctan2(sine, axis @ t.tilt_direction) - t.tilt_max, 0.0)
        lacks /= t.tilt_scale
        turning = np.einsum("kjab,jb->kja", poses[:, 1:, :3, :3], self.geometry.chain.joint_axis)
        slopes = -np.einsum("kja,ka->kj", turning, around) / np.maximum(sine, STRAIGHT)[:, None]
        slopes[sine <= STRAIGHT] = 0.0
        if self.geometry.chain.first_slides:
            slopes[:, 0] = 0.0
        s.of_q += (2.0 * t.clearance_penalty * step / t.tilt_scale) * lacks[:, None] * slopes
        rate = t.clearance_penalty * float(np.sum(lacks**2))
        s.of_step += rate
        return rate * step

    def _beyond(
        self, control: FloatArray, order: int, limit: FloatArray, interval: float
    ) -> tuple[float, FloatArray, float]:
        """Cost of derivatives of `order` beyond their limit (n,), and its own by control and
        interval.
        """
        difference = np.diff(np.eye(len(control)), order, axis=0) / interval**order
        derivative = difference @ control
        over = np.maximum(np.abs(derivative) / limit - 1.0, 0.0)
        slope = 2.0 * self.terms.penalty * interval * over / limit * np.sign(derivative)
        of_interval = (
            self.terms.penalty * float(np.sum(over**2))
            - order * float(np.sum(slope * derivative)) / interval
        )
        return (
            self.terms.penalty * interval * float(np.sum(over**2)),
            difference.T @ slope,
            of_interval,
        )
