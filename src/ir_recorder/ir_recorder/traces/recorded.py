"""Traces of a recording: the joints' and the meter's, each with its own instants."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import Mode
from ir_recorder.errors import TraceError
from ir_recorder.read.recording import JointSeries, PowerSeries, Recording
from ir_recorder.traces.trace import EFFORT, ENERGY, MODE, POWER, VELOCITY, Trace

_NUMBERS = frozenset(int(mode) for mode in Mode)


def recorded_traces(recording: Recording) -> tuple[Trace, ...]:
    """The joints' trace and the meter's, as far as they were recorded; TraceError where neither
    was.
    """
    found = []
    if recording.joints is not None and len(recording.joints.time) > 1:
        found.append(joint_trace(recording.joints, f"{recording.path} joint states"))
    if recording.power is not None and len(recording.power.time) > 1:
        found.append(power_trace(recording.power, f"{recording.path} meter"))
    if not found:
        why = "; ".join(recording.problems) or "neither joint states nor the meter are in it"
        raise TraceError(f"{recording.path}: {why[:500]}")
    return tuple(found)


def joint_trace(joints: JointSeries, source: str) -> Trace:
    """Positions, velocities and efforts by the names of the joints."""
    kinds = (("", joints.position), (VELOCITY, joints.velocity), (EFFORT, joints.effort))
    columns = {
        f"{name}{ending}": values[:, k].copy()
        for ending, values in kinds
        if np.isfinite(values).any()
        for k, name in enumerate(joints.names)
    }
    time, kept, problems = _increasing(joints.time, "joint states")
    return Trace(source, time, _rows(columns, kept), problems=problems)


def power_trace(power: PowerSeries, source: str) -> Trace:
    """Watts, joules and mode of the meter."""
    columns = {POWER: np.array(power.power), ENERGY: np.array(power.energy)}
    time, kept, problems = _increasing(power.time, "readings of the meter")
    modes = tuple(_mode_name(int(number)) for number in power.mode[kept])
    return Trace(source, time, _rows(columns, kept), MappingProxyType({MODE: modes}), problems)


def _mode_name(number: int) -> str:
    """A mode's name, those of transitions among them."""
    return Mode(number).name if number in _NUMBERS else f"mode {number}"


def _increasing(time: FloatArray, what: str) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Time without the rows that go back; which rows are kept; a sentence where some are not."""
    highest = np.maximum.accumulate(time)
    kept = np.concatenate([[True], time[1:] > highest[:-1]])
    lost = int(np.count_nonzero(~kept))
    return np.array(time[kept]), kept, (f"{lost} {what} go back in time: left out",) if lost else ()


def _rows(columns: Mapping[str, FloatArray], kept: FloatArray) -> Mapping[str, FloatArray]:
    return MappingProxyType({name: values[kept] for name, values in columns.items()})
