"""Inverse and forward dynamics of a serial chain, written for reading: the oracle of the compiled
core.

tau = H(q) qdd + h(q, qd) + J_r qdd + F_v qd + F_c sign(qd) - T_cb(q)      (eq. 8; design: gravity
is part of h)

Where motors turn with other joints, w = T qd: tau = T^-T (H qdd + h - T_cb) + J_r T qdd + F_v w +
F_c sign(w) (`ir_kernels.coupling`).

Recursive Newton-Euler in link frames (Luh, Walker, Paul 1980), composite bodies for H (Walker, Orin
1982). Arrays q, qd, qdd, tau are (N, n); rad, rad/s, rad/s^2, Nm. A rail (`first_slides`) is
joint 1: m and N.
"""

from collections.abc import Callable, Sequence

import numpy as np

from ir_kernels.dynamics_data import CounterbalanceData, DynamicsData
from ir_kernels.reference.interval import (
    Matrix,
    Number,
    Vector,
    add,
    apply,
    cross,
    dot,
    joint_rotation,
    matrix,
    scale,
    transpose,
    vector,
)
from ir_values.arrays import FloatArray


def _outward(
    data: DynamicsData,
    sin: Sequence[Number],
    cos: Sequence[Number],
    qd: Sequence[Number],
    qdd: Sequence[Number],
) -> tuple[list[Matrix], list[Vector], list[Vector]]:
    """Rotation of each link in the one before, and force and moment that its motion takes, in its
    frame.
    """
    zero = qd[0] * 0.0
    spin: Vector = (zero, zero, zero)
    spin_rate: Vector = (zero, zero, zero)
    lift = vector(-data.gravity)
    acceleration: Vector = (zero + lift[0], zero + lift[1], zero + lift[2])
    rotations: list[Matrix] = []
    forces: list[Vector] = []
    moments: list[Vector] = []
    for i in range(data.n):
        axis = vector(data.axis[i])
        arm = vector(data.origin[i, :3, 3])
        com = vector(data.com[i])
        slides = data.first_slides and i == 0
        if slides:
            R = matrix(data.origin[i, :3, :3])
        else:
            R = joint_rotation(data.origin[i], data.axis[i], sin[i], cos[i])
        to_link = transpose(R)
        acceleration = add(acceleration, add(cross(spin_rate, arm), cross(spin, cross(spin, arm))))
        acceleration = apply(to_link, acceleration)
        if slides:
            acceleration = add(acceleration, scale(axis, qdd[i]))
        carried = apply(to_link, spin)
        relative = scale(axis, zero if slides else qd[i])
        turned = scale(axis, zero if slides else qdd[i])
        spin_rate = add(apply(to_link, spin_rate), add(turned, cross(carried, relative)))
        spin = add(carried, relative)
        of_com = add(acceleration, add(cross(spin_rate, com), cross(spin, cross(spin, com))))
        force = scale(of_com, float(data.mass[i]))
        inertia = matrix(data.inertia[i])
        moment = add(apply(inertia, spin_rate), cross(spin, apply(inertia, spin)))
        rotations.append(R)
        forces.append(force)
        moments.append(add(moment, cross(com, force)))
    return rotations, forces, moments


def rigid_body_torque(
    data: DynamicsData,
    sin: Sequence[Number],
    cos: Sequence[Number],
    qd: Sequence[Number],
    qdd: Sequence[Number],
) -> list[Number]:
    """H qdd + h per joint, for any kind of number (arrays, complex steps, intervals)."""
    rotations, forces, moments = _outward(data, sin, cos, qd, qdd)
    torque: list[Number] = [qd[0] * 0.0] * data.n
    for i in reversed(range(data.n)):
        axis = vector(data.axis[i])
        arm = vector(data.origin[i, :3, 3])
        torque[i] = dot(axis, forces[i] if data.first_slides and i == 0 else moments[i])
        if i > 0:
            force = apply(rotations[i], forces[i])
            forces[i - 1] = add(forces[i - 1], force)
            moments[i - 1] = add(
                moments[i - 1], add(apply(rotations[i], moments[i]), cross(arm, force))
            )
    return torque


def counterbalance_torque(
    data: CounterbalanceData,
    sin: Number,
    cos: Number,
    sqrt: Callable[..., Number],
    power: Callable[..., Number],
) -> Number:
    """Torque about the joint's +axis (positive lowers the arm), for any kind of number with its
    sqrt and power.
    """
    bx, bz = data.pivot
    ex, ez = data.rod_eye
    px = cos * ex + sin * ez
    pz = cos * ez - sin * ex
    # |P - B| with |P| constant
    length = sqrt(
        cos * (-2.0 * (bx * ex + bz * ez))
        + sin * (-2.0 * (bx * ez - bz * ex))
        + (bx * bx + bz * bz + ex * ex + ez * ez)
    )
    volume = (length - data.rod_length_at_charge) * (-data.piston_area) + data.gas_volume
    pressure = power(volume * (1.0 / data.gas_volume), -data.exponent) * data.charge_pressure
    return pressure * data.piston_area * (pz * bx - px * bz) * power(length, -1.0)


def counterbalance(data: DynamicsData, q: FloatArray) -> FloatArray:
    """What the counterbalance does about each joint's +axis (N, n); zero where there is none."""
    torque = np.zeros(q.shape, q.dtype)
    if data.counterbalance is not None:
        j = data.counterbalance.joint
        torque[:, j] = counterbalance_torque(
            data.counterbalance, np.sin(q[:, j]), np.cos(q[:, j]), np.sqrt, np.power
        )
    return torque


def rigid(data: DynamicsData, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
    """H qdd + h (N, n), the arm alone."""
    columns = rigid_body_torque(data, list(np.sin(q).T), list(np.cos(q).T), list(qd.T), list(qdd.T))
    return np.stack(columns, axis=1)


def friction(data: DynamicsData, qd: FloatArray) -> FloatArray:
    """F_v w + F_c sign(w) (N, n) of the motors, zero at rest."""
    speed = motor_speed(data, qd)
    return data.viscous * speed + data.coulomb * np.sign(speed.real)


def motor_speed(data: DynamicsData, qd: FloatArray) -> FloatArray:
    """What the motors turn (N, n) where the joints turn at qd; complex steps pass."""
    return qd @ data.coupling.turns.T if data.coupling.coupled else qd


def combined(matrix: FloatArray, numbers: Sequence[Number]) -> list[Number]:
    """A matrix (n, n) times any kind of number; nothing of what counts for nothing."""
    rows = []
    for row in matrix.tolist():
        terms = [x * share for share, x in zip(row, numbers, strict=True) if share != 0.0]
        total = terms[0]
        for term in terms[1:]:
            total = total + term
        rows.append(total)
    return rows


def inverse_dynamics(
    data: DynamicsData, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> FloatArray:
    """Torque (N, n) of the motors at the joint: with rotor inertia and friction, less the
    counterbalance.
    """
    arm = rigid(data, q, qd, qdd)
    if data.coupling.coupled:
        through = (arm - counterbalance(data, q)) @ data.coupling.inverse
        return through + data.rotor_inertia * (qdd @ data.coupling.turns.T) + friction(data, qd)
    return arm + data.rotor_inertia * qdd + friction(data, qd) - counterbalance(data, q)


inverse_dynamics_single = inverse_dynamics  # the compiled core has one in single precision


def gravity(data: DynamicsData, q: FloatArray) -> FloatArray:
    """Torque (N, n) that holds the arm against gravity, without the counterbalance."""
    zero = np.zeros_like(q)
    return rigid(data, q, zero, zero)


def bias(data: DynamicsData, q: FloatArray, qd: FloatArray) -> FloatArray:
    """h = C qd + g (N, n) of the arm."""
    return rigid(data, q, qd, np.zeros_like(q))


def mass_matrix(data: DynamicsData, q: FloatArray) -> FloatArray:
    """H (N, n, n) without rotor inertia, by composite bodies in the frame of link 0."""
    N, n = q.shape
    R = np.broadcast_to(np.eye(3), (N, 3, 3))
    p = np.zeros((N, 3))
    axes = np.empty((n, N, 3))
    origins = np.empty((n, N, 3))
    masses = np.empty((n, N))
    moments = np.empty((n, N, 3))
    inertias = np.empty((n, N, 3, 3))
    sin = np.sin(q)
    cos = np.cos(q)
    for i in range(n):
        slides = data.first_slides and i == 0
        p = p + R @ data.origin[i, :3, 3]
        # where a rail stands changes no inertia: it is left at 0
        local = joint_rotation(
            data.origin[i],
            data.axis[i],
            np.zeros(N) if slides else sin[:, i],
            np.ones(N) if slides else cos[:, i],
        )
        R = R @ np.moveaxis(np.array(local), 2, 0)
        com = p + R @ data.com[i]
        axes[i] = R @ data.axis[i]
        origins[i] = p
        masses[i] = data.mass[i]
        moments[i] = data.mass[i] * com
        inertias[i] = R @ data.inertia[i] @ np.swapaxes(R, 1, 2) + data.mass[i] * _about_origin(com)
    H = np.empty((N, n, n))
    for i in reversed(range(n)):
        if i < n - 1:  # the composite of all bodies from i outwards, about the origin of link 0
            masses[i] = masses[i] + masses[i + 1]
            moments[i] = moments[i] + moments[i + 1]
            inertias[i] = inertias[i] + inertias[i + 1]
        # momentum of the composite turning about axis i with unit speed, or sliding along it
        if data.first_slides and i == 0:
            H[:, 0, 0] = masses[0]
            break
        velocity = np.cross(origins[i], axes[i])
        linear = masses[i][:, None] * velocity + np.cross(axes[i], moments[i])
        angular = np.einsum("nij,nj->ni", inertias[i], axes[i]) + np.cross(moments[i], velocity)
        for j in range(i + 1):
            about_j = angular - np.cross(origins[j], linear)
            owed = linear if data.first_slides and j == 0 else about_j
            H[:, i, j] = H[:, j, i] = np.einsum("ni,ni->n", axes[j], owed)
    return H


def _about_origin(d: FloatArray) -> FloatArray:
    """|d|^2 1 - d d' (N, 3, 3)."""
    squared = np.einsum("ni,ni->n", d, d)[:, None, None] * np.eye(3)
    return np.asarray(squared - d[:, :, None] * d[:, None, :])


def forward_dynamics(
    data: DynamicsData, q: FloatArray, qd: FloatArray, tau: FloatArray
) -> FloatArray:
    """Accelerations (N, n) under the motor torques tau (N, n): (H + J_r) qdd = tau - h - friction +
    T_cb.
    """
    turns = data.coupling.turns
    given = (tau - friction(data, qd)) @ turns
    effort = given - bias(data, q, qd) + counterbalance(data, q)
    H = mass_matrix(data, q) + turns.T @ np.diag(data.rotor_inertia) @ turns
    return np.asarray(np.linalg.solve(H, effort[:, :, None])[:, :, 0])


def torque_limit(data: DynamicsData, qd: FloatArray) -> FloatArray:
    """Torque available at the speed |w| (N, n)."""
    limit = np.empty_like(qd)
    turning = np.abs(motor_speed(data, qd))
    for j in range(data.n):
        speeds = data.envelope_speed[j]
        torques = data.envelope_torque[j]
        speed = turning[:, j]
        limit[:, j] = np.where(speed < speeds[0], torques[0], np.interp(speed, speeds, torques[1:]))
    return limit


def axis_power(data: DynamicsData, qd: FloatArray, tau: FloatArray) -> FloatArray:
    """Power each axis takes from the DC link (N, n) W: mechanical plus copper losses, negative
    while braking.
    """
    return tau * motor_speed(data, qd) + data.copper_loss * (tau / data.gear_ratio) ** 2


STEP = 1e-100  # of the complex steps: so small that no digit is lost


def torque_gradients(
    data: DynamicsData, q: FloatArray, qd: FloatArray, qdd: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """d tau_i / d q_j, d qd_j, d qdd_j, each (N, n, n) [i, j], by complex steps: exact to
    rounding.
    """
    N, n = q.shape
    of_q = np.empty((N, n, n))
    of_qd = np.empty((N, n, n))
    for j in range(n):
        step = np.zeros((1, n), complex)
        step[0, j] = STEP * 1j
        of_q[:, :, j] = inverse_dynamics(data, q + step, qd, qdd).imag / STEP
        of_qd[:, :, j] = inverse_dynamics(data, q, qd + step, qdd).imag / STEP
    H = mass_matrix(data, q)
    if data.coupling.coupled:
        through = data.coupling.inverse.T @ H
        return of_q, of_qd, through + np.diag(data.rotor_inertia) @ data.coupling.turns
    return of_q, of_qd, H + np.diag(data.rotor_inertia)


# The drives' DC link, step by step: the oracle of the compiled scan.


def dc_bus(
    axis_power: FloatArray, dt: FloatArray, capacity: float, regeneration: str, stored: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mains W, dissipated W and stored J (N,) for axis_power (N, n) W; see
    `ir_kernels.power.dc_bus`.
    """
    N = len(axis_power)
    mains = np.empty(N)
    dissipated = np.zeros(N)
    level = np.empty(N)
    for k in range(N):
        if regeneration == "none":
            mains[k] = sum(max(p, 0.0) for p in axis_power[k])
            dissipated[k] = sum(max(-p, 0.0) for p in axis_power[k])
        else:
            net = float(sum(axis_power[k])) * dt[k]  # J that the axes want in this step
            moved = min(net, stored) if net > 0.0 else -min(-net, capacity - stored)
            stored -= moved
            rest = net - moved  # J that the capacitor could not give or take
            if rest < 0.0 and regeneration == "shared":
                dissipated[k] = -rest / dt[k]
                rest = 0.0
            mains[k] = rest / dt[k]
        level[k] = stored
    return mains, dissipated, level
