"""Processes of machines and the route of a part: read, written, checked; old files mean what they
meant.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import (
    CellFileError,
    InvalidValueError,
    ProgramStep,
    cell_from_yaml,
    cell_hash,
    cell_to_yaml,
    check_cell,
    load_cell,
)
from ir_description.cell import PartPlaces, ProcessTimes

FLEXIBLE = load_cell("flexible")
TEXT = cell_to_yaml(FLEXIBLE)
VISITS = "visits: [infeed_pick, lathe_chuck, washer_basket, gauge_seat, outfeed_place]"

BROKEN = {
    "no seconds": ("{seconds: 95}", "{}", "process has no seconds, must have seconds, between or"),
    "both": (
        "{seconds: 95}",
        "{between: [90, 95], samples: [90]}",
        "samples stands beside between, must be one of both",
    ),
    "falling": ("{seconds: 95}", "{between: [95, 90]}", "between is 95 to 90 s, must rise and be"),
    "no sample": ("{seconds: 95}", "{samples: []}", "samples has 0 entries, must have 1 to"),
    "no such process": (
        "route:",
        "signals: [{name: go}, {name: end, follows: go, process: infeed}]\nroute:",
        "machine with a process that end reports 'infeed' is unknown; known are lathe, washer",
    ),
    "a process that nothing starts": (
        "route:",
        "signals: [{name: end, process: lathe}]\nroute:",
        "signal end reports the process of lathe: it follows the signal that starts it",
    ),
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
    "room at the end": (
        "- name: outfeed\n",
        "- name: outfeed\n    capacity: 3\n    buffer: 1\n",
        "outfeed has room for 4 parts, but the route doesn't visit it between its first",
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


@given(capacity=st.integers(1, 4), buffer=st.integers(0, 4))
@settings(max_examples=10)
def test_room_in_a_machine_survives_its_file_and_changes_no_movement(
    capacity: int, buffer: int
) -> None:
    machines = tuple(
        replace(machine, capacity=capacity, buffer=buffer) if machine.name == "lathe" else machine
        for machine in FLEXIBLE.equipment
    )
    cell = replace(FLEXIBLE, equipment=machines)
    again = cell_from_yaml(cell_to_yaml(cell)).machine("lathe")
    assert (again.capacity, again.buffer) == (capacity, buffer)
    assert cell_hash(cell) == cell_hash(FLEXIBLE)


@pytest.mark.parametrize("value", [1.5, 0, 9, float("nan"), "two"])
def test_a_capacity_is_a_whole_number_of_parts(value: float) -> None:
    with pytest.raises(InvalidValueError, match="capacity of lathe"):
        replace(FLEXIBLE.machine("lathe"), capacity=value)


@pytest.mark.parametrize("line", ["capacity: 0", "capacity: 5", "capacity: 1.5", "buffer: -1"])
def test_room_that_makes_no_sense_is_refused(line: str) -> None:
    text = cell_to_yaml(FLEXIBLE)
    key = line.split(":")[0]
    before, after = text.split("process:", 1)
    indent = before.rsplit("\n", 1)[1]
    with pytest.raises(CellFileError, match=key):
        cell_from_yaml(f"{before}{line}\n{indent}process:{after}")


@given(
    times=st.one_of(
        st.lists(st.floats(1.0, 500.0), min_size=1, max_size=5).map(ProcessTimes.of),
        st.tuples(st.floats(1.0, 100.0), st.floats(0.0, 100.0)).map(
            lambda ends: ProcessTimes(ends[0], ends[0] + ends[1])
        ),
    ),
    share=st.floats(0.0, 1.0),
)
@settings(max_examples=25)
def test_times_that_vary_survive_their_file_and_count_by_their_mean(
    times: ProcessTimes, share: float
) -> None:
    machines = tuple(
        replace(machine, process=times.mean, process_times=times)
        if machine.name == "lathe"
        else machine
        for machine in FLEXIBLE.equipment
    )
    cell = replace(FLEXIBLE, equipment=machines)
    again = cell_from_yaml(cell_to_yaml(cell)).machine("lathe")
    assert again.process_times == times
    assert times.low <= again.process <= times.high or times.low == times.high
    assert times.low <= times.quantile(share) <= times.high
    assert cell_hash(cell) == cell_hash(FLEXIBLE)


def test_without_seconds_the_mean_of_the_samples_counts() -> None:
    text = TEXT.replace("{seconds: 95}", "{samples: [90, 100, 104]}")
    assert cell_from_yaml(text).machine("lathe").process == 98.0


def test_parts_come_to_the_first_station_and_go_from_the_last_one() -> None:
    part = FLEXIBLE.part("gear")
    spare = replace(
        part,
        load=replace(part.load, name="gear.1", capsules=()),
        bodies=(),
        station="",
    )
    cell = replace(FLEXIBLE, parts=(*FLEXIBLE.parts, spare))
    places = cell.parts_at_start()
    assert FLEXIBLE.route is not None
    visits = FLEXIBLE.route.visits
    for here, there in itertools.pairwise(visits):
        places = places.after(ProgramStep("STATION", here, attach="gear"))
        assert places.lying["gear.1"] == ("" if here == visits[0] else visits[0])
        places = places.after(ProgramStep("STATION", there, detach="gear"))
        assert places.lying["gear.1"] == visits[0]
    assert places.lying["gear"] == ""


ROOMY = TEXT.replace("process: {seconds: 95}", "process: {seconds: 95}\n    capacity: 2")


def test_a_machine_for_several_parts_takes_them_in_and_gives_them_as_they_came() -> None:
    cell = cell_from_yaml(ROOMY)
    assert cell.machine("lathe").places == 2
    copies = tuple(
        replace(
            cell.part("gear"),
            load=replace(cell.part("gear").load, name=f"gear.{k}", capsules=()),
            bodies=(),
            station="",
        )
        for k in (1, 2, 3)
    )
    places = replace(cell, parts=(*cell.parts, *copies)).parts_at_start()

    def moved(places: PartPlaces, part: str, start: str, end: str) -> PartPlaces:
        taken = places.after(ProgramStep("STATION", start, attach=part))
        return taken.after(ProgramStep("STATION", end, detach=part))

    places = moved(places, "gear", "infeed_pick", "lathe_chuck")
    places = moved(places, "gear.1", "infeed_pick", "lathe_chuck")
    assert places.at("lathe_chuck") == ("gear", "gear.1")
    assert "lathe_chuck" not in places.lying.values()  # inside: the station is clear
    assert places.at("infeed_pick") == ("gear.2",)  # parts inside don't come to the infeed
    with pytest.raises(InvalidValueError, match=r"gear and gear\.1 lie there"):
        moved(places, "gear.2", "infeed_pick", "lathe_chuck")
    with pytest.raises(InvalidValueError, match="gear came before it"):
        places.after(ProgramStep("STATION", "lathe_chuck", attach="gear.1"))
    places = moved(places, "gear", "lathe_chuck", "washer_basket")
    assert places.at("lathe_chuck") == ("gear.1",)


def test_as_many_parts_lie_at_a_station_as_its_machine_holds() -> None:
    (line,) = [line for line in ROOMY.splitlines() if line.strip().startswith("- name: gear")][:1]
    start = ROOMY.index(line)
    end = ROOMY.index("equipment:")
    part = ROOMY[start:end]
    assert "station: infeed_pick" in part

    def with_parts(count: int, text: str) -> str:
        more = [
            part.replace("gear", f"gear.{k}").replace("infeed_pick", "lathe_chuck")
            for k in range(1, count + 1)
        ]
        return text.replace(part, "".join([part, *more]))

    assert len(cell_from_yaml(with_parts(2, ROOMY)).parts) == 3
    with pytest.raises(CellFileError, match=r"gear\.1 and gear\.2 are there"):
        cell_from_yaml(with_parts(3, ROOMY))
    with pytest.raises(CellFileError, match=r"gear\.2 can't be at .*, gear\.1 is there"):
        cell_from_yaml(with_parts(2, TEXT))
