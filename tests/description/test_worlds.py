"""Machines out to SDF and URDF and back, and worlds that are hostile."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ir_cli.main import main
from ir_description import bundled_cells, cell_from_yaml, load_cell

SHAPE = "<geometry><box><size>1 2 3</size></box></geometry>"
BOX = f"<collision name='c'><pose>0 0 1 0 0 0</pose>{SHAPE}</collision>"
MESH = (
    "<robot><link name='a'><collision><geometry><mesh "
    "filename='{}'/></geometry></collision></link></robot>"
)


@pytest.mark.parametrize("form", ["sdf", "urdf"])
@pytest.mark.parametrize("name", [*bundled_cells(), "meshes"])
def test_what_is_written_is_read_back_the_same(
    form: str, name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    given = name
    if name == "meshes":
        given = str(tmp_path / "cell.yaml")
        Path(given).write_text(
            "format: ir_cell/1\nname: meshes\nrobot: kr6_r900_2\nequipment:\n"
            "  - {name: wedge_m, pose: {xyz: [1, 0, 0.5], abc_deg: [30, 20, 10]}, bodies: [\n"
            "      {name: wedge, kind: mesh, vertices: [[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, "
            "0, 0.2]]},\n"
            "      {name: rod, kind: capsule, radius: 0.1, length: 0.4, abc_deg: [0, 90, 0]}]}\n"
        )
    cell = load_cell(given)
    assert main(["cell", "export", given, str(tmp_path / f"world.{form}")]) == 0
    capsys.readouterr()
    assert (
        main(["cell", "import", str(tmp_path / f"world.{form}"), "--robot", cell.robot.name]) == 0
    )
    out, err = capsys.readouterr()
    back = cell_from_yaml(out)
    assert err == ""
    assert [machine.name for machine in back.equipment] == [
        machine.name for machine in cell.equipment
    ]
    for machine, other in zip(cell.equipment, back.equipment, strict=True):
        np.testing.assert_allclose(other.pose, machine.pose, atol=1e-9)
        for body, same in zip(machine.present_bodies(), other.bodies, strict=True):
            assert (same.name, same.kind) == (body.name, body.kind)
            np.testing.assert_allclose(same.size, body.size, rtol=1e-12)
            np.testing.assert_allclose(same.pose, body.pose, atol=1e-9)
            np.testing.assert_allclose(same.vertices, np.unique(body.vertices, axis=0), atol=0.0)
    assert (
        main(["cell", "export", given, str(tmp_path / f"world.{form}")]) == 1
    )  # nothing is overwritten


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("<sdf>", "not XML"),
        ("<!DOCTYPE a [<!ENTITY b 'c'>]><sdf/>", "entities"),
        ("<html/>", "must be sdf or robot"),
        (f"<sdf><model><link>{BOX.replace('1 2 3', '1 2')}</link></model></sdf>", "must be 3 numbers"),  # noqa: E501
        (f"<sdf><model><link>{BOX.replace('1 2 3', '1 nan 3')}</link></model></sdf>", "must be 3 numbers"),  # noqa: E501
        (f"<sdf><model><link>{BOX.replace('1 2 3', '1 -2 3')}</link></model></sdf>", "size of c"),
        ("<sdf><model><link><pose "
f"relative_to='x'>0 0 0 0 0 0</pose>{BOX}</link></model></sdf>", "relative to 'x'"),
        (MESH.format("../a.obj"), "without '..'"),
        (MESH.format("package://b/a.obj"), "folder"),
    ],
)  # fmt: skip
def test_hostile_worlds_are_refused_by_a_sentence(
    text: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "world.sdf"
    path.write_text(text)
    assert main(["cell", "import", str(path)]) == 2
    assert sentence in capsys.readouterr().err


def test_what_moves_or_is_elsewhere_is_left_out_by_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "world.sdf"
    arm = f"<model name='arm'><link name='a'>{BOX}</link><joint name='j' type='revolute'/></model>"
    two = f"<model name='2 tables'><link>{BOX}{BOX}</link></model>"
    path.write_text(
        f"<sdf><world name='w'>{arm}{two}<include><uri>model://sun</uri></include></world></sdf>"
    )
    assert main(["cell", "import", str(path)]) == 0
    out, err = capsys.readouterr()
    assert [body.name for body in cell_from_yaml(out).machine("tables").bodies] == ["c", "tables_c"]
    assert "model arm" in err
    assert "model://sun" in err


def test_a_mesh_that_cannot_be_read_is_named_and_the_rest_is_read(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bad = "<model name='shelf'><link><collision><geometry><mesh><uri>shelf.dae</uri></mesh></geometry></collision></link></model>"  # noqa: E501
    path = tmp_path / "world.sdf"
    path.write_text(
        f"<sdf><world><model name='table'><link>{BOX}</link></model>{bad}</world></sdf>"
    )
    assert main(["cell", "import", str(path)]) == 0
    out, err = capsys.readouterr()
    assert [machine.name for machine in cell_from_yaml(out).equipment] == ["table"]
    assert "left out: body" in err
    assert "shelf.dae" in err
    assert "# left out: body" in out


def test_a_world_of_visuals_is_no_empty_cell(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "world.sdf"
    seen = BOX.replace("collision", "visual")
    path.write_text(
        f"<sdf><world><model name='table'><link name='l'>{seen}</link></model></world></sdf>"
    )
    assert main(["cell", "import", str(path)]) == 2
    assert "link l of model table: it has no collision shape" in capsys.readouterr().err
    assert main(["cell", "import", str(path), "--visuals"]) == 0
    assert len(cell_from_yaml(capsys.readouterr().out).equipment) == 1


def test_included_and_nested_models_are_read_where_they_stand(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "table").mkdir()
    (tmp_path / "table" / "model.sdf").write_text(
        f"<sdf><model name='t'><link>{BOX}</link></model></sdf>"
    )
    path = tmp_path / "world.sdf"
    path.write_text(
        "<sdf><world><include><uri>model://table</uri><name>left</name><pose>1 0 0 0 0 0</pose>"
        "</include><model name='outer'><pose>0 2 0 0 0 0</pose><model name='inner'>"
        f"<pose>0 0 3 0 0 0</pose><link>{BOX}</link></model></model></world></sdf>"
    )
    assert main(["cell", "import", str(path)]) == 0
    found = cell_from_yaml(capsys.readouterr().out).equipment
    places = {machine.name: machine.pose[:3, 3].tolist() for machine in found}
    assert places == {"left": [1.0, 0.0, 0.0], "inner": [0.0, 2.0, 3.0]}


SCENE = """cell+
* table
1 0 0
0 0 0 1
2
box
1 2 0.5
0 0 0.25
0 0 0 1
0 0 0 0
cylinder
0.1 0.6
0 0 0.8
0 0 0 1
0 0 0 0
0
* wedge
0 0 0
0 0 0 1
1
mesh
4 4
0 0 0
1 0 0
0 1 0
0 0 1
0 2 1
0 1 3
1 2 3
0 3 2
0 0 2
0 0 0 1
0 0 0 0
0
.
"""


def test_a_scene_of_moveit_is_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cell.scene"
    path.write_text(SCENE)
    assert main(["cell", "import", str(path)]) == 0
    table, wedge = cell_from_yaml(capsys.readouterr().out).equipment
    assert [body.kind for body in table.bodies] == ["box", "cylinder"]
    assert table.bodies[1].size.tolist() == [0.1, 0.6, 0.0]
    assert table.pose[:3, 3].tolist() == [1.0, 0.0, 0.0]
    assert wedge.bodies[0].kind == "mesh"


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("box\n", "boxx\n", "line 6 of the scene is 'boxx'"),
        ("1 2 0.5", "1 nan 0.5", "line 7 of the scene is '1 nan 0.5'"),
        ("0 3 2\n", "0 3 9\n", "names corners beyond its 4"),
        (".\n", "", "ends after line 34"),
    ],
)
def test_a_scene_that_is_none_is_a_sentence_with_its_line(
    old: str, new: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "cell.scene"
    head, _, tail = SCENE.rpartition(old)
    path.write_text(head + new + tail)
    assert main(["cell", "import", str(path)]) == 2
    assert sentence in capsys.readouterr().err


def test_the_glb_holds_every_body_where_it_stands(tmp_path: Path) -> None:
    import trimesh

    path = tmp_path / "demo.glb"
    assert main(["cell", "export", "demo", str(path)]) == 0
    assert main(["cell", "export", "demo", str(path)]) == 1
    cell = load_cell("demo")
    scene = trimesh.load_scene(path)
    upright = np.array([[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    bodies = [body for machine in cell.equipment for body in machine.world_bodies()]
    assert len(scene.graph.nodes_geometry) == len(bodies)
    found = []
    for node in scene.graph.nodes_geometry:  # a machine and its body may have one name
        pose, geometry = scene.graph[node]
        points = trimesh.transform_points(scene.geometry[geometry].vertices, upright @ pose)
        found.append([*points.min(axis=0), *points.max(axis=0)])
    for body in bodies:
        bounds = np.concatenate(body.bounds())
        assert np.abs(np.array(found) - bounds).max(axis=1).min() < 0.02, (
            body.name
        )  # round ones have corners
