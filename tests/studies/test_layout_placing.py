"""Where things stand after they were moved, judged by matrices made here, and which machines
overlap.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import Cell, InvalidValueError, cell_from_yaml, cell_to_yaml, load_cell
from ir_studies.layout.placement import Placing, Variable, deeper, overlaps, separable

DEMO = load_cell("demo")
METRES = st.floats(-2.0, 2.0)
DEGREES = st.floats(-180.0, 180.0)


def about_vertical(degrees: float) -> np.ndarray:
    """Rotation (3, 3)."""
    c = np.cos(np.radians(degrees))
    s = np.sin(np.radians(degrees))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def moved(values: dict[str, float], carried: tuple[str, ...] = ()) -> Cell:
    return Placing(carried).cell(DEMO, values)


@settings(max_examples=20)  # each checks a whole cell several times
@given(x=METRES, y=METRES, z=METRES, turn=DEGREES)
def test_the_base_moves_along_the_axes_of_the_cell_and_turns_about_itself(
    x: float, y: float, z: float, turn: float
) -> None:
    cell = moved({"base.x": x, "base.y": y, "base.z": z, "base.turn_deg": turn}, ("cabinet",))
    np.testing.assert_allclose(cell.base_pose[:3, 3], DEMO.base_pose[:3, 3] + [x, y, z], atol=1e-12)
    R = about_vertical(turn) @ DEMO.base_pose[:3, :3]
    np.testing.assert_allclose(cell.base_pose[:3, :3], R, atol=1e-12)
    seen = np.linalg.inv(DEMO.base_pose) @ DEMO.machine("cabinet").pose
    np.testing.assert_allclose(
        np.linalg.inv(cell.base_pose) @ cell.machine("cabinet").pose, seen, atol=1e-9
    )
    assert np.array_equal(cell.machine("gauge").pose, DEMO.machine("gauge").pose)


@settings(max_examples=20)
@given(x=METRES, turn=DEGREES)
def test_stations_move_with_their_machine(x: float, turn: float) -> None:
    cell = moved({"equipment.gauge.x": x, "equipment.gauge.turn_deg": turn})
    machine = cell.machine("gauge")
    station = cell.station("gauge_measure")
    np.testing.assert_allclose(station.pose, machine.pose @ station.pose_in_equipment, atol=1e-12)
    np.testing.assert_allclose(machine.pose[0, 3], DEMO.machine("gauge").pose[0, 3] + x, atol=1e-12)


@settings(max_examples=20)
@given(shift=st.tuples(METRES, METRES, METRES), c=DEGREES)
def test_the_tool_keeps_its_shape_and_its_tcp(shift: tuple[float, float, float], c: float) -> None:
    cell = moved({**{f"tool.{a}": v for a, v in zip("xyz", shift, strict=True)}, "tool.c_deg": c})
    assert cell.tool is not None
    assert DEMO.tool is not None
    was = np.linalg.norm(DEMO.tool.com - DEMO.tcp[:3, 3])
    assert np.linalg.norm(cell.tool.com - cell.tcp[:3, 3]) == pytest.approx(was, abs=1e-9)
    np.testing.assert_allclose(
        np.linalg.eigvalsh(cell.tool.inertia), np.linalg.eigvalsh(DEMO.tool.inertia), rtol=1e-9
    )


def test_masses_scale_inertia_and_postures_count_from_those_of_the_file() -> None:
    cell = Placing().cell(DEMO, {"park.a1_deg": 10.0}, {"gear": 10.0})
    np.testing.assert_allclose(cell.part("gear").load.inertia * 2.0, DEMO.part("gear").load.inertia)
    assert np.degrees(cell.park - DEMO.park) == pytest.approx([10.0, 0, 0, 0, 0, 0])
    with pytest.raises(InvalidValueError, match="joint_a2"):
        moved({"park.a2_deg": 170.0})


def test_a_placement_is_written_and_read_as_it_is() -> None:
    cell = moved(
        {
            "base.x": 0.123,
            "base.turn_deg": 12.3,
            "equipment.gauge.turn_deg": -7.7,
            "tool.b_deg": 3.3,
        }
    )
    assert cell_to_yaml(cell_from_yaml(cell_to_yaml(cell))) == cell_to_yaml(cell)


@given(share=st.floats(0.0, 1.0))
def test_values_are_what_people_can_set_up_and_within_the_range(share: float) -> None:
    for variable in (Variable("base.x", -0.3, 0.7), Variable("base.turn_deg", -20.0, 11.0)):
        value = variable.at(share)
        assert variable.low <= value <= variable.high
        scale = 10.0 if variable.unit == "deg" else 1000.0
        assert value * scale == pytest.approx(round(value * scale))


def test_machines_of_the_bundled_cells_stand_apart() -> None:
    assert set(overlaps(DEMO)) == {("base", "floor")}  # the capsule of the base is round below


def test_what_reaches_into_each_other_and_below_the_floor_is_named() -> None:
    cell = moved(
        {"equipment.cabinet.x": 0.5, "equipment.cabinet.y": -1.2, "equipment.gauge.z": -0.1}
    )
    assert set(deeper(overlaps(cell), overlaps(DEMO))) == {
        ("outfeed_belt", "cabinet"),
        ("gauge_table", "floor"),
    }


CUBE = """
  - name: {name}
    pose: {{xyz: [{x}, {y}, {z}], abc_deg: [{turn}, 0, 0]}}
    bodies: [{{name: {name}_cube, kind: box, size: [1, 1, 1]}}]
    zone: OPEN
"""
WALL = """
  - name: wall
    pose: {xyz: [0, 4, 0]}
    zone: {kind: OPEN, size: [1, 1, 1]}
    bodies: [{name: wall_face, kind: plane, abc_deg: [0, 0, 90]}]
"""


def of_machines(*machines: str) -> Cell:
    """A cell of nothing else."""
    head = "format: ir_cell/1\nname: cubes\nrobot: kr210_r2700_extra\nequipment:"
    return cell_from_yaml(head + "".join(machines))


def cube(name: str, x: float, y: float, z: float, turn: float = 0.0) -> str:
    """A machine that is a cube of 1 m."""
    return CUBE.format(name=name, x=x, y=y, z=z, turn=turn)


@settings(max_examples=20)
@given(drawn=st.floats(0.01, 0.4), more=st.floats(0.01, 0.4), turn=DEGREES)
def test_an_overlap_as_drawn_may_not_grow(drawn: float, more: float, turn: float) -> None:
    """Cubes turned together overlap along their own x axis: the depth is what they were moved."""
    x, y, _ = about_vertical(turn)[:, 0] * (1.0 - drawn)
    given_ = of_machines(cube("a", 3.0, 3.0, 1.0, turn), cube("b", 3.0 + x, 3.0 + y, 1.0, turn))
    assert overlaps(given_)["a_cube", "b_cube"] == pytest.approx(drawn, abs=1e-9)
    assert deeper(overlaps(given_), overlaps(given_)) == {}
    dx, dy, _ = -about_vertical(turn)[:, 0] * more
    moved_ = Placing().cell(given_, {"equipment.b.x": dx, "equipment.b.y": dy})
    found = deeper(overlaps(moved_), overlaps(given_))
    assert found["a_cube", "b_cube"] == pytest.approx(more, abs=1e-9)
    apart = Placing().cell(given_, {"equipment.b.x": -dx, "equipment.b.y": -dy})
    assert deeper(overlaps(apart), overlaps(given_)) == {}


def test_a_machine_that_is_drawn_below_the_floor_sinks_no_further() -> None:
    given_ = of_machines(cube("a", 3.0, 3.0, 0.48))
    sunk = Placing().cell(given_, {"equipment.a.z": -0.3})
    assert deeper(overlaps(sunk), overlaps(given_)) == pytest.approx({("a_cube", "floor"): 0.3})


def test_the_base_sinks_neither_into_the_floor_nor_into_its_pedestal() -> None:
    sunk = moved({"base.z": -0.05})
    assert deeper(overlaps(sunk), overlaps(DEMO)) == pytest.approx({("base", "floor"): 0.05})
    bench = load_cell("kr6_bench")
    lower = {"base.z": -0.1}
    found = deeper(overlaps(Placing().cell(bench, lower)), overlaps(bench))
    assert found == pytest.approx({("base", "pedestal"): 0.1})
    for free in ({"base.z": 0.1}, {"base.turn_deg": 33.0}, {"base.x": 0.05}):
        assert deeper(overlaps(Placing().cell(bench, free)), overlaps(bench)) == {}


def test_a_wall_that_is_a_plane_is_no_place_for_a_machine() -> None:
    given_ = of_machines(cube("a", 3.0, 3.0, 1.0), WALL)
    assert overlaps(given_).get(("a_cube", "wall_face")) is None
    through = Placing().cell(given_, {"equipment.a.y": 0.7})
    assert overlaps(through)["a_cube", "wall_face"] == pytest.approx(0.2)


def test_a_door_needs_its_place_in_every_state() -> None:
    lathe = DEMO.machine("lathe")
    up = next(body for body in lathe.bodies if body.name == "lathe_door_up")
    wide = replace(up, pose=up.pose @ shifted(-1.0), name="lathe_door_down")
    bodies = tuple(wide if body.name == wide.name else body for body in lathe.bodies)
    cell = replace(
        DEMO,
        equipment=tuple(replace(m, bodies=bodies) if m is lathe else m for m in DEMO.equipment),
    )
    closed = cell.with_equipment("lathe", state="door_closed")
    places = {"equipment.gauge.x": -1.7, "equipment.gauge.y": 0.1, "equipment.gauge.z": 1.2}
    opened, shut = (Placing().cell(one, places) for one in (cell, closed))
    assert overlaps(opened) == overlaps(shut)
    assert any("lathe_door_down" in pair for pair in overlaps(opened))


def shifted(x: float) -> np.ndarray:
    pose = np.eye(4)
    pose[0, 3] = x
    return pose


@settings(max_examples=50)
@given(
    centre=st.tuples(*[st.floats(-3.0, 3.0)] * 3),
    turn=DEGREES,
    size=st.tuples(*[st.floats(0.1, 2.0)] * 3),
)
def test_boxes_are_separable_where_one_of_fifteen_axes_says_so(
    centre: tuple[float, float, float], turn: float, size: tuple[float, float, float]
) -> None:
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) / 2.0
    R = about_vertical(turn) @ about_vertical(30.0).T[[1, 2, 0]][:, [1, 2, 0]]
    first = corners
    second = corners * size @ R.T + centre
    axes = [*np.eye(3), *R.T, *np.cross(np.eye(3)[:, None], R.T[None]).reshape(-1, 3)]
    gaps = []
    for axis in (a / np.linalg.norm(a) for a in axes if np.linalg.norm(a) > 1e-6):
        a = first @ axis
        b = second @ axis
        gaps.append(max(a.min() - b.max(), b.min() - a.max()))
    if abs(max(gaps)) > 1e-6:  # else they touch
        assert separable(first, second) == (max(gaps) > 0.0)
