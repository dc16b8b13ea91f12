"""A rail under the arm: a first joint that slides, against independent libraries, against the same
arm that stands where the rail brings it, and against differences.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio
import pytest
from _coal_shapes import CoalScene
from builds import every_build
from geometry_cases import (
    CAPSULES,
    COLUMNS,
    KR210,
    OPEN,
    SELF_PAIRS,
    TCP,
    Body,
    Capsule,
    every_kind,
    random_pose,
)
from robots import (
    RobotLiteral,
    coupled,
    kr210,
    on_a_rail,
    random_chain,
    random_rotation,
    tool_155,
)
from spline_cases import motion, terms

from ir_kernels import Chain, CollisionModel, DynamicsModel, KernelError, SplineCost
from ir_kernels.ccd import ccd
from ir_kernels.geometry import COLLIDES, FREE
from ir_kernels.inverse_kinematics import RailIk, inverse_kinematics
from ir_kernels.reference import dynamics as reference
from ir_kernels.reference.model import Model
from ir_kernels.wrist_geometry import wrist_geometry
from ir_values.arrays import FloatArray

ROUNDING = 1e-12  # m and relative: sums of a few dozen roundings over ten metres
AGREEMENT = 1e-9  # relative to the largest torque of the batch
ITERATED = 1e-6  # m: to what Coal iterates
CASES = ("kr210", "kr210 with tool", "random 3", "coupled 6", "random 9")


@dataclass(frozen=True)
class Case:
    """An arm, and it on a rail: joint_origin of its first joint in the carriage, base poses."""

    arm: RobotLiteral
    railed: RobotLiteral
    loads: tuple[Any, ...]
    base: FloatArray

    def base_at(self, place: float) -> FloatArray:
        """Pose (4, 4) of the carriage in the world where the rail is at `place` [m]."""
        moved = np.eye(4)
        moved[:3, 3] = place * self.railed.joint_axis[0]
        return np.asarray(self.base @ self.railed.joint_origin[0] @ moved)

    def standing(self) -> RobotLiteral:
        """What stands on the carriage, without the rail."""
        return replace(self.arm, joint_origin=self.railed.joint_origin[1:])


def case_of(name: str) -> Case:
    rng = np.random.default_rng(len(name))
    kind, *more = name.split()
    arm = kr210() if kind == "kr210" else random_chain(rng, int(more[0]))
    arm = coupled(arm, 1) if kind == "coupled" else arm
    along = rng.normal(size=3)
    along /= np.linalg.norm(along)
    loads = (tool_155(),) if "tool" in name else ()
    return Case(arm, on_a_rail(arm, random_pose(rng), along), loads, random_pose(rng))


def batch(seed: int, n: int, N: int = 37) -> tuple[FloatArray, FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    return rng.uniform(-3, 3, (N, n)), rng.normal(size=(N, n)), 2.0 * rng.normal(size=(N, n))


def relative(a: FloatArray, b: FloatArray) -> float:
    return float(np.abs(a - b).max() / np.abs(b).max())


def in_pinocchio(case: Case) -> pinocchio.Model:
    model = pinocchio.Model()
    model.gravity.linear = np.array([0.0, 0.0, -9.80665])
    parent = 0
    robot = case.railed
    for i, (origin, axis) in enumerate(zip(robot.joint_origin, robot.joint_axis, strict=True)):
        pose = case.base @ origin if i == 0 else origin
        joint = (
            pinocchio.JointModelPrismaticUnaligned(axis)
            if i == 0
            else pinocchio.JointModelRevoluteUnaligned(axis)
        )
        placement = pinocchio.SE3(pose[:3, :3].copy(), pose[:3, 3].copy())
        parent = model.addJoint(parent, joint, placement, f"joint_{i}")
        own = pinocchio.Inertia(
            robot.link_mass[i + 1], robot.link_com[i + 1], robot.link_inertia[i + 1]
        )
        model.appendBodyToJoint(parent, own, pinocchio.SE3.Identity())
    for load in case.loads:
        inertia = pinocchio.Inertia(load.mass, load.com, load.inertia)
        model.appendBodyToJoint(parent, inertia, pinocchio.SE3.Identity())
    return model


@pytest.mark.parametrize("name", CASES)
def test_poses_and_jacobian_are_those_of_pinocchio(name: str) -> None:
    case = case_of(name)
    chain = Chain(case.railed, case.base, TCP)
    q, qd, _ = batch(2, chain.n)
    model = in_pinocchio(case)
    data = model.createData()
    poses = chain.link_poses(q)
    tcp = chain.tcp_poses(q)
    twist = np.einsum("kij,kj->ki", chain.jacobian(q), qd)
    for row, (place, speed) in enumerate(zip(q, qd, strict=True)):
        pinocchio.forwardKinematics(model, data, place, speed)
        theirs = np.array([each.homogeneous for each in data.oMi])[1:]
        np.testing.assert_allclose(poses[row, 1:], theirs, rtol=0.0, atol=10 * ROUNDING)
        velocity = pinocchio.getVelocity(model, data, chain.n, pinocchio.LOCAL_WORLD_ALIGNED)
        lever = tcp[row, :3, 3] - theirs[-1, :3, 3]
        linear = velocity.linear + np.cross(velocity.angular, lever)
        np.testing.assert_allclose(twist[row, :3], linear, rtol=0.0, atol=1e-10)
        np.testing.assert_allclose(twist[row, 3:], velocity.angular, rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("name", CASES)
def test_dynamics_are_those_of_pinocchio(core: Any, name: str) -> None:
    case = case_of(name)
    robot = replace(case.railed, motor_turns=np.eye(len(case.railed.joint_axis)))
    ours = DynamicsModel(robot, case.loads, case.base, core=core)
    model = in_pinocchio(case)
    data = model.createData()
    q, qd, qdd = batch(1, ours.n)
    motors = (
        robot.reflected_inertia * qdd
        + robot.friction_viscous * qd
        + robot.friction_coulomb * np.sign(qd)
    )
    arm = ours.inverse_dynamics(q, qd, qdd) - motors + ours.counterbalance(q)
    rows = list(zip(q, qd, qdd, strict=True))
    theirs = np.array([pinocchio.rnea(model, data, *row) for row in rows])
    assert relative(arm, theirs) < AGREEMENT
    upper = np.array([np.triu(pinocchio.crba(model, data, row)) for row in q])
    inertia = upper + np.swapaxes(np.triu(upper, 1), 1, 2)
    assert relative(ours.mass_matrix(q), inertia) < AGREEMENT
    bias = np.array([pinocchio.nonLinearEffects(model, data, a, b) for a, b, _ in rows])
    assert relative(ours.bias(q, qd), bias) < AGREEMENT


@pytest.mark.parametrize("name", CASES)
def test_motors_forward_dynamics_and_derivatives_agree_with_the_reference(
    compiled_core: Any, name: str
) -> None:
    case = case_of(name)
    model = DynamicsModel(case.railed, case.loads, case.base, core=compiled_core)
    q, qd, qdd = batch(3, model.n)
    data = model.data
    torque = model.inverse_dynamics(q, qd, qdd)
    assert relative(torque, reference.inverse_dynamics(data, q, qd, qdd)) < 1e-11
    single = model.inverse_dynamics_single(q, qd, qdd)
    assert relative(single, torque) < 1e-5
    assert relative(model.forward_dynamics(q, qd, torque), qdd) < AGREEMENT
    ours = model.torque_gradients(q, qd, qdd)
    theirs = reference.torque_gradients(data, q, qd, qdd)
    for mine, other in zip((ours.q, ours.qd, ours.qdd), theirs, strict=True):
        assert relative(mine, other) < AGREEMENT
    assert (ours.q[:, :, 0] == 0.0).all()  # where the rail stands changes no torque


@pytest.mark.parametrize("name", CASES)
def test_an_arm_on_a_rail_at_rest_is_the_arm_that_stands_there(core: Any, name: str) -> None:
    case = case_of(name)
    railed = DynamicsModel(case.railed, case.loads, case.base, core=core)
    q, qd, qdd = batch(4, railed.n)
    qd[:, 0] = qdd[:, 0] = 0.0
    base = case.base_at(0.0)
    arm = DynamicsModel(case.standing(), case.loads, base, core=core)
    mine = railed.inverse_dynamics(q, qd, qdd)[:, 1:]
    alone = arm.inverse_dynamics(*(np.ascontiguousarray(each[:, 1:]) for each in (q, qd, qdd)))
    # the products of three rotations are rounded in another order
    assert relative(mine, alone) < 1e-13
    chain = Chain(case.railed, case.base, TCP)
    for place, row in zip(q[:5, 0], q[:5], strict=True):
        there = Chain(case.standing(), case.base_at(float(place)), TCP)
        poses = there.link_poses(row[None, 1:].copy())
        ours = chain.link_poses(row[None])[:, 1:]
        np.testing.assert_allclose(ours, poses, rtol=0.0, atol=ROUNDING)


def test_the_arm_alone_and_on_a_straight_rail_agree_bit_by_bit(core: Any) -> None:
    """Without a turn of frames the recursion is the same, number by number."""
    arm = kr210()
    railed = replace(
        on_a_rail(arm, np.eye(4), np.array([0.0, 1.0, 0.0])),
        joint_origin=np.concatenate([np.eye(4)[None], arm.joint_origin]),
    )
    q, qd, qdd = batch(5, 7)
    qd[:, 0] = qdd[:, 0] = 0.0
    torque = DynamicsModel(railed, (tool_155(),), core=core).inverse_dynamics(q, qd, qdd)[:, 1:]
    alone = DynamicsModel(arm, (tool_155(),), core=core)
    own = (np.ascontiguousarray(each[:, 1:]) for each in (q, qd, qdd))
    assert np.array_equal(torque, alone.inverse_dynamics(*own))


def test_moving_cell_and_rail_together_changes_nothing(core: Any) -> None:
    case = case_of("kr210 with tool")
    q, qd, qdd = batch(6, 7)
    turn = np.eye(4)
    turn[:2, :2] = [[0.8, -0.6], [0.6, 0.8]]  # about the vertical
    turn[:3, 3] = [2.0, -1.0, 0.4]
    here = DynamicsModel(case.railed, case.loads, case.base, core=core)
    there = DynamicsModel(case.railed, case.loads, turn @ case.base, core=core)
    assert relative(there.inverse_dynamics(q, qd, qdd), here.inverse_dynamics(q, qd, qdd)) < 1e-12
    bodies = every_kind(np.random.default_rng(1))
    moved = [replace(body, pose=turn @ body.pose) for body in bodies]
    ours = collision_of(case, bodies).distances(q)
    also = collision_of(replace(case, base=turn @ case.base), tuple(moved))
    np.testing.assert_allclose(also.distances(q), ours, rtol=0.0, atol=1e-11)


def carried() -> tuple[Capsule, ...]:
    """The capsules of the KR 210 on a carriage, which has one, and of the rail's end, which
    doesn't move.
    """
    own = tuple(replace(each, link=each.link + 1) for each in CAPSULES)
    plate = Capsule("carriage", 1, np.array([-0.4, 0.0, -0.1]), np.array([0.4, 0.0, -0.1]), 0.1)
    end = Capsule("rail_end", 0, np.array([0.0, 0.0, -0.4]), np.array([0.3, 0.0, -0.4]), 0.1)
    return (*own, plate, end)


def collision_of(case: Case, bodies: tuple[Body, ...]) -> CollisionModel:
    pairs = (*SELF_PAIRS, ("rail_end", "l3b"), ("rail_end", "l4"))
    there = [body.name for body in bodies if body.name == "floor"]
    ignored = [(own, floor) for own in ("base", "carriage") for floor in there]
    return CollisionModel(Chain(case.railed, case.base, TCP), carried(), bodies, pairs, ignored)


def on_flat_ground() -> Case:
    arm = kr210()
    railed = on_a_rail(arm, np.eye(4), np.array([0.0, 1.0, 0.0]))
    origin = np.concatenate([np.eye(4)[None], arm.joint_origin])
    return Case(arm, replace(railed, joint_origin=origin), (tool_155(),), np.eye(4))


def places(seed: int, count: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    low = np.concatenate([[-3.0], KR210.position_min])
    high = np.concatenate([[3.0], KR210.position_max])
    return rng.uniform(low, high, (count, 7))


SCENES = (OPEN, COLUMNS, every_kind(np.random.default_rng(3)))


@pytest.mark.parametrize("bodies", SCENES)
def test_distances_agree_with_coal_and_with_the_reference(bodies: tuple[Body, ...]) -> None:
    case = on_flat_ground()
    model = collision_of(case, bodies)
    theirs = CoalScene(carried(), bodies, gjk_tolerance=1e-9)
    q = places(7, 40)
    ours = model.distances(q)
    poses = model.chain.link_poses(q)
    expected = np.array(
        [[theirs.distance(*pair, links) for pair in model.pairs] for links in poses]
    )
    apart = expected > 0.0
    np.testing.assert_allclose(ours[apart], expected[apart], rtol=0.0, atol=ITERATED)
    assert not ((ours > ITERATED) & (expected < -ITERATED)).any()
    plain = Model(model._geometry)
    np.testing.assert_allclose(ours, plain.distances(q), rtol=0.0, atol=1e-10)
    near = model.min_distance(q)
    np.testing.assert_allclose(near.distance, ours.min(axis=1), rtol=0.0, atol=1e-10)


@pytest.mark.parametrize("bodies", SCENES)
def test_gradients_of_distances_are_those_of_differences(bodies: tuple[Body, ...]) -> None:
    model = collision_of(on_flat_ground(), bodies)
    q = places(8, 60)
    pair = model.min_distance(q).pair
    slope = model.gradients(q, pair)
    step = 1e-6
    for j in range(7):
        moved = np.zeros(7)
        moved[j] = step
        rows = np.arange(len(q))
        difference = (
            model.distances(q + moved)[rows, pair] - model.distances(q - moved)[rows, pair]
        ) / (2.0 * step)
        smooth = np.abs(difference - slope[:, j]) < 1e-4
        assert smooth.mean() > 0.9  # the others stand at a kink
    assert np.abs(slope[:, 0]).max() > 0.1


@pytest.mark.sampled
@pytest.mark.parametrize("bodies", SCENES)
def test_dense_samples_contradict_no_verdict(bodies: tuple[Body, ...]) -> None:
    model = collision_of(on_flat_ground(), bodies)
    start = places(9, 100)
    rng = np.random.default_rng(10)
    goal = start + rng.uniform(-1.0, 1.0, start.shape) * np.array([1.5, *np.full(6, 0.5)])
    goal[:20, 1:] = start[:20, 1:]  # the rail alone
    found = model.certify_edges(start, goal, 0.01)
    share = np.linspace(0.0, 1.0, 201)
    for row in range(len(start)):
        q = start[row] + share[:, None] * (goal[row] - start[row])
        least = (model.distances(q) - 0.01).min(axis=1)
        before = share < found.t0[row]
        assert (least[before] > -1e-9).all()
        if found.verdict[row] == COLLIDES:
            at = start[row] + found.t1[row] * (goal[row] - start[row])
            assert (model.distances(at[None]) - 0.01).min() <= 1e-9
    assert (found.verdict == FREE).sum() > 10
    assert (found.verdict == COLLIDES).sum() > 10


@pytest.mark.parametrize("bodies", SCENES)
def test_verdicts_of_trajectories_are_those_of_dense_samples_and_bounds_hold(
    bodies: tuple[Body, ...],
) -> None:
    model = collision_of(on_flat_ground(), bodies)
    free = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        c = np.zeros((3, 7, 4))
        c[0, :, 0] = places(seed, 1)[0]
        c[:, :, 1:] = rng.uniform(-0.3, 0.3, (3, 7, 3))
        c[:, 0, 1:] *= 3.0
        for k in (1, 2):
            c[k, :, 0] = c[k - 1].sum(axis=1)
        found = model.certify_trajectory(c, np.ones(3), 0.0)
        u = np.linspace(0.0, 1.0, 101)[:, None] ** np.arange(4)
        q = np.concatenate([u @ each.T for each in c])
        least = model.distances(q).min(axis=1)
        if found.verdict == FREE:
            free += 1
            assert least.min() >= found.lower_bound > 0.0
        elif found.verdict == COLLIDES:
            whole = min(int(found.interval[1]), 2)
            at = c[whole] @ (found.interval[1] - whole) ** np.arange(4.0)
            assert model.distances(at[None]).min() <= 1e-9
    assert free > 1


def test_a_thin_plate_across_the_rail_is_found() -> None:
    plate = Body("plate", "box", np.eye(4), np.array([20.0, 2e-3, 20.0]))
    model = collision_of(on_flat_ground(), (plate,))
    q = np.zeros((1, 7))
    q[0, 2:4] = [-1.5, 1.5]
    start = q - 3.0 * np.eye(7)[:1]
    goal = q + 3.0 * np.eye(7)[:1]
    assert model.certify_edges(start, goal, 0.0).verdict[0] == COLLIDES
    assert model.certify_edges(start, start + 0.5 * np.eye(7)[:1], 0.0).verdict[0] == FREE


@every_build("seed", [(seed,) for seed in range(3)], few=0)
def test_torque_bounds_hold_and_powers_are_enclosed(core: Any, seed: int) -> None:
    case = case_of("kr210 with tool")
    model = DynamicsModel(case.railed, case.loads, case.base, core=core)
    rng = np.random.default_rng(seed)
    c = rng.normal(0.0, 0.3, (2, 7, 5))
    c[1, :, 0] = c[0].sum(axis=1)
    bounds = model.torque_bounds(c, np.ones(2))
    power = model.power_bounds(c, np.ones(2), longest=0.01)
    order = np.arange(5)
    u = np.linspace(0.0, 1.0, 501)[:, None]
    ends = np.cumsum(power.seconds)
    for k in range(2):
        q = u**order @ c[k].T
        qd = (order[1:] * u ** order[:-1]) @ c[k, :, 1:].T
        qdd = (order[2:] * order[1:-1] * u ** order[:-2]) @ c[k, :, 2:].T
        torque = model.inverse_dynamics(q, qd, qdd)
        use = np.abs(torque) / model.torque_limit(qd)
        assert (use.max(axis=0) <= bounds.upper).all()
        net = model.axis_power(qd, torque).sum(axis=1)
        piece = np.minimum(np.searchsorted(ends, k + u[:, 0]), len(ends) - 1)
        near = np.maximum(power.net[piece], power.net[np.maximum(piece - 1, 0)])
        assert (net <= near + 1e-6).all()


def test_power_is_torque_times_speed_and_losses_and_energy_closes(core: Any) -> None:
    """The work of all motors is what the bodies gain, and what friction and weight take."""
    case = case_of("kr210 with tool")
    model = DynamicsModel(case.railed, case.loads, case.base, core=core)
    q = np.array([[0.3, 0.2, -1.4, 1.3, 0.1, 0.5, 0.2]])
    h = 1e-4
    t = np.arange(0.0, 1.0 + h / 2, h)[:, None]
    s = t**3 * (10.0 - 15.0 * t + 6.0 * t**2)
    sd = 30.0 * t**2 * (1.0 - t) ** 2
    sdd = 60.0 * t * (1.0 - 3.0 * t + 2.0 * t**2)
    by = np.array([[1.2, 0.5, 0.3, -0.2, 0.6, 0.4, -0.5]])
    path = (q + s * by, sd * by, sdd * by)
    torque = model.inverse_dynamics(*path)
    work = float(np.trapezoid((torque * path[1]).sum(axis=1), dx=h))
    friction = np.trapezoid(
        (case.railed.friction_viscous * path[1] + case.railed.friction_coulomb * np.sign(path[1]))
        * path[1],
        dx=h,
        axis=0,
    ).sum()
    helped = float(np.trapezoid((model.counterbalance(path[0]) * path[1]).sum(axis=1), dx=h))
    heights = []
    chain = Chain(case.railed, case.base)
    for row in (path[0][:1], path[0][-1:]):
        links = chain.link_poses(row)[0]
        own = np.einsum("kij,kj->ki", links[:, :3, :3], case.railed.link_com) + links[:, :3, 3]
        load = case.loads[0]
        hand = links[-1, :3, :3] @ load.com + links[-1, :3, 3]
        masses = case.railed.link_mass[1:]
        heights.append(float(masses @ own[1:, 2] + load.mass * hand[2]))
    lifted = 9.80665 * (heights[1] - heights[0])
    assert work == pytest.approx(lifted + friction - helped, rel=1e-6)


@pytest.mark.sampled
@pytest.mark.parametrize("name", ["kr210 with tool", "random 3", "coupled 6"])
def test_the_cost_of_a_spline_and_its_derivatives_agree_with_the_reference(
    compiled_core: Any, name: str
) -> None:
    case = case_of(name)
    if case.arm.name.startswith("kr210"):
        flat = on_flat_ground()
        robot = flat.railed
        collision = collision_of(flat, COLUMNS)
        dynamics = DynamicsModel(robot, flat.loads, flat.base)
    else:
        robot = case.railed
        capsules = [
            Capsule(f"c{k}", k, np.full(3, 0.05 * k), np.full(3, -0.1), 0.05)
            for k in range(1, len(robot.joint_axis) + 1)
        ]
        bodies = every_kind(np.random.default_rng(2))
        collision = CollisionModel(Chain(robot, case.base), capsules, bodies, [("c1", "c3")])
        dynamics = DynamicsModel(robot, (), case.base)
    n = dynamics.n
    middle = 0.5 * (robot.position_min + robot.position_max)
    control = motion(3, 12, n, around=middle)
    row = np.zeros(9, dtype=np.int32)
    tilt = {"tilt_axis": random_rotation(np.random.default_rng(3))[0], "tilt_max": 0.4}
    for changes in ({}, tilt):
        own = terms(robot, len(collision.pairs), **changes)
        fast = SplineCost(collision, dynamics, own, core=compiled_core).value(control, 0.2, row)
        slow = SplineCost(collision, dynamics, own, core=None).value(control, 0.2, row)
        assert fast.value == pytest.approx(slow.value, rel=1e-9)
        assert relative(fast.gradient, slow.gradient) < 1e-7
        assert fast.of_interval == pytest.approx(slow.of_interval, rel=1e-7)
        cost = SplineCost(collision, dynamics, own, core=compiled_core)
        step = 1e-6
        bad = 0
        for k in range(3, 9):
            moved = np.zeros_like(control)
            moved[k, 0] = step
            ahead = cost.value(control + moved, 0.2, row).value
            behind = cost.value(control - moved, 0.2, row).value
            difference = (ahead - behind) / (2.0 * step)
            bad += abs(difference - fast.gradient[k, 0]) > 1e-4 * np.abs(fast.gradient).max()
        assert bad <= 1  # a kink of the bus or of a distance


def test_native_and_baseline_agree_bit_by_bit(baseline: Any) -> None:
    from ir_kernels import compiled
    from ir_kernels.collision import core_of

    native = compiled.load("native")[1]
    case = on_flat_ground()
    q, qd, qdd = batch(11, 7)
    results = []
    for core in (native, baseline):
        dynamics = DynamicsModel(case.railed, case.loads, core=core)
        model = core_of(collision_of(case, COLUMNS)._geometry, core)
        start = places(12, 64)
        verdicts = model.certify_edges(
            start, start[::-1].copy(), np.full(len(collision_of(case, COLUMNS).pairs), 0.02)
        )
        results.append(
            [
                dynamics.inverse_dynamics(q, qd, qdd),
                dynamics.mass_matrix(q),
                *model.min_distance(start, np.zeros(len(collision_of(case, COLUMNS).pairs))),
                *verdicts,
            ]
        )
    for mine, other in zip(*results, strict=True):
        assert np.array_equal(mine, other, equal_nan=True)


def test_inverse_kinematics_is_that_of_the_arm_at_each_place_of_the_rail() -> None:
    case = replace(case_of("kr210"), loads=())
    low = case.railed.position_min
    high = case.railed.position_max
    chain = Chain(case.railed, case.base, TCP)
    solver = inverse_kinematics(chain, low, high)
    assert isinstance(solver, RailIk)
    rng = np.random.default_rng(5)
    q = rng.uniform(low, high, (8, 7))
    targets = chain.tcp_poses(q)
    found = solver.with_places(q[:, 0]).solve(targets)
    error = np.abs(chain.tcp_poses(found.q) - targets[found.pose_index]).max()
    assert error < 1e-8
    for k, row in enumerate(q):
        own = found.of_pose(k)
        there = own[own[:, 0] == row[0]]
        assert np.abs(there - row).max(axis=1).min() < 1e-6
        standing = Chain(case.standing(), case.base_at(float(row[0])), TCP)
        alone = inverse_kinematics(standing, low[1:], high[1:]).solve(targets[k : k + 1]).q
        np.testing.assert_allclose(there[:, 1:], alone, rtol=0.0, atol=1e-7)
    everywhere = solver.solve(targets)
    assert set(np.unique(everywhere.q[:, 0])) <= set(np.linspace(-3.0, 3.0, 25))
    with pytest.raises(KernelError, match="places must be"):
        RailIk(chain, low, high, [3.5])


def test_what_turns_joints_alone_refuses_a_rail() -> None:
    case = on_flat_ground()
    chain = Chain(case.railed)
    with pytest.raises(KernelError, match="needs 6"):
        wrist_geometry(chain)
    with pytest.raises(KernelError, match="rail"):
        ccd(chain, np.eye(4), np.zeros((1, 7)), case.railed.position_min, case.railed.position_max)


def test_what_no_rail_can_be_is_refused() -> None:
    case = on_flat_ground()
    turns = np.eye(7)
    turns[0, 3] = 0.1
    with pytest.raises(KernelError, match="couples the rail"):
        DynamicsModel(replace(case.railed, motor_turns=turns))
    with pytest.raises(KernelError, match="carries at least one"):
        Chain(replace(random_chain(np.random.default_rng(1), 1), first_slides=True))
