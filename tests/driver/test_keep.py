"""Where along a trajectory the contacts of a station are allowed: in its machine's zone, nowhere
else.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import load_cell, load_power_data
from ir_description.cell import AllowedContact
from ir_kernels.dynamics import DynamicsModel
from ir_msgs_py.trajectory import JointTrajectory
from ir_sim_driver import make_simulation
from ir_sim_driver.controller.cell_scene import Keep
from ir_sim_driver.controller.contacts import HARDEST
from ir_sim_driver.errors import TrajectoryRefusedError
from ir_sim_driver.motion import Path, TrajectoryGoal
from ir_sim_driver.plant import carried, typical_plant

DEMO = load_cell("demo")
HOME = np.array(DEMO.machine_home)
STATION = "infeed_pick"
SCENE = make_simulation(DEMO, backend="ideal").cell_watch.scene
INSIDE = 2.0 * np.ones(1)  # another value than outside
OUTSIDE = np.ones(1)


def over_the_zone():
    """A configuration with the tcp in the zone of the station's machine."""
    zone = DEMO.machine(DEMO.station(STATION).equipment).zone
    rng = np.random.default_rng(0)
    while True:
        q = rng.uniform(DEMO.robot.position_min, DEMO.robot.position_max, (1000, 6))
        depth = SCENE.depth(q, STATION)
        if depth.max() > 0.1 * zone.size.min():
            return q[depth.argmax()]


INTO = over_the_zone()
points = st.lists(
    st.tuples(st.floats(0.0, 1.3), st.lists(st.floats(-0.4, 0.4), min_size=6, max_size=6)),
    max_size=3,
)


@given(points, st.floats(0.5, 20.0))
@settings(max_examples=25, deadline=None)
def test_the_pieces_are_the_path_and_inside_means_in_the_zone(between, seconds):
    via = [HOME + share * (INTO - HOME) + np.array(off) for share, off in between]
    q = np.array([HOME, *via, INTO])
    rest = np.zeros_like(q)
    times = np.linspace(0.0, seconds, len(q))
    trajectory = JointTrajectory.from_seconds(DEMO.robot.joint_names, times, q, rest, rest)
    path = Path(*trajectory.coefficients(), q[0])
    begin = 0.0
    for piece in Keep(SCENE, OUTSIDE, STATION, INSIDE).pieces(path.coefficients, path.durations):
        own = Path(piece.coefficients, piece.durations, piece.coefficients[0, :, 0])
        t = np.linspace(0.0, own.duration, 40)
        np.testing.assert_allclose(own.positions(t), path.positions(begin + t), atol=1e-9)
        depth = SCENE.depth(own.positions(t), STATION)
        if piece.thresholds is INSIDE:
            assert (depth > -1e-9).all()
        else:
            assert (depth < 0.01).all()  # found within some millimetres
        begin += own.duration
    assert begin == pytest.approx(path.duration)


def test_an_allowed_pair_may_not_touch_far_from_its_station():
    """Two links that touch at a posture far from the station are allowed to touch, at the
    station.
    """
    rng = np.random.default_rng(1)
    q = rng.uniform(DEMO.robot.position_min, DEMO.robot.position_max, (3000, 6))
    near = SCENE.model.min_distance(q)
    shallow = (near.distance < -1e-4) & (near.distance > -4e-3) & (SCENE.depth(q, STATION) < -0.3)
    k = int(np.flatnonzero(shallow)[0])
    pair = SCENE.model.pairs[near.pair[k]]
    contact = AllowedContact(pair.body_a, pair.body_b, 0.0)
    stations = tuple(
        replace(s, allowed_contacts=(*s.allowed_contacts, contact)) if s.name == STATION else s
        for s in DEMO.stations
    )
    simulation = make_simulation(replace(DEMO, stations=stations), backend="ideal")
    rest = np.zeros((2, 6))
    there = JointTrajectory.from_seconds(
        DEMO.robot.joint_names, [0.0, 1.0], [q[k], q[k]], rest, rest
    )
    with pytest.raises(TrajectoryRefusedError, match=f"{pair.body_a} and {pair.body_b}"):
        simulation.vet(TrajectoryGoal(there, station=STATION), 0)


def test_no_state_accelerates_surfaces_harder_than_the_watch_counts_on():
    """By the kernels: random states under the whole envelope, of plants and loads of all kinds."""
    rng = np.random.default_rng(2)
    robot = DEMO.robot
    data = load_power_data()
    tool = DEMO.tool.name
    loads = [carried(DEMO, text).loads for text in ("none", tool, f"{tool}+{DEMO.parts[0].name}")]
    for k, load in enumerate(loads * 2):
        plant = typical_plant(robot, data, k).robot
        dynamics = DynamicsModel(plant, load, DEMO.base_pose)
        q = rng.uniform(robot.position_min, robot.position_max, (5000, 6))
        qd = rng.uniform(-1.1, 1.1, (5000, 6)) * robot.velocity_max * rng.integers(0, 2, (5000, 6))
        most = dynamics.torque_limit(np.zeros_like(q))
        a = np.abs(dynamics.forward_dynamics(q, qd, most * rng.choice([-1.0, 0.0, 1.0], (5000, 6))))
        for _, reach in SCENE.groups:
            assert (
                2.0 * float(reach @ robot.acceleration_max) < (a @ reach).max()
            )  # a bound of 2 is wrong
            assert (a @ reach).max() < HARDEST / 1.3 * float(reach @ robot.acceleration_max)
