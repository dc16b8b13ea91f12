"""Steps of the program: every movement and pause with the times at which it really ran."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_recorder.reading.recording import ControllerSeries, ProgramEvent, Recording
from ir_values.arrays import FloatArray

STARTED = "started"
OPEN = "open"  # no end was recorded
_FEWEST = 3  # states of the executor: fewer give no speed to extrapolate its start and end with
UNSEEN = 0.06
"""A shorter movement [s] has fewer than three states of the controller, at 50 Hz."""


@dataclass(frozen=True, eq=False)
class ExecutedStep:
    """Step `index` of the `total` of a program.

    start, end [s]: from the executor's path time where it moved, else from the events; a movement
    that is too short for its states lasts as long as planned.

    outcome: "ended", "failed", "canceled", or "open" where the recording ends before.
    """

    index: int
    total: int
    movement: PlannedMovement
    start: float
    end: float
    outcome: str
    note: str

    @property
    def seconds(self) -> float:
        """How long it took [s]."""
        return self.end - self.start

    @property
    def label(self) -> str:
        """In a few words: "infeed → lathe", "into lathe", "pause at lathe (BUS_POWER_OFF)"."""
        return step_label(self.movement)


def step_label(movement: PlannedMovement) -> str:
    """A step in a few words."""
    if movement.is_pause:
        place = movement.to_station or movement.from_station
        where = f" at {place}" if place else ""
        mode = f" ({movement.power_mode})" if movement.power_mode else ""
        return f"pause{where}{mode}"
    if movement.from_station == movement.to_station != "":
        direction = {
            MovementKind.SERVICE_ENTRY: "into",
            MovementKind.SERVICE_EXIT: "out of",
            MovementKind.CARTESIAN: "along",
        }
        return f"{direction.get(MovementKind(movement.kind), 'at')} {movement.to_station}"
    return f"{movement.from_station or 'start'} → {movement.to_station or 'goal'}"


def executed_steps(recording: Recording) -> tuple[ExecutedStep, ...]:
    """All steps that started, in the order of time.

    The runner's events come later than the robot's stamps where the machine is busy. A pause is
    moved back by what the end of the movement before it came late, and ends at the latest when the
    robot moves again, as does a movement that is too short to be seen.
    """
    steps: list[ExecutedStep] = []
    runs = _Runs(recording.controller)
    late = 0.0
    for event, end in zip(recording.events, _ends(recording.events), strict=True):
        if event.event != STARTED:
            continue
        last = end.time if end else max(recording.duration, event.time)
        ran = runs.next_of(event.movement)
        if ran is not None:
            late = max(0.0, last - ran[1]) if end else 0.0
            steps[-1:] = [_ended_at(step, ran[0]) for step in steps[-1:]]
        start, stop = ran or (_begin_of(event, steps) - late, last - late)
        if ran is None and _is_unseen(
            event.movement
        ):  # its events are as far apart as the nodes' answers
            stop = min(stop, start + event.movement.report.duration)
        steps.append(
            ExecutedStep(
                event.index,
                event.total,
                event.movement,
                start,
                stop,
                end.event if end else OPEN,
                end.note if end else "",
            )
        )
    return tuple(steps)


def _is_unseen(movement: PlannedMovement) -> bool:
    return not movement.is_pause and 0.0 < movement.report.duration < UNSEEN


def _ended_at(step: ExecutedStep, moves: float) -> ExecutedStep:
    """The step before the robot moves at a time [s]: a pause ends by then, an unseen movement was
    before.
    """
    late = max(0.0, step.end - moves)
    if step.movement.is_pause:
        return replace(step, end=max(step.start, step.end - late))
    if _is_unseen(step.movement):
        return replace(step, start=step.start - late, end=step.end - late)
    return step


def _begin_of(event: ProgramEvent, before: Sequence[ExecutedStep]) -> float:
    """When a step that isn't seen began [s]: not while the robot was still moving; the runner's
    stamps are those of the meter, a reading old.
    """
    moving = before and not before[-1].movement.is_pause and before[-1].index == event.index - 1
    return max(event.time, before[-1].end) if moving else event.time


def _ends(events: Sequence[ProgramEvent]) -> list[ProgramEvent | None]:
    """For each event the next one of its step, where that is its end."""
    following: dict[tuple[str, int], ProgramEvent] = {}
    ends: list[ProgramEvent | None] = []
    for event in reversed(events):
        step = event.program_id, event.index
        later = following.get(step)
        ends.append(later if later is not None and later.event != STARTED else None)
        following[step] = event
    return ends[::-1]


class _Runs:
    """When each trajectory was run, from the executor's path time: in the robot's own time."""

    def __init__(self, controller: ControllerSeries | None) -> None:
        self._runs: dict[str, list[tuple[FloatArray, FloatArray]]] = {}
        if controller is None:
            return
        ids = np.array(controller.trajectory_id, dtype=object)
        begins = (ids[1:] != ids[:-1]) | (np.diff(controller.path_time) < 0.0)
        for run in np.split(np.arange(len(ids)), np.flatnonzero(begins) + 1):
            moving = run[controller.path_time[run] > 0.0]
            if len(moving) >= _FEWEST and ids[moving[0]]:
                times = controller.time[moving], controller.path_time[moving]
                self._runs.setdefault(ids[moving[0]], []).append(times)

    def next_of(self, movement: PlannedMovement) -> tuple[float, float] | None:
        """Start and end [s] of the movement's trajectory in its next run; None where it wasn't
        recorded.

        Both are extrapolated at the speed seen at that end of the path to path time 0 and to the
        planned duration; a run that stopped well before its end ends where it stopped.
        """
        runs = self._runs.get(movement.trajectory_id, [])
        if not runs:
            return None
        time, path = runs.pop(0)
        start = _extrapolated(time[:_FEWEST], path[:_FEWEST], 0.0)
        last = time[-_FEWEST:], path[-_FEWEST:]
        end = _extrapolated(*last, movement.report.duration or movement.duration)
        return start, end if end - time[-1] <= 2.0 * (last[0][-1] - last[0][0]) else float(time[-1])


def _extrapolated(time: FloatArray, path: FloatArray, at: float) -> float:
    """Time [s] at which the path time reaches `at`, by the mean speed of these samples."""
    moved = path[-1] - path[0]
    if moved <= 0.0:
        return float(time[-1])
    return float(time[0] + (at - path[0]) * (time[-1] - time[0]) / moved)
