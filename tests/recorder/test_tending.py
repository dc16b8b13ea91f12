"""Parts of a tended cell from steps and signals: sums, waits, and the page."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ir_description import Cell, cell_from_yaml, cell_to_yaml, load_cell
from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_recorder.analysis.tending import (
    SHORT,
    SignalChange,
    TendedStep,
    Tending,
    planned_machines,
    tending_of,
)

SIGNALS = """
signals:
  - {name: gauge.start}
  - {name: gauge.done, follows: gauge.start, process: gauge}
"""


def tended_cell() -> Cell:
    text = cell_to_yaml(load_cell("flexible"))
    return cell_from_yaml(text.replace("route:", f"{SIGNALS.strip()}\nroute:"))


CELL = tended_cell()
GAUGE = next(each for each in CELL.equipment if each.name == "gauge")


def step(seconds: float, **more: object) -> PlannedMovement:
    report = TrajectoryReport(duration=seconds, energy=10.0 * seconds)
    return PlannedMovement(kind="pause", duration=seconds, report=report, **more)  # type: ignore[arg-type]


def cycle(process: float) -> list[PlannedMovement]:
    """A part into the gauge, its process, and out of it."""
    return [
        step(3.0, to_station="gauge_seat", detach="gear", load="gripper+gear"),
        step(1.0, set_signals=("gauge.start",)),
        step(process, since="gauge.start"),
        step(
            2.0,
            to_station="gauge_seat",
            attach="gear",
            load="gripper",
            wait_for=("gauge.done",),
            set_signals=("gauge.start=0",),
        ),
        step(4.0, to_station="outfeed_place", detach="gear", load="gripper+gear"),
        step(1.0),
    ]


def driven(parts: list[tuple[float, float]]) -> Tending | None:
    """Parts with their planned process and how much later [s] the gauge was; 10 W all the time."""
    now = 0.0
    steps: list[TendedStep] = []
    signals: list[SignalChange] = []
    for process, late in parts:
        done = 0.0
        for movement in cycle(process):
            begin = now
            start = max(begin, done) if movement.wait_for else begin
            now = start + movement.duration
            waiting = 10.0 * (start - begin)
            steps.append(TendedStep(movement, begin, start, now, waiting, 10.0 * (now - start)))
            for text in movement.set_signals:
                name, _, level = text.partition("=")
                signals.append(SignalChange(now, name, level != "0"))
                if level != "0":
                    done = now + process + late
                    signals.append(SignalChange(done, "gauge.done", True))
                else:
                    signals.append(SignalChange(now, "gauge.done", False))
    return tending_of(CELL, steps, signals)


@given(
    parts=st.lists(
        st.tuples(st.floats(5.0, 100.0), st.one_of(st.just(0.0), st.floats(0.1, 50.0))),
        min_size=1,
        max_size=5,
    )
)
def test_rows_add_up_and_every_wait_is_named(parts: list[tuple[float, float]]) -> None:
    tending = driven(parts)
    assert tending is not None
    assert len(tending.parts) == len(parts)
    for part, (process, late) in zip(tending.parts, parts, strict=True):
        assert part.joules == pytest.approx(10.0 * part.span.seconds)
        assert part.span.seconds == pytest.approx(part.planned_seconds + late)
        assert part.paused == {"gauge": pytest.approx(process)}
        assert sum(part.late.values()) == pytest.approx(late)
        assert part.finished["gauge"] == pytest.approx(2.0)
    for before, after in itertools.pairwise(tending.parts):
        assert before.span.end == after.span.begin
    (gauge,) = tending.machines
    assert [span.seconds for span in gauge.working] == pytest.approx([sum(p) for p in parts])


def test_a_cell_without_a_route_has_no_parts() -> None:
    assert tending_of(load_cell("demo"), [], []) is None


def test_a_run_of_which_no_part_left_has_no_parts() -> None:
    assert tending_of(CELL, [TendedStep(step(1.0), 0.0, 0.0, 1.0, 0.0, 1.0)], []) is None


@given(process=st.floats(1.0, 100.0), wait=st.floats(0.0, 20.0), round_=st.integers(0, 2))
def test_a_planned_cycle_has_each_machine_at_work_once(
    process: float, wait: float, round_: int
) -> None:
    """From where the robot puts a part down until its process is over, then until it takes it,
    wherever in the cycle that begins.
    """
    kinds = [
        planned(2.0, "gauge_seat", "gripper"),
        planned(process + wait, "gauge_seat.front", "gripper"),
        planned(3.0, "gauge_seat", "gripper+gear"),
        planned(4.0, "outfeed_place", "gripper"),
        planned(1.0, "infeed_pick", "gripper+gear"),
    ]
    steps = [*kinds[round_:], *kinds[:round_]]
    period = sum(each.duration for each in steps)
    (gauge,) = planned_machines(CELL, steps)
    assert gauge.name == "gauge"
    worked = sum(span.within(0.0, period) for span in gauge.working)
    waited = sum(span.within(0.0, period) for span in gauge.finished)
    assert worked == pytest.approx(GAUGE.process)
    assert waited == pytest.approx((process + wait - GAUGE.process) % period, abs=2.0 * SHORT)


def planned(seconds: float, station: str, load: str) -> PlannedMovement:
    return step(seconds, to_station=station, load=load)
