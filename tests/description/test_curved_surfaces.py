"""STEP files: their solids lie within the stated error of triangles and inside the pieces, in
metres whatever their unit is.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from ir_cli.main import main
from ir_description.files import curved_surfaces
from ir_description.files.convex_pieces import point_triangle
from ir_description.files.curved_surfaces import triangles_of_surfaces
from ir_description.files.solid_reader import SolidReader
from ir_description.files.stl_mesh import is_closed
from ir_values.errors import InvalidValueError

UNITS = {"mm": 0.001, "m": 1.0, "inch": 0.0254}
RADIUS = 0.3  # m
HEIGHT = 0.8  # m


def cylinder_step(unit: str) -> str:
    """A cylinder of RADIUS and HEIGHT that stands on z = 0, as a STEP file in a unit."""
    r = RADIUS / UNITS[unit]
    h = HEIGHT / UNITS[unit]
    length = {
        "mm": "(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.))",
        "m": "(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT($,.METRE.))",
        "inch": "(CONVERSION_BASED_UNIT('INCH',#61) LENGTH_UNIT() NAMED_UNIT(#62))",
    }[unit]
    lines = f"""\
#1=APPLICATION_CONTEXT('core data for automotive mechanical design processes');
#2=APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#1);
#3=PRODUCT_CONTEXT('',#1,'mechanical');
#4=PRODUCT('drum','drum','',(#3));
#5=PRODUCT_DEFINITION_FORMATION('','',#4);
#6=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#7=PRODUCT_DEFINITION('design','',#5,#6);
#8=PRODUCT_DEFINITION_SHAPE('','',#7);
#9=SHAPE_DEFINITION_REPRESENTATION(#8,#10);
#10=ADVANCED_BREP_SHAPE_REPRESENTATION('',(#11,#15),#50);
#11=AXIS2_PLACEMENT_3D('',#12,#13,#14);
#12=CARTESIAN_POINT('',(0.,0.,0.));
#13=DIRECTION('',(0.,0.,1.));
#14=DIRECTION('',(1.,0.,0.));
#15=MANIFOLD_SOLID_BREP('',#16);
#16=CLOSED_SHELL('',(#17,#18,#19));
#17=ADVANCED_FACE('',(#20),#23,.T.);
#18=ADVANCED_FACE('',(#21),#24,.T.);
#19=ADVANCED_FACE('',(#22),#25,.F.);
#20=FACE_BOUND('',#26,.T.);
#21=FACE_BOUND('',#27,.T.);
#22=FACE_BOUND('',#28,.F.);
#23=CYLINDRICAL_SURFACE('',#11,{r!r});
#24=PLANE('',#29);
#25=PLANE('',#11);
#26=EDGE_LOOP('',(#30,#31,#32,#33));
#27=EDGE_LOOP('',(#34));
#28=EDGE_LOOP('',(#35));
#29=AXIS2_PLACEMENT_3D('',#36,#13,#14);
#30=ORIENTED_EDGE('',*,*,#40,.T.);
#31=ORIENTED_EDGE('',*,*,#42,.T.);
#32=ORIENTED_EDGE('',*,*,#41,.F.);
#33=ORIENTED_EDGE('',*,*,#42,.F.);
#34=ORIENTED_EDGE('',*,*,#41,.T.);
#35=ORIENTED_EDGE('',*,*,#40,.T.);
#36=CARTESIAN_POINT('',(0.,0.,{h!r}));
#40=EDGE_CURVE('',#43,#43,#45,.T.);
#41=EDGE_CURVE('',#44,#44,#46,.T.);
#42=EDGE_CURVE('',#43,#44,#47,.T.);
#43=VERTEX_POINT('',#48);
#44=VERTEX_POINT('',#49);
#45=CIRCLE('',#11,{r!r});
#46=CIRCLE('',#29,{r!r});
#47=LINE('',#48,#53);
#48=CARTESIAN_POINT('',({r!r},0.,0.));
#49=CARTESIAN_POINT('',({r!r},0.,{h!r}));
#50=(GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#54))
GLOBAL_UNIT_ASSIGNED_CONTEXT((#55,#56,#57)) REPRESENTATION_CONTEXT('',''));
#53=VECTOR('',#13,1.);
#54=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-07),#55,'distance_accuracy_value','');
#55={length};
#56=(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.));
#57=(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT());
#60=(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.));
#61=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#60);
#62=DIMENSIONAL_EXPONENTS(1.,0.,0.,0.,0.,0.,0.);
"""
    head = (
        "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','')"
        ";\nFILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));\nENDSEC;\nDATA;\n"
    )
    return f"{head}{lines}ENDSEC;\nEND-ISO-10303-21;\n"


def on_the_surface(rng: np.random.Generator, count: int) -> np.ndarray:
    """Points (N, 3) [m] of the cylinder's side and ends."""
    turn = rng.uniform(-np.pi, np.pi, count)
    side = rng.random(count) < 0.7
    radius = np.where(side, RADIUS, RADIUS * np.sqrt(rng.random(count)))
    height = np.where(side, rng.uniform(0.0, HEIGHT, count), HEIGHT * rng.integers(0, 2, count))
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn), height])


@pytest.mark.parametrize(
    "unit", ["inch", *(pytest.param(unit, marks=pytest.mark.long) for unit in ("mm", "m"))]
)
def test_triangles_are_in_metres_closed_and_as_near_as_stated(unit: str) -> None:
    pytest.importorskip("cascadio")
    triangles, error = triangles_of_surfaces(cylinder_step(unit).encode(), ".step")
    assert is_closed(triangles)
    points = on_the_surface(np.random.default_rng(1), 60)
    apart = [
        point_triangle(np.repeat(point[None], len(triangles), axis=0), triangles).min()
        for point in points
    ]
    assert max(apart) < error
    volume = np.linalg.det(triangles).sum() / 6.0
    assert volume == pytest.approx(np.pi * RADIUS**2 * HEIGHT, rel=0.01)


@pytest.mark.filterwarnings("error")
def test_a_triangle_without_area_is_as_far_as_its_longest_edge() -> None:
    """Also where its sides are so short that their squares vanish."""
    rng = np.random.default_rng(2)
    corner = rng.normal(size=3)
    far = rng.normal(size=3)
    points = rng.normal(size=(50, 3))
    line = np.array([corner, 0.5 * (corner + far), far])
    tiny = np.array([[0.0, 0.0, 0.0], [1e-170, 0.0, 0.0], [0.0, 1e-170, 0.0]])
    share = np.clip((points - corner) @ (far - corner) / ((far - corner) @ (far - corner)), 0, 1)
    to_line = np.linalg.norm(points - corner - share[:, None] * (far - corner), axis=1)
    expected = (
        (np.array([corner, corner, corner]), np.linalg.norm(points - corner, axis=1)),
        (line, to_line),
        (tiny, np.linalg.norm(points, axis=1)),
    )
    for triangle, distance in expected:
        found = point_triangle(points, np.tile(triangle, (len(points), 1, 1)))
        np.testing.assert_allclose(found, distance, rtol=1e-9)


def test_a_point_is_as_far_from_a_triangle_as_from_its_nearest_point() -> None:
    """Of 5000 triangles, more than are measured at once: against a grid of points of each."""
    rng = np.random.default_rng(3)
    triangles = rng.normal(size=(5000, 3, 3))
    points = rng.normal(size=(5000, 3))
    found = point_triangle(points, triangles)
    shares = np.array([(i, j, 16 - i - j) for i in range(17) for j in range(17 - i)]) / 16.0
    grid = np.einsum("gk,tkx->tgx", shares, triangles)
    nearest = np.linalg.norm(grid - points[:, None], axis=2).min(axis=1)
    longest = np.linalg.norm(triangles - np.roll(triangles, -1, axis=1), axis=2).max(axis=1)
    assert (found <= nearest + 1e-12).all()
    assert (found >= nearest - longest / 16.0).all()


@pytest.mark.long
def test_the_pieces_of_a_cell_contain_the_curved_solid(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("cascadio")
    monkeypatch.setenv("IR_CACHE", str(tmp_path))
    (tmp_path / "drum.step").write_text(cylinder_step("inch"))
    pieces = SolidReader(tmp_path).pieces("drum.step", "", 8)
    assert pieces.margin >= curved_surfaces.ERRORS[0]
    planes = [ConvexHull(piece).equations for piece in pieces.vertices]
    points = on_the_surface(np.random.default_rng(2), 500)
    deepest = [(points @ each[:, :3].T + each[:, 3]).max(axis=1) for each in planes]
    assert np.min(deepest, axis=0).max() <= 0.0
    with pytest.raises(InvalidValueError, match="says its unit itself"):
        SolidReader(tmp_path).pieces("drum.step", "mm", 8)


@pytest.mark.parametrize("cut", [False, pytest.param(True, marks=pytest.mark.long)])
def test_a_part_that_opencascade_leaves_out_is_refused(cut: bool) -> None:
    pytest.importorskip("cascadio")
    text = cylinder_step("mm")
    hurt = text[:2000] if cut else text.replace("#23=CYLINDRICAL", "#99=CYLINDRICAL")
    with pytest.raises(InvalidValueError, match="can't read all of its surfaces"):
        triangles_of_surfaces(hurt.encode(), ".step")


def test_without_cascadio_the_sentence_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(curved_surfaces, "find_spec", lambda name: None)
    with pytest.raises(InvalidValueError, match="pip install"):
        triangles_of_surfaces(b"", ".step")


@pytest.mark.long
def test_an_import_says_that_the_triangles_of_curved_surfaces_are_not_proved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("cascadio")
    monkeypatch.setenv("IR_CACHE", str(tmp_path))
    (tmp_path / "drum.step").write_text(cylinder_step("inch"))
    assert main(["cell", "import", str(tmp_path / "drum.step")]) == 0
    said = capsys.readouterr().out.splitlines()
    assert said[-1] == f"# {curved_surfaces.NOT_PROVED}"
