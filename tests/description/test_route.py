"""Processes of machines and the route of a part: read, written, checked; old files mean what they
meant.
"""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import (
    CellFileError,
    cell_from_yaml,
    cell_hash,
    cell_to_yaml,
    check_cell,
    load_cell,
)

FLEXIBLE = load_cell("flexible")
TEXT = cell_to_yaml(FLEXIBLE)
VISITS = "visits: [infeed_pick, lathe_chuck, washer_basket, gauge_seat, outfeed_place]"

BROKEN = {
    "no seconds": ("{seconds: 95}", "{}", "process has no seconds"),
    "a process of no time": ("seconds: 95", "seconds: 0", "is 0 s, must be in (0, 86400] s"),
    "two days": ("seconds: 95", "seconds: 2e5", "is 2e5 s, must be in (0, 86400] s"),
    "negative handling": ("handling: 0.5", "handling: -1", "handling is -1 s, must be in [0,"),
    "two visits": (VISITS, "visits: [infeed_pick, outfeed_place]", "has 2 entries, must have 3 to"),
    "unknown station": ("lathe_chuck, w", "lathe_chuk, w", "station 'lathe_chuk' is unknown"),
    "unknown part": ("part: gear, visits", "part: geer, visits", "part 'geer' is unknown"),
    "twice": ("gauge_seat, out", "lathe_chuck, out", "visits lathe_chuck twice"),
    "not visited": (
        "washer_basket, gauge_seat, out",
        "gauge_seat, out",
        "washer has a process of 40 s, but the route doesn't visit it",
    ),
    "no process": ("process: {seconds: 12}", "enabled: true", "gauge, which has no process"),
    "begins elsewhere": (
        "visits: [infeed_pick, lathe_chuck, washer_basket, gauge_seat, outfeed_place]",
        "visits: [outfeed_place, lathe_chuck, washer_basket, gauge_seat, infeed_pick]",
        "the route of gear begins at outfeed_place, but it lies at infeed_pick",
    ),
}


@pytest.mark.parametrize("case", BROKEN)
def test_a_route_without_sense_is_answered_by_a_sentence_with_its_line(case: str) -> None:
    before, after, sentence = BROKEN[case]
    assert before in TEXT
    with pytest.raises(CellFileError, match=r"^cell.yaml:\d+: ") as caught:
        cell_from_yaml(TEXT.replace(before, after), "cell.yaml")
    assert sentence in str(caught.value)


@given(seconds=st.floats(1e-3, 86_400.0), handling=st.floats(0.0, 100.0))
@settings(max_examples=25)
def test_processes_and_route_survive_their_file(seconds: float, handling: float) -> None:
    assert FLEXIBLE.route is not None
    machines = tuple(
        replace(machine, process=seconds) if machine.process else machine
        for machine in FLEXIBLE.equipment
    )
    route = replace(FLEXIBLE.route, handling=handling)
    cell = replace(FLEXIBLE, equipment=machines, route=route)
    again = cell_from_yaml(cell_to_yaml(cell))
    assert again.route == route
    assert [machine.process for machine in again.equipment] == [m.process for m in machines]
    assert cell_hash(again) == cell_hash(FLEXIBLE)


def test_a_file_without_them_is_written_without_them() -> None:
    text = cell_to_yaml(load_cell("demo"))
    assert "process" not in text
    assert "route" not in text


def test_a_process_that_no_route_visits_is_found() -> None:
    (*_, finding) = check_cell(replace(FLEXIBLE, route=None))
    assert finding.subject == "gauge"
    assert finding.sentence == "has a process of 12 s, but the cell has no route"
