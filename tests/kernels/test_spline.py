"""The cost of a motion along a spline: against its definition by other means, and its
derivatives.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from builds import every_build, slow_reference
from geometry_cases import COLUMNS, OPEN, Body, box
from robots import RobotLiteral, kr210, power_gradients
from spline_cases import (
    MIDDLE,
    WORKING,
    along,
    chain_models,
    kr210_cost,
    kr210_models,
    motion,
    sample_times,
    terms,
)

from ir_kernels import CollisionModel, DynamicsModel, SplineCost, compiled
from ir_kernels.power import REGENERATIONS, DcBusParameters, Regeneration, dc_bus
from ir_kernels.spline_terms import SplineTerms
from ir_values.arrays import FloatArray, IntArray

FREE: dict[str, Any] = {
    "penalty": 0.0,
    "clearance_penalty": 0.0,
    "time_value": 0.0,
    "travel": np.zeros(6),
}


def plain(robot: RobotLiteral) -> RobotLiteral:
    """Without what the cost smoothes: Coulomb friction, and the step of the envelope."""
    torque = robot.envelope_torque.copy()
    torque[:, 0] = torque[:, 1]
    return replace(
        robot, friction_coulomb=np.zeros_like(robot.friction_coulomb), envelope_torque=torque
    )


def by_definition(
    collision: CollisionModel,
    dynamics: DynamicsModel,
    t: SplineTerms,
    control: FloatArray,
    interval: float,
    row: IntArray,
) -> float:
    """The cost from the public kernels along scipy's spline, for robots without friction and
    step.
    """
    K = len(control)
    step = interval / 2.0
    at = sample_times(K, interval)
    q, qd, qdd = (np.ascontiguousarray(along(control, interval, at, order)) for order in range(3))
    torque = dynamics.inverse_dynamics(q, qd, qdd)
    bus = DcBusParameters(t.capacity_energy, t.regeneration)
    cost = t.energy_value * step * dc_bus(dynamics.axis_power(qd, torque), step, bus).mains.sum()
    cost += t.time_value * interval * (K - 3)
    cost += step * float((t.travel * (np.sqrt(qd**2 + 0.01**2) - 0.01)).sum())

    def squares(use: FloatArray, weight: float) -> float:
        return weight * float((np.maximum(use - 1.0, 0.0) ** 2).sum())

    cost += squares(np.abs(qd) / t.velocity, t.penalty * step)
    cost += squares(np.abs(torque) / (t.torque_share * dynamics.torque_limit(qd)), t.penalty * step)
    knots = np.arange(K - 2) * interval
    middles = (np.arange(K - 3) + 0.5) * interval
    inside = np.clip(knots, 1e-12, knots[-1] - 1e-12)  # scipy's spline ends there
    cost += squares(
        np.abs(along(control, interval, inside, 2)) / t.acceleration, t.penalty * interval
    )
    cost += squares(np.abs(along(control, interval, middles, 3)) / t.jerk, t.penalty * interval)
    over = np.maximum(np.maximum(t.low - control, control - t.high), 0.0)
    cost += t.penalty * interval * float(((100.0 * over) ** 2).sum())
    kept = t.threshold[np.repeat(row, 2)] + t.clearance_margin
    lacks = np.maximum(kept - collision.distances(q), 0.0) / t.clearance_scale
    return cost + t.clearance_penalty * step * float((lacks**2).sum())


@pytest.mark.sampled
@every_build(
    "seed, regeneration", [(seed, how) for seed in range(3) for how in REGENERATIONS], few=3
)
def test_the_cost_is_what_it_says(core: Any, seed: int, regeneration: Regeneration) -> None:
    robot = plain(kr210())
    collision, dynamics = kr210_models(few=core is None, robot=robot)
    rng = np.random.default_rng(seed)
    rows = np.stack(
        [np.full(len(collision.pairs), 0.02), rng.choice([-np.inf, 0.0, 0.2], len(collision.pairs))]
    )
    t = terms(
        robot, len(collision.pairs), threshold=rows, regeneration=regeneration, energy_value=0.7
    )
    cost = SplineCost(collision, dynamics, t, core=core)
    control = motion(seed, 16, around=MIDDLE, size=1.5)
    row = rng.integers(0, 2, 13)
    for interval in (0.06, 0.5):  # much too fast; nearly within the limits
        expected = by_definition(collision, dynamics, t, control, interval, row)
        assert cost.value(control, interval, row).value == pytest.approx(expected, rel=1e-9)


@every_build(
    "n, wrist", [(1, False), (6, True), (4, False), (7, True), (8, False), (16, False)], few=2
)
def test_the_cost_of_other_robots_is_what_it_says(core: Any, n: int, wrist: bool) -> None:
    robot, collision, _ = chain_models(n, n, wrist=wrist)
    robot = plain(robot)
    dynamics = DynamicsModel(robot)
    t = terms(robot, len(collision.pairs), threshold=np.full((1, len(collision.pairs)), 0.1))
    control = motion(n, 9, n)
    row = np.zeros(6, int)
    expected = by_definition(collision, dynamics, t, control, 0.2, row)
    assert SplineCost(collision, dynamics, t, core=core).value(control, 0.2).value == pytest.approx(
        expected, rel=1e-9
    )


@pytest.mark.sampled
@pytest.mark.parametrize("capacity", [0.0, 106.0, 5000.0])
@pytest.mark.parametrize("regeneration", REGENERATIONS)
def test_energy_is_that_of_the_drives(
    core: Any, regeneration: Regeneration, capacity: float
) -> None:
    control = motion(4, 20, around=WORKING)
    interval = 0.15
    for robot, tolerance in (
        (plain(kr210()), 1e-11),
        (kr210(), 0.01),
    ):  # smoothed below 0.01 rad/s: less than 1 %
        collision, dynamics = kr210_models((), few=True, robot=robot)
        t = terms(
            robot, 0, regeneration=regeneration, capacity_energy=capacity, energy_value=3.0, **FREE
        )
        found = SplineCost(collision, dynamics, t, core=core).value(control, interval)
        at = sample_times(20, interval)
        power = dynamics.drive_power(
            *(np.ascontiguousarray(along(control, interval, at, k)) for k in range(3))
        )
        step = interval / 2.0
        mains = dc_bus(power, step, DcBusParameters(capacity, regeneration)).mains
        assert found.energy == pytest.approx(step * mains.sum(), rel=tolerance)
        assert found.value == pytest.approx(3.0 * found.energy, rel=1e-12)


@pytest.mark.parametrize("regeneration", REGENERATIONS)
def test_a_rounded_bus_costs_more_and_nears_the_exact_one(
    core: Any, regeneration: Regeneration
) -> None:
    control = motion(4, 20, around=WORKING)
    interval = 0.15
    exact, *rounded = (
        kr210_cost(core, (), few=True, regeneration=regeneration, smoothing=watts).value(
            control, interval
        )
        for watts in (0.0, 1e-3, 30.0, 300.0)
    )
    energies = [value.energy for value in rounded]
    assert rounded[0].energy == pytest.approx(exact.energy, rel=1e-5)
    if regeneration != "fed_back":  # a surplus that is rounded up, returns
        assert exact.energy < energies[0] < energies[1] < energies[2]


@every_build("n", [(1,), (6,), (2,), (5,), (9,), (16,)], few=2)
def test_torque_adjoint_is_the_transpose_of_the_torque_gradients(core: Any, n: int) -> None:
    """With every axis for itself the gradient is that of the axis powers, sample by sample."""
    if n == 6:
        collision, dynamics = kr210_models(
            (), few=True, robot=plain(kr210())
        )  # with a counterbalance
        robot = plain(kr210())
    else:
        robot, collision, _ = chain_models(n, n)
        dynamics = DynamicsModel(plain(robot))
    free = {**FREE, "travel": np.zeros(n), "regeneration": "none"}
    t = terms(
        robot, len(collision.pairs), threshold=np.full((1, len(collision.pairs)), -np.inf), **free
    )
    control = motion(n, 10, n)
    interval = 0.3
    found = SplineCost(collision, dynamics, t, core=core).value(control, interval)
    at = sample_times(10, interval)
    motions = [np.ascontiguousarray(along(control, interval, at, k)) for k in range(3)]
    of = power_gradients(dynamics, *motions)
    drawn = np.where(dynamics.drive_power(*motions) > 0.0, interval / 2.0, 0.0)
    weights = [along(np.eye(10), interval, at, k) for k in range(3)]
    parts = [
        np.einsum("kc,ki,kij->cj", w, drawn, g)
        for w, g in zip(weights, (of.q, of.qd, of.qdd), strict=True)
    ]
    expected = sum(parts)
    np.testing.assert_allclose(found.gradient, expected, atol=1e-10 * np.abs(expected).max())


def check_derivatives(
    cost: SplineCost,
    control: FloatArray,
    interval: float,
    row: IntArray,
    seed: int,
    directions: int,
) -> None:
    """Central differences along random directions, along single control points, and by the
    interval.
    """
    found = cost.value(control, interval, row)
    rng = np.random.default_rng(seed)
    K, n = control.shape
    chosen = [rng.normal(size=(K, n)) for _ in range(directions)]
    for _ in range(directions):
        single = np.zeros((K, n))
        single[rng.integers(K), rng.integers(n)] = 1.0
        chosen.append(single)
    h = 1e-6
    scale = float(np.abs(found.gradient).max())
    for d in chosen:
        ahead, behind = (cost.value(control + s * h * d, interval, row).value for s in (1.0, -1.0))
        error = (ahead - behind) / (2.0 * h) - float((found.gradient * d).sum())
        assert abs(error) < 3e-6 * scale * float(np.abs(d).sum()) ** 0.5
    h = 1e-6 * interval
    ahead, behind = (cost.value(control, interval + s * h, row).value for s in (1.0, -1.0))
    assert found.of_interval == pytest.approx((ahead - behind) / (2.0 * h), rel=3e-6)


def directions(core: Any) -> int:
    """How many of each kind; the reference, a hundred times slower, is held against the others
    too.
    """
    return 2 if core is None else 8


@pytest.mark.sampled
@every_build(
    "interval, seed, regeneration, smoothing",
    # every interval and smoothing with two regenerations and every regeneration with both of them
    [
        (interval, seed, REGENERATIONS[(seed + step) % len(REGENERATIONS)], 300.0 * step)
        for seed, interval in enumerate((0.08, 0.3, 0.6))
        for step in (0, 1)
    ],
)
def test_derivatives_are_those_of_differences(
    core: Any, interval: float, seed: int, regeneration: Regeneration, smoothing: float
) -> None:
    collision, _ = kr210_models(few=core is None)
    rng = np.random.default_rng(seed)
    rows = np.stack(
        [np.full(len(collision.pairs), 0.02), rng.choice([-np.inf, 0.1], len(collision.pairs))]
    )
    cost = kr210_cost(
        core, few=core is None, regeneration=regeneration, smoothing=smoothing, threshold=rows
    )
    control = motion(seed, 12, around=MIDDLE, size=1.5)
    check_derivatives(cost, control, interval, rng.integers(0, 2, 9), seed, directions(core))


@every_build("n, wrist", [(3, True), (1, False), (3, False), (6, True), (7, False), (7, True)])
def test_derivatives_of_other_robots_are_those_of_differences(
    core: Any, n: int, wrist: bool
) -> None:
    robot, collision, dynamics = chain_models(10 + n, n, wrist=wrist)
    t = terms(robot, len(collision.pairs), threshold=np.full((1, len(collision.pairs)), 0.1))
    cost = SplineCost(collision, dynamics, t, core=core)
    check_derivatives(cost, motion(n, 8, n), 0.2, np.zeros(5, int), n, directions(core))


@pytest.mark.sampled
@pytest.mark.parametrize(
    "bodies", [COLUMNS, OPEN, (box("far", (60.0, 0.0, 0.0), (100.0, 1.0, 3.0)),), ()]
)
def test_compiled_cores_agree_with_the_reference(
    compiled_core: Any, bodies: tuple[Body, ...]
) -> None:
    """One scene is so large that lanes of doubles choose the pairs."""
    control = motion(7, 13, around=WORKING)
    found, expected = (
        kr210_cost(one, bodies).value(control, 0.15) for one in (compiled_core, None)
    )
    assert found.value == pytest.approx(expected.value, rel=1e-11)
    assert found.energy == pytest.approx(expected.energy, rel=1e-11)
    assert found.of_interval == pytest.approx(expected.of_interval, rel=1e-9)
    np.testing.assert_allclose(
        found.gradient, expected.gradient, atol=1e-9 * np.abs(expected.gradient).max()
    )


def tilted(seed: int, most: float) -> dict[str, Any]:
    """Terms of a drawn axis and direction that may be `most` rad apart."""
    drawn = np.random.default_rng(seed).normal(0.0, 1.0, (2, 3))
    axis, direction = drawn / np.linalg.norm(drawn, axis=1)[:, None]
    return {"tilt_axis": axis, "tilt_direction": direction, "tilt_max": most}


@pytest.mark.sampled
@pytest.mark.parametrize(("seed", "most"), [(0, 0.0), (1, 0.2), (2, 1.5), (3, 3.0)])
def test_a_tilt_costs_the_square_of_its_excess_over_time(core: Any, seed: int, most: float) -> None:
    control = motion(seed, 9, around=WORKING)
    asked = tilted(seed, most)
    with_tilt, without = (
        kr210_cost(core, few=True, **given).value(control, 0.2).value for given in (asked, {})
    )
    chain = kr210_models(few=True)[0].chain
    q = np.ascontiguousarray(along(control, 0.2, sample_times(9, 0.2)))
    axis = chain.link_poses(q)[:, -1, :3, :3] @ asked["tilt_axis"]
    tilt = np.arccos(np.clip(axis @ asked["tilt_direction"], -1.0, 1.0))
    excess = np.maximum(tilt - most, 0.0) / SplineTerms.tilt_scale
    expected = 1e4 * float(np.square(excess).sum()) * 0.1
    assert with_tilt - without == pytest.approx(expected, rel=1e-7, abs=1e-6 * abs(without))


@every_build("seed, most", [(4, 0.0), (5, 0.3), (6, 1.0)])
def test_derivatives_of_a_tilt_are_those_of_differences(core: Any, seed: int, most: float) -> None:
    cost = kr210_cost(core, OPEN, few=True, **tilted(seed, most))
    control = motion(seed, 10, around=WORKING)
    check_derivatives(cost, control, 0.2, np.zeros(7, int), seed, directions(core))


def test_compiled_cores_agree_with_the_reference_on_a_tilt(compiled_core: Any) -> None:
    control = motion(9, 13, around=WORKING)
    found, expected = (
        kr210_cost(one, OPEN, **tilted(9, 0.4)).value(control, 0.15)
        for one in (compiled_core, None)
    )
    assert found.value == pytest.approx(expected.value, rel=1e-11)
    assert found.of_interval == pytest.approx(expected.of_interval, rel=1e-9)
    np.testing.assert_allclose(
        found.gradient, expected.gradient, atol=1e-9 * np.abs(expected.gradient).max()
    )


def test_native_agrees_with_baseline(baseline: Any) -> None:
    control = motion(8, 40, around=WORKING)
    native, portable = (
        kr210_cost(each).value(control, 0.1) for each in (compiled.load("native")[1], baseline)
    )
    assert native.value == pytest.approx(portable.value, rel=1e-13)
    np.testing.assert_allclose(
        native.gradient, portable.gradient, atol=1e-11 * np.abs(portable.gradient).max()
    )


@pytest.mark.parametrize("lack", [1e-7, 1e-6, 1e-5])
def test_pairs_that_lack_less_than_a_float_can_resolve_count(core: Any, lack: float) -> None:
    collision, dynamics = kr210_models(few=core is None)
    q = np.tile(WORKING, (4, 1))
    threshold = collision.distances(q[:1]) + lack  # what every pair lacks, all the time
    t = terms(kr210(), len(collision.pairs), **{**FREE, "threshold": threshold})
    t = replace(
        t, energy_value=0.0, clearance_margin=0.0, clearance_scale=lack, clearance_penalty=1.0
    )
    found = SplineCost(collision, dynamics, t, core=core).value(q, 2.0)
    assert found.value == pytest.approx(2.0 * len(collision.pairs), rel=1e-7)


@slow_reference
def test_a_threshold_row_holds_in_its_interval_only(core: Any) -> None:
    collision, _ = kr210_models(few=True)
    rows = np.stack([np.full(len(collision.pairs), value) for value in (-np.inf, 1.0)])
    cost = kr210_cost(
        core, few=True, threshold=rows, **FREE | {"clearance_penalty": 1.0, "energy_value": 0.0}
    )
    control = motion(9, 12, around=WORKING, size=0.2)
    single = [cost.value(control, 0.1, np.eye(9, dtype=int)[k]).value for k in range(9)]
    assert cost.value(control, 0.1).value == 0.0
    assert min(single) > 0.0
    assert sum(single) == pytest.approx(cost.value(control, 0.1, np.ones(9, int)).value, rel=1e-12)


def test_the_smoothed_envelope_stays_below_the_true_one(core: Any) -> None:
    """At one speed after the other: the step of the envelope is a ramp below its first speed."""
    robot = replace(kr210(), friction_coulomb=np.zeros(6))
    collision, dynamics = kr210_models((), few=True, robot=robot)
    t = terms(robot, 0, **{**FREE, "penalty": 1.0, "travel": np.zeros(6)})
    huge = {name: np.full(6, 1e9) for name in ("velocity", "acceleration", "jerk", "high")}
    t = replace(t, **huge, low=-huge["high"], energy_value=0.0, torque_share=1e-3)
    cost = SplineCost(collision, dynamics, t, core=core)
    first = robot.envelope_speed[0, 0]
    for share, exact in ((0.5, True), (0.949, True), (0.97, False), (0.999, False), (1.1, True)):
        control = np.tile(WORKING, (4, 1))
        control[:, 0] = (
            share * first * np.arange(4) * 0.01
        )  # only the first axis moves, at one speed
        at = sample_times(4, 0.01)
        q, qd, qdd = (np.ascontiguousarray(along(control, 0.01, at, k)) for k in range(3))
        use = np.abs(dynamics.inverse_dynamics(q, qd, qdd)) / (1e-3 * dynamics.torque_limit(qd))
        least = float((np.maximum(use - 1.0, 0.0) ** 2).sum()) * 0.005
        found = cost.value(control, 0.01).value
        assert found == pytest.approx(least, rel=1e-9) if exact else found > (1.0 + 1e-6) * least


def test_an_envelope_that_falls_from_standstill_on_has_no_step(core: Any) -> None:
    robot = kr210()
    speed = robot.envelope_speed.copy()
    speed[:, 0] = 0.0
    robot = replace(plain(robot), envelope_speed=speed)
    collision, dynamics = kr210_models(few=True, robot=robot)
    t = terms(robot, len(collision.pairs))
    control = motion(3, 10, around=WORKING)
    expected = by_definition(collision, dynamics, t, control, 0.1, np.zeros(7, int))
    assert SplineCost(collision, dynamics, t, core=core).value(control, 0.1).value == pytest.approx(
        expected, rel=1e-9
    )


def test_a_scene_without_pairs_has_no_clearance_to_lack(core: Any) -> None:
    cost = kr210_cost(core, (), few=True, threshold=np.zeros((2, 0)))
    control = motion(2, 9, around=WORKING)
    other = cost.value(control, 0.1, np.ones(6, int))
    assert cost.value(control, 0.1).value == other.value
    assert np.isfinite(other.gradient).all()
