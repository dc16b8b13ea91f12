"""A robot set on a linear unit: a chain of one joint more, the first, which slides [m]; the arm's
joints follow.

What no data sheet says of a linear unit is estimated here, from the mass that it moves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ir_description.robot.rail import Rail
from ir_description.robot.robot import RobotModel
from ir_values.errors import InvalidValueError

RAIL_LINK = "rail"
"""Link 0 of a robot on a rail: what stands still."""

_GRAVITY = 9.80665  # m/s^2
_ROLLING = 0.02  # Coulomb friction of profiled guides, rack and seals, as a share of the weight
_VISCOUS = 0.01  # and what full speed adds
_ROTOR = 0.15  # of the moved mass: rotor and gear as felt at the carriage
_MOTOR_SPEED = 2.0 * np.pi * 3000.0 / 60.0  # rad/s of the motor at full speed of the carriage
_SURPLUS = 1.5  # largest force over what friction and the acceleration limit take
_KNEE = 0.6  # of full speed: from here on the force falls
_AT_FULL_SPEED = 0.6  # of the largest force
_JERK_TIME = 0.1  # s to full acceleration
_ESTIMATED = "L"  # mark of a figure that is an estimate
_FIRST_PAIR = 2  # link of the arm from which on it can come to its own carriage


def on_rail(arm: RobotModel, rail: Rail) -> RobotModel:
    """The arm on the rail: its base is link 1, what it moves is all of its mass, its drive pushes.

    Raises InvalidValueError for a robot that is on a rail already, names that are taken, and for a
    controller with measured rests, which know no rail.
    """
    if arm.rail is not None:
        raise InvalidValueError(f"{arm.name} is on the rail {arm.rail.name} already")
    if rail.name in arm.joint_names:
        raise InvalidValueError(f"rail {rail.name}: the robot has a joint of this name")
    if RAIL_LINK in arm.link_names:
        raise InvalidValueError(f"the robot has a link {RAIL_LINK}, which the rail's own would be")

    # figures of the drive that aren't given are estimated from the mass that it moves
    moved = float(arm.link_mass.sum()) + arm.rated_payload + rail.carriage_mass
    coulomb = rail.friction_coulomb or _ROLLING * moved * _GRAVITY
    viscous = rail.friction_viscous or _VISCOUS * moved * _GRAVITY / rail.velocity
    reflected = rail.reflected_mass or _ROTOR * moved
    needed = (moved + reflected) * rail.acceleration + coulomb + viscous * rail.velocity
    force = rail.force or _SURPLUS * needed
    jerk = rail.jerk or rail.acceleration / _JERK_TIME
    ratio = rail.gear_ratio or _MOTOR_SPEED / rail.velocity
    speeds = rail.velocity * np.linspace(_KNEE, 1.0, arm.envelope_speed.shape[1])
    falls = np.linspace(1.0, _AT_FULL_SPEED, len(speeds))
    available = force * falls if rail.power == 0.0 else np.minimum(force, rail.power / speeds)

    # every link, joint and capsule of the arm has a number more than before
    balance = arm.counterbalance
    if balance is not None:
        balance = replace(balance, joint=balance.joint + 1)
    turns = np.eye(arm.n + 1)
    turns[1:, 1:] = arm.motor_turns
    arm_capsules = tuple(replace(own, link=own.link + 1) for own in arm.capsules)
    carriage = [rail.carriage_mass, arm.link_mass[0] + rail.carriage_mass]
    pairs = []
    for plate in rail.capsules:
        pairs += [(plate.name, own.name) for own in arm.capsules if own.link >= _FIRST_PAIR]
    place = f"links.{RAIL_LINK}"
    marks = {f"{place}.{figure}": _ESTIMATED for figure in ("mass_kg", "com_m", "inertia_kgm2")}
    return replace(
        arm,
        rail=rail,
        marks={**arm.marks, **marks},
        joint_names=(rail.name, *arm.joint_names),
        link_names=(RAIL_LINK, *arm.link_names),
        joint_origin=np.concatenate([np.eye(4)[None], arm.joint_origin]),
        joint_axis=np.concatenate([rail.axis[None], arm.joint_axis]),
        position_min=np.append(rail.low, arm.position_min),
        position_max=np.append(rail.high, arm.position_max),
        velocity_max=np.append(rail.velocity, arm.velocity_max),
        acceleration_max=np.append(rail.acceleration, arm.acceleration_max),
        jerk_max=np.append(jerk, arm.jerk_max),
        link_mass=np.concatenate([carriage, arm.link_mass[1:]]),
        link_com=np.concatenate([np.zeros((1, 3)), arm.link_com]),
        link_inertia=np.concatenate([arm.link_inertia[:1], arm.link_inertia]),
        gear_ratio=np.append(ratio, arm.gear_ratio),
        reflected_inertia=np.append(reflected, arm.reflected_inertia),
        friction_viscous=np.append(viscous, arm.friction_viscous),
        friction_coulomb=np.append(coulomb, arm.friction_coulomb),
        copper_loss=np.append(arm.copper_loss[0], arm.copper_loss),
        iron_loss=np.append(0.0, arm.iron_loss),
        inverter_loss=np.append(0.0, arm.inverter_loss),
        gear_loss=np.append(0.0, arm.gear_loss),
        idle_loss=np.append(0.0, arm.idle_loss),
        envelope_speed=np.concatenate([speeds[None], arm.envelope_speed]),
        envelope_torque=np.concatenate([[[force, *available]], arm.envelope_torque]),
        counterbalance=balance,
        capsules=(*rail.capsules, *arm_capsules),
        self_pairs=(*pairs, *arm.self_pairs),
        load_self_capsules=(*(plate.name for plate in rail.capsules), *arm.load_self_capsules),
        machine_home=np.append(rail.home, arm.machine_home),
        motor_turns=turns,
    )
