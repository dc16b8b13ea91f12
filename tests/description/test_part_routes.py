"""States that stations take and give: read, written, checked, and the ways of a part by them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import Cell, CellFileError, cell_from_yaml, cell_hash, cell_to_yaml, load_cell
from ir_values.errors import InvalidValueError

FLEXIBLE = load_cell("flexible")
INFEED, *MACHINES, OUTFEED = FLEXIBLE.route.visits if FLEXIBLE.route else ()
STATES = {
    INFEED: ((), "raw"),
    "lathe_chuck": (("raw",), "turned"),
    "washer_basket": (("turned",), "clean"),
    "gauge_seat": (("clean",), "measured"),
    OUTFEED: (("measured",), ""),
}
VISITS = f"visits: [{', '.join((INFEED, *MACHINES, OUTFEED))}], "


def with_states(cell: Cell, states: dict[str, tuple[tuple[str, ...], str]]) -> Cell:
    stations = tuple(
        replace(station, takes=states[station.name][0], gives=states[station.name][1])
        for station in cell.stations
    )
    return replace(cell, stations=stations)


TEXT = cell_to_yaml(with_states(FLEXIBLE, STATES))


def test_states_survive_their_file_and_are_no_place() -> None:
    again = cell_from_yaml(TEXT)
    assert {each.name: (each.takes, each.gives) for each in again.stations} == STATES
    assert cell_hash(again) == cell_hash(FLEXIBLE)
    assert again.part_routes == (FLEXIBLE.route,)


def test_without_visits_the_route_follows_from_the_states() -> None:
    assert VISITS in TEXT
    text = TEXT.replace(VISITS, "")
    cell = cell_from_yaml(text)
    assert FLEXIBLE.route is not None
    assert cell.part_routes == (replace(FLEXIBLE.route, by_states=True),)
    assert cell.route == cell.part_routes[0]
    assert cell_from_yaml(cell_to_yaml(cell)).route == cell.route
    assert cell_hash(cell) == cell_hash(FLEXIBLE)


BROKEN = {
    "a state that nobody gives": (
        "takes: [turned]",
        "takes: [turnt]",
        "washer_basket takes turnt, but lathe_chuck before it gives turned",
    ),
    "work that changes nothing": (
        "gives: clean",
        "gives: turned",
        "washer_basket gives turned, which it takes too, but washer works on the part",
    ),
    "a change without work": (
        "process: {seconds: 12}",
        "enabled: true",
        "gauge_seat takes clean and gives measured, but gauge has no process",
    ),
    "no way": (
        VISITS,
        "",
        "gear has no way through the cell: from infeed_pick no stations",
    ),
    "a name": ("gives: clean", "gives: 3 x", "must"),
}


@pytest.mark.parametrize("case", BROKEN)
def test_states_without_sense_are_answered_by_a_sentence_with_their_line(case: str) -> None:
    before, after, sentence = BROKEN[case]
    assert before in TEXT
    text = TEXT.replace(before, after)
    if case == "no way":
        text = text.replace("takes: [measured]", "takes: [painted]")
    with pytest.raises(CellFileError, match=r"^cell.yaml:\d+: ") as caught:
        cell_from_yaml(text, "cell.yaml")
    assert sentence in str(caught.value)


def test_a_part_that_lies_where_none_is_given_has_no_ways() -> None:
    states = {**STATES, INFEED: ((), "")}
    text = cell_to_yaml(with_states(replace(FLEXIBLE, route=None), states))
    with pytest.raises(CellFileError, match=r"where it lies .infeed_pick. doesn't give one"):
        cell_from_yaml(f"{text}\nroute: {{part: gear}}\n")


@given(st.data())
@settings(max_examples=60, deadline=None)
def test_the_ways_are_all_chains_in_which_everyone_takes_what_is_given(data: st.DataObject) -> None:
    names = st.sampled_from(["a", "b", "c"])
    states: dict[str, tuple[tuple[str, ...], str]] = {INFEED: ((), data.draw(names))}
    takes = st.lists(names, min_size=1, max_size=2, unique=True).map(tuple)
    process = {}
    for name in MACHINES:
        given_on = data.draw(names)
        taken = tuple(state for state in data.draw(takes) if state != given_on)
        states[name] = (taken or (given_on,), given_on)
        process[name] = 10.0 if taken else 0.0  # a buffer where nothing changes
    states[OUTFEED] = (data.draw(takes), "")
    expected = [
        (INFEED, *way, OUTFEED)
        for count in range(1, 4)
        for way in itertools.permutations(MACHINES, count)
        if _fits(states, (INFEED, *way, OUTFEED))
    ]
    machines = tuple(
        replace(
            machine,
            process=next((process[s.name] for s in there if s.name in process), 0.0),
        )
        for machine in FLEXIBLE.equipment
        for there in [[s for s in FLEXIBLE.stations if s.equipment == machine.name]]
    )
    cell = with_states(replace(FLEXIBLE, equipment=machines, route=None), states)
    text = f"{cell_to_yaml(cell)}\nroute: {{part: gear}}\n"
    if not 0 < len(expected) <= 8:
        with pytest.raises((CellFileError, InvalidValueError), match=r"has no way|has more than 8"):
            cell_from_yaml(text)
        return
    found = [way.visits for way in cell_from_yaml(text).part_routes]
    assert sorted(found) == sorted(expected)
    assert len(found[0]) == min(map(len, expected))


def _fits(states: dict[str, tuple[tuple[str, ...], str]], way: tuple[str, ...]) -> bool:
    return all(states[one][1] in states[two][0] for one, two in itertools.pairwise(way))
