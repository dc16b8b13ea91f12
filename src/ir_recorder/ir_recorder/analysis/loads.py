"""Loads over time: from the driver's diagnostics and from the program's steps."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ir_description import Cell, Load
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_recorder.analysis.steps import STARTED
from ir_recorder.reading.recording import PowerSeries, Recording

STALE = 1.5  # s: how old the load in the diagnostics may be; they come once a second
TOOL_STEP = 3.0  # W of base load: less than any tool that draws power


class LoadTimeline:
    """Observations (time [s], load text) in the order of time; between two that differ the load is
    unknown.
    """

    def __init__(self, observations: tuple[tuple[float, str], ...]) -> None:
        self.observations = tuple(sorted(observations, key=lambda observation: observation[0]))

    def certain(self, end: float) -> Iterator[tuple[float, float, str]]:
        """Intervals (from, to, load) in which the load is known, up to `end` [s]."""
        start = None
        following = [*self.observations[1:], None][: len(self.observations)]
        for (time, load), after in zip(self.observations, following, strict=True):
            start = time if start is None else start
            if after is None:
                yield start, max(end, time), load
            elif after[1] != load:
                yield start, time, load
                start = None


def load_timeline(recording: Recording) -> LoadTimeline:
    """The load over time.

    While a program runs its steps give it exactly; before and after, the driver's diagnostics do
    once a second, and a step of the base load in between marks when a tool was attached or
    detached.
    """
    steps = []
    for event in recording.events:
        load = normal(event.movement.load)
        if event.event == STARTED and event.movement.load:
            steps.append((event.time, load))
        elif event.event == "ended" and event.movement.load:
            carried_on = load_after(load, event.movement.attach, event.movement.detach)
            steps.append((event.time, carried_on))
    reported = [(event.time, normal(event.text)) for event in recording.loads]
    if steps:
        first = steps[0][0]
        last = steps[-1][0] + STALE
        reported = [observation for observation in reported if not first <= observation[0] <= last]
    if recording.power is not None:
        reported = _sharpened(reported, recording.power)
    return LoadTimeline((*reported, *steps))


def _sharpened(reported: list[tuple[float, str]], power: PowerSeries) -> list[tuple[float, str]]:
    """Replaces the reports around a change by the readings before and after the step of the base
    load.
    """
    jumps = np.flatnonzero(
        (np.abs(np.diff(power.base_power)) > TOOL_STEP) & (np.diff(power.mode) == 0)
    )
    before_jumps = power.time[jumps]
    after_jumps = power.time[jumps + 1]
    result: list[tuple[float, str]] = []
    for time, load in reported:
        if result and result[-1][1] != load:
            start = result[-1][0] - STALE
            first = int(np.searchsorted(before_jumps, start, "right"))
            end = int(np.searchsorted(after_jumps, time, "right"))
            if first < end:
                before = float(before_jumps[first])
                after = float(after_jumps[end - 1])
                old = result[-1][1]
                while result and result[-1][0] > before and result[-1][1] == old:
                    result.pop()
                result += [(before, old), (after, load)]
        result.append((time, load))
    return result


def carried(cell: Cell | None, load: str) -> tuple[Load, ...]:
    """The loads of the cell that a load text names."""
    if cell is None:
        return ()
    attached = normal(load).split(LOAD_SEPARATOR)
    return tuple(item for item in cell.loads(held_part(cell, load)) if item.name in attached)


def held_part(cell: Cell, load: str) -> str:
    """The part named in a load text, "" for none."""
    attached = normal(load).split(LOAD_SEPARATOR)
    return next((part.name for part in cell.parts if part.name in attached), "")


def normal(load: str) -> str:
    """A load text with "none" for nothing."""
    return load or NO_LOAD


def load_after(load: str, attach: str, detach: str) -> str:
    """The load text after a step's attaching and detaching."""
    names = [name for name in load.split(LOAD_SEPARATOR) if name and name not in (NO_LOAD, detach)]
    if attach and attach not in names:
        names.append(attach)
    return LOAD_SEPARATOR.join(names) or NO_LOAD
