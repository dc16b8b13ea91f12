"""Contact with machines, floor and parts: refused before it starts, else stopped; then left."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import ProgramStep, load_cell
from ir_description.cell import AllowedContact, Zone, machine_in
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import make_simulation
from ir_sim_driver.controller.cell_scene import MachinesInScene, Parts
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion.goal import ErrorCode, TrajectoryGoal
from ir_sim_driver.plant import carried

DEMO = load_cell("demo")
HOME = np.array(DEMO.machine_home)
INTO_THE_PALLET = HOME + np.array([np.pi - 1.2, 1.2, 0.0, 0.0, 0.0, 0.0])
REACTION = 2  # steps from the first touch until the motors brake


def movement(*points, seconds=4.0):
    rest = np.zeros((len(points), 6))
    return JointTrajectory.from_seconds(
        DEMO.robot.joint_names, np.linspace(0.0, seconds, len(points)), np.array(points), rest, rest
    )


def started(simulation, *points, seconds=4.0, **more):
    goal = TrajectoryGoal(movement(*points, seconds=seconds), **more)
    return simulation.execute(simulation.vet(goal, 0), 0)


@pytest.fixture(params=["ideal", "pybullet"])
def simulation(request):
    return make_simulation(DEMO, backend=request.param)


def test_a_trajectory_that_collides_is_refused_with_pair_and_time():
    simulation = make_simulation(DEMO, backend="ideal")
    with pytest.raises(
        TrajectoryRefusedError, match=r"t_bar and infeed_pallet \(environment\) .* at 2\.\d+ s"
    ):
        started(simulation, HOME, INTO_THE_PALLET)
    assert not simulation.executor.active


@pytest.mark.parametrize("seconds", [4.0, pytest.param(20.0, marks=pytest.mark.long)])
def test_a_contact_stops_the_robot_and_ends_the_goal(simulation, run_out, seconds):
    started(simulation, HOME, INTO_THE_PALLET, seconds=seconds, allow_collision=True)
    outcome = run_out(simulation)
    assert outcome.code is ErrorCode.CONTACT
    contact = outcome.contact
    assert {contact.pair.body_a, contact.pair.body_b} == {"t_bar", "infeed_pallet"}
    assert "t_bar touched infeed_pallet" in outcome.sentence
    assert simulation.fault
    assert simulation.cell_watch.take_contacts() == (contact,)
    assert simulation.backend.standing
    distance = simulation.cell_watch.scene.model.distances(simulation.backend.q[None])[0]
    assert distance.min() - 1e-12 < contact.pair.distance < 0.0  # other pairs may be deeper
    assert contact.depth <= contact.speed * contact.stopped_after + 1e-3


def test_after_a_contact_only_what_goes_away_is_done(run_out):
    simulation = make_simulation(DEMO, backend="ideal")
    started(simulation, HOME, INTO_THE_PALLET, allow_collision=True)
    run_out(simulation)
    with pytest.raises(TrajectoryRefusedError, match="recover first"):
        started(simulation, simulation.backend.q, HOME, allow_collision=True)
    simulation.recover()
    simulation.run(1.0)
    q = simulation.executor.command
    with pytest.raises(TrajectoryRefusedError, match="collides"):
        started(simulation, q, INTO_THE_PALLET)
    deeper = q + 0.02 * (INTO_THE_PALLET - HOME)
    started(simulation, q, deeper, allow_collision=True)
    assert run_out(simulation).code is ErrorCode.CONTACT
    simulation.recover()
    simulation.run(1.0)
    started(simulation, simulation.executor.command, HOME)
    assert run_out(simulation).code is ErrorCode.SUCCESSFUL
    with pytest.raises(TrajectoryRefusedError, match="collides"):
        started(simulation, HOME, INTO_THE_PALLET)


def test_a_pair_that_the_station_allows_may_touch_and_no_other(run_out):
    bar = AllowedContact("t_bar", "infeed_pallet", 0.0)
    stations = tuple(
        replace(station, allowed_contacts=(*station.allowed_contacts, bar))
        if station.name == "infeed_pick"
        else station
        for station in DEMO.stations
    )
    zone = Zone("OPEN", np.eye(4), np.full(3, 5.0))  # the tool is in it where it touches
    machines = tuple(replace(each, zone_in_equipment=zone) for each in DEMO.equipment)
    cell = replace(DEMO, stations=stations, equipment=machines)
    simulation = make_simulation(cell, backend="ideal")
    started(simulation, HOME, INTO_THE_PALLET, allow_collision=True)
    first = run_out(simulation).contact
    there = make_simulation(cell, backend="ideal")
    started(there, HOME, INTO_THE_PALLET, allow_collision=True, station="infeed_pick")
    contact = run_out(there).contact
    assert (
        contact.path_time > first.path_time
    )  # until it is deeper than what is allowed, or another pair
    with pytest.raises(TrajectoryRefusedError, match="station 'nowhere' is unknown"):
        started(there, HOME, HOME, station="nowhere")


def test_a_door_that_is_not_open_stops_the_start_and_names_the_signal(run_out):
    simulation = make_simulation(DEMO, backend="ideal")
    relies = {"states": ("lathe=door_open",)}
    started(simulation, HOME, HOME, seconds=0.1, **relies)
    run_out(simulation)
    simulation.cell_watch.hear("lathe_open_door", False)
    with pytest.raises(TrajectoryRefusedError, match="changing to door_closed for another"):
        started(simulation, HOME, HOME, **relies)
    simulation.run(1.6)
    with pytest.raises(
        TrajectoryRefusedError, match=r"lathe is door_closed: .* wait for signal lathe_door_open"
    ):
        started(simulation, HOME, HOME, **relies)
    simulation.cell_watch.hear("lathe_open_door", True)
    simulation.run(1.0)
    with pytest.raises(TrajectoryRefusedError, match="changing to door_open"):
        started(simulation, HOME, HOME, **relies)
    simulation.run(0.6)
    started(simulation, HOME, HOME, **relies)
    with pytest.raises(TrajectoryRefusedError, match="known are door_open, door_closed"):
        started(simulation, HOME, HOME, states=("lathe=ajar",))


def test_a_door_that_closes_onto_the_robot_is_a_contact():
    """The tool reaches through the door's plane: 1.62 m to the left, at the height of the door."""
    simulation = make_simulation(DEMO, backend="ideal")
    through = np.array([-np.pi / 2, -0.7, 1.0, 0.0, -0.3, 0.0])
    simulation.backend.reset(through)
    simulation.executor.hold(through)
    simulation.cell_watch.recovered()
    simulation.run(0.01)
    assert not simulation.fault
    simulation.cell_watch.hear("lathe_open_door", False)
    simulation.run(0.01)
    assert "lathe_door_" in simulation.fault
    (contact,) = simulation.cell_watch.take_contacts()
    assert contact.speed == pytest.approx(1.1 / 1.5)  # its lower edge, in the time of the switch
    assert contact.stopped_after <= 0.002


def test_an_opening_door_counts_as_what_it_sweeps():
    """Every body between the two places of the door touches what it sweeps."""
    simulation = make_simulation(DEMO, backend="ideal")
    simulation.cell_watch.hear("lathe_open_door", False)
    scene = simulation.cell_watch.scene
    swept = [b for _, _, b in scene.model.pairs if b == "lathe_door_up_to_lathe_door_down"]
    assert swept
    lathe = machine_in(DEMO.machine("lathe"), ("door_open", "door_closed"))
    (hull,) = (body for body in lathe.world_bodies() if body.name == swept[0])
    low, high = hull.bounds()
    for body in DEMO.machine("lathe").bodies_in("door_open", "door_closed"):
        if body.name.startswith("lathe_door"):
            a, b = body.bounds()
            assert (a >= low - 1e-9).all()
            assert (b <= high + 1e-9).all()
    simulation.run(1.6)
    assert not any(b == swept[0] for _, _, b in simulation.cell_watch.scene.model.pairs)


def test_a_part_stays_where_it_was_put_down(run_out):
    simulation = make_simulation(DEMO, backend="ideal")
    gripper = DEMO.tool.name
    simulation.set_load(carried(DEMO, f"{gripper}+gear"))
    simulation.set_load(carried(DEMO, gripper))
    lying = [name for _, _, name in simulation.cell_watch.scene.model.pairs if name == "gear_lying"]
    assert lying
    part = DEMO.part("gear")
    tcp = simulation.tool.chain.tcp_poses(simulation.backend.q[None])[0]
    (body,) = part.lying(tcp)
    (there,) = simulation.cell_watch.lying
    np.testing.assert_allclose(there.pose, body.pose)
    turned = HOME + np.array([0.2, 0.0, 0.0, 0.0, 0.0, 0.0])
    with pytest.raises(TrajectoryRefusedError, match="gear_lying"):
        started(simulation, HOME, turned)


def test_looks_are_rare_where_there_is_room():
    simulation = make_simulation(DEMO, backend="ideal")
    looks = []
    look = simulation.cell_watch.look
    simulation.cell_watch.look = lambda *given: (looks.append(1), look(*given))
    started(simulation, HOME, HOME + np.array([1.0, -0.2, 0.0, 0.0, 0.5, 0.0]))
    simulation.run(4.0)
    assert len(looks) < 4000 / 15  # each takes some 5 us of an idle machine, so below 1 us a step


signals = st.lists(st.tuples(st.booleans(), st.floats(0.0, 3.0)), max_size=12)


@given(signals)
@settings(max_examples=50, deadline=None)
def test_a_machine_ends_in_the_state_of_its_last_signal_in_its_own_time(heard):
    machines = MachinesInScene(DEMO)
    now = 0.0
    switch = DEMO.machine("lathe").switch
    for level, pause in heard:
        machines.hear("lathe_open_door", level, now)
        wanted = switch.on if level else switch.off
        (state,) = (each for each in machines.states(now) if each.equipment == "lathe")
        assert wanted in machines.present(DEMO.machine("lathe"))
        assert (state.next or state.state) == wanted
        assert 0.0 <= state.remaining <= switch.time + 1e-9
        now += pause
        machines.step(now)
    machines.step(now + switch.time + 1e-9)
    if heard:
        assert machines.present(DEMO.machine("lathe")) == (
            switch.on if heard[-1][0] else switch.off,
        )


def test_parts_come_and_go_at_the_ends_of_a_route() -> None:
    """The same places as the cell's own rule gives, from loads and the place of the tool alone."""
    cell = load_cell("flexible")
    part = cell.part("gear")
    load = replace(part.load, name="gear.1", capsules=())
    cell = replace(cell, parts=(*cell.parts, replace(part, load=load, bodies=(), station="")))
    tool = carried(cell, "gripper")
    parts = Parts(cell, tool)
    places = cell.parts_at_start()
    visits = cell.route.visits
    for here, there in itertools.pairwise(visits):
        for step in (
            ProgramStep("STATION", here, attach="gear"),
            ProgramStep("STATION", there, detach="gear"),
        ):
            places = places.after(step)
            held = carried(cell, f"gripper+{places.held}") if places.held else tool
            parts.carry(held, cell.station(step.target).pose)
            lying = {name: station for name, station in places.lying.items() if station}
            assert parts._places.keys() == lying.keys()
            for name, station in lying.items():
                assert np.array_equal(parts._places[name], cell.station(station).pose)
