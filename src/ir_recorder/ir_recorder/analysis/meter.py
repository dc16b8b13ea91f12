"""Energy read off the mains meter, or off an external power meter laid on the recording's clock."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ir_description.robot import DcLink
from ir_recorder.errors import RecorderError
from ir_recorder.reading.recording import PowerSeries, Recording
from ir_recorder.traces import Trace, TraceMapping, clock_offset, mean_power, read_traces
from ir_values.arrays import FloatArray

# Joules between two times, read off the mains meter.
#
# A reading's power is the mean since the reading before, so energies are exact at readings and
# linear between them.


_SLIP_MAX = 1.0  # s: farther apart in one step, plant and recorder have clocks of different speed


class Meter:
    """Cumulative energies over the readings; times [s] outside of them count as the nearest
    reading.
    """

    def __init__(self, power: PowerSeries) -> None:
        self.time = power.time
        self.power = power.power
        self._behind = power.heard - power.time
        self._volts = power.bus_voltage
        step = np.diff(power.time, prepend=power.time[:1])
        self._energy = power.energy - power.energy[:1]
        self._joints = np.cumsum(np.nan_to_num(power.joint_power) * step[:, None], axis=0)
        self._base = np.cumsum(np.nan_to_num(power.base_power) * step)
        self._rectifier = np.cumsum(np.nan_to_num(power.rectifier_loss) * step)
        self._dissipated = np.cumsum(np.nan_to_num(power.burnt_power) * step)

    def energy(self, start: float, end: float) -> float:
        """J at the mains."""
        return self._between(self._energy, start, end)

    def straddling(self, start: float, end: float) -> float:
        """J by which `energy` may be wrong, as the readings at both ends lie partly outside.

        A reading doesn't say when its energy was drawn: of a step shorter than one, nothing is
        known.
        """
        after = np.searchsorted(self.time, [start, end], "left").clip(0, len(self.time) - 1)
        before = (np.searchsorted(self.time, [start, end], "right") - 1).clip(0)
        least = max(float(self._energy[before[1]] - self._energy[after[0]]), 0.0)
        most = float(self._energy[after[1]] - self._energy[before[0]])
        read = self.energy(start, end)
        return max(most - read, read - least)

    def slip(self, start: float, end: float) -> float:
        """By how much the plant fell behind the recorder's clock meanwhile, or made up for it [s]:
        a busy computer delays the plant and the answers of the nodes.
        """
        first, last = np.searchsorted(self.time, [start, end])
        behind = self._behind[max(first - 1, 0) : last + 1]
        return min(float(np.ptp(behind)), _SLIP_MAX) if len(behind) else 0.0

    def base(self, start: float, end: float) -> float:
        """J of controller, drives and tool."""
        return self._between(self._base, start, end)

    def dissipated(self, start: float, end: float) -> float:
        """J dissipated in the brake resistor."""
        return self._between(self._dissipated, start, end)

    def rectifier(self, start: float, end: float) -> float:
        """J lost in the rectifier."""
        return self._between(self._rectifier, start, end)

    def joints(self, start: float, end: float) -> FloatArray:
        """J per joint (n,) at the DC link, signed."""
        return np.array([self._between(column, start, end) for column in self._joints.T])

    def peak(self, start: float, end: float) -> float:
        """Largest W of a reading in the interval; NaN where there is none."""
        inside = (self.time > start) & (self.time <= end + 1e-6)
        return float(self.power[inside].max()) if inside.any() else float("nan")

    def stored(self, time: float, link: DcLink) -> float:
        """J in the capacitors of the DC link at a time, by its voltage; NaN where none is known."""
        volts = float(np.interp(time, self.time, self._volts))
        return (
            max(0.5 * link.capacitance * (volts**2 - link.voltage**2), 0.0)
            if volts > 0.0
            else float("nan")
        )

    def _between(self, cumulative: FloatArray, start: float, end: float) -> float:
        ends: FloatArray = np.interp([start, end], self.time, cumulative)
        return float(ends[1] - ends[0])


# A power meter beside a recording: its joules on the recording's time axis, in place of the
# recorded ones.
#
# The meter's file is read by the reader of traces. Its clock is laid onto the recording's by the
# offset that the mapping gives, or by comparing its power with the recorded one.

MEASURED = "measured"  # the name of the plant: its figures are not the model's
# facts of such a recording
METER = "meter"
OFFSET = "meter_clock_offset"
SHARE = "meter_against_recorded"


@dataclass(frozen=True)
class MeterPlace:
    """Seconds that were added to the meter's clock, and how well both powers then agree (1:
    exactly; NaN: the offset was given).
    """

    offset: float
    correlation: float


def with_meter(
    recording: Recording, path: str | Path, mapping: TraceMapping | None = None
) -> Recording:
    """The recording with the joules and watts of a meter's file, at its own readings.

    What the meter doesn't cover keeps the recorded figures. The facts name the file, the offset of
    its clock, and its joules over the recorded ones. RecorderError where the file has no power, the
    recording no meter, or the clocks' offset can't be found.
    """
    power = recording.power
    if power is None or len(power.time) < 2:
        raise RecorderError(f"{recording.path} has no readings that a meter could be laid onto")
    mapping = mapping or TraceMapping()
    trace = read_traces(path, mapping, joint_names=())[0]
    joules = trace.joules()
    if joules is None:
        raise RecorderError(f"{trace.source}: has neither power nor energy")
    place = _place(power, trace, joules, mapping)
    watts = mean_power(trace.time + place.offset, joules, power.time)
    covered = np.isfinite(watts)
    if not covered.any():
        raise RecorderError(
            f"{trace.source}: covers none of the recording's {recording.duration:g} s"
        )
    steps = np.diff(power.time)
    recorded = power.power[1:]
    share = float((watts[covered] @ steps[covered]) / (recorded[covered] @ steps[covered]))
    found = np.where(covered, watts, recorded)
    measured = replace(
        power,
        power=np.concatenate([power.power[:1], found]),
        energy=power.energy[0] + np.concatenate([[0.0], np.cumsum(found * steps)]),
        plant=MEASURED,
    )
    return replace(
        recording,
        power=measured,
        hardware=f"meter {Path(path).name}",
        facts=(*recording.facts, *_facts(path, place, share)),
    )


def _place(
    power: PowerSeries, trace: Trace, joules: FloatArray, mapping: TraceMapping
) -> MeterPlace:
    if np.isfinite(mapping.clock_offset):  # the reader has added it
        return MeterPlace(0.0, np.nan)
    watts = np.diff(joules) / np.diff(trace.time)
    middle = trace.time[1:] - 0.5 * np.diff(trace.time)
    own = power.time[1:] - 0.5 * np.diff(power.time)
    found = clock_offset(own, power.power[1:], middle, watts)
    return MeterPlace(found.seconds, found.correlation)


def _facts(path: str | Path, place: MeterPlace, share: float) -> tuple[tuple[str, str], ...]:
    found = (
        "as given"
        if np.isnan(place.correlation)
        else f"found, the powers agree by {place.correlation:.2f}"
    )
    return (
        (METER, Path(path).name),
        (OFFSET, f"{place.offset:.3f} s ({found})" if place.offset else found),
        (SHARE, f"{share:.4f} of the recorded joules"),
    )
