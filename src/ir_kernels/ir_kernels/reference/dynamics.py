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
    """Rotation of each link in the one before, and force [N] and moment [N m] that its motion
    takes, in its frame: from the base to the tool, every motion from that of the link before.

    Gravity is an acceleration of the base upwards: no link needs a weight of its own.
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

        # the origin of the link, still moved by the link before
        acceleration = add(acceleration, _of_rotation(spin, spin_rate, arm))
        if slides:
            R = matrix(data.origin[i, :3, :3])
            to_link = transpose(R)
            acceleration = add(apply(to_link, acceleration), scale(axis, qdd[i]))
            own_speed = zero
            own_rate = zero
        else:
            R = joint_rotation(data.origin[i], data.axis[i], sin[i], cos[i])
            to_link = transpose(R)
            acceleration = apply(to_link, acceleration)
            own_speed = qd[i]
            own_rate = qdd[i]

        # what the joint adds to the rotation that the link before carries it with
        carried = apply(to_link, spin)
        relative = scale(axis, own_speed)
        gyration = add(scale(axis, own_rate), cross(carried, relative))
        spin_rate = add(apply(to_link, spin_rate), gyration)
        spin = add(carried, relative)

        # Newton's and Euler's laws at the centre of mass
        of_com = add(acceleration, _of_rotation(spin, spin_rate, com))
        force = scale(of_com, float(data.mass[i]))
        inertia = matrix(data.inertia[i])
        momentum = apply(inertia, spin)
        moment = add(apply(inertia, spin_rate), cross(spin, momentum))
        rotations.append(R)
        forces.append(force)
        moments.append(add(moment, cross(com, force)))
    return rotations, forces, moments


def _of_rotation(spin: Vector, spin_rate: Vector, arm: Vector) -> Vector:
    """Acceleration of a point at `arm` from the origin of a body that turns: tangential and
    centripetal.
    """
    centripetal = cross(spin, cross(spin, arm))
    return add(cross(spin_rate, arm), centripetal)


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
    """H (N, n, n) [kg m^2, kg m, kg] at q (N, n) without rotor inertia, by composite bodies in the
    frame of link 0.

    Row i is the momentum of all links from i outwards while axis i alone moves with unit speed,
    seen from each axis j before it: composite bodies need one sum from the tool to the base.
    """
    N, n = q.shape
    axes, origins, masses, moments, inertias = _bodies_in_base(data, q)
    H = np.empty((N, n, n))
    for i in reversed(range(n)):
        if i < n - 1:  # the composite of all bodies from i outwards, about the origin of link 0
            masses[i] = masses[i] + masses[i + 1]
            moments[i] = moments[i] + moments[i + 1]
            inertias[i] = inertias[i] + inertias[i + 1]
        if data.first_slides and i == 0:
            H[:, 0, 0] = masses[0]
            break
        # momentum of the composite turning about axis i with unit speed
        velocity = np.cross(origins[i], axes[i])
        linear = masses[i][:, None] * velocity + np.cross(axes[i], moments[i])
        spin = np.einsum("nij,nj->ni", inertias[i], axes[i])
        angular = spin + np.cross(moments[i], velocity)
        for j in range(i + 1):
            slides = data.first_slides and j == 0
            along_j = linear if slides else angular - np.cross(origins[j], linear)
            H[:, i, j] = H[:, j, i] = np.einsum("ni,ni->n", axes[j], along_j)
    return H


def _bodies_in_base(
    data: DynamicsData, q: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Axes and origins (n, N, 3) of the joints at q (N, n), and of the links masses (n, N), mass
    times centre of mass (n, N, 3) and inertia (n, N, 3, 3): about the origin of link 0, in its
    frame.
    """
    N, n = q.shape
    axes = np.empty((n, N, 3))
    origins = np.empty((n, N, 3))
    masses = np.empty((n, N))
    moments = np.empty((n, N, 3))
    inertias = np.empty((n, N, 3, 3))
    sin = np.sin(q)
    cos = np.cos(q)
    R = np.broadcast_to(np.eye(3), (N, 3, 3))
    p = np.zeros((N, 3))
    for i in range(n):
        p = p + R @ data.origin[i, :3, 3]
        # where a rail stands changes no inertia: it is left at 0
        slides = data.first_slides and i == 0
        sine = np.zeros(N) if slides else sin[:, i]
        cosine = np.ones(N) if slides else cos[:, i]
        local = joint_rotation(data.origin[i], data.axis[i], sine, cosine)
        R = R @ np.moveaxis(np.array(local), 2, 0)
        com = p + R @ data.com[i]
        about_com = R @ data.inertia[i] @ np.swapaxes(R, 1, 2)
        axes[i] = R @ data.axis[i]
        origins[i] = p
        masses[i] = data.mass[i]
        moments[i] = data.mass[i] * com
        inertias[i] = about_com + data.mass[i] * _about_origin(com)
    return axes, origins, masses, moments, inertias


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
