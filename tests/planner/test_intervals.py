"""Intervals of energies: against drawn robots that are computed one by one, closed forms, and
laws.
"""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import PowerParameters, load_power_data
from ir_description.library import load_power_parameters
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner, PlannerSettings
from ir_planner.checks import interval, movement_energy, movement_spread, peak_power
from ir_planner.checks.intervals import Sampled, energy_and_slope, holding_slope
from ir_planner.program.standby import plan_standby
from ir_planner.request import Goal
from ir_planner.scene import Drives, PlanningScene
from ir_values.arrays import FloatArray

SHEET = load_power_parameters()
Z90 = 1.6449  # of a normal distribution: half the width of its 90 % interval
QUANTILES = 0.12  # of a width: 1000 drawn robots, and a bus that is not linear


@cache
def planner() -> Planner:
    """In the open cell."""
    return Planner("open", clock=lambda: 0.0, settings=PlannerSettings())


@cache
def movement(task: str) -> JointTrajectory:
    """A planned movement of it."""
    wanted = planner().cell.task(task)
    options = PlanOptions(safety_distance=0.005)
    found = planner().plan_regional(
        start=wanted.start, goal=Goal(configuration=wanted.goal, text=task), options=options
    )
    assert found.trajectory is not None, found.status.message
    return found.trajectory


def scene(parameters: PowerParameters = SHEET) -> PlanningScene:
    """Of a robot with these parameters."""
    power = parameters.power_with(load_power_data())
    return replace(planner().scene(), drives=Drives(parameters=parameters), power=power)


def with_value(name: str, value: float) -> PowerParameters:
    mean = SHEET.mean.copy()
    mean[SHEET.index(name)] = value
    return replace(SHEET, mean=mean)


@pytest.mark.sampled
@pytest.mark.parametrize("task", ["home->p1", "conv->p1", "p1b->cab"])
def test_the_interval_is_that_of_robots_computed_one_by_one(task: str) -> None:
    trajectory = movement(task)
    nominal = movement_energy(trajectory, scene()).total
    found = interval(nominal, movement_spread(trajectory, scene()))
    energies = []
    for robot in SHEET.draws(150, seed=11):
        drawn = replace(SHEET, mean=robot, covariance=np.zeros_like(SHEET.covariance))
        energies.append(movement_energy(trajectory, scene(drawn), step=4e-3).total)
    low, high = np.quantile(energies, (0.05, 0.95))
    width = high - low
    assert found.low == pytest.approx(min(low, nominal), abs=QUANTILES * width)
    assert found.high == pytest.approx(high, abs=QUANTILES * width)


def test_where_only_constant_watts_are_unsure_the_interval_is_the_normal_one() -> None:
    covariance = np.zeros_like(SHEET.covariance)
    for name, sigma in (("drives_watts", 20.0), ("watts.STAND_ON_MOTORS", 15.0)):
        covariance[SHEET.index(name), SHEET.index(name)] = sigma**2
    here = scene(replace(SHEET, covariance=covariance))
    trajectory = movement("home->p1")
    found = interval(0.0, movement_spread(trajectory, here))
    sigma = np.hypot(20.0, 15.0) * trajectory.duration
    assert found.high == pytest.approx(Z90 * sigma, rel=0.1)
    assert found.low == pytest.approx(-Z90 * sigma, rel=0.1)


@settings(max_examples=8, deadline=None)
@given(factor=st.floats(0.05, 0.9), task=st.sampled_from(["home->p1", "p1->p2"]))
def test_intervals_hold_the_nominal_and_shrink_with_the_covariance(
    factor: float, task: str
) -> None:
    trajectory = movement(task)
    nominal = 1000.0
    smaller = replace(SHEET, covariance=SHEET.covariance * factor**2)
    spreads = [movement_spread(trajectory, scene(parameters)) for parameters in (SHEET, smaller)]
    whole, part = (interval(nominal, added) for added in spreads)
    assert whole.low <= nominal <= whole.high
    assert part.low <= nominal <= part.high <= whole.high
    widths = [float(np.diff(np.quantile(added, (0.05, 0.95)))[0]) for added in spreads]
    assert widths[1] == pytest.approx(factor * widths[0], rel=0.15)


def test_without_uncertainty_there_is_no_interval() -> None:
    sure = replace(SHEET, covariance=np.zeros_like(SHEET.covariance))
    assert np.abs(movement_spread(movement("home->p1"), scene(sure))).max() < 1e-6


def test_the_same_question_has_the_same_interval() -> None:
    one, two = (movement_spread(movement("home->p1"), scene()) for _ in range(2))
    assert np.array_equal(one, two)


AT_ZERO = ("iron", "inverter", "gear", "idle_watts")  # in the data sheet


@pytest.mark.parametrize(
    "name",
    [
        *(f"{term}.joint_a{j}" for term in ("viscous", "coulomb", "copper") for j in (1, 3)),
        *(f"{term}.joint_a2" for term in ("iron", "inverter", "gear")),
        *(
            "rotor_inertia",
            "link_mass",
            "load_mass",
            "counterbalance",
            "rectifier_efficiency",
            "dc_link",
        ),
        *("tool_watts", "idle_watts", "drives_watts", "watts.STAND_ON_MOTORS"),
    ],
)
def test_slopes_are_those_of_the_energy(name: str) -> None:
    """Central differences of the energy itself, one-sided at a bound."""
    trajectory = movement("p1b->cab")
    at = SHEET.value(name)
    step = 0.02 * SHEET.deviation[SHEET.index(name)]
    below = at if at in (0.0, 1.0) and name.partition(".")[0] in AT_ZERO else at - step
    above = min(at + step, 1.0) if name == "rectifier_efficiency" else at + step
    energies = [
        movement_energy(trajectory, scene(with_value(name, v))).total for v in (below, above)
    ]
    slope = energy_and_slope(Sampled.of(trajectory), scene())[1][SHEET.index(name)]
    difference = (energies[1] - energies[0]) / (above - below)
    assert slope == pytest.approx(
        difference, rel=0.05, abs=1e-3 * movement_energy(trajectory, scene()).total
    )


@pytest.mark.parametrize("name", ["centre_1.joint_a2", "centre_2.joint_a3"])
def test_slopes_by_centres_of_mass_are_those_of_the_energy(name: str) -> None:
    sheet = SHEET.with_centres(np.full(12, 0.01))
    trajectory = movement("p1b->cab")
    k = sheet.index(name)

    def energy(shift: float) -> float:
        moved = replace(sheet, mean=sheet.mean + shift * np.eye(len(sheet.mean))[k])
        return movement_energy(trajectory, scene(moved)).total

    slope = energy_and_slope(Sampled.of(trajectory), scene(sheet))[1][k]
    assert slope == pytest.approx((energy(1e-3) - energy(-1e-3)) / 2e-3, rel=0.05)


def test_holding_slopes_are_those_of_holding_watts() -> None:
    q = np.array(planner().cell.machine_home)
    slope = holding_slope(q, scene())
    rest = JointTrajectory(SCENE_NAMES, [0, 10**9], np.stack([q, q]))
    for name in ("copper.joint_a2", "inverter.joint_a5", "link_mass", "idle_watts", "drives_watts"):
        more = scene(
            with_value(name, SHEET.value(name) + 0.01 * SHEET.deviation[SHEET.index(name)])
        )
        watts = movement_energy(rest, more).total - movement_energy(rest, scene()).total
        expected = watts / (0.01 * SHEET.deviation[SHEET.index(name)])
        assert slope[SHEET.index(name)] == pytest.approx(expected, rel=0.02)


SCENE_NAMES = planner().cell.robot.joint_names


def test_more_losses_never_cost_less_and_peak_power_still_bounds() -> None:
    trajectory = movement("p1b->cab")
    robot = SHEET.drawn(3)
    lossy = movement_energy(trajectory, scene(robot))
    plain = movement_energy(trajectory, scene())
    assert plain.watts.max() <= peak_power(trajectory, scene()) * (1.0 + 1e-9)
    assert lossy.watts.max() <= peak_power(trajectory, scene(robot))
    for name in ("iron.joint_a1", "inverter.joint_a2", "gear.joint_a3"):
        assert movement_energy(trajectory, scene(with_value(name, 0.05))).total >= plain.total


def test_a_saving_of_a_pause_has_an_interval_of_its_own() -> None:
    """Of a long pause it is the difference of two modes' watts that counts, not their sum."""
    q = np.array(planner().cell.machine_home)
    times = PlannerSettings().transitions
    bare = replace(scene(), loads=())
    found = plan_standby(3600.0, q, bare, times)
    assert found.saving_low < found.saving < found.saving_high
    brakes = SHEET.index("watts.STAND_ON_BRAKES")
    deep = SHEET.index("watts.HIBERNATION")
    sigma = np.hypot(SHEET.deviation[brakes], SHEET.deviation[deep]) * 3600.0
    assert found.saving_high - found.saving == pytest.approx(Z90 * sigma, rel=0.15)
    assert "90 % interval" in found.sentence
    short = plan_standby(1.0, q, bare, times)
    assert (short.saving_low, short.saving, short.saving_high) == (0.0, 0.0, 0.0)


def test_reports_name_their_parameters_and_hold_their_energy() -> None:
    found = planner().evaluate(movement("home->p1"), safety_distance=0.005).report
    assert found.power_parameters == "data_sheet"
    assert found.energy_low <= found.energy < found.energy_high


@given(st.floats(0.0, 1e6), st.lists(st.floats(-1e5, 1e5), min_size=1, max_size=50).map(np.array))
def test_an_interval_holds_the_energy_that_it_is_of(energy: float, added: FloatArray) -> None:
    within = interval(energy, added)
    assert within.low <= energy <= within.high


@pytest.mark.long
def test_every_answer_lies_within_its_own_interval() -> None:
    asked = planner()
    cell = asked.cell
    start = np.array(asked.cell.park)
    name = cell.stations[0].name
    plan = asked.plan_program(
        stations=(name, "park"),
        start=start,
        savings=True,
        front_points=3,
        max_iterations=100_000,
    )
    assert plan.compared is not None
    programs = (plan, plan.compared, *plan.front)
    reports = [step.report for program in programs for step in program.movements]
    reports += [program.report for program in programs]
    first = plan.movements[0].trajectory
    assert first is not None
    better = asked.optimize_trajectory(first, max_iterations=3_000)
    reports += [
        better.before,
        better.after,
        asked.evaluate(first, safety_distance=0.0, station=name).report,
    ]
    service = asked.plan_service(name, near=start, max_candidates=2)
    reports += [one.report for one in service.candidates if one.trajectory is not None]
    assert len(plan.front) == 3
    assert all(report.energy_low <= report.energy <= report.energy_high for report in reports)
    assert all(report.power_parameters for report in reports)
    savings = plan.savings
    assert savings.movements.saved_low <= savings.movements.saved <= savings.movements.saved_high
    rest = asked.standby(300.0, q=start)
    assert rest.saving_low <= rest.saving <= rest.saving_high
