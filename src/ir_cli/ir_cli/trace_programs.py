"""A measured trace as a program: movements between standstills, pauses, doors."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ir_cli.errors import InputError
from ir_cli.traces import motion_of
from ir_description import Cell, Equipment
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner import Planner
from ir_planner.before_after import Today, TodayMotion
from ir_planner.program import Doors, Progress, nobody
from ir_recorder import read_recording
from ir_recorder.errors import RecorderError
from ir_recorder.reading.recording import TextEvent
from ir_recorder.traces import read_mapping, read_traces
from ir_values.arrays import FloatArray

# How the doors stood in a recording: the states of machines that the driver published.


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


PAUSE = 0.5  # s: a shorter standstill belongs to the movement before it
_STOP = 0.1  # s: the shortest standstill
_MOVING = 0.01  # rad/s
_NOISE = 0.002  # rad: a joint that moves by less stands still
_STEP = 0.004  # s
_FALLING = 20  # steps: slower than `_MOVING` a movement begins and ends for so long at most
_NEAR = 0.02  # s: points nearer to the ends of a movement are left out


def today_of_trace(
    arguments: argparse.Namespace, planner: Planner, path: Path, progress: Progress = nobody
) -> Today:
    """Today's program of a trace; InputError where the robot doesn't move in it."""
    known, motion = motion_of(arguments, planner, progress, path)
    stretches, lost = stretches_of(motion, recorded_doors(path, planner.cell))
    if not stretches:
        raise InputError(f"{path}: the robot does not move in it")
    notes = [] if known is None else list(known.sentences)
    if lost >= PAUSE:
        notes.append(
            f"{lost:.1f} s of standstill before the first and after the last movement are left out"
        )
    notes += _meter(arguments, planner, path)
    start = (
        np.asarray(stretches[0].trajectory.positions[0])
        if stretches[0].trajectory is not None
        else None
    )
    assert start is not None  # a cycle begins with a movement
    return Today(path.name, "trace", start, tuple(stretches), tuple(notes))


def stretches_of(
    motion: JointTrajectory, doors: RecordedDoors | None = None
) -> tuple[list[TodayMotion], float]:
    """Movements and pauses from the first movement to the last, and the seconds [s] outside of
    them.
    """
    runs = _runs(motion)
    found: list[TodayMotion] = []

    def stood(begin: float, end: float) -> Doors | None:
        return None if doors is None else doors.during(begin, end)

    for k, (begin, end) in enumerate(runs):
        behind = runs[k + 1][0] if k + 1 < len(runs) else end
        stands = behind - end >= PAUSE
        last = end if stands else behind
        part = cut(motion, begin, last)
        label = f"{begin:.2f} s"
        at = stood(begin, last)
        found.append(
            TodayMotion(part, np.asarray(part.positions[-1]), part.duration, label=label, doors=at)
        )
        if stands:
            at = stood(end, behind)
            found.append(
                TodayMotion(None, found[-1].q, behind - end, label=f"{end:.2f} s", doors=at)
            )
    covered = runs[-1][1] - runs[0][0] if runs else 0.0
    return found, float(motion.duration - motion.times[0] - covered)


def _runs(motion: JointTrajectory) -> list[tuple[float, float]]:
    """Times [s] between which the robot moves; what only noise moves stands still."""
    count = max(int(np.ceil((motion.duration - motion.times[0]) / _STEP)), 2)
    at = np.linspace(motion.times[0], motion.duration, count)
    seen = motion.sample(at)
    speed = np.abs(seen.qd).max(axis=1)
    moving = speed > _MOVING
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(int))).reshape(
        -1, 2
    )
    runs: list[tuple[float, float]] = []
    for first, behind in edges.tolist():
        if np.ptp(seen.q[first:behind], axis=0).max() < _NOISE:
            continue
        begin = float(at[_slowest(speed, first, -1)])
        end = float(at[_slowest(speed, behind - 1, 1)])
        if runs and begin - runs[-1][1] < _STOP:
            begin = runs.pop()[0]
        runs.append((begin, end))
    return runs


def _slowest(speed: FloatArray, row: int, step: int) -> int:
    """The row near `row` up to which a speed (N,) goes on falling: where a movement really begins
    or ends.
    """
    for _ in range(_FALLING):
        if not 0 <= row + step < len(speed) or speed[row + step] >= speed[row]:
            break
        row += step
    return row


def cut(motion: JointTrajectory, begin: float, end: float) -> JointTrajectory:
    """The motion between two times [s], from time 0 on, at rest at both ends."""
    inside = motion.times[(motion.times > begin + _NEAR) & (motion.times < end - _NEAR)]
    times = np.concatenate([[begin], inside, [end]])
    found = motion.sample(times)
    qd = found.qd.copy()
    qdd = found.qdd.copy()
    qd[[0, -1]] = 0.0
    qdd[[0, -1]] = 0.0
    return JointTrajectory.from_seconds(motion.joint_names, times - begin, found.q, qd, qdd)


def _meter(arguments: argparse.Namespace, planner: Planner, path: Path) -> list[str]:
    """What a meter in the same file counted."""
    try:
        meaning = read_mapping(arguments.mapping) if arguments.mapping is not None else None
        traces = read_traces(path, meaning, planner.cell.robot.joint_names)
        counted = [(trace, trace.joules()) for trace in traces]
    except RecorderError as error:
        raise InputError(str(error)) from error
    return [
        f"the meter counted {joules[-1]:.0f} J in the {trace.time[-1] - trace.time[0]:.1f} s of "
        "the file: today's figures here are predicted, as the planner's are"
        for trace, joules in counted
        if joules is not None
    ]
