"""What the program did: every movement and pause with the times at which it really ran."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from ir_msgs_py.report import MovementKind, PlannedMovement

from ir_recorder.recording import ControllerSeries, ProgramEvent, Recording

STARTED = "started"
OPEN = "open"  # no end was recorded
_SLACK = 0.2  # s between an event of the runner and the executor's first state of that trajectory


@dataclass(frozen=True, eq=False)
class ExecutedStep:
    """A step of the program. start, end [s]: from the executor's path time where it moved, else from the
    events.

    outcome: "ended", "failed", "canceled", or "open" where the recording ends before.
    """

    index: int
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
        movement = self.movement
        if movement.is_pause:
            place = movement.to_station or movement.from_station
            where = f" at {place}" if place else ""
            mode = f" ({movement.power_mode})" if movement.power_mode else ""
            return f"pause{where}{mode}"
        if movement.from_station == movement.to_station != "":
            way = {MovementKind.SERVICE_ENTRY: "into", MovementKind.SERVICE_EXIT: "out of"}
            return f"{way.get(MovementKind(movement.kind), 'at')} {movement.to_station}"
        return f"{movement.from_station or 'start'} → {movement.to_station or 'goal'}"


def executed_steps(recording: Recording) -> tuple[ExecutedStep, ...]:
    """All steps that started, in the order of time."""
    steps = []
    for position, event in enumerate(recording.events):
        if event.event != STARTED:
            continue
        end = _end_of(event, recording.events[position + 1 :])
        last = end.time if end else max(recording.duration, event.time)
        start, stop = _motion(recording.controller, event, last)
        steps.append(
            ExecutedStep(
                event.index, event.movement, start, stop, end.event if end else OPEN, end.note if end else ""
            )
        )
    return tuple(steps)


def _end_of(start: ProgramEvent, later: tuple[ProgramEvent, ...]) -> ProgramEvent | None:
    for event in later:
        if (event.program_id, event.index) == (start.program_id, start.index):
            return event if event.event != STARTED else None
    return None


def _motion(controller: ControllerSeries | None, event: ProgramEvent, end: float) -> tuple[float, float]:
    """The times at which path time 0 and the last path time of the step's trajectory were commanded."""
    wanted = event.movement.trajectory_id
    if controller is None or not wanted:
        return event.time, end
    own = np.array([trajectory_id == wanted for trajectory_id in controller.trajectory_id], dtype=bool)
    own &= (controller.time >= event.time - _SLACK) & (controller.time <= end + _SLACK)
    own &= controller.path_time > 0.0
    if own.sum() < 2:
        return event.time, end
    time, path = controller.time[own], controller.path_time[own]
    if np.allclose(controller.speed_scaling[own], 1.0):
        start = float(np.median(time - path))
        return start, start + (event.movement.report.duration or event.movement.duration or end - start)
    return float(time[0] - path[0]), float(time[-1])
