"""The bundled cells: distances are those of their origin, and the demonstration cell can be worked
in.
"""

from __future__ import annotations

from dataclasses import fields
from itertools import pairwise

import numpy as np
import pytest

from ir_description import (
    Body,
    Cell,
    PartPlaces,
    Station,
    bundled_cells,
    cell_from_yaml,
    cell_to_yaml,
    check_cell,
    load_cell,
    load_power_data,
)
from ir_description.poses import composed, pose_of
from ir_kernels import Chain, CollisionModel
from ir_kernels.spherical_wrist import SphericalWristIk
from ir_msgs_py.plc import PLC_INPUT_NAMES, PlcOutputs
from ir_values.arrays import FloatArray

PARK_CLEARANCE = 0.0982
CLEARANCE = {  # m, at the configurations of the tasks; published with the cells to 0.1 mm
    "open": {"p1": 0.1031, "p2": 0.0975, "conv": 0.0853, "p1b": 0.1084, "cab": 0.0584},
    "table_columns": {"tL": 0.0777, "tR": 0.0777, "side1": 0.0724, "side2": 0.0747, "mid": 0.0581},
    "cnc_door": {"cnc": 0.1468, "cncL": 0.0350, "press": 0.1432, "pal": 0.0975},
    "deep_box": {"bin": 0.0528, "binhi": 0.0950, "tun": 0.0609, "pal": 0.0975},
}
PUBLISHED = 6e-5  # m: the rounding of those figures
REQUIRED = 0.030  # m: what the demonstration cell keeps at its stations, allowed contacts apart
SAFETY_DISTANCE = 0.020  # m: the planner's default


def model(cell: Cell, held: str = "", places: PartPlaces | None = None) -> CollisionModel:
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    return CollisionModel(
        chain, cell.capsules(held), cell.bodies(places), cell.self_pairs(held), cell.ignored_pairs
    )


def withdrawn(station: Station) -> FloatArray:
    """Pose (4, 4) of the tcp in the world at the end of the approach, along -x of the tcp."""
    return composed(station.pose, pose_of((-station.approach_distance, 0.0, 0.0)))


def thresholds(
    collisions: CollisionModel, station: Station | None, safety_distance: float
) -> FloatArray:
    """Safety distance per pair (Z,) [m], the station's own for its allowed contacts."""
    allowed = {
        frozenset((c.body_a, c.body_b)): c.safety_distance
        for c in (station.allowed_contacts if station is not None else ())
    }
    return np.array(
        [
            allowed.get(frozenset((pair.body_a, pair.body_b)), safety_distance)
            for pair in collisions.pairs
        ]
    )


def unturned(q: FloatArray) -> FloatArray:
    """The configurations (M, 6) with the wrist as at machine home: |A4| below a quarter turn."""
    return q[np.abs(q[:, 3]) < np.pi / 2.0]


def test_all_cells_are_there() -> None:
    known = (
        "cnc_door",
        "deep_box",
        "demo",
        "flexible",
        "kr300_pallets",
        "kr6_bench",
        "open",
        "table_columns",
        "ur10e_bench",
    )
    assert bundled_cells() == known


@pytest.mark.parametrize("name", bundled_cells())
def test_a_written_cell_is_read_back_unchanged(name: str) -> None:
    text = cell_to_yaml(load_cell(name))
    assert cell_to_yaml(cell_from_yaml(text)) == text


@pytest.mark.parametrize("name", bundled_cells())
def test_nothing_looks_wrong(name: str) -> None:
    assert check_cell(load_cell(name)) == ()


@pytest.mark.parametrize("name", CLEARANCE)
def test_tasks_stand_at_their_stations_with_the_published_clearance(name: str) -> None:
    cell = load_cell(name)
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    collisions = model(cell)
    for task in cell.tasks:
        for station, q in zip(task.name.split("->"), (task.start, task.goal), strict=True):
            distance = float(collisions.min_distance(q[None]).distance[0])
            if station == "home":  # the start of these tasks is the park posture
                assert q == pytest.approx(cell.park, abs=1e-8)
                assert distance == pytest.approx(PARK_CLEARANCE, abs=PUBLISHED)
                continue
            assert distance == pytest.approx(CLEARANCE[name][station], abs=PUBLISHED)
            pose = chain.tcp_poses(q[None])[0]
            assert pose == pytest.approx(cell.station(station).pose, abs=5e-6)


def test_zone_kinds_say_how_closed_a_machine_is() -> None:
    kinds = {m.name: m.zone.kind for name in CLEARANCE for m in load_cell(name).equipment}
    assert {n for n, kind in kinds.items() if kind == "SEMI_CLOSED"} == {"cnc", "press"}
    assert {n for n, kind in kinds.items() if kind == "CLOSED"} == {"bin", "tun"}


def test_the_demo_has_five_stations_of_which_two_are_semi_closed() -> None:
    cell = load_cell("demo")
    zones = {station.name: station.zone for station in cell.stations}
    assert [name for name, zone in zones.items() if zone == "SEMI_CLOSED"] == [
        "lathe_work",
        "washer_rinse",
    ]
    assert len(zones) == 5
    pauses = [step.power_mode for step in cell.program if step.kind == "PAUSE"]
    assert {"BUS_POWER_OFF", "HIBERNATION"} <= set(pauses)
    assert cell.program[0].target == cell.program[-1].target == "home"


def test_the_demo_pauses_at_machine_home() -> None:
    """Table II was measured there."""
    program = load_cell("demo").program
    for before, step in pairwise(program):
        if step.kind == "PAUSE":
            assert (before.kind, before.target) == ("POSTURE", "home")


@pytest.mark.parametrize("state", ["door_open", "door_closed"])
def test_the_demo_s_postures_are_free(state: str) -> None:
    cell = load_cell("demo").with_equipment("lathe", state=state)
    postures = np.array([cell.machine_home, cell.park])
    assert model(cell).min_distance(postures).distance.min() > REQUIRED


def test_every_station_of_the_demo_but_the_washer_s_can_be_entered_and_left_straight() -> None:
    """There is a configuration that keeps 30 mm along the whole retraction, allowed contacts apart;
    in the washer a plate of nozzles is in the path of the blank.
    """
    cell = load_cell("demo")
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    ik = SphericalWristIk(chain, cell.robot.position_min, cell.robot.position_max)
    places = cell.parts_at_start()
    for step in cell.program:
        after = places.after(step)
        if step.kind == "STATION":
            station = cell.station(step.target)
            steps = np.linspace(0.0, station.approach_distance, 12)
            poses = np.repeat(station.pose[None], len(steps), axis=0)
            poses[:, :3, 3] -= steps[:, None] * station.pose[:3, 0]
            assert poses[-1] == pytest.approx(withdrawn(station))
            solutions = ik.solve(poses)
            free = np.ones(len(solutions.q), dtype=bool)
            for state in (places, after):  # as it comes and as it goes
                collisions = model(cell, state.held, state)
                free &= collisions.is_free(solutions.q, thresholds(collisions, station, REQUIRED))
            # the same branch all along, e.g. wrist not turned
            branches = [
                set(solutions.branch[(solutions.pose_index == k) & free].tolist())
                for k in range(len(steps))
            ]
            assert bool(set.intersection(*branches)) is (station.name != "washer_rinse"), (
                station.name
            )
            assert branches[-1], station.name
        places = after


def test_every_move_of_the_demo_is_free_straight_or_by_way_of_park() -> None:
    cell = load_cell("demo")
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    ik = SphericalWristIk(chain, cell.robot.position_min, cell.robot.position_max)
    places = cell.parts_at_start()
    here = cell.machine_home[None]
    for step in cell.program:
        if step.kind == "PAUSE":
            continue
        there = (
            cell.posture(step.target)[None]
            if step.kind == "POSTURE"
            else unturned(ik.solve(withdrawn(cell.station(step.target))[None]).q)
        )
        collisions = model(cell, places.held, places)

        def connects(a: FloatArray, b: FloatArray, collisions: CollisionModel = collisions) -> bool:
            q = a + (b - a) * np.linspace(0.0, 1.0, 50)[:, None]
            return bool(collisions.is_free(q, SAFETY_DISTANCE).all())

        straight = any(connects(a, b) for a in here for b in there)
        by_park = any(connects(a, cell.park) for a in here) and any(
            connects(cell.park, b) for b in there
        )
        assert straight or by_park, step.target
        places = places.after(step)
        here = there


def test_the_demo_s_tool_is_out_of_the_zone_after_the_retraction() -> None:
    """Every capsule from link_3 to the tool is farther than the safety distance from the zone's
    box.
    """
    cell = load_cell("demo")
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    ik = SphericalWristIk(chain, cell.robot.position_min, cell.robot.position_max)
    for station in cell.stations:
        zone = cell.machine(station.equipment).zone
        forbidden = Body("zone", "box", zone.pose, zone.size)
        moving = [capsule for capsule in cell.capsules("gear") if capsule.link >= 3]
        collisions = CollisionModel(chain, moving, [forbidden], ())
        q = ik.solve(withdrawn(station)[None]).q
        assert collisions.min_distance(q).distance.max() > SAFETY_DISTANCE, station.name


def test_the_plc_bits_of_the_data_are_those_that_driver_and_clients_use() -> None:
    """Names and mutual exclusion: the data stands beside its source, the code beside its use."""
    power = load_power_data()
    for bit in power.plc_inputs:
        assert bit.name.lower() in PLC_INPUT_NAMES
        assert set(bit.excludes) == {other.name for other in power.plc_inputs if other is not bit}
    outputs = {field.name for field in fields(PlcOutputs)}
    assert {bit.name.lower() for bit in power.plc_outputs} <= outputs
