"""A recording carries its cell and its facts."""

from __future__ import annotations

from pathlib import Path

from ir_recorder.reading.mcap_file import read_raw
from ir_recorder.recording.cell_files import CellFiles
from ir_recorder.recording.session import RecordingSession
from ir_recorder.recording.writer import RecordingWriter


def test_facts_and_cell_are_in_the_file(tmp_path: Path) -> None:
    session = RecordingSession(RecordingWriter(tmp_path / "a.mcap"), {"shift": "night"}, 5)
    session.attach_cell(CellFiles("name: here", "<robot/>"), 6)
    session.attach_cell(CellFiles("name: other", ""), 7)
    raw = read_raw(session.finish().path)
    assert raw.fact("shift") == "night"
    assert raw.fact("started_ns") == "5"
    assert raw.attachment("cell.yaml") == b"name: here"
