"""The report: one file, nothing from outside, right whatever is missing."""

from __future__ import annotations

import base64
import json
import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from ir_description.body import Body
from ir_recorder.report import report_html, write_report
from ir_recorder.report.picture import write_picture
from ir_recorder.report.series import envelope, quantised
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_recorder.report_main import main

from ir_description import Capsule
from ir_recorder import PathError, RecorderError, analyse, findings, read_recording


@pytest.fixture(scope="module")
def page(demo_file: Path) -> str:
    analysis = analyse(read_recording(demo_file))
    return report_html(analysis, findings(analysis))


def data_of(page: str) -> dict:
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)[1])


class _Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.links += [value or "" for name, value in attributes if name in ("src", "href", "data", "action")]


def test_nothing_is_fetched_from_outside(page: str) -> None:
    parser = _Links()
    parser.feed(page)
    assert all(link.startswith("#") for link in parser.links)
    for word in ("http://", "https://", "//cdn", "@import", "url(", "fetch(", "XMLHttpRequest", "<link"):
        assert word not in page


def test_the_page_is_small(page: str) -> None:
    assert len(page) < 1_000_000


def test_headlines_steps_and_checks_are_written(page: str) -> None:
    for words in ("test_cell", "home → table", "pause at press", "Table II", "hibernation leave", "A2"):
        assert words in page


def test_the_motion_is_in_the_page_to_a_hundredth_of_a_degree(page: str, demo_file: Path) -> None:
    scene = data_of(page)["scene"]
    counts = np.frombuffer(base64.b64decode(scene["angles"]), dtype="<i2").reshape(scene["frames"], 6)
    joints = read_recording(demo_file).joints
    np.testing.assert_allclose(counts[0] * scene["angleStep"], joints.position[0], atol=1.1e-4)
    np.testing.assert_allclose(counts[-1] * scene["angleStep"], joints.position[-1], atol=1.1e-4)


def test_a_part_moves_from_station_to_hand_to_station(page: str) -> None:
    (part,) = data_of(page)["scene"]["parts"]
    assert [where is not None for _, where in part["lies"]] == [True, False, True]


def test_names_from_a_file_cannot_become_markup(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    evil = "<script>alert(1)</script>{{data}}"
    analysis = analyse(replace(recording, facts=((evil, evil),), problems=(evil,)))
    page = report_html(analysis, ())
    assert "<script>alert" not in page
    assert page.count('id="data"') == 1


def test_an_empty_recording_still_gives_a_page(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    bare = replace(recording, power=None, joints=None, controller=None, events=(), loads=(), cell_yaml="")
    analysis = analyse(bare)
    page = report_html(analysis, findings(analysis))
    assert data_of(page)["scene"] is None
    assert "Not everything could be read" in page
    assert ">nan" not in page


def test_ir_report_writes_page_and_picture(demo_file: Path, tmp_path: Path) -> None:
    target = tmp_path / "out" / "report.html"
    picture = tmp_path / "demo.png"
    assert main([str(demo_file), "-o", str(target), "--picture", str(picture)]) == 0
    assert target.read_text().startswith("<!doctype html>")
    assert picture.read_bytes()[:4] == b"\x89PNG"


def test_ir_report_says_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([str(tmp_path / "none.mcap")]) == 1
    assert "No such file" in capsys.readouterr().err


def test_places_that_cannot_be_written_are_named(demo_file: Path) -> None:
    analysis = analyse(read_recording(demo_file))
    with pytest.raises(PathError, match="can't be written"):
        write_report(analysis, (), "/proc/report.html")
    with pytest.raises(RecorderError, match="can't be written"):
        write_picture(analysis, "/proc/picture.png")


def test_an_envelope_keeps_every_peak() -> None:
    time = np.arange(100_000) * 0.01
    value = np.zeros(100_000)
    value[[7, 50_123]] = 9.0, -4.0
    shape = envelope(time, value, 1000)
    assert len(shape.time) == 1000
    assert (shape.high.max(), shape.low.min()) == (9.0, -4.0)
    assert shape.time[int(np.argmax(shape.high))] == pytest.approx(0.07, abs=1.0)


def test_quantised_numbers_keep_half_a_step() -> None:
    values = np.linspace(-6.2, 6.2, 1001)
    back = np.frombuffer(base64.b64decode(quantised(values, 2e-4)), dtype="<i2") * 2e-4
    assert np.abs(back - values).max() <= 1.0001e-4


BODIES = [
    Body("b", "box", np.eye(4), np.array([0.4, 0.6, 0.8])),
    Body("c", "cylinder", np.eye(4), np.array([0.3, 1.0, 0.0])),
    Body("s", "sphere", np.eye(4), np.array([0.5, 0.0, 0.0])),
    Body("k", "capsule", np.eye(4), np.array([0.2, 0.7, 0.0])),
    Body("m", "mesh", np.eye(4), np.zeros(3), np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])),
]


@pytest.mark.parametrize("body", BODIES, ids=lambda body: body.kind)
def test_triangles_close_around_the_bodys_volume(body: Body) -> None:
    """The divergence theorem: a closed surface seen from outside has the volume of the body."""
    mesh = body_mesh(body)
    a, b, c = (mesh.points[mesh.triangles[:, k]] for k in range(3))
    volume = float(np.einsum("ti,ti->t", a, np.cross(b, c)).sum() / 6.0)
    r, length = body.size[0], body.size[1]
    expected = {
        "box": float(np.prod(body.size)),
        "cylinder": np.pi * r**2 * length,
        "sphere": 4 / 3 * np.pi * r**3,
        "capsule": np.pi * r**2 * length + 4 / 3 * np.pi * r**3,
        "mesh": 1 / 6,
    }[body.kind]
    assert volume == pytest.approx(expected, rel=0.04)  # flat faces lie inside a round surface
    np.testing.assert_allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-9)


def test_a_capsule_between_two_points_has_its_radius_all_round() -> None:
    capsule = Capsule("c", 1, np.array([0.1, 0.2, 0.3]), np.array([0.5, -0.1, 0.9]), 0.15)
    mesh = capsule_mesh(capsule)
    axis = capsule.p1 - capsule.p0
    along = np.clip((mesh.points - capsule.p0) @ axis / (axis @ axis), 0.0, 1.0)
    distance = np.linalg.norm(mesh.points - (capsule.p0 + along[:, None] * axis), axis=1)
    np.testing.assert_allclose(distance, 0.15, atol=1e-9)


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node to read JavaScript")
def test_the_scripts_are_free_of_syntax_errors(page: str, tmp_path: Path) -> None:
    script = tmp_path / "page.js"
    script.write_text(page.rsplit("<script>", 1)[1].split("</script>", 1)[0])
    said = subprocess.run(["node", "--check", str(script)], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
