"""Point clouds and height maps as boxes: the balls about all points are covered, nothing sticks out
farther than stated, and files are read as their writers meant them or refused.
"""

from __future__ import annotations

import io
import json
import re
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from ir_cli.main import main
from ir_description import Body, CellFileError, load_cell
from ir_description.files.point_cloud import (
    SUFFIXES,
    CloudSettings,
    cloud_boxes,
    read_cloud,
)
from ir_description.shapes import point_distance
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

HEADER = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"


def pcd(points: FloatArray, encoding: str, viewpoint: str = "0 0 0 1 0 0 0") -> bytes:
    """A PCD with a padding field of three bytes and an intensity between the coordinates."""
    record = np.dtype(
        [("x", "<f4"), ("_", "<u1", 3), ("y", "<f4"), ("intensity", "<f4"), ("z", "<f8")]
    )
    records = np.zeros(len(points), record)
    for axis, name in enumerate("xyz"):
        records[name] = points[:, axis]
    records["intensity"] = np.arange(len(points))
    head = (
        "# .PCD v0.7\nVERSION 0.7\nFIELDS x _ y intensity z\nSIZE 4 1 4 4 8\nTYPE F U F F F\n"
        f"COUNT 1 3 1 1 1\nWIDTH {len(points)}\nHEIGHT 1\nVIEWPOINT {viewpoint}\n"
        f"POINTS {len(points)}\nDATA {encoding}\n"
    )
    if encoding == "binary":
        return head.encode() + records.tobytes()
    if encoding == "binary_compressed":
        data = b"".join(records[name].tobytes() for name in record.names)
        packed = lzf(data)
        sizes = np.array([len(packed), len(data)], "<u4").tobytes()
        return head.encode() + sizes + packed
    rows = "".join(
        f"{float(x)!r} 0 0 0 {float(y)!r} {k} {float(z)!r}\n" for k, (x, y, z) in enumerate(points)
    )
    return (head + rows).encode()


def lzf(data: bytes) -> bytes:
    """A simple LZF packer: repeated bytes as copies, all else as literals."""
    packed = bytearray()
    at = 0
    while at < len(data):
        run = 1
        while at + run < len(data) and data[at + run] == data[at] and run < 264:
            run += 1
        if run >= 10:
            packed += bytes([0, data[at], 7 << 5, run - 10, 0])
            at += run
            continue
        packed += bytes([0, data[at]])
        at += 1
    return bytes(packed)


def ply(points: FloatArray, binary: bool) -> bytes:
    form = "binary_big_endian" if binary else "ascii"
    head = (
        f"ply\nformat {form} 1.0\ncomment scanned\nelement vertex {len(points)}\n"
        "property float x\nproperty float y\nproperty float z\nproperty uchar red\nend_header\n"
    )
    if binary:
        record = np.dtype([("x", ">f4"), ("y", ">f4"), ("z", ">f4"), ("red", ">u1")])
        records = np.zeros(len(points), record)
        for axis, name in enumerate("xyz"):
            records[name] = points[:, axis]
        return head.encode() + records.tobytes()
    rows = "".join(f"{float(x)!r} {float(y)!r} {float(z)!r} 7\n" for x, y, z in points)
    return (head + rows).encode()


def npy(array: object) -> bytes:
    stream = io.BytesIO()
    np.save(stream, np.asarray(array))
    return stream.getvalue()


def scan(seed: int, count: int) -> FloatArray:
    """Points on the walls of a box and a sphere, as a sensor sees them, in single precision."""
    rng = np.random.default_rng(seed)
    ball = rng.normal(size=(count, 3))
    ball *= 0.3 / np.linalg.norm(ball, axis=1, keepdims=True)
    wall = rng.uniform(-1.0, 1.0, (count, 3))
    wall[:, seed % 3] = -0.7
    return np.concatenate([ball, wall]).astype(np.float32).astype(np.float64)


def bodies_of(lower: FloatArray, upper: FloatArray) -> list[Body]:
    bodies = []
    for low, high in zip(lower, upper, strict=True):
        pose = np.eye(4)
        pose[:3, 3] = (low + high) / 2.0
        bodies.append(Body("box", "box", pose, high - low))
    return bodies


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 1000),
    count=st.integers(1, 200),
    voxel=st.floats(0.02, 0.5),
    margin=st.floats(0.0, 0.1),
    at=st.floats(-20.0, 20.0),
)
def test_balls_about_the_points_are_covered_and_nothing_sticks_out_farther(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    count: int,
    voxel: float,
    margin: float,
    at: float,
) -> None:
    """Judged by random points of the balls and by corners of the boxes against the nearest point
    of the cloud.
    """
    folder = tmp_path_factory.mktemp("cloud")
    points = scan(seed, count) + at
    (folder / "scan.npy").write_bytes(npy(points))
    boxes = cloud_boxes(folder, "scan.npy", CloudSettings("m", voxel, margin))
    rng = np.random.default_rng(seed)
    towards = rng.normal(size=points.shape)
    towards *= margin / np.linalg.norm(towards, axis=1, keepdims=True)
    for point in np.concatenate([points, points + towards]):
        assert ((boxes.lower <= point) & (point <= boxes.upper)).all(axis=1).any()
    corners = [
        np.where(np.array(which, dtype=bool), boxes.upper, boxes.lower)
        for which in np.ndindex(2, 2, 2)
    ]
    inside = boxes.lower + rng.uniform(size=boxes.lower.shape) * (boxes.upper - boxes.lower)
    tree = cKDTree(points)
    for each in [*corners, inside]:
        assert tree.query(each)[0].max() <= boxes.protrusion + 1e-12
    assert len(boxes.lower) <= len(points)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(
    seed=st.integers(0, 1000),
    shape=st.tuples(st.integers(2, 12), st.integers(2, 12)),
    pitch=st.floats(0.005, 0.3),
    voxel=st.floats(0.02, 0.2),
    margin=st.floats(0.0, 0.05),
)
def test_what_lies_below_a_height_map_is_covered(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    shape: tuple[int, int],
    pitch: float,
    voxel: float,
    margin: float,
) -> None:
    rng = np.random.default_rng(seed)
    heights = rng.uniform(-0.5, 1.0, shape)
    heights[rng.uniform(size=shape) < 0.1] = np.nan
    heights[0, 0] = 0.25
    folder = tmp_path_factory.mktemp("map")
    (folder / "map.npy").write_bytes(npy(heights))
    boxes = cloud_boxes(folder, "map.npy", CloudSettings("m", voxel, margin, pitch))
    lowest = float(np.nanmin(heights))
    for row, column in np.argwhere(np.isfinite(heights)):
        top = heights[row, column]
        for _ in range(4):
            point = np.array(
                [
                    (column + rng.uniform(-0.5, 0.5)) * pitch,
                    (row + rng.uniform(-0.5, 0.5)) * pitch,
                    rng.uniform(lowest, top),
                ]
            )
            assert ((boxes.lower <= point) & (point <= boxes.upper)).all(axis=1).any()
    missing = int(np.isnan(heights).sum())
    assert bool(boxes.notes) == bool(missing)
    assert boxes.upper[:, 2].max() <= np.nanmax(heights) + voxel + margin + 1e-6


def test_three_columns_are_heights_where_their_distance_is_given(tmp_path: Path) -> None:
    (tmp_path / "map.npy").write_bytes(npy(np.full((5, 3), 0.2)))
    boxes = cloud_boxes(tmp_path, "map.npy", CloudSettings("m", 0.05, 0.0, 0.1))
    assert boxes.upper.max(axis=0) == pytest.approx([0.25, 0.45, 0.25], abs=1e-6)
    points = cloud_boxes(tmp_path, "map.npy", CloudSettings("m", 0.05, 0.0))
    assert len(points.lower) == 1


def test_a_wall_is_one_box(tmp_path: Path) -> None:
    y, z = np.meshgrid(np.arange(0.01, 2.0, 0.02), np.arange(0.01, 1.0, 0.02))
    wall = np.stack([np.full(y.size, 0.01), y.ravel(), z.ravel()], axis=1)
    (tmp_path / "wall.npy").write_bytes(npy(wall))
    boxes = cloud_boxes(tmp_path, "wall.npy", CloudSettings("m", 0.05, 0.01))
    assert len(boxes.lower) == 1
    assert boxes.lower[0] == pytest.approx([-0.01, -0.01, -0.01], abs=1e-6)
    assert boxes.upper[0] == pytest.approx([0.06, 2.01, 1.01], abs=1e-6)


FILES = {
    "a.pcd": lambda points: pcd(points, "ascii"),
    "b.pcd": lambda points: pcd(points, "binary"),
    "c.pcd": lambda points: pcd(points, "binary_compressed"),
    "a.ply": lambda points: ply(points, False),
    "b.ply": lambda points: ply(points, True),
    "a.npy": npy,
    "b.npy": lambda points: npy(points.reshape(2, -1, 3).astype(np.float32)),
}


@pytest.mark.parametrize("name", FILES)
def test_every_format_gives_the_same_points(tmp_path: Path, name: str) -> None:
    points = scan(3, 50)
    (tmp_path / name).write_bytes(FILES[name](points))
    found = read_cloud(tmp_path, name)
    assert found.points is not None
    assert np.array_equal(found.points, points)
    assert not found.notes


@pytest.mark.parametrize("name", ["a.pcd", "b.pcd", "c.pcd", "a.npy"])
def test_what_was_not_seen_is_counted(tmp_path: Path, name: str) -> None:
    points = scan(4, 20)
    points[5] = np.nan
    (tmp_path / name).write_bytes(FILES[name](points))
    found = read_cloud(tmp_path, name)
    assert found.points is not None
    assert len(found.points) == 39
    assert found.notes[0].startswith("1 points are not finite")


def test_a_viewpoint_that_is_not_applied_is_said(tmp_path: Path) -> None:
    (tmp_path / "a.pcd").write_bytes(pcd(scan(1, 5), "ascii", "0 0 1.2 1 0 0 0"))
    assert "VIEWPOINT is not applied" in read_cloud(tmp_path, "a.pcd").notes[0]


MESH = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n"
    "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
WRONG = {
    "mesh.ply": (MESH.encode(), "1 faces: it is a mesh"),
    "cut.ply": (ply(scan(1, 5), True)[:-9], "can't be read"),
    "text.ply": (b"ply\nnothing", "can't be read"),
    "cut.pcd": (pcd(scan(1, 5), "binary")[:-1], "was it cut"),
    "short.pcd": (pcd(scan(1, 5), "ascii").rsplit(b"\n", 2)[0], "9 lines of points"),
    "damaged.pcd": (pcd(scan(1, 5), "binary_compressed")[:-4], "was it cut"),
    "nothing.pcd": (b"\x00" * 100, "has no PCD header"),
    "flat.pcd": (
        (HEADER.replace("x y z", "x y w") + "POINTS 1\nDATA ascii\n0 0 0\n").encode(),
        "has 0 fields z",
    ),
    "many.pcd": ((HEADER + "POINTS 99999999999\nDATA binary\n").encode(), "must have 1 to"),
    "word.pcd": ((HEADER + "POINTS 1\nDATA ascii\n0 0 one\n").encode(), "is no number"),
    "empty.npy": (npy(np.full((4, 3), np.nan)), "no point with three finite"),
    "object.npy": (npy(np.array(["a", "b"])), "array of numbers"),
    "shape.npy": (npy(np.zeros(7)), "has the shape (7,)"),
    "far.npy": (npy(np.full((4, 3), 1000.0)), "is its unit another"),
    "map.npy": (npy(np.zeros((4, 5))), "say their distance"),
    "dust.npy": (
        npy(np.random.default_rng(1).uniform(-90, 90, (9000, 3))),
        "must need at most 2000",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_what_is_no_cloud_is_refused_with_the_reason(tmp_path: Path, name: str) -> None:
    content, words = WRONG[name]
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InvalidValueError, match=re.escape(words)):
        cloud_boxes(tmp_path, name, CloudSettings("m", 0.05, 0.01))


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_damaged_files_are_refused_or_read(tmp_path: Path, suffix: str) -> None:
    """Drawn bytes changed, cut and doubled: an answer or one refusal, never another exception."""
    rng = np.random.default_rng(7)
    names = [name for name in FILES if name.endswith(suffix)]
    for number in range(60):
        content = bytearray(FILES[names[number % len(names)]](scan(number, 20)))
        for _ in range(int(rng.integers(1, 6))):
            content[int(rng.integers(len(content)))] = int(rng.integers(256))
        if number % 3 == 0:
            del content[int(rng.integers(len(content))) :]
        name = f"damaged{suffix}"
        (tmp_path / name).write_bytes(bytes(content))
        try:
            cloud_boxes(tmp_path, name, CloudSettings("m", 0.5, 0.01))
        except InvalidValueError:
            continue


CELL = """\
format: ir_cell/1
name: bin
robot: kr210_r2700_extra
equipment:
  - name: bin
    pose: {{xyz: [1.5, 0, 0.8], abc_deg: [30, 0, 0]}}
    bodies: [{line}]
    stations:
      - name: feed
        pose: {{xyz: [0.0, 0.0, 0.6]}}
        allowed_contacts: [{{between: [l6, scan], safety_distance: 0.001}}]
"""


def test_a_cell_stands_around_its_cloud(tmp_path: Path) -> None:
    """Distances in the cell are never above the distance to the nearest point less the margin."""
    points = scan(5, 400)
    (tmp_path / "scan.pcd").write_bytes(pcd(1000.0 * points, "binary"))
    line = "{name: scan, cloud: scan.pcd, unit: mm, margin: 0.02, voxel: 0.1, xyz: [0, 0, 0.1]}"
    path = tmp_path / "cell.yaml"
    path.write_text(CELL.format(line=line))
    cell = load_cell(path)
    bodies = [body for body in cell.bodies() if body.name.startswith("scan")]
    assert len(bodies) > 5
    contacts = cell.stations[0].allowed_contacts
    assert {contact.body_b for contact in contacts} == {body.name for body in bodies}
    turn = np.deg2rad(30.0)
    rotation = np.array(
        [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    )
    world = (points + np.array([0, 0, 0.1])) @ rotation.T + [1.5, 0, 0.8]
    tree = cKDTree(world)
    for place in np.random.default_rng(2).uniform((0, -2, 0), (3, 2, 2.5), (60, 3)):
        ours = min(point_distance(body, place) for body in bodies)
        truth = float(tree.query(place)[0]) - 0.02
        assert ours <= max(truth, 0.0) + 1e-6
        assert ours >= truth - np.sqrt(3.0) * 0.12 - 1e-6


def test_the_line_that_import_prints_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    points = scan(6, 100)
    points[0] = np.inf
    (tmp_path / "scan.npy").write_bytes(npy(points))
    monkeypatch.chdir(tmp_path)
    arguments = ["scan.npy", "--unit", "m", "--margin", "0.01", "--voxel", "0.2"]
    assert main(["cell", "import", *arguments, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    line = printed["line"].removeprefix("- ")
    assert printed["notes"] == ["1 points are not finite (nothing was seen there): left out"]
    (tmp_path / "cell.yaml").write_text(CELL.format(line=line))
    bodies = [body for body in load_cell(tmp_path / "cell.yaml").bodies() if "scan" in body.name]
    assert len(bodies) == printed["boxes"]
    assert main(["cell", "import", *arguments]) == 0
    assert "boxes, none of which sticks out" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ("cloud: scan.npy, unit: m", "margin"),
        ("cloud: scan.npy, unit: m, margin: -1", "must be in [0, 1] m"),
        ("cloud: ../scan.npy, unit: m, margin: 0.1", "in the cell file's folder"),
        ("cloud: scan.pcd, unit: m, margin: 0.1, pitch: 0.1", "has no pitch"),
        ("cloud: scan.npy, unit: m, margin: 0.1, crop: [[0, 0, 0], [0, 1, 1]]", "lower corner"),
        (
            "cloud: scan.npy, unit: m, margin: 0.1, crop: [[50, 0, 0], [51, 1, 1]]",
            "no point inside",
        ),
        ("cloud: scan.npy, unit: mile, margin: 0.1", "must be one of"),
    ],
)
def test_a_wrong_entry_is_refused_with_its_place(tmp_path: Path, keys: str, words: str) -> None:
    (tmp_path / "scan.npy").write_bytes(npy(scan(1, 10)))
    (tmp_path / "scan.pcd").write_bytes(pcd(scan(1, 10), "binary"))
    path = tmp_path / "cell.yaml"
    path.write_text(CELL.format(line=f"{{name: scan, {keys}}}"))
    with pytest.raises(CellFileError, match="yaml:7") as caught:
        load_cell(path)
    assert words in str(caught.value)
