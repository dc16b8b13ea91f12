"""Laws of places that are passed without a stop."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest

from ir_description import ProgramStep, cell_from_yaml, cell_to_yaml, load_cell
from ir_description.cell import StepVia
from ir_msgs_py.report import MovementKind
from ir_msgs_py.status import StatusCode
from ir_planner import Planner, RequestError
from ir_values.errors import CellFileError

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))  # the judge of poses
from _pinocchio_arm import pinocchio_arm

CELLS = ("open", "kr6_bench", "ur10e_bench")
DRAWN = [
    ("kr6_bench", 0),
    *(
        pytest.param(cell, seed, marks=pytest.mark.long)
        for cell in CELLS
        for seed in (0, 1)
        if (cell, seed) != ("kr6_bench", 0)
    ),
]


@pytest.fixture(scope="module")
def planners() -> dict[str, Planner]:
    return {name: Planner(name, clock=lambda: 0.0) for name in CELLS}


def drawn(planner: Planner, draw: np.random.Generator, count: int) -> list[np.ndarray]:
    """Free configurations around home."""
    home = np.array(planner.cell.machine_home)
    found: list[np.ndarray] = []
    while len(found) < count:
        q = home + draw.uniform(-0.5, 0.5, len(home))
        if planner.check_state(q=q).valid:
            found.append(q)
    return found


def passes(trajectory: object, places: list[np.ndarray], tolerance: float) -> bool:
    """Whether samples come within the tolerance of the places, one after the other."""
    q = trajectory.sample(np.linspace(0.0, trajectory.duration, 20_000)).q
    first = 0
    for place in places:
        near = np.flatnonzero(np.abs(q[first:] - place).max(axis=1) <= tolerance + 1e-4)
        if len(near) == 0:
            return False
        first += int(near[0])
    return True


@pytest.mark.parametrize(("cell", "seed"), DRAWN)
def test_places_are_passed_in_order_and_never_slower_than_with_stops(
    planners: dict[str, Planner], cell: str, seed: int
) -> None:
    planner = planners[cell]
    places = drawn(planner, np.random.default_rng([seed, 7]), 3)
    tolerance = (0.02, 0.1)[seed]
    asked = {"objective": "time", "planning_time": 100.0}
    plan = planner.plan_regional(goal=places[-1], via=places[:-1], via_tolerance=tolerance, **asked)
    assert plan.status.ok, plan.status
    assert plan.report.certified
    assert passes(plan.trajectory, places[:-1], tolerance)
    assert plan.trajectory.positions[-1] == pytest.approx(places[-1], abs=1e-9)
    stops = 0.0
    here = np.array(planner.cell.machine_home)
    for place in places:
        leg = planner.plan_regional(start=here, goal=place, **asked)
        stops += leg.report.duration
        here = place
    assert plan.report.duration <= stops + 1e-6
    again = planner.plan_regional(
        goal=places[-1], via=places[:-1], via_tolerance=tolerance, **asked
    )
    assert again.trajectory.trajectory_id == plan.trajectory.trajectory_id


def test_the_tcp_passes_within_a_distance(planners: dict[str, Planner]) -> None:
    planner = planners["open"]
    place, goal = drawn(planner, np.random.default_rng(3), 2)
    plan = planner.plan_regional(goal=goal, via=[place], via_distance=0.02, via_tolerance=0.2)
    assert plan.status.ok
    times = np.linspace(0.0, plan.trajectory.duration, 5000)
    chain = planner.scene().chain
    poses = chain.tcp_poses(plan.trajectory.sample(times).q)
    away = np.linalg.norm(poses[:, :3, 3] - chain.tcp_poses(place[None])[0, :3, 3], axis=1)
    assert away.min() <= 0.02 + 1e-4


@pytest.mark.long
def test_a_requested_duration_is_kept_or_refused_with_the_shortest(
    planners: dict[str, Planner],
) -> None:
    planner = planners["kr6_bench"]
    place, goal = drawn(planner, np.random.default_rng(4), 2)
    plan = planner.plan_regional(goal=goal, via=[place], duration=9.0)
    assert plan.report.duration == pytest.approx(9.0, abs=1e-5)
    with pytest.raises(RequestError, match="shortest found within the limits is"):
        planner.plan_regional(goal=goal, via=[place], duration=0.05)


def test_a_place_in_collision_or_without_sense_is_an_answer(
    planners: dict[str, Planner],
) -> None:
    planner = planners["open"]
    buried = np.radians([0.0, -6.0, 155.0, 0.0, 0.0, 0.0])
    plan = planner.plan_regional(goal="park", via=[buried])
    assert not plan.status.ok
    assert "to via 1" in plan.status.message
    with pytest.raises(RequestError, match="via_tolerance"):
        planner.plan_regional(goal="park", via=["home"], via_tolerance=0.0)
    with pytest.raises(RequestError, match="via_distance"):
        planner.plan_regional(goal="park", via=["home"], via_distance=5.0)


def sampled(trajectory: object) -> np.ndarray:
    """States (N, n) all along a trajectory."""
    return trajectory.sample(np.linspace(0.0, trajectory.duration, 2000)).q


def leaning(planner: Planner, states: np.ndarray) -> float:
    """The largest angle [rad] in states (N, n) by which what points up in the first leans."""
    cell = planner.cell
    model = pinocchio_arm(cell.robot, (), cell.base_pose)
    data = model.createData()
    hand = np.asarray(cell.tcp)[:3, :3]

    def rotation(q: np.ndarray) -> np.ndarray:
        pinocchio.forwardKinematics(model, data, q)
        return data.oMi[cell.robot.n].rotation @ hand

    axis = rotation(states[0]).T[:, 2]
    heights = [(rotation(q) @ axis)[2] for q in states]
    return float(np.arccos(np.clip(min(heights), -1.0, 1.0)))


@pytest.mark.parametrize(("cell", "seed"), DRAWN)
def test_the_tool_leans_from_where_the_whole_movement_begins(
    planners: dict[str, Planner], cell: str, seed: int
) -> None:
    """What is answered keeps the tilt of the axis that is upright at the start, not at each place;
    a goal that leans too far from it is refused, however little it leans from the place before.
    """
    planner = planners[cell]
    start, other = drawn(planner, np.random.default_rng([seed, 9]), 2)
    step = 0.2 * (other - start)
    asked = {"start": start, "via": [start + step], "via_tolerance": 0.02}
    free = planner.plan_regional(goal=start + 0.2 * step, **asked)
    assert free.status.ok, free.status
    states = np.concatenate([sampled(free.trajectory), asked["via"]])
    most = 1.1 * leaning(planner, states)
    kept = planner.plan_regional(goal=start + 0.2 * step, tilt_max=most, **asked)
    assert kept.status.ok, kept.status
    seen = leaning(planner, sampled(kept.trajectory))
    assert seen <= most + 1e-6
    assert seen <= kept.report.largest_tilt + 1e-6
    far = planner.plan_regional(goal=start + 2.0 * step, tilt_max=most, **asked)
    assert far.status.code is StatusCode.GOAL_VIOLATES_PATH_CONSTRAINTS


def test_nothing_to_move_past_a_place_is_an_answer(planners: dict[str, Planner]) -> None:
    planner = planners["open"]
    home = np.array(planner.cell.machine_home)
    for duration in (0.0, 3.0):
        plan = planner.plan_regional(start=home, goal=home, via=[home, home], duration=duration)
        assert plan.status.ok
        assert plan.report.certified
        assert np.abs(plan.trajectory.positions - home).max() <= 1e-9


@pytest.mark.parametrize("name", ["via_tolerance", "via_distance"])
@pytest.mark.parametrize("value", [None, [0.1], "0.1 rad", 10**400, float("nan")])
def test_a_tolerance_that_is_no_number_is_refused(
    planners: dict[str, Planner], name: str, value: object
) -> None:
    with pytest.raises(RequestError, match=f"{name} is .*: it must be"):
        planners["open"].plan_regional(goal="park", via=["home"], **{name: value})


@pytest.mark.parametrize("via", ["park", "", None, 3.0])
def test_places_that_are_no_list_are_refused(planners: dict[str, Planner], via: object) -> None:
    with pytest.raises(RequestError, match=r"via is .*: it must be a list"):
        planners["open"].plan_regional(goal="park", via=via)


LITTLE = 3_000  # max_iterations
VIA_CELL = replace(
    load_cell("open"),
    program=(
        ProgramStep("STATION", "p2"),
        ProgramStep("STATION", "conv", via=StepVia(("park", "home"), tolerance=0.1)),
        ProgramStep("POSTURE", "home", via=StepVia(("p1",), distance=0.05, tolerance=0.5)),
    ),
)


@pytest.mark.long
@pytest.mark.parametrize("cycle_time", [pytest.param(0.0, marks=pytest.mark.long), 40.0])
def test_steps_of_a_program_pass_their_places(cycle_time: float) -> None:
    """Found and judged in the cell that its file says."""
    cell = cell_from_yaml(cell_to_yaml(VIA_CELL), "via.yaml")
    assert [step.via for step in cell.program] == [step.via for step in VIA_CELL.program]
    plan = Planner(cell, clock=lambda: 0.0).plan_program(
        cycle_time=cycle_time, max_iterations=LITTLE
    )
    assert plan.status.ok, plan.status
    assert all(step.report.certified for step in plan.movements)
    past = [step.trajectory for step in plan.movements if step.kind == MovementKind.REGIONAL]
    postures = [np.array(cell.posture(name)) for name in ("park", "home")]
    assert any(passes(motion, postures, 0.1) for motion in past)
    model = pinocchio_arm(cell.robot, (), cell.base_pose)
    data = model.createData()
    place = np.linalg.inv(cell.base_pose) @ cell.station("p1").pose
    last = past[-1].sample(np.linspace(0.0, past[-1].duration, 20_000)).q
    away = []
    for q in last:
        pinocchio.forwardKinematics(model, data, q)
        away.append(np.linalg.norm((data.oMi[6].act(cell.tcp[:3, 3])) - place[:3, 3]))
    assert min(away) <= 0.05 + 1e-4
    if cycle_time > 0.0:
        assert plan.report.duration == pytest.approx(cycle_time, abs=1e-6)
    else:
        stopping = replace(VIA_CELL, program=STOPPING)
        stops = Planner(stopping, clock=lambda: 0.0).plan_program(max_iterations=LITTLE)
        assert plan.report.duration < stops.report.duration


STOPPING = tuple(
    ProgramStep(kind, name)
    for kind, name in (
        ("STATION", "p2"),
        ("POSTURE", "park"),
        ("POSTURE", "home"),
        ("STATION", "conv"),
        ("STATION", "p1"),
        ("POSTURE", "home"),
    )
)


def test_a_step_that_goes_nowhere_passes_nothing() -> None:
    steps = (
        ProgramStep("POSTURE", "home"),
        ProgramStep("POSTURE", "home", via=StepVia(("park",))),
    )
    planner = Planner(replace(VIA_CELL, program=steps), clock=lambda: 0.0)
    with pytest.raises(RequestError, match="step 2 passes park and goes nowhere"):
        planner.plan_program()


def test_a_cell_file_names_what_it_can_not_pass() -> None:
    text = cell_to_yaml(VIA_CELL)
    for good, bad, said in (
        ("via: [p1]", "via: [p9]", "via place 'p9' is unknown"),
        ("via: [p1]", "via: []", "via"),
        ("via: [p1], ", "", "belongs to a step with via"),
        ("via_distance: 0.05", "via_distance: 2", "2"),
    ):
        assert good in text
        with pytest.raises(CellFileError, match=said):
            cell_from_yaml(text.replace(good, bad), "via.yaml")
