"""Logs of searches in notes, as earlier versions recorded them: read, or left out."""

from __future__ import annotations

import json

import numpy as np
import pytest

from ir_msgs_py.search_log import ConfigurationLog, CorrectionLog, WithdrawalLog
from ir_recorder.reading.search_notes import log_of

LOOP = {
    "station": "s",
    "load": "",
    "method": "m",
    "generations": 1,
    "candidates": 1,
    "rejected": [],
}
WALK = {"distance": [1, 2], "kept": [[0, 0, 0], [1, 1, 1]], "dropped": [], "path": []}


@pytest.mark.parametrize(
    "note",
    [
        "",
        "[]",
        "{}",
        "null",
        "[" * 100_000,
        json.dumps({**LOOP, **WALK, "parents": [0, 5]}),  # of a node that comes later
        json.dumps({**LOOP, **WALK, "parents": [0]}),
        json.dumps({**LOOP, **WALK, "parents": [0, 0], "dropped": [[1e300, 0, 0]]}),
        json.dumps({**LOOP, **WALK, "parents": [0, 0], "dropped": [[0, 0]]}),
        json.dumps({**LOOP, **WALK, "parents": [0, 0]}).replace("[1, 2]", "[1, NaN]"),
    ],
)
def test_a_note_that_makes_no_sense_is_no_log(note: str) -> None:
    assert log_of("log: withdrawal", note) is None


def test_other_stages_are_no_logs() -> None:
    assert log_of("station graph", json.dumps({**LOOP, **WALK, "parents": [0, 0]})) is None
    assert log_of("log: withdrawal", json.dumps({**LOOP, **WALK, "parents": [0, 0]})) is not None


def test_notes_of_earlier_versions_are_read() -> None:
    walk = log_of("log: withdrawal", json.dumps({**LOOP, **WALK, "parents": [0, 0]}))
    assert isinstance(walk, WithdrawalLog)
    assert np.allclose(walk.kept, [[0.0, 0.0, 0.0], [1e-3, 1e-3, 1e-3]])
    search = log_of(
        "log: configurations",
        '{"station":"s","starts":3,"accepted":1,"distinct":1,"rejected":[["too near",2]],'
        '"tracks":[{"outcome":"","points":[[1500,0,1000]]}]}',
    )
    assert isinstance(search, ConfigurationLog)
    assert search.rejected == (("too near", 2),)
    assert search.tracks[0].points.tolist() == [[1.5, 0.0, 1.0]]
    correction = log_of(
        "log: genetic correction",
        '{"start":"a","goal":"b","generations":2,"fitness":[[1.0,0.9]],"costs":[2.0,1.8],'
        '"straight":[[0,0,0],[1,0,0]],"stretches":[],"path":[]}',
    )
    assert isinstance(correction, CorrectionLog)
    assert correction.fitness == ((1.0, 0.9),)
