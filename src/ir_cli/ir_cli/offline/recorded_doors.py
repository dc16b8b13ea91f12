"""How the doors stood in a recording: the states of machines that the driver published."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ir_description import Cell, Equipment
from ir_planner.program import Doors
from ir_recorder import read_recording
from ir_recorder.reading.recording import TextEvent


class RecordedDoors:
    """Of the machines of `cell` that a signal switches. events: their states, "shut>open" while
    they change; start [s]: the time of the events at which the motion's time is 0.
    """

    def __init__(self, cell: Cell, events: Sequence[TextEvent], start: float) -> None:
        self._switched = [
            each for each in cell.equipment if each.switch is not None and each.enabled
        ]
        self._events = events
        self._start = start

    def during(self, begin: float, end: float) -> Doors | None:
        """Those that were not as the cell has them between two times [s] of the motion, with their
        state or the two that they were in; None where no state was recorded.
        """
        if not self._events:
            return None
        found = (
            (each, self._states(each, begin + self._start, end + self._start))
            for each in self._switched
        )
        return tuple((each.name, states) for each, states in found if states != (each.state,))

    def _states(self, machine: Equipment, begin: float, end: float) -> tuple[str, ...]:
        own = [event for event in self._events if event.name == machine.name]
        before = [event for event in own if event.time <= begin][-1:] or own[:1]
        texts = [
            event.text for event in (*before, *(each for each in own if begin < each.time < end))
        ]
        states = tuple(dict.fromkeys(state for text in texts for state in text.split(">")))
        if not states or not {state.name for state in machine.states}.issuperset(states):
            return (machine.state,)
        return states[:2]


def recorded_doors(path: Path, cell: Cell) -> RecordedDoors | None:
    """Those of a recording; None for other files."""
    if path.suffix.lower() != ".mcap":
        return None
    recording = read_recording(path)
    start = 0.0 if recording.joints is None else float(recording.joints.time[0])
    return RecordedDoors(cell, recording.machines, start)
