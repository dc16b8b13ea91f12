"""Batched dynamics of a robot with its drives: one class, arrays (N, n) in and out.

tau = H qdd + C qd + g + J_r qdd + F_v qd + F_c sign(qd) - T_cb      (eq. 8)

Where motors turn with other joints than their own, rotors, friction, losses and limits are those of
the motors (`ir_kernels.coupling`).
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ir_kernels import compiled
from ir_kernels.arguments import finite, same_length, shaped
from ir_kernels.dynamics_data import (
    FURTHER_LOSSES,
    STANDARD_GRAVITY,
    LoadLike,
    RobotLike,
    dynamics_data,
)
from ir_kernels.errors import KernelError
from ir_kernels.limits import segments
from ir_kernels.reference import dynamics as reference
from ir_kernels.reference import enclosures
from ir_values.arrays import FloatArray

# What the axes take from the DC link at most, between samples too.


class PowerBounds(NamedTuple):
    """Of consecutive pieces of a trajectory: seconds (K,) that they last. In each the sum of the
    axes' powers is at every instant at most net (K,) W, the sum of those that take power at most
    taken (K,) W; rounding and Coulomb friction of either sign where a joint turns are included.
    """

    seconds: FloatArray
    net: FloatArray
    taken: FloatArray


def power_bounds(seconds: FloatArray, net: FloatArray, taken: FloatArray) -> PowerBounds:
    """The bounds, read-only; arrays (K,)."""
    for array in (seconds, net, taken):
        array.setflags(write=False)
    return PowerBounds(seconds, net, taken)


# What a proof of the torque limits says: per joint an upper bound of |tau| / limit over all
# times.

WITHIN = np.uint8(0)
EXCEEDS = np.uint8(1)
UNDECIDED = np.uint8(2)


class TorqueBounds(NamedTuple):
    """Enclosure of max over time of |tau(t)| / limit(qd(t)), per joint (n,).

    upper: never exceeded, rounding included. sampled: reached, at `time` s from the start of the
    trajectory; so sampled <= true maximum <= upper. verdict: WITHIN (upper <= 1: proved), EXCEEDS
    (sampled > 1), else UNDECIDED, which counts as not allowed. intervals: examined, the work. Where
    a moving joint's velocity may vanish, Coulomb friction of either sign counts (a speed below 1e-9
    rad/s is rest); a joint that rests through a segment has none.
    """

    upper: FloatArray
    sampled: FloatArray
    time: FloatArray
    verdict: NDArray[np.uint8]
    intervals: int

    @property
    def within(self) -> bool:
        """Whether the limits of all joints are proved."""
        return bool((self.verdict == WITHIN).all())


def torque_bounds(
    upper: FloatArray, sampled: FloatArray, time: FloatArray, intervals: int
) -> TorqueBounds:
    """The verdicts that follow from the bounds: upper, sampled (n,), time (n,) [s]."""
    verdict = np.where(upper <= 1.0, WITHIN, np.where(sampled > 1.0, EXCEEDS, UNDECIDED)).astype(
        np.uint8
    )
    for array in (upper, sampled, time, verdict):
        array.setflags(write=False)
    return TorqueBounds(upper, sampled, time, verdict, int(intervals))


MAX_TERMS = 8  # of a polynomial segment


class Gradients(NamedTuple):
    """Derivatives of a joint quantity y (torque, power): q, qd, qdd are (N, n, n), [k, i, j] = d
    y_i / d x_j.
    """

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray


class DynamicsModel:
    """Dynamics of `robot` (see `ir_kernels.data.Robot`) carrying `loads`, mounted at `base_pose` in
    the world.

    The world's z points up. Torques are those of the motors seen at the joint, Nm. Every method
    takes and returns C-contiguous (N, n) float64 arrays, N >= 1, and raises KernelError naming the
    argument that is not.
    """

    def __init__(
        self,
        robot: RobotLike,
        loads: Sequence[LoadLike] = (),
        base_pose: ArrayLike | None = None,
        gravity: float = STANDARD_GRAVITY,
        *,
        core: compiled.Core = compiled.MODULE,
    ) -> None:
        pose = np.eye(4) if base_pose is None else base_pose
        self.data = dynamics_data(robot, loads, pose, gravity)
        self.n = self.data.n
        self.coupling = self.data.coupling
        self.lossy = any(getattr(self.data, name).any() for name in FURTHER_LOSSES)
        self._core = (
            None if core is None or not hasattr(core, "Dynamics") else core.Dynamics(self.data)
        )

    def _run(self, function: str, **values: ArrayLike) -> Any:
        """Call the kernel; only when something it read is not finite are the arguments searched for
        it.
        """
        arrays = [shaped(name, value, None, self.n) for name, value in values.items()]
        if any(len(array) != len(arrays[0]) for array in arrays):
            same_length(**dict(zip(values, arrays, strict=True)))
        if self._core is not None:
            result, all_finite = getattr(self._core, function)(*arrays)
            if all_finite:
                return result
        for name, array in zip(values, arrays, strict=True):
            finite(name, array)
        return (
            result if self._core is not None else getattr(reference, function)(self.data, *arrays)
        )

    def inverse_dynamics(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> FloatArray:
        """Motor torque (N, n) Nm at the joint, with rotor inertia and friction, less the
        counterbalance.
        """
        return np.asarray(self._run("inverse_dynamics", q=q, qd=qd, qdd=qdd))

    def inverse_dynamics_at(self, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """`inverse_dynamics` of one state, float64 arrays (n,), for who needs it a thousand times a
        second: half the time.
        """
        if self._core is not None and q.shape == qd.shape == qdd.shape == (self.n,):
            torque, all_finite = self._core.inverse_dynamics(q[None], qd[None], qdd[None])
            if all_finite:
                return np.asarray(torque[0])
        return np.asarray(self.inverse_dynamics(q[None], qd[None], qdd[None])[0])

    def inverse_dynamics_single(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> FloatArray:
        """`inverse_dynamics` computed in single precision, in half the time; 1e-5 of the largest
        torque exact.

        For searches, not for proofs or reports. Without a compiled core it is `inverse_dynamics`.
        """
        return np.asarray(self._run("inverse_dynamics_single", q=q, qd=qd, qdd=qdd))

    def bias(self, q: ArrayLike, qd: ArrayLike) -> FloatArray:
        """C qd + g (N, n) Nm of the arm and its loads, without friction and counterbalance."""
        return np.asarray(self._run("bias", q=q, qd=qd))

    def gravity(self, q: ArrayLike) -> FloatArray:
        """Torque (N, n) Nm that holds arm and loads against gravity, without the counterbalance."""
        return np.asarray(self._run("gravity", q=q))

    def counterbalance(self, q: ArrayLike) -> FloatArray:
        """What the counterbalance does about each joint's +axis (N, n) Nm; zero for joints without
        one.
        """
        return np.asarray(self._run("counterbalance", q=q))

    def mass_matrix(self, q: ArrayLike) -> FloatArray:
        """H (N, n, n) kg m^2 of arm and loads, without rotor inertia."""
        return np.asarray(self._run("mass_matrix", q=q))

    def forward_dynamics(self, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> FloatArray:
        """Accelerations (N, n) rad/s^2 under motor torques `tau`, with H + J_r, friction and
        counterbalance.
        """
        return np.asarray(self._run("forward_dynamics", q=q, qd=qd, tau=tau))

    def torque_limit(self, qd: ArrayLike) -> FloatArray:
        """Torque (N, n) Nm available where joints turn at qd: the envelope of gear and motor."""
        return np.asarray(self._run("torque_limit", qd=qd))

    def axis_power(self, qd: ArrayLike, tau: ArrayLike) -> FloatArray:
        """Power (N, n) W each axis takes from the DC link: tau w + k_cu (tau / ratio)^2, with the
        losses of iron, inverter and gear that the robot has; negative while braking.
        """
        power = np.asarray(self._run("axis_power", qd=qd, tau=tau))
        return power + self.further_losses(qd, tau) if self.lossy else power

    def further_losses(self, qd: ArrayLike, tau: ArrayLike) -> FloatArray:
        """Losses (N, n) W that most data have at zero: k_fe w^2 + k_i |tau / ratio| + k_g |tau w| +
        P_0, w the speeds of the motors.
        """
        return self.losses_at(self.coupling.motors(np.asarray(qd, float)), tau)

    def losses_at(self, speed: FloatArray, tau: ArrayLike) -> FloatArray:
        """`further_losses` by the speeds (N, n) of the motors."""
        torque = np.abs(np.asarray(tau, float))
        d = self.data
        inverter = d.inverter_loss / np.abs(d.gear_ratio)
        by_torque = torque * (inverter + d.gear_loss * np.abs(speed))
        return np.asarray(d.iron_loss * (speed * speed) + by_torque + d.idle_loss)

    def drive_power(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> FloatArray:
        """Power (N, n) W each axis takes from the DC link along a motion: `axis_power` of
        `inverse_dynamics`.
        """
        return self.axis_power(qd, self.inverse_dynamics(q, qd, qdd))

    def torque_gradients(self, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike) -> Gradients:
        """Derivatives of `inverse_dynamics`, Nm per rad, rad/s, rad/s^2; Coulomb friction counts as
        constant.
        """
        return Gradients(*self._run("torque_gradients", q=q, qd=qd, qdd=qdd))

    def torque_bounds(
        self,
        coefficients: ArrayLike,
        durations: ArrayLike,
        tolerance: float = 0.01,
        max_intervals: int = 20000,
    ) -> TorqueBounds:
        """Enclose max |tau| / limit per joint along q(t) = sum_k c_k t^k: torque limits proved
        between samples too.

        coefficients (S, n, d + 1), d <= 7, lowest power first in the local time of each segment;
        durations (S,) s. Interval arithmetic over pieces of time that are halved until upper -
        sampled <= `tolerance` and every joint is decided, or `max_intervals` pieces are spent.
        Raises KernelError.
        """
        c, T = self._motion(coefficients, durations)
        if not tolerance > 0.0:
            raise KernelError(f"tolerance is {tolerance}: it has to be above 0")
        if self._core is None:
            return torque_bounds(
                *enclosures.torque_bounds(self.data, c, T, tolerance, max_intervals)
            )
        return torque_bounds(*self._core.torque_bounds(c, T, tolerance, max_intervals))

    def power_bounds(
        self, coefficients: ArrayLike, durations: ArrayLike, longest: float = 2e-3
    ) -> PowerBounds:
        """Bounds of the power that the axes take from the DC link along q(t) = sum_k c_k t^k, by
        interval arithmetic over pieces of at most `longest` s; half as long a piece leaves a fourth
        of the excess.

        coefficients (S, n, d + 1), d <= 7; durations (S,) s. Raises KernelError.
        """
        c, T = self._motion(coefficients, durations)
        if not longest > 0.0:
            raise KernelError(f"longest is {longest} s: it has to be above 0")
        if self._core is None:
            return power_bounds(*enclosures.power_bounds(self.data, c, T, longest))
        return power_bounds(*self._core.power_bounds(c, T, longest))

    def _motion(
        self, coefficients: ArrayLike, durations: ArrayLike
    ) -> tuple[FloatArray, FloatArray]:
        c, T = segments(coefficients, durations)
        if c.shape[1] != self.n or not 1 <= c.shape[2] <= MAX_TERMS:
            raise KernelError(
                f"coefficients has shape {c.shape}, expected (S, {self.n}, 1..{MAX_TERMS})"
            )
        return c, T
