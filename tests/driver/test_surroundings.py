"""The planner's cell in the driver: taken while the robot stands; what was planned elsewhere is
refused.
"""

from __future__ import annotations

import itertools
import threading
from dataclasses import replace

import numpy as np
import pytest

from ir_description import Body, cell_hash, load_cell
from ir_sim_driver.controller import Driver, PlannedCell, contacts, surroundings
from ir_sim_driver.controller.driver import take_offered_cell
from ir_sim_driver.errors import RequestRefusedError, TrajectoryRefusedError
from ir_sim_driver.motion.goal import ErrorCode, GoalOutcome, TrajectoryGoal
from ir_sim_driver.node.announcements import announced
from ir_sim_driver.plant import carried, custom_load

OPEN = load_cell("open")
DEMO = load_cell("demo")


def planned(cell):
    return PlannedCell(cell, cell_hash(cell))


def without_parts():
    stations = tuple(replace(station, allowed_contacts=()) for station in DEMO.stations)
    return replace(DEMO, parts=(), program=(), stations=stations)


def movement(plan, simulation, by=0.05):
    q = simulation.backend.q
    return plan(1.0, q, q + by)


def executed(simulation, goal):
    return simulation.execute(simulation.vet(goal, 0), 0)


def test_the_cell_is_taken_with_its_tool_tcp_and_postures(make):
    simulation = make(load="none")
    simulation.set_load(carried(OPEN, OPEN.tool.name) if OPEN.tool else carried(OPEN, "none"))
    home = np.array(DEMO.machine_home)
    home[0] += 0.5
    cell = replace(DEMO, machine_home=home)
    assert simulation.surroundings.offer(planned(cell)) == ""
    take_offered_cell(simulation)
    assert simulation.cell is cell
    assert simulation.surroundings.hash == cell_hash(cell)
    np.testing.assert_array_equal(simulation.tool.chain.tcp_poses(home[None])[0].shape, (4, 4))
    assert not simulation.outputs().in_home
    simulation.backend.reset(home)
    assert simulation.outputs().in_home
    if OPEN.tool is not None:
        assert simulation.load.text == DEMO.tool.name
        assert simulation.load.mass == DEMO.tool.mass


def test_bodies_that_are_placed_are_not_placed_again_while_the_plant_waits(make, monkeypatch):
    """A cell may have ten thousand, which would hold up everybody for seconds."""
    simulation = make(load="none")
    for machine in DEMO.equipment:
        machine.world_bodies()
    simulation.surroundings.offer(planned(DEMO))
    placed = []
    place = Body.placed
    monkeypatch.setattr(
        Body, "placed", lambda body, pose: (placed.append(body.name), place(body, pose))[1]
    )
    take_offered_cell(simulation)
    assert simulation.cell is DEMO
    of_parts = {body.name for part in DEMO.parts for body in part.lying(np.eye(4))}
    assert set(placed) <= of_parts


def test_a_robot_that_moves_takes_no_cell_until_it_stands(make, plan, run_out):
    simulation = make()
    executed(simulation, TrajectoryGoal(movement(plan, simulation)))
    simulation.run(0.2)
    simulation.surroundings.offer(planned(DEMO))
    take_offered_cell(simulation)
    assert simulation.cell is OPEN
    run_out(simulation)
    simulation.run(0.5)
    take_offered_cell(simulation)
    assert simulation.cell is DEMO


def test_a_trajectory_of_another_cell_is_refused_with_both_hashes(make, plan):
    simulation = make()
    trajectory = movement(plan, simulation)
    with pytest.raises(TrajectoryRefusedError, match=cell_hash(OPEN)) as refused:
        executed(simulation, TrajectoryGoal(trajectory, cell_hash=cell_hash(DEMO)))
    assert cell_hash(DEMO) in str(refused.value)
    assert executed(simulation, TrajectoryGoal(trajectory, cell_hash=cell_hash(OPEN))) > 0


@pytest.mark.parametrize("load", ["none", "gripper+part", "custom"])
def test_a_trajectory_of_another_load_is_refused_with_both_loads(load, plan, make):
    simulation = make()
    simulation.surroundings.offer(planned(DEMO))
    take_offered_cell(simulation)
    own = custom_load(DEMO, 20.0, np.array((0.0, 0.0, 0.1)), np.zeros(0), 0.0, 0.0)
    tool = DEMO.tool.name
    part = DEMO.parts[0].name
    names = {"none": "none", "gripper+part": f"{part}+{tool}", "custom": "custom"}
    simulation.set_load(own if load == "custom" else carried(DEMO, names[load]))
    trajectory = movement(plan, simulation)
    other = tool if load != "none" else f"{tool}+{part}"
    with pytest.raises(TrajectoryRefusedError) as refused:
        executed(simulation, TrajectoryGoal(trajectory, load=other))
    assert repr(other) in str(refused.value)
    assert repr(simulation.load.text) in str(refused.value)
    same = f"{tool}+{part}" if load == "gripper+part" else simulation.load.text
    assert executed(simulation, TrajectoryGoal(trajectory, load=same)) > 0


def test_a_cell_of_another_robot_or_another_mounting_is_not_taken(make):
    simulation = make()
    robot = replace(DEMO.robot, name="other")
    assert "its robot is 'other'" in simulation.surroundings.offer(
        planned(replace(DEMO, robot=robot))
    )
    tilted = np.diag([1.0, -1.0, -1.0, 1.0])
    assert "inclination" in simulation.surroundings.offer(planned(replace(DEMO, base_pose=tilted)))
    take_offered_cell(simulation)
    assert simulation.cell is OPEN


def test_a_trajectory_waits_for_its_cell_which_may_come_later(make, plan, monkeypatch):
    monkeypatch.setattr(surroundings, "PATIENCE", 60.0)  # s: a busy machine
    simulation = make()
    driver = Driver(simulation)
    trajectory = movement(plan, simulation)
    outcomes: list[GoalOutcome] = []
    try:
        goal = TrajectoryGoal(trajectory, cell_hash=cell_hash(DEMO))
        driver.submit(2, lambda: goal, outcomes.append)
        threading.Timer(0.05, lambda: driver.offer_cell(planned(DEMO))).start()
        for k in itertools.takewhile(lambda _: not outcomes, itertools.count()):
            driver.tick(k)
    finally:
        driver.close()
    assert [outcome.code for outcome in outcomes] == [ErrorCode.SUCCESSFUL]


def test_an_unknown_load_is_kept_with_a_warning(make):
    simulation = make()
    simulation.surroundings.offer(planned(DEMO))
    take_offered_cell(simulation)
    simulation.set_load(carried(DEMO, f"{DEMO.tool.name}+{DEMO.parts[0].name}"))
    mass = simulation.load.mass
    simulation.surroundings.offer(planned(without_parts()))
    take_offered_cell(simulation)
    assert simulation.load.mass == mass
    assert any("is kept as it is" in notice.sentence for notice in simulation.notices.take())


def test_the_announced_load_is_one_rigid_body():
    """Against the sum over points: masses and first and second moments of the loads."""
    load = carried(DEMO, f"{DEMO.tool.name}+{DEMO.parts[0].name}")
    one = announced(load)
    assert one.mass == pytest.approx(sum(each.mass for each in load.loads))
    moment = sum(each.mass * each.com for each in load.loads)
    np.testing.assert_allclose(one.mass * one.center_of_mass, moment)

    def about_origin(mass, com, inertia):
        return inertia + mass * (com @ com * np.eye(3) - np.outer(com, com))

    together = sum(about_origin(each.mass, each.com, each.inertia) for each in load.loads)
    np.testing.assert_allclose(about_origin(one.mass, one.center_of_mass, one.inertia), together)
    assert announced(carried(DEMO, "none")).mass == 0.0


def same_name(**other):
    """A robot under the driver's name with other data."""
    return replace(DEMO, robot=replace(DEMO.robot, **other))


@pytest.mark.parametrize(
    "other",
    [
        same_name(capsules=DEMO.robot.capsules[:1], self_pairs=(), load_self_capsules=()),
        same_name(velocity_max=DEMO.robot.velocity_max * 1.000001),
    ],
    ids=["one capsule", "a little faster"],
)
def test_a_robot_is_compared_by_its_content(make, other):
    driver = Driver(make())
    driver.offer_cell(planned(other))
    for stamp in (2_000_000, 4_000_000):
        driver.tick(stamp)
    driver.close()
    assert driver._simulation.cell is not other
    assert any("data differ" in notice.sentence for notice in driver.snapshot(0.0).notices)


def test_a_cell_without_bodies_is_a_cell(make, plan):
    simulation = make(load="none")
    bare = replace(
        OPEN, equipment=(), parts=(), stations=(), program=(), floor=False, tool=None, paths=()
    )
    driver = Driver(simulation)
    driver.offer_cell(planned(bare))
    for k in range(1, 200):
        driver.tick(k * 2_000_000)
    driver.close()
    assert driver.failure == ""
    assert simulation.cell is bare


def test_whatever_fails_while_a_cell_is_tried_leaves_the_old_one(make, monkeypatch):
    simulation = make()
    driver = Driver(simulation)
    monkeypatch.setattr(
        "ir_sim_driver.controller.driver.ContactScene.of",
        lambda *given: (_ for _ in ()).throw(IndexError("no such capsule")),
    )
    before = simulation.cell
    driver.offer_cell(planned(DEMO))
    monkeypatch.undo()
    driver.tick(2_000_000)
    driver.close()
    assert simulation.cell is before
    assert any("no such capsule" in notice.sentence for notice in driver.snapshot(0.0).notices)


def test_whatever_fails_while_a_cell_is_taken_leaves_the_old_one(make, monkeypatch):
    simulation = make()
    driver = Driver(simulation)
    before = simulation.cell
    hashed = simulation.surroundings.hash
    driver.offer_cell(planned(DEMO))
    stand_in = simulation.cell_watch.stand_in

    def fails(cell, load):
        if cell.name == DEMO.name:
            raise ZeroDivisionError
        stand_in(cell, load)

    monkeypatch.setattr(simulation.cell_watch, "stand_in", fails)
    driver.tick(2_000_000)
    driver.tick(4_000_000)
    driver.close()
    assert driver.failure == ""
    assert simulation.cell is before
    assert simulation.surroundings.hash == hashed


def test_another_cell_is_arranged_once(make, monkeypatch):
    """A cell of thousands of bodies takes long, and the plant waits meanwhile."""
    simulation = make()
    driver = Driver(simulation)
    driver.offer_cell(planned(DEMO))
    arranged = []
    scene_of = contacts.ContactScene.of
    monkeypatch.setattr(
        contacts.ContactScene,
        "of",
        lambda cell, *given: arranged.append(cell.name) or scene_of(cell, *given),
    )
    driver.tick(2_000_000)
    driver.tick(4_000_000)
    driver.close()
    assert arranged == [DEMO.name]


def test_whatever_fails_while_a_load_is_taken_leaves_the_old_one(make, monkeypatch):
    simulation = make(load="none")
    before = simulation.load
    carry = simulation.cell_watch.carry

    def fails(load):
        if load is not before:
            raise ValueError("no place for it")
        carry(load)

    monkeypatch.setattr(simulation.cell_watch, "carry", fails)
    driver = Driver(simulation)
    with pytest.raises(RequestRefusedError, match="no place for it"):
        driver.set_load(lambda cell: carried(cell, "none"))
    driver.close()
    assert simulation.load is before
