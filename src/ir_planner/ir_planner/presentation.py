"""Results as people see them: one line of text each, and plots where matplotlib is installed.

The text says what is asked first: found or why not, seconds, joules, minimum clearance, the proof
and the id that other requests take.
"""

from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import numpy as np

from ir_msgs_py.report import PlannedMovement, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.trajectory import JointTrajectory, in_people_units
from ir_values.arrays import FloatArray

_DIGITS = 10  # of a mm, at most
_SAMPLES = 400  # of a plotted trajectory: finer than a screen shows


def in_mm(distance: float, bound: float) -> tuple[str, str]:
    """Two distances [m] in mm, with as many digits as it takes to tell them apart."""
    return told_apart(1e3 * distance, 1e3 * bound)


def told_apart(value: float, bound: float) -> tuple[str, str]:
    """Two numbers with as many digits as it takes to tell them apart."""
    for digits in range(1, _DIGITS):
        texts = f"{value:.{digits}f}", f"{bound:.{digits}f}"
        if texts[0] != texts[1]:
            break
    return texts


def status_text(status: Status) -> str:
    """The name of the status, with its sentence where it is no success."""
    name = StatusCode(status.code).name
    return name if status.ok or not status.message else f"{name}: {status.message}"


def report_text(report: TrajectoryReport) -> str:
    """Seconds, joules, clearance and proof of a report."""
    clearance = f"clearance {1e3 * report.min_clearance:.0f} mm"
    parts = [f"{report.duration:.2f} s", f"{report.energy:.0f} J"]
    if np.isfinite(report.min_clearance):
        parts.append(clearance)
    parts.append("certified" if report.certified else "not certified")
    return ", ".join(parts)


def result_text(
    kind: str, status: Status, report: TrajectoryReport, identity: str, *more: str
) -> str:
    """One line: kind of the result, status, and where it is one the figures, `more` and the id."""
    if not status.ok:
        return f"{kind}({status_text(status)})"
    parts = (report_text(report), *(each for each in more if each), f"id {identity}")
    return f"{kind}({', '.join(parts)})"


def _figure(rows: int) -> tuple[Any, list[Any]]:
    """A figure with `rows` axes above each other. Raises ImportError with what to install."""
    try:
        pyplot = import_module("matplotlib.pyplot")
    except ImportError as error:
        raise ImportError("plot() needs matplotlib: pip install matplotlib") from error
    figure, axes = pyplot.subplots(rows, 1, squeeze=False, layout="constrained")
    return figure, list(axes[:, 0])


def plot_trajectory(trajectory: JointTrajectory | None, title: str) -> Any:
    """The joints' angles and speeds over time, as a matplotlib figure, of a rail in m and m/s; of
    no trajectory the title alone.
    """
    figure, (angles, speeds) = _figure(2)
    figure.suptitle(title, wrap=True, fontsize="medium")
    if trajectory is not None:
        times = np.linspace(0.0, float(trajectory.times[-1]), _SAMPLES)
        motion = trajectory.sample(times)
        names = trajectory.joint_names
        angles.plot(times, in_people_units(names, motion.q), label=names)
        speeds.plot(times, in_people_units(names, motion.qd))
        angles.legend(fontsize="small")
    angles.set_ylabel("angle [deg]")
    speeds.set_ylabel("speed [deg/s]")
    speeds.set_xlabel("time [s]")
    return figure


def plot_front(reports: list[TrajectoryReport], title: str) -> Any:
    """Joules over seconds of answers with different durations, as a matplotlib figure."""
    figure, (axes,) = _figure(1)
    figure.suptitle(title, wrap=True, fontsize="medium")
    axes.plot([each.duration for each in reports], [each.energy for each in reports], "o-")
    axes.set_xlabel("duration [s]")
    axes.set_ylabel("energy [J]")
    return figure


def plot_profiles(
    times: FloatArray, distances: FloatArray, watt_times: FloatArray, watts: FloatArray, title: str
) -> Any:
    """A matplotlib figure: clearance (N,) [m] over times (N,) [s], and mains power (M,) [W] over
    watt_times (M,) [s].
    """
    figure, (clearance, power) = _figure(2)
    figure.suptitle(title, wrap=True, fontsize="medium")
    clearance.plot(times, 1e3 * distances)
    clearance.set_ylabel("clearance [mm]")
    power.plot(watt_times, watts)
    power.set_ylabel("power [W]")
    power.set_xlabel("time [s]")
    return figure


def plot_steps(movements: tuple[PlannedMovement, ...], title: str) -> Any:
    """The steps of a program as bars: from begin to end, as high as their mean power."""
    figure, (axes,) = _figure(1)
    figure.suptitle(title, wrap=True, fontsize="medium")
    _power_bars(axes, movements)
    return figure


def _power_bars(axes: Any, movements: Sequence[PlannedMovement]) -> None:
    begin = 0.0
    for step in movements:
        if step.duration > 0.0:
            colour = "tab:gray" if step.is_pause else "tab:blue"
            watts = step.report.energy / step.duration
            axes.bar(begin, watts, step.duration, align="edge", color=colour, edgecolor="white")
        begin += step.duration
    axes.set_xlabel("time [s]")
    axes.set_ylabel("mean power [W]")


def plot_choices(names: list[str], energies: list[float], title: str) -> Any:
    """Alternatives with their joules as bars; one that is not possible (inf) has none."""
    figure, (axes,) = _figure(1)
    figure.suptitle(title, wrap=True, fontsize="medium")
    axes.bar(names, [each if np.isfinite(each) else 0.0 for each in energies])
    axes.tick_params(axis="x", rotation=30)
    axes.set_ylabel("energy [J]")
    return figure


_KINDS = {"transport": "tab:blue", "hop": "tab:cyan", "wait": "tab:gray"}
_WORKING = "tab:orange"


def plot_cycle(
    robot: Sequence[tuple[str, float, float, str]],
    machines: Mapping[str, Sequence[tuple[float, float]]],
    movements: Sequence[PlannedMovement],
    title: str,
) -> Any:
    """Gantt chart of a cycle. robot: name, begin, length [s] and kind of what it does; machines:
    begin and length [s] of their work; below, the mean power of each step where there are any.
    """
    figure, (chart, *below) = _figure(2 if movements else 1)
    figure.suptitle(title, wrap=True, fontsize="medium")
    figure.set_size_inches(11, 6)
    rows = ["robot", *machines]
    for name, begin, length, kind in robot:
        colour = _KINDS.get(kind, _KINDS["wait"])
        chart.broken_barh([(begin, length)], (-0.4, 0.8), color=colour, edgecolor="white")
        if kind not in _KINDS:
            chart.text(begin, 0.45, name.lower(), fontsize="x-small", va="bottom", clip_on=True)
    for row, works in enumerate(machines.values(), start=1):
        chart.broken_barh(list(works), (row - 0.4, 0.8), color=_WORKING, edgecolor="white")
    chart.set_yticks(range(len(rows)), rows)
    chart.invert_yaxis()
    if not below:
        chart.set_xlabel("time [s]")
    for power in below:
        _power_bars(power, movements)
        chart.sharex(power)
    return figure


def plot_robots(
    robots: Sequence[tuple[str, float, Sequence[PlannedMovement]]],
    zones: Sequence[tuple[str, str, float, float]],
    period: float,
    title: str,
) -> Any:
    """Gantt chart of robots over a cycle. robots: name, begin of the steps [s], and the steps;
    zones: name, robot, begin and length [s] of its turn.
    """
    figure, (chart,) = _figure(1)
    figure.suptitle(title, wrap=True, fontsize="medium")
    figure.set_size_inches(11, 5)
    rows = [name for name, _, _ in robots]
    rows += list(dict.fromkeys(name for name, _, _, _ in zones))
    for row, (_, begin, steps) in enumerate(robots):
        for step in steps:
            colour = _KINDS["wait" if step.is_pause else "transport"]
            _bar(chart, (begin, step.duration), row, period, colour)
            if step.is_pause and step.power_mode:
                at = begin % period
                mode = step.power_mode.lower()
                chart.text(at, row + 0.45, mode, fontsize="x-small", va="bottom", clip_on=True)
            begin += step.duration
    colours = {name: f"C{row + 1}" for row, (name, _, _) in enumerate(robots)}
    for name, robot, begin, length in zones:
        _bar(chart, (begin, length), rows.index(name), period, colours[robot])
        chart.text(begin % period, rows.index(name), robot, fontsize="small", clip_on=True)
    chart.set_yticks(range(len(rows)), rows)
    chart.set_xlim(0.0, period)
    chart.set_xlabel("time [s]")
    chart.invert_yaxis()
    return figure


def _bar(chart: Any, span: tuple[float, float], row: int, period: float, colour: str) -> None:
    """A bar from begin to end of a span (begin, length); over the end of the cycle it goes on at
    its begin.
    """
    begin = span[0] % period
    before = min(span[1], period - begin)
    bars = [(begin, before), (0.0, span[1] - before)]
    shown = [bar for bar in bars if bar[1] > 0.0]
    chart.broken_barh(shown, (row - 0.4, 0.8), color=colour, edgecolor="white")


def plot_throughputs(points: Sequence[tuple[float, float]], title: str) -> Any:
    """Joules a part over parts an hour, as a matplotlib figure."""
    figure, (axes,) = _figure(1)
    figure.suptitle(title, wrap=True, fontsize="medium")
    axes.plot([parts for parts, _ in points], [joules for _, joules in points], "o-")
    axes.set_xlabel("parts an hour")
    axes.set_ylabel("energy a part [J]")
    return figure
