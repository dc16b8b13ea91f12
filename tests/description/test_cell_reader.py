"""A cell that is written is read back the same, bit for bit; meshes come from their own folder
only.
"""

from __future__ import annotations

import struct
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from ir_description import (
    Body,
    Cell,
    CellFileError,
    Equipment,
    Load,
    ProgramStep,
    Station,
    cell_from_yaml,
    cell_to_yaml,
    load_cell,
    load_robot,
)
from ir_description.cell import (
    BLEND_MAX,
    ZONE_KINDS,
    AllowedContact,
    CellSignal,
    EquipmentState,
    Part,
    StateSwitch,
    StationSearch,
    Task,
    Zone,
    station_at,
    zone_around,
)
from ir_description.poses import (
    abc_from_rotation,
    pose_of,
    rotation_from_abc,
    rotation_from_matrix,
    rotation_from_quaternion,
)
from ir_description.shapes import KINDS, Capsule
from ir_msgs_py.plc import Signal
from ir_values.arrays import FloatArray, solid_box_inertia

ROBOT = load_robot()
ROTATION_TOLERANCE = 1e-14  # a few roundings of a product of three matrices


def assert_same(first: Any, second: Any, where: str = "cell") -> None:
    """Both are equal in every field; arrays bit for bit (-0.0 is written as 0)."""
    assert type(first) is type(second), where
    if isinstance(first, np.ndarray):
        np.testing.assert_array_equal(first, second, err_msg=where)
    elif isinstance(first, tuple):
        assert len(first) == len(second), where
        for i, pair in enumerate(zip(first, second, strict=True)):
            assert_same(*pair, f"{where}[{i}]")
    elif is_dataclass(first):
        for field in fields(first):
            assert_same(
                getattr(first, field.name), getattr(second, field.name), f"{where}.{field.name}"
            )
    else:
        assert first == second, where


lengths = st.floats(1e-6, 900.0)
coordinates = st.floats(-900.0, 900.0)
angles = st.floats(-180.0, 180.0)


@st.composite
def rotations(draw: st.DrawFn) -> FloatArray:
    if draw(st.booleans()):
        return rotation_from_abc([draw(angles), draw(angles), draw(angles)])
    q = np.array([draw(st.floats(-1, 1)) for _ in range(4)])
    length = float(np.linalg.norm(q))
    return rotation_from_quaternion(q / length) if length > 1e-3 else np.eye(3)


@st.composite
def poses(draw: st.DrawFn) -> FloatArray:
    return pose_of([draw(coordinates) for _ in range(3)], draw(rotations()))


@st.composite
def bodies(draw: st.DrawFn, name: str) -> Body:
    kind = draw(st.sampled_from([kind for kind in KINDS if kind != "plane"]))
    used = {"box": 3, "cylinder": 2, "sphere": 1, "capsule": 2, "mesh": 0}[kind]
    size = [draw(lengths) if i < used else 0.0 for i in range(3)]
    vertices = np.zeros((0, 3))
    if kind == "mesh":
        edge = draw(st.floats(0.01, 10.0))
        vertices = np.array([[0, 0, 0], [edge, 0, 0], [0, edge, 0], [0, 0, edge]])
    return Body(name, kind, draw(poses()), np.array(size), vertices)


ENDS = (st.just("door_open"), st.just("door_closed"))


@st.composite
def machines(draw: st.DrawFn, name: str) -> tuple[Equipment, tuple[Station, ...]]:
    own = tuple(draw(bodies(f"{name}_{i}")) for i in range(draw(st.integers(1, 3))))
    kind = draw(st.sampled_from(ZONE_KINDS))
    zone = zone_around(kind, own)
    if draw(st.booleans()):
        zone = Zone(kind, draw(poses()), np.array([draw(lengths) for _ in range(3)]))
    states: tuple[EquipmentState, ...] = ()
    if draw(st.booleans()):
        states = (EquipmentState("door_open", (own[0].name,)), EquipmentState("door_closed", ()))
    machine = Equipment(
        name=name,
        pose=draw(poses()),
        bodies=own,
        zone_in_equipment=zone,
        states=states,
        state=draw(st.sampled_from(["door_open", "door_closed"])) if states else "",
        enabled=draw(st.booleans()),
        switch=draw(
            st.none() | st.builds(StateSwitch, st.just("ask"), *ENDS, st.floats(0.0, 3600.0))
        )
        if states
        else None,
    )
    contacts = (AllowedContact("gear_held", own[0].name, draw(st.floats(0.0, 1.0))),)
    approach = draw(st.floats(0.0, 5.0))
    ccd = st.builds(
        StationSearch, st.just("ccd"), st.integers(1, 10_000), st.sampled_from(["", "tree"])
    )
    search = draw(st.just(StationSearch()) | st.just(StationSearch(withdrawal="modified_ga")) | ccd)
    station = station_at(machine, f"at_{name}", draw(poses()), contacts, approach, search)
    return machine, (replace(station, blend=draw(st.floats(0.0, BLEND_MAX))),)


@st.composite
def cells(draw: st.DrawFn) -> Cell:
    pairs = [draw(machines(f"machine_{i}")) for i in range(draw(st.integers(1, 2)))]
    stations = tuple(station for _, own in pairs for station in own)
    capsule = Capsule(
        "gear_held",
        6,
        np.zeros(3),
        np.array([0.0, draw(st.floats(0, 1)), 0.0]),
        draw(st.floats(0.01, 1)),
    )
    part_load = Load(
        "gear", "part", 20.0, np.zeros(3), solid_box_inertia(20.0, (0.1, 0.2, 0.3)), (capsule,)
    )
    part = Part(part_load, (draw(bodies("gear_lying")),), draw(poses()), stations[0].name)
    tool = Load(
        "gripper",
        "tool",
        draw(st.floats(0.1, 180.0)),
        np.array([draw(coordinates) for _ in range(3)]),
        solid_box_inertia(100.0, (0.4, 0.5, 0.6)),
        (),
        draw(st.floats(0.0, 1000.0)),
        draw(st.floats(0.0, 1000.0)),
    )
    share = draw(st.floats(0.0, 1.0))
    between = ROBOT.position_min + share * (ROBOT.position_max - ROBOT.position_min)
    posture = np.clip(between, ROBOT.position_min, ROBOT.position_max)
    return Cell(
        name="drawn",
        description=draw(
            st.text(
                st.characters(codec="utf-8", categories=["L", "N", "P"], include_characters=" "),
                max_size=30,
            )
        ).strip(),
        robot=ROBOT,
        base_pose=draw(poses()),
        tool=tool,
        tcp=draw(poses()),
        parts=(part,),
        equipment=tuple(machine for machine, _ in pairs),
        stations=stations,
        signals=(CellSignal("ask"), CellSignal("open", True, "ask", draw(st.floats(0.0, 100.0)))),
        park=posture,
        machine_home=ROBOT.machine_home,
        program=(
            ProgramStep("POSTURE", "home", set_signals=(Signal("ask"),)),
            ProgramStep("STATION", stations[0].name, draw(st.floats(0.0, 10.0)), attach="gear"),
            ProgramStep(
                "STATION",
                stations[-1].name,
                detach="gear",
                wait_for=(Signal("open", False),),
                planner="tree",
                blend=draw(st.none() | st.floats(0.0, BLEND_MAX)),
            ),
            ProgramStep("PAUSE", dwell=draw(st.floats(0.1, 1000.0)), power_mode="AUTO"),
        ),
        tasks=(Task("there and back", ROBOT.machine_home, posture),),
        floor=draw(st.booleans()),
        base_contacts=(("base", pairs[0][0].bodies[0].name),),
    )


@given(cells())
@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_a_cell_survives_its_file(cell: Cell) -> None:
    text = cell_to_yaml(cell)
    read = cell_from_yaml(text)
    assert_same(read, cell)
    assert cell_to_yaml(read) == text


@given(rotations())
def test_abc_angles_give_the_rotation_back(R: FloatArray) -> None:
    again = rotation_from_abc(abc_from_rotation(R))
    assert np.abs(again - R).max() < 1e-7  # near B = +-90 deg A and C share an axis
    assert np.abs(again @ again.T - np.eye(3)).max() < ROTATION_TOLERANCE


def test_abc_turn_about_z_then_y_then_x() -> None:
    """KUKA: A about Z, B about the new Y, C about the new X."""
    assert rotation_from_abc([0, 90, 0]) @ [1, 0, 0] == pytest.approx([0, 0, -1])
    assert rotation_from_abc([90, 90, 0]) @ [0, 1, 0] == pytest.approx([-1, 0, 0])
    assert rotation_from_abc([0, 0, 90]) @ [0, 1, 0] == pytest.approx([0, 0, 1])


def test_a_quaternion_of_a_few_digits_is_normalised() -> None:
    R = rotation_from_quaternion([0.0, 0.7071, 0.0, 0.7071])
    assert pytest.approx(rotation_from_abc([0, 90, 0]), abs=1e-12) == R


def test_a_matrix_of_a_few_digits_becomes_a_rotation() -> None:
    R = rotation_from_matrix(np.round(rotation_from_abc([10, 20, 30]), 7))
    assert np.abs(R @ R.T - np.eye(3)).max() < ROTATION_TOLERANCE


MESH_CELL = """\
format: ir_cell/1
name: meshed
robot: kr210_r2700_extra
equipment:
  - name: rock
    bodies:
      - {{name: rock, kind: mesh, file: "{file}", scale: 0.001, convex_hull: {hull}, xyz: [3, 0, 0]}}
"""  # noqa: E501
CORNERS = np.array(
    [[x, y, z] for x in (0, 100) for y in (0, 200) for z in (0, 300)], dtype=np.float64
)
FACES = [
    (0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
    (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3),
]  # fmt: skip


def binary_stl(triangles: FloatArray) -> bytes:
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *triangle.ravel(), 0) for triangle in triangles)
    return b"\0" * 80 + struct.pack("<I", len(triangles)) + rows


def ascii_stl(triangles: FloatArray) -> bytes:
    lines = ["solid box"]
    for triangle in triangles:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid box"]).encode()


def cell_with(folder: Path, file: str, hull: str = "false") -> Path:
    path = folder / "cell.yaml"
    path.write_text(MESH_CELL.format(file=file, hull=hull))
    return path


@pytest.mark.parametrize("write", [binary_stl, ascii_stl])
def test_a_convex_mesh_is_its_corners(tmp_path: Path, write: Any) -> None:
    (tmp_path / "box.stl").write_bytes(write(CORNERS[np.array(FACES)]))
    cell = load_cell(cell_with(tmp_path, "box.stl"))
    body = cell.bodies()[-1]
    assert np.array(sorted(map(tuple, body.vertices))) == pytest.approx(CORNERS / 1000)
    assert cell.machine("rock").zone.size == pytest.approx([0.1, 0.2, 0.3])
    again = cell_from_yaml(cell_to_yaml(cell))  # a written cell needs no mesh file
    assert np.array_equal(again.bodies()[-1].vertices, body.vertices)


def test_a_mesh_that_is_not_convex_needs_a_word(tmp_path: Path) -> None:
    dent = np.vstack([CORNERS, [[50, 100, 150]]])
    faces = [face for face in FACES if face not in [(0, 1, 3), (0, 3, 2)]]
    faces += [(0, 1, 8), (1, 3, 8), (3, 2, 8), (2, 0, 8)]
    (tmp_path / "dent.stl").write_bytes(binary_stl(dent[np.array(faces)]))
    with pytest.raises(CellFileError, match=r"cell.yaml:7: .*the mesh is not convex"):
        load_cell(cell_with(tmp_path, "dent.stl"))
    assert len(load_cell(cell_with(tmp_path, "dent.stl", "true")).bodies()[-1].vertices) == 8


def test_an_open_mesh_needs_a_word(tmp_path: Path) -> None:
    (tmp_path / "open.stl").write_bytes(binary_stl(CORNERS[np.array(FACES[:-1])]))
    with pytest.raises(CellFileError, match="the mesh is not closed"):
        load_cell(cell_with(tmp_path, "open.stl"))


@pytest.mark.parametrize(
    "name",
    [
        "../../etc/passwd",
        "/etc/passwd",
        "http://host/x.stl",
        "a/../../x.stl",
        "passwd",
        "link.stl",
        "a\\\\x.stl",
    ],
)
def test_nothing_leads_out_of_the_cell_s_folder(tmp_path: Path, name: str) -> None:
    folder = tmp_path / "cells"
    folder.mkdir()
    (tmp_path / "x.stl").write_bytes(binary_stl(CORNERS[np.array(FACES)]))
    (folder / "link.stl").symlink_to(tmp_path / "x.stl")
    with pytest.raises(CellFileError, match=r"cell.yaml:7: .*(must be an .stl file|leads out)"):
        load_cell(cell_with(folder, name))


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"", "neither a binary STL"),
        (b"solid x\nendsolid x", "the mesh has 0 triangles, must have 4 to 200000"),
        (b"solid x\nvertex 1 2 3\nendsolid", "has 1 vertices, must have three to a triangle"),
        (
            b"solid x\nvertex a b c\nvertex 1 2 3\nvertex 1 2 3\nendsolid",
            "a vertex that is not three numbers",
        ),
        (binary_stl(np.full((4, 3, 3), np.nan)), "not finite"),
        (binary_stl(np.zeros((4, 3, 3))), "span no volume"),
        (binary_stl(CORNERS[np.array(FACES)])[:-1], "neither a binary STL"),
    ],
)
def test_a_broken_mesh_is_answered_by_a_sentence(
    tmp_path: Path, content: bytes, sentence: str
) -> None:
    (tmp_path / "mesh.stl").write_bytes(content)
    with pytest.raises(CellFileError, match=rf"cell.yaml:7: .*{sentence}"):
        load_cell(cell_with(tmp_path, "mesh.stl"))


def test_a_huge_mesh_is_refused_unread(tmp_path: Path) -> None:
    with (tmp_path / "mesh.stl").open("wb") as file:
        file.truncate(2_000_000_000)
    with pytest.raises(
        CellFileError, match="has 2000000000 bytes, must be at most 120000000 bytes"
    ):
        load_cell(cell_with(tmp_path, "mesh.stl"))


def test_a_half_turn_is_written_the_same_whatever_the_sign_of_its_zeros() -> None:
    cell = load_cell("open")
    turned = np.diag([-1.0, -1.0, 1.0, 1.0])
    negative = turned.copy()
    negative[1, 0] = -0.0
    texts = {cell_to_yaml(replace(cell, base_pose=pose)) for pose in (turned, negative)}
    assert len(texts) == 1
