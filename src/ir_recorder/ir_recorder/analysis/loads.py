"""What was attached when: from the driver's diagnostics and from the program's steps."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterator

from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD

from ir_recorder.analysis.steps import STARTED
from ir_recorder.recording import Recording


class LoadTimeline:
    """Observations (time [s], load text) in the order of time; between two that differ the load is
    unknown.
    """

    def __init__(self, observations: tuple[tuple[float, str], ...]) -> None:
        self.observations = tuple(sorted(observations, key=lambda observation: observation[0]))
        self._times = [time for time, _ in self.observations]

    def at(self, time: float) -> str:
        """The load last seen at `time`; "" before the first observation."""
        position = bisect_right(self._times, time)
        return self.observations[position - 1][1] if position else ""

    def certain(self, end: float) -> Iterator[tuple[float, float, str]]:
        """Intervals (from, to, load) in which the load is known, up to `end` [s]."""
        start = None
        following = [*self.observations[1:], None]
        for (time, load), after in zip(self.observations, following, strict=True):
            start = time if start is None else start
            if after is None:
                yield start, max(end, time), load
            elif after[1] != load:
                yield start, time, load
                start = None


def load_timeline(recording: Recording) -> LoadTimeline:
    """What the recording tells of the load."""
    observations = [(event.time, normal(event.text)) for event in recording.loads]
    for event in recording.events:
        load = normal(event.movement.load)
        if event.event == STARTED and event.movement.load:
            observations.append((event.time, load))
        elif event.event == "ended" and event.movement.load:
            observations.append((event.time, after(load, event.movement.attach, event.movement.detach)))
    return LoadTimeline(tuple(observations))


def normal(load: str) -> str:
    """A load text with "none" for nothing."""
    return load or NO_LOAD


def after(load: str, attach: str, detach: str) -> str:
    """The load text after a step's attaching and detaching."""
    names = [name for name in load.split(LOAD_SEPARATOR) if name and name not in (NO_LOAD, detach)]
    if attach and attach not in names:
        names.append(attach)
    return LOAD_SEPARATOR.join(names) or NO_LOAD
