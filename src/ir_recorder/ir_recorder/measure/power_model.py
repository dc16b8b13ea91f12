"""Power at the mains from motion: DC link, losses, and derivatives by every power parameter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import exp, log1p

import numpy as np

from ir_description import PowerParameters, RobotModel
from ir_description.robot import IDLE, LINK, DcLink, centre_directions
from ir_msgs_py.modes import drive_bus_up
from ir_recorder.errors import RecorderError
from ir_recorder.measure.arm import ArmTorques, arm_torques, centre_torques
from ir_recorder.measure.samples import Samples
from ir_values.arrays import FloatArray

# The DC link as a tank of joules: a rectifier that only fills, a chopper that takes what is too
# much.
#
# The charge above the rectified mains is what the capacitors hold. The chopper switches at two
# voltages, between which a braking robot leaves the charge at random; here it is held in their
# middle, so that powers change steadily with the parameters. With the watts, their derivatives go
# through the same steps.

_SATURATED = 40.0  # beyond, a double is one of the two lines


@dataclass(frozen=True, eq=False)
class BusFlow:
    """Watts (N,) that the rectifier gives, their derivatives (N, P), and joules (N,) held after
    each step.
    """

    watts: FloatArray
    slopes: FloatArray
    charge: FloatArray


def bus_flow(
    link: DcLink,
    wanted: FloatArray,
    step: float,
    slopes: FloatArray | None = None,
    softness: float = 0.0,
    size: float = 1.0,
    by_size: FloatArray | None = None,
) -> BusFlow:
    """Run the link, empty at first, over N steps of `step` [s] in which the axes together want
    `wanted` (N,) W.

    slopes (N, P): derivatives of `wanted` by parameters.
    softness [J]: over which rectifier and chopper begin to conduct; 0: at once.
    size: times the joules that the link's data give it; by_size (P,): its own derivatives.
    """
    given = 0.5 * (_joules(link, link.chopper_on) + _joules(link, link.chopper_off))
    tangents = np.zeros((len(wanted), 0)) if slopes is None else slopes
    by_top = given * (np.zeros(tangents.shape[1]) if by_size is None else by_size)
    if softness > 0.0:
        return _soft_flow((size * given, by_top), wanted, step, tangents, softness)
    return _hard_flow((size * given, by_top), wanted, step, tangents)


Top = tuple[float, FloatArray]
"""Joules that the link holds at most, and their derivatives (P,)."""


def _hard_flow(limit: Top, wanted: FloatArray, step: float, tangents: FloatArray) -> BusFlow:
    """With switches that conduct at once.

    What the rectifier gives is what was wanted since the link was empty or full for the last time,
    less what it held then.
    """
    top, by_top = limit
    given = np.zeros(len(wanted))
    held = np.empty(len(wanted))
    since = np.zeros(len(wanted), int)  # the first step that is counted
    charge = 0.0
    begin = 0
    was_full = np.zeros(len(wanted), bool)
    full = False
    for k, joules in enumerate((wanted * step).tolist()):
        rest = charge - joules
        since[k] = begin
        was_full[k] = full
        if rest < 0.0:
            given[k] = -rest / step
            charge = 0.0
            begin = k + 1
            full = False
        elif rest > top:
            charge = top
            begin = k + 1
            full = True
        else:
            charge = rest
        held[k] = charge
    if not tangents.shape[1]:
        return BusFlow(given, tangents, held)
    rows = np.flatnonzero(given)
    sums = np.concatenate([np.zeros((1, tangents.shape[1])), np.cumsum(tangents, axis=0)])
    slopes = np.zeros_like(tangents)
    slopes[rows] = sums[rows + 1] - sums[since[rows]]
    slopes[rows[was_full[rows]]] -= by_top / step
    return BusFlow(given, slopes, held)


def _soft_flow(
    limit: Top, wanted: FloatArray, step: float, tangents: FloatArray, softness: float
) -> BusFlow:
    """The same with switches that conduct more and more: given = S ln(1 + exp(-rest / S)), S the
    softness.

    No kink stops a descent, however many samples change from one state of the link to another.
    """
    from scipy.linalg import solve_banded

    top, by_top = limit
    charge = 0.0
    given, held, conducts, passes, loses = np.empty((5, len(wanted)))
    for k, joules in enumerate((wanted * step).tolist()):
        rest = charge - joules
        filled, filling = _soft(-rest / softness)
        lost, losing = _soft((rest - top) / softness)
        charge = rest + softness * (filled - lost)
        given[k] = softness * filled / step
        held[k] = charge
        conducts[k] = filling
        passes[k] = 1.0 - filling - losing
        loses[k] = losing
    if not tangents.shape[1]:
        return BusFlow(given, tangents, held)
    # the charge's slope s after each step: s[k] - passes[k] s[k - 1] = what the step itself changes
    own = loses[:, None] * by_top - (step * passes)[:, None] * tangents
    bands = np.stack([np.ones(len(wanted)), np.append(-passes[1:], 0.0)])
    after = solve_banded((1, 0), bands, own, check_finite=False)
    before = np.concatenate([np.zeros((1, tangents.shape[1])), after[:-1]])
    given_slopes = (-conducts / step)[:, None] * (before - step * tangents)
    return BusFlow(given, given_slopes, held)


def _soft(x: float) -> tuple[float, float]:
    """ln(1 + e^x) and its derivative."""
    if abs(x) > _SATURATED:
        return max(x, 0.0), float(x > 0.0)
    power = exp(x)
    return log1p(power), power / (1.0 + power)


def _joules(link: DcLink, volts: float) -> float:
    """Above what the rectified mains keep in the capacitors."""
    return 0.5 * link.capacitance * (volts**2 - link.voltage**2)


# Watts at the mains that motion asks for, and how they change with every power parameter.
#
# Per axis: torque times speed, copper loss of the motor torque squared, inverter loss of its
# magnitude, iron loss of the speed squared; friction viscous, Coulomb, and a share of the torque
# through the gear. The axes share the DC link, which feeds idle inverters too; the rectifier's
# efficiency and the standing watts come on top.

STILL = 1e-3  # rad/s over which friction changes its sign


def friction_side(speed: FloatArray, step: float, travel: FloatArray) -> FloatArray:
    """The share (M, n), -1 to 1, of dry friction that acts at speeds (M, n) every `step` [s].

    After a reversal teeth and bearings give way before they slide: the share comes near its other
    end over `travel` (n,) rad (Dahl, "A solid friction model", 1968); with 0 it changes at once.
    """
    side = np.tanh(speed / STILL)
    gives = travel > 0.0
    if not gives.any():
        return side
    moved = speed[:, gives] * step
    kept = np.exp(-np.abs(moved) / travel[gives])
    pushed = (1.0 - kept) * np.sign(moved)
    share = np.zeros(int(gives.sum()))
    shares = np.empty_like(moved)
    for k in range(len(moved)):
        share = pushed[k] + kept[k] * share
        shares[k] = share
    side[:, gives] = shares
    return side


@dataclass(frozen=True, eq=False)
class Prepared:
    """Samples with the torques of their bodies and the speeds (M, n) of their motors, both as seen
    at the joints; side (M, n): of their dry friction; tool_watts (M,) W of the tool by its
    declaration; centres (2 n, M, n) Nm per metre that a link's centre of mass lies elsewhere, none
    where these are no parameters.
    """

    samples: Samples
    torques: ArmTorques
    speed: FloatArray
    side: FloatArray
    tool_watts: FloatArray
    centres: FloatArray

    def turning_over(self, travel: FloatArray) -> Prepared:
        """The same with dry friction that turns over a travel (n,) rad."""
        side = friction_side(self.speed, self.samples.step, travel)
        return replace(self, side=side)


class PowerModel:
    """Watts of one robot; `layout` names the parameters, the vectors of which the methods take;
    `bodies` computes torques at motion (3, N, n) as `arm_torques` does. robot: whose watts.
    """

    def __init__(
        self,
        robot: RobotModel,
        link: DcLink,
        base_pose: FloatArray,
        layout: PowerParameters,
        bodies: Callable[..., ArmTorques] = arm_torques,
    ) -> None:
        if layout.robot != robot.name or layout.joints != robot.joint_names:
            raise RecorderError(
                f"power parameters are of {layout.robot}, the robot is {robot.name}"
            )
        self.robot = robot
        self._link = link
        self._pose = base_pose
        self.layout = layout
        self._bodies = bodies
        self._ratio = np.array(robot.gear_ratio)

    def prepare(self, samples: Samples) -> Prepared:
        """Torques of the bodies at every sample; where the motion is unknown the robot counts as at
        rest.
        """
        count = len(samples)
        n = self.robot.n
        known = samples.known[:, None]
        motion = np.where(known, [samples.q, samples.qd, samples.qdd], 0.0)
        motion[0] = np.where(known, samples.q, self.robot.machine_home)
        links = np.zeros((count, n))
        held = np.zeros((count, n))
        rotors = np.zeros((count, n))
        spring = np.zeros((count, n))
        watts = np.zeros(count)
        modes_with_bus = [k for k, mode in enumerate(self.layout.modes) if drive_bus_up(mode)]
        bus_up = np.isin(samples.mode, modes_with_bus)
        for k in np.unique(samples.load):
            rows = samples.load == k
            loads = samples.loads[k] if k >= 0 else ()
            own = self._bodies(self.robot, loads, self._pose, motion[:, rows])
            links[rows] = own.links
            held[rows] = own.loads
            rotors[rows] = own.rotors
            spring[rows] = own.counterbalance
            watts[rows] = sum(load.watts(drive_bus=False) for load in loads)
            watts[rows & bus_up] = sum(load.watts(drive_bus=True) for load in loads)
        centres = np.zeros((0, count, n))
        if self.layout.centres:
            directions = centre_directions(self.robot)
            centres = centre_torques(self.robot, self._pose, motion, directions)
            centres = centres.reshape(-1, count, n)
        speed = motion[1]
        if self.robot.coupled:  # torques and speeds of the motors, not of the joints
            turns = self.robot.motor_turns
            to_motors = np.linalg.inv(turns)
            centres = centres @ to_motors
            links = links @ to_motors
            held = held @ to_motors
            spring = spring @ to_motors
            rotors = (motion[2] @ turns.T) * self.robot.reflected_inertia
            speed = motion[1] @ turns.T
        arm = ArmTorques(links, held, rotors, spring)
        side = friction_side(speed, samples.step, np.zeros(n))
        return Prepared(samples, arm, speed, side, watts, centres)

    def watts(self, mean: FloatArray, prepared: Prepared, softness: float = 0.0) -> FloatArray:
        """Predicted W (M,) at the mains for parameters `mean` (P,); softness [J]: that of
        `bus_flow`.
        """
        wanted = self._wanted(mean, prepared, None)
        size = self._one(mean, LINK)
        step = prepared.samples.step
        flow = bus_flow(self._link, wanted, step, softness=softness, size=size)
        return self._base(mean, prepared) + flow.watts / self._one(mean, "rectifier_efficiency")

    def watts_and_slopes(
        self, mean: FloatArray, prepared: Prepared, softness: float = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """The same with derivatives (M, P) by all parameters; softness [J]: that of `bus_flow`."""
        slopes = np.zeros((len(prepared.samples), len(mean)))
        wanted = self._wanted(mean, prepared, slopes)
        flow = bus_flow(
            self._link,
            wanted,
            prepared.samples.step,
            slopes,
            softness=softness,
            size=self._one(mean, LINK),
            by_size=np.asarray(np.array(self.layout.names) == LINK, float),
        )
        efficiency = self._one(mean, "rectifier_efficiency")
        result = flow.slopes / efficiency
        result[:, self.layout.index("rectifier_efficiency")] = -flow.watts / efficiency**2
        samples = prepared.samples
        for k, mode in enumerate(self.layout.modes):
            result[:, self.layout.index(f"watts.{mode}")] = samples.mode == k
        result[:, self.layout.index("drives_watts")] = samples.motors
        result[:, self.layout.index("tool_watts")] = prepared.tool_watts
        return self._base(mean, prepared) + flow.watts / efficiency, result

    def _one(self, mean: FloatArray, name: str) -> float:
        return float(mean[self.layout.index(name)])

    def _base(self, mean: FloatArray, prepared: Prepared) -> FloatArray:
        samples = prepared.samples
        modes = np.array([self._one(mean, f"watts.{mode}") for mode in self.layout.modes])
        watts = np.where(samples.mode >= 0, modes[samples.mode], 0.0)
        watts += self._one(mean, "drives_watts") * samples.motors
        return np.asarray(watts + self._one(mean, "tool_watts") * prepared.tool_watts)

    def torque(self, mean: FloatArray, prepared: Prepared) -> FloatArray:
        """Predicted Nm (M, n) of the motors, as seen at the joints."""
        return self._torque(mean, prepared)[2]

    def _bodies_of(
        self, mean: FloatArray, prepared: Prepared
    ) -> tuple[tuple[str, FloatArray], ...]:
        """What each factor of inertia or mass weighs, (M, n) Nm."""
        arm = prepared.torques
        shifts = mean[self.layout.centre_places()]
        links = arm.links
        if len(shifts):
            links = links + np.tensordot(shifts, prepared.centres, 1)
        return (
            ("link_mass", links),
            ("load_mass", arm.loads),
            ("rotor_inertia", arm.rotors),
            ("counterbalance", -arm.counterbalance),
        )

    def _torque(
        self, mean: FloatArray, prepared: Prepared
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Torque (M, n) through the gears, side of the friction, and torque of the motors."""
        of = self.layout.places
        viscous, coulomb, gear = (mean[of(term)] for term in ("viscous", "coulomb", "gear"))
        qd = prepared.speed
        through = np.asarray(
            sum(self._one(mean, name) * body for name, body in self._bodies_of(mean, prepared))
        )
        side = prepared.side
        return through, side, through + viscous * qd + (coulomb + gear * np.abs(through)) * side

    def _wanted(
        self, mean: FloatArray, prepared: Prepared, slopes: FloatArray | None
    ) -> FloatArray:
        """W (M,) that the axes together take from the link; fills `slopes` (M, P) where given."""
        of = self.layout.places
        copper = mean[of("copper")]
        iron = mean[of("iron")]
        inverter = mean[of("inverter")]
        gear = mean[of("gear")]
        qd = prepared.speed
        on = prepared.samples.motors[:, None]
        through, side, torque = self._torque(mean, prepared)
        motor = torque / self._ratio
        axes = torque * qd + copper * motor**2 + inverter * np.abs(motor) + iron * qd**2
        if slopes is not None:
            by_motor = 2.0 * copper * motor + inverter * np.sign(motor)
            by_torque = on * (qd + by_motor / self._ratio)
            slopes[:, of("viscous")] = by_torque * qd
            slopes[:, of("coulomb")] = by_torque * side
            slopes[:, of("gear")] = by_torque * np.abs(through) * side
            slopes[:, of("copper")] = on * motor**2
            slopes[:, of("inverter")] = on * np.abs(motor)
            slopes[:, of("iron")] = on * qd**2
            by_body = by_torque * (1.0 + gear * np.sign(through) * side)
            for name, body in self._bodies_of(mean, prepared):
                slopes[:, self.layout.index(name)] = (by_body * body).sum(axis=1)
            mass = self._one(mean, "link_mass")
            by_centre = np.einsum("mn,kmn->mk", by_body, prepared.centres)
            slopes[:, self.layout.centre_places()] = mass * by_centre
            slopes[:, self.layout.index(IDLE)] = prepared.samples.motors
        idle = self._one(mean, IDLE) * prepared.samples.motors
        return np.asarray((on * axes).sum(axis=1) + idle)
