"""Meshes from CAD as convex pieces: they contain the mesh, are repeatable, and hostile files are
refused.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator
from pathlib import Path

import coal
import numpy as np
import pytest
import trimesh
from scipy.spatial import ConvexHull

from ir_cli.main import main
from ir_description import Body, CellFileError, cell_from_yaml, cell_to_yaml, load_cell
from ir_description.files import convex_pieces as coacd_process
from ir_description.files import convex_pieces as convex
from ir_description.files import piece_cache, solid_mesh
from ir_description.files.convex_pieces import ConvexPieces, contains, protrusion, winding
from ir_description.files.piece_cache import pieces_of
from ir_description.files.solid_mesh import triangles_from_obj
from ir_description.files.stl_mesh import is_closed
from ir_description.shapes import point_distance
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

PROFILE = np.array([(0, 0), (1, 0), (1, 0.2), (0.2, 0.2), (0.2, 0.8), (1, 0.8), (1, 1), (0, 1)])
FACES = [
    (0, 1, 2),
    (0, 2, 3),
    (0, 3, 4),
    (0, 4, 7),
    (4, 5, 6),
    (4, 6, 7),
]  # of the profile
NOISE = 1e-9  # m: Coal's


def c_frame() -> FloatArray:
    """Triangles (T, 3, 3) of a press frame, 1 m high and 0.5 m wide."""
    count = len(PROFILE)
    low = np.column_stack([PROFILE, np.zeros(count)])
    points = np.concatenate([low, low + np.array([0.0, 0.0, 0.5])])
    faces = [(a, c, b) for a, b, c in FACES] + [
        (a + count, b + count, c + count) for a, b, c in FACES
    ]
    for k in range(count):
        n = (k + 1) % count
        faces += [(k, n, n + count), (k, n + count, k + count)]
    return points[np.array(faces)]


def obj_of(triangles: FloatArray, scale: float = 1000.0) -> str:
    lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in (triangles.reshape(-1, 3) * scale).tolist()]
    lines += [f"f {3 * k + 1}/1/1 {3 * k + 2}//2 {3 * k + 3}" for k in range(len(triangles))]
    return "mtllib ../../../etc/passwd\n" + "\n".join(lines) + "\n"


def gltf_of(triangles: FloatArray, uri: str) -> dict[str, object]:
    """A glTF of the triangles, whose y is up."""
    count = 3 * len(triangles)
    points = triangles.reshape(-1, 3)[:, [0, 2, 1]] * (1, 1, -1)
    low = points.min(axis=0).tolist()
    high = points.max(axis=0).tolist()
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": 5126,
                "count": count,
                "type": "VEC3",
                "min": low,
                "max": high,
            }
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 12 * count}],
        "buffers": [{"byteLength": 12 * count, "uri": uri}],
    }


def cell_text(line: str) -> str:
    return f"""\
format: ir_cell/1
name: press
robot: kr210_r2700_extra
equipment:
  - name: press
    pose: {{xyz: [1.5, 0, 0]}}
    bodies: [{line}]
    states: {{there: [frame], gone: []}}
    state: there
    stations:
      - name: feed
        pose: {{xyz: [0.6, 0.5, 0.25]}}
        allowed_contacts: [{{between: [l6, frame], safety_distance: 0.001}}]
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("cache")
    before = os.environ.get(piece_cache.FOLDER_VARIABLE)
    os.environ[piece_cache.FOLDER_VARIABLE] = str(folder)
    yield folder
    if before is None:
        del os.environ[piece_cache.FOLDER_VARIABLE]
    else:
        os.environ[piece_cache.FOLDER_VARIABLE] = before


@pytest.fixture(scope="module")
def divided(cache: Path) -> ConvexPieces:
    return pieces_of(c_frame(), 32)


@pytest.fixture
def folder(tmp_path: Path, cache: Path) -> Path:
    (tmp_path / "frame.obj").write_text(obj_of(c_frame()))
    return tmp_path


def coal_mesh(triangles: FloatArray) -> coal.BVHModelOBBRSS:
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(triangles), 3 * len(triangles))
    for a, b, c in triangles:
        model.addTriangle(a, b, c)
    model.endModel()
    return model


def distance(body: object, sphere: object, there: object) -> float:
    request = coal.DistanceRequest()
    result = coal.DistanceResult()
    return float(coal.distance(body, coal.Transform3s(), sphere, there, request, result))


def test_distances_from_the_pieces_are_safe_and_as_near_as_stated(divided: ConvexPieces) -> None:
    """Coal measures to the mesh itself; inside the solid it sees its shell, so points outside are
    taken.
    """
    triangles = c_frame()
    rng = np.random.default_rng(1)
    mesh = coal_mesh(triangles)
    sphere = coal.Sphere(1e-6)
    bodies = [
        Body(f"p{k}", "mesh", np.eye(4), np.zeros(3), each)
        for k, each in enumerate(divided.vertices)
    ]
    points = rng.uniform((-0.3, -0.3, -0.3), (1.3, 1.3, 0.8), (120, 3))
    points = points[winding(triangles, points) < 0.5]
    for point in points:
        there = coal.Transform3s(np.eye(3), point)
        truth = coal.distance(
            mesh, coal.Transform3s(), sphere, there, coal.DistanceRequest(), coal.DistanceResult()
        )
        ours = min(point_distance(body, point) for body in bodies)
        assert ours <= truth + 1e-6 + NOISE
        assert truth - ours <= divided.protrusion + 2e-6


def test_every_point_of_the_surface_lies_in_a_piece(divided: ConvexPieces) -> None:
    triangles = c_frame()
    rng = np.random.default_rng(2)
    shares = rng.dirichlet(np.ones(3), (200, len(triangles)))
    points = np.einsum("ntk,tkx->ntx", shares, triangles).reshape(-1, 3)
    shapes = [coal.Convex.convexHull(_points(each), False, "") for each in divided.vertices]
    sphere = coal.Sphere(1e-9)
    for point in points[rng.choice(len(points), 200, replace=False)]:
        there = coal.Transform3s(np.eye(3), point)
        depth = [
            coal.distance(
                shape,
                coal.Transform3s(),
                sphere,
                there,
                coal.DistanceRequest(),
                coal.DistanceResult(),
            )
            for shape in shapes
        ]
        assert min(depth) <= 1e-6


def _points(vertices: FloatArray) -> coal.StdVec_Vec3s:
    points = coal.StdVec_Vec3s()
    points.extend(list(vertices))
    return points


def test_what_is_stated_is_so(divided: ConvexPieces) -> None:
    assert 2 <= len(divided.vertices) <= 32
    assert divided.volume == pytest.approx(0.26, abs=1e-9)
    assert 0.26 < divided.of_pieces < 0.28
    assert divided.margin <= divided.protrusion < 0.03
    assert "convex pieces contain it, widened by 0.5 mm" in divided.sentence


def test_the_same_mesh_gives_the_same_pieces_and_is_divided_once(
    divided: ConvexPieces, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = list((cache / "pieces").glob("*.npz"))
    assert kept
    monkeypatch.setattr(coacd_process, "find_spec", lambda name: None)
    again = pieces_of(c_frame(), 32)
    for a, b in zip(divided.vertices, again.vertices, strict=True):
        np.testing.assert_array_equal(a, b)
    assert again.sentence == divided.sentence
    with pytest.raises(InvalidValueError, match=r"ir_description\[cad\]"):
        pieces_of(2.0 * c_frame(), 32)  # another mesh


@pytest.mark.long
def test_dividing_again_gives_the_same_bytes(divided: ConvexPieces) -> None:
    from ir_description.files.convex_pieces import convex_pieces

    for a, b in zip(divided.vertices, convex_pieces(c_frame(), 32).vertices, strict=True):
        np.testing.assert_array_equal(a, b)


def test_a_broken_cache_is_not_believed(
    divided: ConvexPieces, cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(convex, "convex_pieces", lambda *_: divided)
    for content in (b"", b"PK\x03\x04 nothing"):
        for path in (cache / "pieces").glob("*.npz"):
            path.write_bytes(content)
        assert pieces_of(c_frame(), 32) is divided
    monkeypatch.setattr(convex, "_CUTS", 3)
    small = ConvexPieces(tuple(0.5 * each for each in divided.vertices), 0.0, 0.0, 1.0, 1.0)
    for path in (cache / "pieces").glob("*.npz"):
        piece_cache._write(path, small)  # smaller than the mesh
    assert pieces_of(c_frame(), 32) is divided


def test_a_machine_is_one_line_of_a_cell(folder: Path, divided: ConvexPieces) -> None:
    path = folder / "press.yaml"
    path.write_text(cell_text("{name: frame, mesh: frame.obj, unit: mm, xyz: [0, 0, 0.1]}"))
    cell = load_cell(path)
    names = [body.name for body in cell.machine("press").bodies]
    assert names == [f"frame.{k}" for k in range(1, len(divided.vertices) + 1)]
    assert [contact.body_b for contact in cell.station("feed").allowed_contacts] == names
    assert list(cell.machine("press").states[0].bodies) == names
    written = cell_to_yaml(cell)
    assert cell_to_yaml(cell_from_yaml(written)) == written
    path.write_text(path.read_text() + PATHS)
    (bead,) = load_cell(path).paths
    assert [contact.body_b for contact in bead.allowed_contacts] == names


def test_the_guide_repairs_what_is_refused_with_the_place_of_its_hole(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, divided: ConvexPieces
) -> None:
    corners = np.arange(3 * len(OPEN)).reshape(-1, 3)
    trimesh.Trimesh(OPEN.reshape(-1, 3), corners, process=False).export(tmp_path / "press.stl")
    path = tmp_path / "press.yaml"
    path.write_text(cell_text("{name: frame, mesh: press.stl, unit: m}"))
    with pytest.raises(CellFileError, match=r"3 edges, one at \(.*\) m") as refused:
        load_cell(path)
    assert "docs/cad.md, Repair" in str(refused.value)
    page = (Path(__file__).resolve().parents[2] / "docs" / "cad.md").read_text()
    (code,) = re.findall(r"```python\n(import trimesh.*?)```", page, re.DOTALL)
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    mended = solid_mesh.read_solid(tmp_path, "press_closed.stl").triangles
    assert len(mended) == len(CUBE)
    assert is_closed(mended)
    assert np.linalg.det(mended).sum() / 6.0 == pytest.approx(divided.volume, rel=1e-6)


def test_gltf_stands_upright_and_takes_buffers_of_its_folder_only(
    folder: Path, divided: ConvexPieces
) -> None:
    triangles = c_frame()
    points = (triangles.reshape(-1, 3)[:, [0, 2, 1]] * (1, 1, -1)).astype("<f4")
    (folder / "frame.bin").write_bytes(points.tobytes())
    outside = folder.parent / "outside.bin"
    outside.write_bytes(points.tobytes())
    (folder / "link.bin").symlink_to(outside)
    gltf = folder / "frame.gltf"
    gltf.write_text(json.dumps(gltf_of(triangles, "frame.bin")))
    read = solid_mesh.read_solid(folder, "frame.gltf").triangles
    np.testing.assert_allclose(read, triangles, atol=1e-6)
    for uri in (
        "../outside.bin",
        "link.bin",
        str(outside),
        "http://127.0.0.1/frame.bin",
        "file:" + "///etc/passwd",
    ):
        gltf.write_text(json.dumps(gltf_of(triangles, uri)))
        with pytest.raises(InvalidValueError, match="folder"):
            solid_mesh.read_solid(folder, "frame.gltf")
    for broken in (
        "",
        "[]",
        "{}",
        '{"buffers": 7}',
        json.dumps({**gltf_of(triangles, "frame.bin"), "accessors": []}),
    ):
        gltf.write_text(broken)
        with pytest.raises(InvalidValueError, match="glTF"):
            solid_mesh.read_solid(folder, "frame.gltf")


PATHS = """\
paths:
  - name: bead
    equipment: press
    allowed_contacts: [{between: [l6, frame], safety_distance: 0.001}]
    start: {xyz: [1.0, 0, 1.0]}
    segments: [{line: {xyz: [1.1, 0, 1.0]}}]
"""
CUBE = c_frame()
OPEN = CUBE[:-1]
NAN = np.where(np.arange(3) == 0, np.nan, CUBE)


@pytest.mark.parametrize(
    ("line", "content", "sentence"),
    [
        ("mesh: x.obj, unit: mm", obj_of(OPEN), "is not closed"),
        ("mesh: x.obj, unit: mm", obj_of(np.concatenate([CUBE, CUBE[:1]])), "is not closed"),
        ("mesh: x.obj, unit: mm", obj_of(CUBE[:, ::-1]), "seen from outside"),
        ("mesh: x.obj, unit: mm", obj_of(NAN), "not finite"),
        ("mesh: x.obj, unit: m", obj_of(CUBE), "is its unit another"),
        ("mesh: x.obj", obj_of(CUBE), "has no unit"),
        ("mesh: x.obj, unit: miles", obj_of(CUBE), "must be one of"),
        ("mesh: x.obj, unit: mm, pieces: 0", obj_of(CUBE), "pieces is 0"),
        ("mesh: x.obj, unit: mm, kind: mesh", obj_of(CUBE), "unknown key"),
        ("mesh: ../x.obj, unit: mm", obj_of(CUBE), "without '..'"),
        ("mesh: /etc/passwd, unit: mm", "", "must be an .stl or .obj"),
        ("mesh: y.obj, unit: mm", "", "can't be opened"),
        ("mesh: x.obj, unit: mm", "", "no faces"),
        ("mesh: x.obj, unit: mm", "v 0 0 0\nf 1 2 3\n", "line 2 of the OBJ"),
        ("mesh: x.obj, unit: mm", "v 0 zero 0\n", "line 1 of the OBJ"),
        ("mesh: x.obj, unit: mm", "v 0 0\n", "line 1 of the OBJ"),
        ("mesh: x.obj, unit: mm", "v 0 1_5 0\n", "line 1 of the OBJ"),
        ("mesh: x.glb, unit: m", "glTF", "can't be read"),
        ("mesh: x.stl, unit: m", "solid\nendsolid", "0 triangles"),
        ("mesh: x.stl, unit: m", "solid", "was it cut?"),
    ],
)
def test_what_is_no_machine_is_refused_by_a_sentence_at_its_line(
    line: str, content: str, sentence: str, tmp_path: Path, cache: Path
) -> None:
    for suffix in ("obj", "glb", "stl"):
        (tmp_path / f"x.{suffix}").write_text(content)
    path = tmp_path / "press.yaml"
    path.write_text(cell_text(f"{{name: frame, {line}}}"))
    with pytest.raises(CellFileError, match=r"press\.yaml:7") as refused:
        load_cell(path)
    assert sentence in str(refused.value)


def test_a_mesh_is_named_in_a_file_and_is_a_regular_one(tmp_path: Path) -> None:
    with pytest.raises(CellFileError, match="this is a text"):
        cell_from_yaml(cell_text("{name: frame, mesh: frame.obj, unit: mm}"))
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "link.stl").symlink_to("/etc/passwd")
    for name in ("pipe.obj", "link.stl"):
        with pytest.raises(InvalidValueError):
            solid_mesh.read_solid(tmp_path, name)


@pytest.mark.long
def test_a_mesh_of_very_many_triangles_is_simplified_and_all_of_it_is_contained(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pytest.importorskip("fast_simplification")
    dense = c_frame()
    for _ in range(2):
        dense = convex._cut(dense)
    monkeypatch.setattr(convex, "TRIANGLES_MAX", 300)
    monkeypatch.setattr(convex, "SIMPLE", 100)
    pieces = convex.convex_pieces(dense, 8)
    assert pieces.simplified == len(dense)
    assert f"all of its {len(dense)}" in pieces.sentence
    assert contains(pieces.vertices, dense)
    assert pieces.volume == pytest.approx(np.linalg.det(c_frame()).sum() / 6.0)
    assert pieces.protrusion >= protrusion(pieces.vertices, c_frame()) / 1.2
    monkeypatch.setattr(convex, "find_spec", lambda name: None)
    with pytest.raises(InvalidValueError, match="export it coarser"):
        convex.convex_pieces(dense, 8)


@pytest.mark.long
def test_a_convex_solid_with_very_many_corners_is_one_piece_with_few() -> None:
    turn = np.linspace(0.0, 2.0 * np.pi, 250, endpoint=False)
    ring = np.column_stack([np.cos(turn), np.sin(turn), np.zeros(250)])
    points = np.concatenate([0.4 * ring, 0.4 * ring + [0.0, 0.0, 0.5]])
    hull = ConvexHull(points)
    triangles = points[hull.simplices]
    inwards = np.linalg.det(triangles - points.mean(axis=0)) < 0.0
    triangles[inwards] = triangles[inwards][:, ::-1]
    pieces = convex.convex_pieces(triangles, 8)
    (only,) = pieces.vertices
    assert len(only) <= 1000
    assert contains(pieces.vertices, triangles)
    assert pieces.of_pieces <= 1.06 * pieces.volume


def test_a_division_that_crashes_is_a_sentence(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(coacd_process, "PROGRAM", "import os; os.kill(os.getpid(), 11)")
    with pytest.raises(InvalidValueError, match="code -11"):
        coacd_process.decomposed(c_frame(), 4)


@pytest.mark.parametrize("gap", [0.0, 0.01])
def test_containment_is_not_claimed_where_a_gap_is_left(
    gap: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(convex, "_CUTS", 11)  # until its pieces are as small as the margin
    box = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 1.0)])
    halves = [
        box * (0.5 - gap / 2.0, 1, 1),
        box * (0.5 - gap / 2.0, 1, 1) + (0.5 + gap / 2.0, 0, 0),
    ]
    wide = [1.005 * (each - each.mean(axis=0)) + each.mean(axis=0) for each in halves]
    triangles = np.random.default_rng(3).uniform(0.05, 0.95, (4, 3, 3))
    assert contains(wide, triangles) == (gap == 0.0)


def test_the_bound_of_the_protrusion_holds_and_is_near() -> None:
    triangles = c_frame()
    box = np.array([[x, y, z] for x in (0.0, 1.0) for y in (0.0, 1.0) for z in (0.0, 0.5)])
    bound = protrusion([box], triangles)  # the farthest point is in the middle of the opening
    assert 0.3 <= bound <= 1.1 * 0.3 + 0.02
    assert len(triangles_from_obj(obj_of(triangles).encode())) == len(triangles)


def test_ir_cell_import_gives_the_line_to_paste(
    folder: Path, divided: ConvexPieces, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["cell", "import", str(folder / "frame.obj"), "--unit", "mm"]) == 0
    line, stated = capsys.readouterr().out.splitlines()
    assert line == "- {name: frame, mesh: frame.obj, unit: mm}"
    assert "convex pieces contain it" in stated
    assert main(["cell", "import", str(folder / "frame.obj"), "--unit", "m"]) == 2
    assert "is its unit another" in capsys.readouterr().err
    assert main(["cell", "import", str(folder / "frame.obj")]) == 2
    assert "--unit" in capsys.readouterr().err


def shell(low: tuple[float, float, float], high: tuple[float, float, float]) -> FloatArray:
    """Triangles of a box."""
    return np.asarray(trimesh.creation.box(bounds=[low, high]).triangles, dtype=np.float64)


def test_shells_that_touch_are_divided_one_by_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """A pedestal of plates and a column: CoACD did not end with them in ten minutes."""
    asked: list[tuple[int, int]] = []

    def one_piece(triangles: FloatArray, most: int, share: int) -> list[FloatArray]:
        asked.append((most, share))
        return [triangles.reshape(-1, 3)]

    monkeypatch.setattr(convex, "decomposed", one_piece)
    column = np.asarray(trimesh.creation.annulus(0.1, 0.15, 0.52, sections=60).triangles)
    column = column + np.array([0.0, 0.0, 0.3])
    plates = shell((-0.3, -0.3, 0.0), (0.3, 0.3, 0.04)), shell((-0.2, -0.2, 0.56), (0.2, 0.2, 0.6))
    found = convex.convex_pieces(np.concatenate([plates[0], column, plates[1]]), 8)
    assert asked == [(6, 1)]  # for the hollow column alone: the plates are convex
    assert len(found.vertices) == 3
    assert contains(found.vertices, np.concatenate([*plates, column]))


@pytest.mark.parametrize("most", [1, 8])
def test_hollows_and_more_shells_than_pieces_are_divided_as_a_whole(
    most: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole: list[int] = []

    def box(triangles: FloatArray, most: int) -> list[FloatArray]:
        whole.append(len(triangles))
        return [triangles.reshape(-1, 3)]

    monkeypatch.setattr(convex, "decomposed", box)
    outer = shell((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    other = shell((0.2, 0.2, 0.2), (0.8, 0.8, 0.8))
    inner = other if most == 1 else other[:, ::-1]
    convex.convex_pieces(np.concatenate([outer, inner]), most)
    assert whole == [24]


def test_shells_share_the_time_of_a_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many shells a hostile mesh has, it takes no longer than one."""
    read = "numpy.load(io.BytesIO(sys.stdin.buffer.read()))['seconds']"
    seconds = f"import io, numpy, sys; sys.exit(int({read}))"
    monkeypatch.setattr(coacd_process, "PROGRAM", seconds)
    monkeypatch.setattr(coacd_process, "PROCESSOR_SECONDS", 100)
    two = np.concatenate([c_frame(), c_frame() + 2.0])
    with pytest.raises(InvalidValueError, match="code 50"):
        convex.convex_pieces(two, 8)
