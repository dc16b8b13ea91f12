"""What leaks from the capacitors while a step waits for late answers is no error of the step."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from ir_recorder import Analysis, findings
from ir_recorder.analysis.analyse import lost_charges


class Leaking:
    """A meter by whose volts the capacitors lose 50 J a second after second 1, from 100 J."""

    def stored(self, time: float, _link: Any) -> float:
        return max(0.0, min(100.0, 150.0 - 50.0 * time))


def steps(*rows: tuple[float, float, float | None]) -> Any:
    """Steps of a program: start, end, and the planned length of a pause; None for a movement."""
    return [
        SimpleNamespace(
            index=index,
            start=start,
            end=end,
            movement=SimpleNamespace(is_pause=pause is not None, duration=pause or 0.0),
        )
        for index, (start, end, pause) in enumerate(rows)
    ]


LINK: Any = None


def test_a_movement_after_a_pause_that_was_longer_than_planned_has_lost_charge() -> None:
    on_time = steps((0.0, 1.0, None), (1.0, 2.0, 1.0), (2.0, 3.0, None))
    assert lost_charges(on_time, Leaking(), LINK) == [0.0, 0.0, 0.0]
    late = steps((0.0, 1.0, None), (1.0, 2.0, 1.0), (2.4, 3.0, None))
    assert lost_charges(late, Leaking(), LINK) == [0.0, 0.0, pytest.approx(20.0)]
    early = steps((0.0, 1.0, None), (1.0, 1.5, 1.0), (1.5, 3.0, None))
    assert lost_charges(early, Leaking(), LINK) == [0.0, 0.0, 0.0]


def test_what_several_pauses_are_late_adds_up_until_the_next_movement() -> None:
    late = steps(
        (0.0, 1.0, None),
        (1.1, 1.4, 0.2),
        (1.4, 1.7, 0.3),
        (1.7, 1.8, None),
        (1.8, 2.0, 0.2),
        (2.0, 2.1, None),
    )
    assert lost_charges(late, Leaking(), LINK) == pytest.approx([0.0, 5.0, 10.0, 10.0, 0.0, 0.0])


def test_a_program_begins_when_it_is_asked_to() -> None:
    """Whatever was left from the one before is not counted on."""
    first = steps((0.0, 1.0, None))
    again = steps((2.0, 3.0, None))
    assert lost_charges([*first, *again], Leaking(), LINK) == [0.0, 0.0]


def test_without_volts_nothing_is_known_to_be_lost() -> None:
    late = steps((0.0, 1.0, None), (2.0, 3.0, None))
    unknown: Any = SimpleNamespace(stored=lambda time, link: float("nan"))
    assert lost_charges(late, unknown, LINK) == [0.0, 0.0]
    assert lost_charges(late, None, LINK) == [0.0, 0.0]


def test_what_had_gone_may_be_drawn_but_not_more(analysis: Analysis) -> None:
    moved = analysis.movements[0]
    planned = moved.step.movement.report.energy
    for more, ok in ((40.0, True), (40.0 + 0.02 * planned + 10.0, False)):
        result = replace(moved, energy=planned + more, stored_energy=0.0, lost_charge=40.0)
        checks = findings(replace(analysis, steps=(result,)))
        check = next(check for check in checks if check.name.startswith("energy of"))
        assert check.ok == ok
        assert "40 J that had gone from them as it began late" in check.reason
