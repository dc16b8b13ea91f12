"""Measured data on one clock: columns of numbers and of words over strictly increasing seconds, in
SI.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_recorder.errors import TraceError

TIME = "time"
POWER = "power"  # W at the mains
ENERGY = "energy"  # J at the mains
MODE = "mode"  # name of a power mode
LOAD = "load"  # what is attached: "gripper+part", "none"
VELOCITY = "_velocity"
ACCELERATION = "_acceleration"
EFFORT = "_effort"
ENDINGS = ("", VELOCITY, ACCELERATION, EFFORT)  # of a joint's columns
GAP_FACTOR = 4.0  # a step so many times longer than the usual one is a gap


@dataclass(frozen=True, eq=False)
class Trace:
    """N instants of one source: time (N,) s; columns by name, each (N,), NaN where a value is
    missing; texts by name, each of N words; problems that did not prevent reading.

    sampled: `power` holds values of the instants; else means since the row before, as meters report
    them.
    """

    source: str
    time: FloatArray
    columns: Mapping[str, FloatArray]
    texts: Mapping[str, tuple[str, ...]] = field(default_factory=lambda: MappingProxyType({}))
    problems: tuple[str, ...] = ()
    sampled: bool = False

    def __post_init__(self) -> None:
        if len(self.time) < 2:
            raise TraceError(f"{self.source}: has {len(self.time)} points, a trace has at least 2")
        back = np.flatnonzero(np.diff(self.time) <= 0.0)
        if len(back):
            k = int(back[0])
            raise TraceError(
                f"{self.source}: time {self.time[k + 1]:g} s follows {self.time[k]:g} s"
            )
        self.time.setflags(write=False)
        for values in self.columns.values():
            values.setflags(write=False)

    @property
    def period(self) -> float:
        """The usual step [s]: the median."""
        return float(np.median(np.diff(self.time)))

    def joints(self, names: Sequence[str], ending: str = "") -> FloatArray | None:
        """Columns (N, n) of all joints with an ending ("", "_velocity", ...); None where none has
        it.

        TraceError where some have it and others have not.
        """
        wanted = [f"{name}{ending}" for name in names]
        missing = [name for name in wanted if name not in self.columns]
        if len(missing) == len(wanted):
            return None
        if missing:
            known = ", ".join(self.columns)[:200]
            raise TraceError(f"{self.source}: there is no column {missing[0]}, there is: {known}")
        return np.column_stack([self.columns[name] for name in wanted])

    def gaps(self) -> tuple[tuple[float, float], ...]:
        """Where rows are missing: (time [s], length [s]) of steps much longer than the usual
        one.
        """
        steps = np.diff(self.time)
        return tuple(
            (float(self.time[k]), float(steps[k]))
            for k in np.flatnonzero(steps > GAP_FACTOR * self.period)
        )

    def shifted(self, offset: float) -> Trace:
        """The same on another clock: `offset` [s] is added to the time."""
        return Trace(
            self.source, self.time + offset, self.columns, self.texts, self.problems, self.sampled
        )

    def joules(self) -> FloatArray | None:
        """Energy at the mains (N,) J since the first row, by the meter's count or its power; None
        without.

        A reading of power that is missing counts as the one before.
        """
        if ENERGY in self.columns:
            count = _filled(self.columns[ENERGY])
            return np.asarray(count - count[0])
        if POWER not in self.columns:
            return None
        watts = _filled(self.columns[POWER])
        steps = np.diff(self.time)
        mean = 0.5 * (watts[1:] + watts[:-1]) if self.sampled else watts[1:]
        return np.concatenate([[0.0], np.cumsum(mean * steps)])


def _filled(values: FloatArray) -> FloatArray:
    """Missing values replaced by the one before; by the first one at the start."""
    known = np.isfinite(values)
    if not known.any():
        raise TraceError("a column of the meter holds no value at all")
    rows = np.maximum.accumulate(np.where(known, np.arange(len(values)), -1))
    return np.where(rows < 0, values[np.argmax(known)], values[np.maximum(rows, 0)])
