"""Series of the page: envelopes, numbers in base64, curves of the axes, lanes of machines."""

from __future__ import annotations

import base64
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ir_msgs_py.names import EXTERNAL_AXES
from ir_msgs_py.trajectory import in_people_units
from ir_recorder.analysis import Analysis
from ir_recorder.reading.recording import Recording, TextEvent
from ir_values.arrays import FloatArray

# Series small enough for a page: envelopes of long ones, and numbers packed into base64.

Json: TypeAlias = "Mapping[str, Json] | Sequence[Json] | str | float | bool | None"


@dataclass(frozen=True, eq=False)
class Envelope:
    """Lowest and highest value per stretch: time (M,) of its middle, low (M,), high (M,)."""

    time: FloatArray
    low: FloatArray
    high: FloatArray


def envelope(time: FloatArray, value: FloatArray, most: int) -> Envelope:
    """A series (N,) as at most `most` stretches of equal count, every peak kept; a short one
    unchanged.
    """
    if len(time) <= most:
        return Envelope(time, value, value)
    edges = np.linspace(0, len(time), most + 1).astype(int)[:-1]
    low = np.minimum.reduceat(value, edges)
    high = np.maximum.reduceat(value, edges)
    first = time[edges]
    last = time[np.append(edges[1:], len(time)) - 1]
    return Envelope((first + last) / 2.0, low, high)


def stretches(edges: FloatArray, time: FloatArray, value: FloatArray) -> Envelope:
    """Lowest and highest value of a series (N,) between neighbours of rising `edges` (M + 1,),
    straight between its readings; where it has none, its first or last.
    """
    inside = (time > edges[0]) & (time < edges[-1])
    at = np.concatenate((edges, time[inside]))
    order = np.argsort(at, kind="stable")
    at = at[order]
    known = np.interp(at, time, value)
    first = np.flatnonzero(order < len(edges))
    last = known[first[1:]]
    low = np.minimum(np.minimum.reduceat(known[: first[-1] + 1], first[:-1]), last)
    high = np.maximum(np.maximum.reduceat(known[: first[-1] + 1], first[:-1]), last)
    return Envelope((edges[1:] + edges[:-1]) / 2.0, low, high)


def floats(values: ArrayLike) -> str:
    """An array of any shape (...) as float32, little endian, in base64."""
    return _base64(np.asarray(values, dtype="<f4"))


def quantised(values: ArrayLike, step: float | FloatArray) -> str:
    """An array (...) as int16 multiples of `step`, of its last axis one step or each its own,
    little endian, in base64; clipped to its range.
    """
    one = np.asarray(step)
    kept = np.clip(np.nan_to_num(np.asarray(values, dtype=float)), -32768 * one, 32767 * one)
    return _base64(np.rint(kept / one).astype("<i2"))


def indices(values: ArrayLike) -> str:
    """An array (...) of indices as uint16, little endian, in base64."""
    return _base64(np.asarray(values, dtype="<u2"))


def _base64(array: NDArray[np.generic]) -> str:
    return base64.b64encode(np.ascontiguousarray(array).tobytes()).decode()


LONG_REST = 20.0  # s: charts show longer rests short
Span: TypeAlias = tuple[float, float]


def long_rests(programs: Sequence[Sequence[Span]]) -> list[Span]:
    """Stretches (from, to) s in which every program rests, long enough for charts to show them
    short; rests of each program in their order.
    """
    common = list(programs[0]) if programs else []
    for other in programs[1:]:
        both = ((max(a, c), min(b, d)) for a, b in common for c, d in other)
        common = [(start, end) for start, end in both if end > start]
    return [(start, end) for start, end in common if LONG_REST < end - start < math.inf]


# Curves of every axis for the engineer: position, speed, torque, power, tracking error,
# temperature.

MOST = 4_000  # stretches of a curve: more than a screen has pixels; peaks are kept
_STEPS = 32_000  # of int16


@dataclass(frozen=True, eq=False)
class Curves:
    """One quantity: time (N,) s, value (N, n) in `unit`, limit (n, 2); series: what the columns
    are, "axes" A1 to An or the name of a single curve. low (N, n): the lowest values where `value`
    has the highest ones of stretches, which are drawn as they are.
    """

    name: str
    unit: str
    time: FloatArray
    value: FloatArray
    limit: FloatArray | None = None
    shown: bool = True
    series: str = "axes"
    low: FloatArray | None = None


def axis_curves(analysis: Analysis) -> list[dict[str, Json]]:
    """What axes.js draws."""
    return [
        packed(curves)
        for curves in _curves(analysis)
        if len(curves.time) > 1 and _seen(curves.value)
    ]


def _seen(value: FloatArray) -> bool:
    return bool(np.isfinite(value).any())


def _curves(analysis: Analysis) -> Iterator[Curves]:
    recording = analysis.recording
    joints = recording.joints
    power = recording.power
    controller = recording.controller
    rail = _rail(analysis)
    if joints is not None:
        limits = _limits(analysis, joints.position.shape[1])
        position = in_people_units(joints.names, joints.position)
        speed = in_people_units(joints.names, joints.velocity)
        turning = Curves("position", "°", joints.time, position, limits[0])
        yield from _with_rail(turning, rail, "position", "m")
        turning = Curves("speed", "°/s", joints.time, speed, limits[1])
        yield from _with_rail(turning, rail, "speed", "m/s")
        turning = Curves("torque", "Nm", joints.time, joints.effort, limits[2])
        yield from _with_rail(turning, rail, "force", "N")
    if power is not None:
        drawn = Curves("power at the DC link", "W", power.time, power.joint_power)
        yield from _with_rail(drawn, rail, "power at the DC link", "W")
    if controller is not None:
        error = controller.joint_error
        slides = int(bool(rail))
        scaled, unit = _readable(error[:, slides:], "rad")
        yield Curves("tracking error", unit, controller.time, scaled, shown=False)
        if rail:
            scaled, unit = _readable(error[:, :1], "m")
            name = f"tracking error of {rail}"
            yield Curves(name, unit, controller.time, scaled, shown=False, series=rail)
        tool = controller.tool_deviation[:, None] * 1e3
        yield Curves("tool off its path", "mm", controller.time, tool, shown=False, series="tool")
    if power is not None:
        warm = power.joint_temperature
        curves = Curves("temperature of the gear", "°C", power.time, warm, shown=False)
        yield from _with_rail(curves, rail, "temperature of the gear", "°C")


def _rail(analysis: Analysis) -> str:
    """Name of the external axis that the first joint is, "" where the robot stands."""
    joints = analysis.recording.joints
    first = "" if joints is None else next(iter(joints.names), "")
    return first if first in EXTERNAL_AXES else ""


def _with_rail(curves: Curves, rail: str, name: str, unit: str) -> Iterator[Curves]:
    """The arm's curves, and those of a rail, the first column, in a chart and unit of its own."""
    if not rail:
        yield curves
        return
    limit = curves.limit
    yield replace(curves, value=curves.value[:, 1:], limit=None if limit is None else limit[1:])
    yield replace(
        curves,
        name=f"{name} of {rail}",
        unit=unit,
        value=curves.value[:, :1],
        limit=None if limit is None else limit[:1],
        series=rail,
    )


def _limits(
    analysis: Analysis, n: int
) -> tuple[FloatArray | None, FloatArray | None, FloatArray | None]:
    """Limits (n, 2) of position [deg, m], speed [deg/s, m/s] and torque [Nm, N] by the data of the
    robot.
    """
    if analysis.cell is None or analysis.cell.robot.n != n:
        return None, None, None
    robot = analysis.cell.robot
    torque = robot.envelope_torque[:, 0]
    position = np.stack([robot.position_min, robot.position_max])
    speed = np.stack([-robot.velocity_max, robot.velocity_max])
    return (
        robot.in_people_units(position).T,
        robot.in_people_units(speed).T,
        np.stack([-torque, torque], axis=1),
    )


def _readable(error: FloatArray, unit: str) -> tuple[FloatArray, str]:
    """Radians or metres in thousandths, or in millionths where all are below a thousandth."""
    most = float(np.nanmax(np.abs(error))) if _seen(error) else 0.0
    return (error * 1e3, f"m{unit}") if most >= 1e-3 else (error * 1e6, f"µ{unit}")


def packed(curves: Curves) -> dict[str, Json]:
    """Curves as the page's scripts read them: peaks kept, int16."""
    value = np.nan_to_num(curves.value)
    if curves.low is None:
        shape = envelope(curves.time, value, MOST)
    else:
        shape = Envelope(curves.time, np.nan_to_num(curves.low), value)
    step = max(float(np.abs(value).max()), 1e-9) / _STEPS
    packed: dict[str, Json] = {
        "name": curves.name,
        "unit": curves.unit,
        "series": curves.series,
        "count": value.shape[1],
        "shown": curves.shown,
        "step": step,
        "time": floats(shape.time),
        "high": quantised(shape.high, step),
    }
    if shape.low is not shape.high:
        packed["low"] = quantised(shape.low, step)
    if curves.limit is not None:
        packed["limits"] = [
            [round(float(x), 3) if math.isfinite(x) else None for x in row] for row in curves.limit
        ]
    return packed


# States of machines, moving ones too, and contacts, as rows of spans beside the power modes.

_SHOWN = 0.5  # s that a contact is wide: an instant would not be seen


def machine_lanes(recording: Recording) -> Iterator[dict[str, Json]]:
    """A lane for each machine whose state changed, and one for the contacts where there were
    any.
    """
    for name in dict.fromkeys(event.name for event in recording.machines):
        events = [event for event in recording.machines if event.name == name]
        if len({event.text for event in events}) > 1:
            yield {"label": name, "spans": list(_spans(events, recording.duration))}
    if recording.contacts:
        spans: list[Json] = [
            [at.time, at.time + _SHOWN, at.text, "contact"] for at in recording.contacts
        ]
        yield {"label": "contact", "spans": spans}


def _spans(events: Sequence[TextEvent], end: float) -> Iterator[list[Json]]:
    """From one change to the next; styles alternate with the states, and movement has its own."""
    styles: dict[str, str] = {}
    start = max(events[0].time, 0.0)
    current = events[0].text
    for time, text in [*((event.time, event.text) for event in events[1:]), (end, "")]:
        if text == current:
            continue
        before, _, ahead = current.partition(">")
        style = styles.setdefault(before, "none" if not styles else "load")
        words = f"{before} to {ahead}" if ahead else before
        yield [start, time, words, "moving" if ahead else style]
        start = max(time, 0.0)
        current = text
