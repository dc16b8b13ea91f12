"""The report: one file, nothing from outside, right whatever is missing."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

from ir_recorder import RecorderError, analyse, findings, read_recording
from ir_recorder.report import report_html, write_report
from ir_recorder.report.number_text import text
from ir_recorder.report.picture import write_picture


class _Links(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.open: list[str] = []

    def handle_starttag(self, tag: str, attributes: list[tuple[str, str | None]]) -> None:
        self.links += [
            value or "" for name, value in attributes if name in ("src", "href", "data", "action")
        ]


def test_nothing_is_fetched_from_outside(page: str) -> None:
    parser = _Links()
    parser.feed(page)
    assert all(link.startswith("#") for link in parser.links)
    for word in (
        "http://",
        "https://",
        "//cdn",
        "@import",
        "url(",
        "fetch(",
        "XMLHttpRequest",
        "<link",
    ):
        assert word not in page


def test_the_page_is_small(page: str) -> None:
    assert len(page) < 1_000_000


def test_headlines_steps_and_checks_are_written(page: str) -> None:
    for words in (
        "test_cell",
        "home → table",
        "pause at press",
        "Table II",
        "hibernation leave",
        "A2",
    ):
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
    bare = replace(
        recording, power=None, joints=None, controller=None, events=(), loads=(), cell_yaml=""
    )
    analysis = analyse(bare)
    page = report_html(analysis, findings(analysis))
    assert data_of(page)["scene"] is None
    assert "What is missing, and why" in page
    assert ">nan" not in page


def test_places_that_cannot_be_written_are_named(demo_file: Path) -> None:
    analysis = analyse(read_recording(demo_file))
    with pytest.raises(RecorderError, match="can't be written"):
        write_report(analysis, (), "/proc/report.html")
    with pytest.raises(RecorderError, match="can't be written"):
        write_picture(analysis, "/proc/picture.png")


def brackets_left_open(script: str) -> str:
    """Brackets that don't close, outside of strings and comments."""
    code = re.sub(
        r"/\*.*?\*/|//[^\n]*|\"(?:\\.|[^\"\\\n])*\"|'(?:\\.|[^'\\\n])*'", "", script, flags=re.S
    )
    pairs = {")": "(", "]": "[", "}": "{"}
    stack = []
    for character in code:
        if character in "([{":
            stack.append(character)
        elif character in pairs and (not stack or stack.pop() != pairs[character]):
            return f"{character} without its other half"
    return "".join(stack)


def test_the_scripts_close_what_they_open(page: str) -> None:
    script = page.rsplit("<script>", 1)[1].split("</script>", 1)[0]
    assert "class Timeline" in script
    assert brackets_left_open(script) == ""
    assert brackets_left_open(script[: len(script) // 2]) != ""


def test_every_element_that_the_scripts_ask_for_is_in_the_page(page: str) -> None:
    body, script = page.rsplit("<script>", 1)
    asked = set(re.findall(r'find\("([\w-]+)"\)', script)) | {
        "show-zones",
        "show-trail",
        "show-nearest",
        "show-capsules",
    }
    assert len(asked) > 10
    assert [name for name in asked if f'id="{name}"' not in body] == []


def test_the_page_fits_a_telephone_and_a_sheet_of_paper(page: str) -> None:
    style = page.split("<style>", 1)[1].split("</style>", 1)[0]
    for rule in ("@page { size: A4", "@media print", "(max-width: 700px)", "(pointer: coarse)"):
        assert rule in style
    assert 'name="viewport" content="width=device-width' in page
    stage = page.split('<div class="stage">', 1)[1].split("</div>", 1)[0]
    assert "button" not in stage  # controls stand below the picture, not over it


def test_texts_of_a_recording_neither_mark_up_nor_steer() -> None:
    assert text("<b>\x1b[31m\u202ered\x00") == "&lt;b&gt;\ufffd[31m\ufffdred\ufffd"
    assert text("a\tb\nc \u00e9 \u00b0") == "a\tb\nc \u00e9 \u00b0"
