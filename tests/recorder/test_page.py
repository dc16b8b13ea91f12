"""The report: one file, nothing from outside, right whatever is missing."""

from __future__ import annotations

import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from ir_recorder import PathError, RecorderError, analyse, findings, read_recording
from ir_recorder.report import report_html, write_report
from ir_recorder.report.picture import write_picture


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


def test_names_from_a_file_cannot_become_markup(demo_file: Path) -> None:
    recording = read_recording(demo_file)
    evil = "<script>alert(1)</script>{{data}}"
    analysis = analyse(replace(recording, facts=((evil, evil),), problems=(evil,)))
    page = report_html(analysis, ())
    assert "<script>alert" not in page
    assert page.count('id="data"') == 1


def test_an_empty_recording_still_gives_a_page(demo_file: Path, data_of: Any) -> None:
    recording = read_recording(demo_file)
    bare = replace(recording, power=None, joints=None, controller=None, events=(), loads=(), cell_yaml="")
    analysis = analyse(bare)
    page = report_html(analysis, findings(analysis))
    assert data_of(page)["scene"] is None
    assert "Not everything could be read" in page
    assert ">nan" not in page


def test_places_that_cannot_be_written_are_named(demo_file: Path) -> None:
    analysis = analyse(read_recording(demo_file))
    with pytest.raises(PathError, match="can't be written"):
        write_report(analysis, (), "/proc/report.html")
    with pytest.raises(RecorderError, match="can't be written"):
        write_picture(analysis, "/proc/picture.png")


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node to read JavaScript")
def test_the_scripts_are_free_of_syntax_errors(page: str, tmp_path: Path) -> None:
    script = tmp_path / "page.js"
    script.write_text(page.rsplit("<script>", 1)[1].split("</script>", 1)[0])
    said = subprocess.run(["node", "--check", str(script)], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
