"""A cell is a value: another state of a machine is another cell, checked like the first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ir_description import (
    Body,
    Cell,
    InvalidValueError,
    Load,
    ProgramStep,
    UnknownNameError,
    cell_from_yaml,
    cell_to_yaml,
    check_cell,
    load_cell,
)
from ir_description.cell import ToolTilt, Zone, zone_around
from ir_description.poses import composed, inverse, pose_of, rotation_from_abc
from ir_description.robot import ToolLimits
from ir_description.shapes import BodyKind, capsule_distance
from ir_kernels import Chain, CollisionModel
from ir_values.arrays import FloatArray, solid_box_inertia


@pytest.fixture
def cell() -> Cell:
    return load_cell("demo")


def names(cell: Cell) -> list[str]:
    return [body.name for body in cell.bodies()]


def test_the_door_is_where_the_state_says(cell: Cell) -> None:
    assert "lathe_door_up" in names(cell)
    assert "lathe_door_down" not in names(cell)
    closed = cell.with_equipment("lathe", state="door_closed")
    assert "lathe_door_down" in names(closed)
    assert "lathe_door_up" not in names(closed)


def test_the_zone_does_not_change_with_the_door(cell: Cell) -> None:
    closed = cell.with_equipment("lathe", state="door_closed")
    assert np.array_equal(closed.machine("lathe").zone.size, cell.machine("lathe").zone.size)


def test_bodies_zone_and_stations_move_with_their_machine(cell: Cell) -> None:
    move = pose_of([0.1, -0.2, 0.3], rotation_from_abc([10, 20, 30]))
    old = cell.machine("lathe")
    moved = cell.with_equipment("lathe", pose=composed(move, old.pose))
    new = moved.machine("lathe")
    assert new.zone.pose == pytest.approx(move @ old.zone.pose)
    assert moved.station("lathe_work").pose == pytest.approx(move @ cell.station("lathe_work").pose)
    assert moved.station("infeed_pick").pose == pytest.approx(cell.station("infeed_pick").pose)
    for body, before in zip(new.world_bodies(), old.world_bodies(), strict=True):
        assert body.pose == pytest.approx(move @ before.pose)


def test_what_a_station_says_stays_when_its_machine_or_itself_is_moved(cell: Cell) -> None:
    said = {
        "limits": ToolLimits(0.5, 3.0, True),
        "tilt": ToolTilt(0.1),
        "blend": 0.05,
        "takes": ("raw",),
        "gives": "turned",
        "approach_distance": 0.2,
    }
    stations = tuple(replace(station, **said) for station in cell.stations)
    saying = replace(cell, stations=stations)
    there = pose_of([0.1, -0.2, 0.3])
    lathe = cell.station("lathe_work")
    for moved in (
        saying.with_equipment("lathe", pose=composed(there, cell.machine("lathe").pose)),
        saying.with_equipment("lathe", state="door_closed"),
        saying.with_station("lathe_work", composed(there, lathe.pose_in_equipment)),
    ):
        after = moved.station("lathe_work")
        assert {name: getattr(after, name) for name in said} == said
        assert after.allowed_contacts == lathe.allowed_contacts
        assert after.search == lathe.search


def test_a_machine_moved_there_and_back_is_written_as_before(cell: Cell) -> None:
    place = cell.machine("gauge").pose
    away = cell.with_equipment("gauge", pose=pose_of([5.0, 5.0, 0.0]))
    assert cell_to_yaml(away.with_equipment("gauge", pose=place)) == cell_to_yaml(cell)


def test_equipment_that_is_switched_off_is_not_there(cell: Cell) -> None:
    off = cell.with_equipment("cabinet", enabled=False)
    assert "cabinet" not in names(off)
    assert len(off.bodies()) == len(cell.bodies()) - 1
    assert cell_to_yaml(cell_from_yaml(cell_to_yaml(off))) == cell_to_yaml(off)


def test_a_part_is_a_body_where_it_lies_and_a_load_while_it_is_held(cell: Cell) -> None:
    start = cell.parts_at_start()
    held = start.after(cell.program[1])
    assert held.held == "gear"
    assert "gear_lying" in [body.name for body in cell.bodies(start)]
    assert "gear_lying" not in [body.name for body in cell.bodies(held)]
    assert [load.name for load in cell.loads(held.held)] == ["gripper", "gear"]
    put = held.after(next(step for step in cell.program if step.detach))
    lying = next(body for body in cell.bodies(put) if body.name == "gear_lying")
    held_centre = (
        cell.station("outfeed_place").pose
        @ inverse(cell.tcp)
        @ np.append(cell.loads("gear")[1].com, 1.0)
    )
    assert lying.pose[:3, 3] == pytest.approx(held_centre[:3])


def test_a_held_part_has_mass_and_capsules_of_the_flange(cell: Cell) -> None:
    gear = cell.loads("gear")[1]
    assert gear.com == pytest.approx([0.36, 0.0, 0.0])
    assert {capsule.link for capsule in gear.capsules} == {6}
    assert ("gear_held", "l2") in cell.self_pairs("gear")
    assert ("gear_held", "l2") not in cell.self_pairs()


def test_turning_a_load_turns_its_inertia() -> None:
    load = Load("part", "part", 2.0, np.zeros(3), solid_box_inertia(2.0, (0.1, 0.2, 0.3)))
    turned = load.placed(pose_of([1.0, 0.0, 0.0], rotation_from_abc([90, 0, 0])))
    assert np.diag(turned.inertia) == pytest.approx(np.diag(load.inertia)[[1, 0, 2]])
    assert turned.com == pytest.approx([1.0, 0.0, 0.0])


def test_unknown_names_list_the_known(cell: Cell) -> None:
    with pytest.raises(
        UnknownNameError, match="equipment 'press' is unknown; known are infeed, lathe, gauge"
    ):
        cell.with_equipment("press")
    with pytest.raises(
        UnknownNameError, match="state of lathe 'ajar' is unknown; known are door_open, door_closed"
    ):
        cell.with_equipment("lathe", state="ajar")
    with pytest.raises(UnknownNameError, match="state of gauge 'open' is unknown; known are none"):
        cell.with_equipment("gauge", state="open")
    with pytest.raises(UnknownNameError, match="station 'x' is unknown; known are infeed_pick"):
        cell.station("x")
    with pytest.raises(UnknownNameError, match="posture 'bed' is unknown; known are home, park"):
        cell.posture("bed")


def test_a_pose_that_is_none_is_refused(cell: Cell) -> None:
    for pose in (
        np.full((4, 4), np.nan),
        np.eye(3),
        np.diag([1.0, 1.0, -1.0, 1.0]),
        np.diag([2.0, 1.0, 1.0, 1.0]),
    ):
        with pytest.raises(InvalidValueError, match="pose of lathe"):
            cell.with_equipment("lathe", pose=pose)


def test_a_cell_built_in_code_is_checked_like_a_file(cell: Cell) -> None:
    with pytest.raises(UnknownNameError, match="station 'nowhere' is unknown"):
        replace(cell, program=(ProgramStep("STATION", "nowhere"),))
    with pytest.raises(
        InvalidValueError, match="gear can't be attached at lathe_work, it lies at infeed_pick"
    ):
        replace(cell, program=(ProgramStep("STATION", "lathe_work", attach="gear"),))
    with pytest.raises(InvalidValueError, match="equipment lathe is there twice"):
        replace(
            cell,
            equipment=(
                cell.machine("lathe"),
                replace(cell.machine("lathe"), bodies=(), states=(), state="", switch=None),
            ),
        )


def test_the_default_zone_encloses_bodies_in_any_orientation() -> None:
    rng = np.random.default_rng(5)
    kinds = {
        "box": [0.3, 0.5, 0.7],
        "cylinder": [0.3, 0.9, 0],
        "sphere": [0.4, 0, 0],
        "capsule": [0.2, 0.6, 0],
    }
    for kind, size in kinds.items():
        for _ in range(20):
            pose = pose_of(rng.uniform(-1, 1, 3), rotation_from_abc(rng.uniform(-180, 180, 3)))
            body = Body("body", kind, pose, np.array(size))  # type: ignore[arg-type]
            zone = zone_around("OPEN", [body])
            surface = surface_points(body, rng) @ pose[:3, :3].T + pose[:3, 3] - zone.pose[:3, 3]
            assert (np.abs(surface) <= zone.size / 2 + 1e-12).all()
            assert np.abs(surface).max(axis=0) == pytest.approx(
                zone.size / 2, rel=0.05
            )  # and no larger


def table_with(stations: str, zone: str = "OPEN") -> Cell:
    return cell_from_yaml(f"""
format: ir_cell/1
name: bench
robot: kr210_r2700_extra
equipment:
  - name: table
    pose: {{xyz: [2, 0, 0], abc_deg: [30, 0, 0]}}
    zone: {zone}
    bodies:
      - {{name: top, kind: box, size: [0.8, 0.6, 0.7], xyz: [0, 0, 0.35]}}
    stations: {stations}
""")


def test_the_default_zone_holds_what_stands_on_a_table_up_to_its_stations() -> None:
    rng = np.random.default_rng(3)
    low = np.array([-0.4, -0.3, 0.0])
    high = np.array([0.4, 0.3, 0.7])
    for _ in range(10):
        places = rng.uniform([-0.6, -0.5, 0.5], [0.6, 0.5, 1.2], (2, 3))
        items = (
            f"{{name: s{k}, pose: {{xyz: {place.tolist()}}}}}" for k, place in enumerate(places)
        )
        cell = table_with(f"[{', '.join(items)}]")
        zone = cell.machine("table").zone_in_equipment
        ends = zone.pose[:3, 3] - zone.size / 2, zone.pose[:3, 3] + zone.size / 2
        assert ends[0] == pytest.approx(np.minimum(low, places.min(axis=0)))
        assert ends[1] == pytest.approx(np.maximum(high, places.max(axis=0)))


def test_the_default_zone_follows_a_station_that_is_moved_and_a_given_one_stays() -> None:
    station = "[{name: pick, pose: {xyz: [0, 0, 0.9]}}]"
    lower = pose_of([0.1, 0.0, 0.8])
    cell = table_with(station)
    moved = cell.with_station("pick", lower)
    assert moved.machine("table").zone_in_equipment.size == pytest.approx([0.8, 0.6, 0.8])
    assert moved.station("pick").pose == pytest.approx(cell.machine("table").pose @ lower)
    assert "zone: OPEN" in cell_to_yaml(moved)
    given = table_with(station, "{kind: OPEN, size: [0.8, 0.6, 0.7], xyz: [0, 0, 0.35]}")
    assert given.with_station("pick", lower).machine("table").zone_in_equipment.size[2] == 0.7
    again = cell_from_yaml(cell_to_yaml(given))
    assert again.machine("table").zone_in_equipment.size[2] == 0.7


def surface_points(body: Body, rng: np.random.Generator) -> FloatArray:
    """Points (N, 3) of the surface in the body's frame, its farthest ones among them."""
    d = rng.normal(size=(4000, 3))
    d /= np.linalg.norm(d, axis=1)[:, None]
    ends: FloatArray = np.sign(d[:, 2:]) * [[0.0, 0.0, body.size[1] / 2]]
    points: FloatArray = np.sign(d) * body.size / 2
    if body.kind == "box":
        return points
    if body.kind in ("sphere", "capsule"):
        points = d * body.size[0]
        return points + ends if body.kind == "capsule" else points
    flat = d[:, :2] / np.linalg.norm(d[:, :2], axis=1)[:, None] * body.size[0]
    return np.hstack([flat, np.zeros((len(d), 1))]) + ends


def found(cell: Cell) -> list[tuple[str, str]]:
    return [(finding.severity, finding.subject) for finding in check_cell(cell)]


def test_a_machine_in_the_robot_s_foot_is_found(cell: Cell) -> None:
    moved = cell.with_equipment("cabinet", pose=pose_of([0.3, 0.3, 0.0]))
    assert ("error", "cabinet") in found(moved)
    standing = replace(moved, base_contacts=(("base", "cabinet"),))
    assert ("error", "cabinet") not in found(standing)


def test_a_tcp_inside_a_body_or_out_of_reach_is_found(cell: Cell) -> None:
    at_lathe = cell.machine("lathe").pose
    sunk = cell.with_equipment("gauge", pose=composed(at_lathe, pose_of([0.8, 0.0, 0.3])))
    assert ("error", "gauge_measure") in found(sunk)
    far = cell.with_equipment("infeed", pose=pose_of([5.0, 0.0, 0.0]))
    assert ("error", "infeed_pick") in found(far)


def test_a_body_whose_middle_was_meant_as_its_underside_is_found(cell: Cell) -> None:
    lowered = cell.with_equipment(
        "cabinet", pose=composed(cell.machine("cabinet").pose, pose_of([0.0, 0.0, -0.2]))
    )
    sentences = {finding.subject: finding.sentence for finding in check_cell(lowered)}
    assert sentences["cabinet"].startswith("reaches 0.200 m below the floor; xyz is the middle")
    assert "cabinet" not in {subject for _, subject in found(replace(lowered, floor=False))}


def test_angles_in_radians_are_found(cell: Cell) -> None:
    assert not [each for each in check_cell(cell) if "rad?" in each.sentence]
    for abc, meant in (
        ([3.14, 0, 0], "180 for 3.14 rad?"),
        ([0.7, -1.571, 0], "-90 for -1.571 rad?"),
    ):
        turned = pose_of([0.0, 0.0, 0.5], rotation_from_abc(abc))
        (finding,) = (
            each
            for each in check_cell(cell.with_station(cell.stations[0].name, turned))
            if "rad?" in each.sentence
        )
        assert (finding.severity, finding.subject) == ("warning", cell.stations[0].name)
        assert finding.sentence.endswith(meant)
    for abc in ([180, 0, 0], [90, 1.57, 0], [3, 0, 0], [1.5, 2.0, 0]):
        turned = pose_of([0.0, 0.0, 0.5], rotation_from_abc(abc))
        moved = cell.with_station(cell.stations[0].name, turned)
        assert not [each for each in check_cell(moved) if "rad?" in each.sentence]
    posture = replace(cell, park=np.radians([0.0, -6.28, 1.57, 0.0, 1.57, 0.0]))
    assert ("warning", "park") in found(posture)


def test_overlapping_zones_are_found(cell: Cell) -> None:
    close = cell.with_equipment(
        "gauge", pose=composed(cell.machine("infeed").pose, pose_of([0.5, 0.0, 0.0]))
    )
    assert ("warning", "infeed") in found(close)


def test_a_contact_allowed_outside_its_zone_is_found(cell: Cell) -> None:
    lathe = cell.machine("lathe")
    small = replace(
        lathe, zone_in_equipment=Zone("SEMI_CLOSED", pose_of([1.0, 0.0, 0.5]), np.ones(3))
    )
    outside = replace(cell, equipment=tuple(small if m is lathe else m for m in cell.equipment))
    assert ("warning", "lathe_work") in found(outside)


def test_a_signal_nobody_sets_and_a_short_pause_are_found(cell: Cell) -> None:
    program = tuple(replace(step, set_signals=()) for step in cell.program)
    assert ("warning", "lathe_door_open") in found(replace(cell, program=program))
    short = (ProgramStep("PAUSE", dwell=10.0, power_mode="HIBERNATION"),)
    assert found(replace(cell, program=short)) == [("warning", "step 1")]


def test_distances_of_the_review_agree_with_the_kernels(cell: Cell) -> None:
    """Two implementations that know nothing of each other."""
    rng = np.random.default_rng(11)
    chain = Chain(cell.robot)
    home = cell.machine_home[None]
    capsule = replace(cell.robot.capsules[0], link=cell.robot.n)
    in_world = capsule.placed(chain.link_poses(home)[0, -1])
    tetrahedron = np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [0.0, 0.6, 0.0], [0.0, 0.0, 0.7]])
    shapes: list[tuple[BodyKind, list[float], FloatArray]] = [
        ("box", [0.3, 0.5, 0.7], np.zeros((0, 3))),
        ("cylinder", [0.3, 0.9, 0.0], np.zeros((0, 3))),
        ("sphere", [0.4, 0.0, 0.0], np.zeros((0, 3))),
        ("capsule", [0.2, 0.6, 0.0], np.zeros((0, 3))),
        ("plane", [0.0, 0.0, 0.0], np.zeros((0, 3))),
        ("mesh", [0.0, 0.0, 0.0], tetrahedron),
    ]
    for kind, size, vertices in shapes:
        for _ in range(10):
            place = pose_of(rng.uniform(-2, 2, 3), rotation_from_abc(rng.uniform(-180, 180, 3)))
            body = Body("body", kind, place, np.array(size), vertices)
            exact = CollisionModel(chain, [capsule], [body], ()).distances(home)[0, 0]
            if exact > -capsule.radius:  # where the capsule's axis is outside both mean the same
                assert capsule_distance(body, in_world) == pytest.approx(exact, abs=1e-6), kind


def test_a_program_begins_where_its_last_cycle_ended() -> None:
    demo = load_cell("demo")
    assert demo.cycle_start() == "home"
    assert demo.cycle_start(("home", "gauge_measure", "park")) == "park"
    assert demo.cycle_start(("home", "gauge_measure")) == "park"
