"""A picture of power and motion, for people who don't open a page. matplotlib is asked for only
here.
"""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from ir_kernels import Chain
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.results import mode_name
from ir_recorder.errors import RecorderError
from ir_recorder.reading.recording import PowerSeries
from ir_recorder.report.files import write_output
from ir_recorder.report.number_text import joules, mode_words
from ir_recorder.report.series import envelope
from ir_recorder.report.tables import savings_lines
from ir_values.arrays import FloatArray
from ir_values.files import ANYWHERE, FileRoots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

MODE_COLOURS = {
    "STAND_ON_MOTORS": "#5b8def",
    "MOVING": "#f08c00",
    "STAND_ON_BRAKES": "#37b24d",
    "BUS_POWER_OFF": "#12b5cb",
    "HIBERNATION": "#845ef7",
    "EMERGENCY_STOP": "#e03131",
}
TRANSITION = "#c3ccd6"
PICTURE_START = b"\x89PNG\r\n\x1a\n"
MOST_POINTS = 4000  # more than twice the picture's pixels

_LABELS = 150.0  # pt: height of the drawing of joules, shared by the names of its rows
_LINE = 150  # characters of a line below the drawings: wider ones are cut


def write_picture(analysis: Analysis, path: str | Path, roots: FileRoots = ANYWHERE) -> Path:
    """Power with the modes marked, joules per movement, and the tool's path from above, as PNG
    below `roots`.

    Returns the absolute path. RecorderError where matplotlib isn't installed or the file can't be
    written.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise RecorderError("a picture needs matplotlib: pip install matplotlib") from error
    figure = Figure(figsize=(12.0, 7.2), dpi=130, layout="constrained", facecolor="white")
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 1.1), width_ratios=(1.25, 1.0))
    _power(figure.add_subplot(grid[0, :]), analysis)
    _joules(figure.add_subplot(grid[1, 0]), analysis)
    _path(figure.add_subplot(grid[1, 1]), analysis)
    if saved := savings_lines(analysis):
        lines = [line for sentence in saved for line in wrap(sentence, _LINE)]
        figure.supxlabel("\n".join(lines), fontsize=8.5, color="#39434f", ha="left", x=0.02)
    picture = BytesIO()
    figure.savefig(picture, format="png")
    return write_output(path, picture.getvalue(), PICTURE_START, roots)


def _power(axes: Axes, analysis: Analysis) -> None:
    power = analysis.recording.power
    axes.set(
        xlabel="time [s]",
        ylabel="power at the mains [W]",
        title=f"Power, {joules(analysis.energy)}",
    )
    _plain(axes)
    if power is None:
        return
    _mode_bands(axes, power)
    shape = envelope(power.time, power.power, MOST_POINTS)
    axes.fill_between(shape.time, 0.0, shape.high, color="#e8590c", alpha=0.15, linewidth=0)
    axes.plot(shape.time, shape.high, color="#e8590c", linewidth=1.1)
    axes.set_xlim(float(power.time[0]), float(power.time[-1]))
    axes.set_ylim(0.0, None)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles, labels, loc="upper left", ncols=3, frameon=False, fontsize=8)


def _mode_bands(axes: Axes, power: PowerSeries) -> None:
    change = np.flatnonzero(np.diff(power.mode)) + 1
    named: set[str] = set()
    for first, last in zip([0, *change], [*change, len(power.mode)], strict=True):
        name = mode_name(int(power.mode[first]))
        colour = MODE_COLOURS.get(name, TRANSITION)
        label = mode_words(name) if name in MODE_COLOURS else "transition"
        end = float(power.time[min(last, len(power.time) - 1)])
        shown = None if label in named else label
        axes.axvspan(
            float(power.time[first]), end, color=colour, alpha=0.22, linewidth=0, label=shown
        )
        named.add(label)


def _joules(axes: Axes, analysis: Analysis) -> None:
    moved = analysis.movements
    rows = np.arange(len(moved))
    found = [result.energy for result in moved]
    planned = [result.step.movement.report.energy for result in moved]
    axes.barh(rows - 0.18, found, height=0.36, color="#e8590c", label=analysis.recording.origin)
    axes.barh(rows + 0.18, planned, height=0.36, color="#a9b4c0", label="predicted")
    size = min(8.0, _LABELS / max(len(moved), 1))
    axes.set_yticks(rows, [f"{r.step.index + 1} {r.step.label}" for r in moved], fontsize=size)
    axes.invert_yaxis()
    axes.set(xlabel="energy at the mains [J]", title="Joules per movement")
    _plain(axes)
    if moved:
        axes.legend(frameon=False, fontsize=8)


def _path(axes: Axes, analysis: Analysis) -> None:
    cell = analysis.cell
    joints = analysis.recording.joints
    axes.set(
        xlabel="x [m]",
        ylabel="y [m]",
        title="Tool path from above, wide: much power",
        aspect="equal",
    )
    _plain(axes)
    if cell is None or joints is None or joints.position.shape[1] != cell.robot.n:
        return
    for machine in cell.equipment:
        for body in machine.world_bodies():
            low, high = body.bounds()
            if np.isfinite(low).all():
                xs = [low[0], high[0], high[0], low[0]]
                ys = [low[1], low[1], high[1], high[1]]
                axes.fill(xs, ys, color="#b9c5d2", alpha=0.5, linewidth=0)
    stride = max(1, len(joints.time) // MOST_POINTS)
    q = np.ascontiguousarray(joints.position[::stride])
    place = Chain(cell.robot, cell.base_pose, cell.tcp).tcp_poses(q)[:, :3, 3]
    power = _power_at(analysis, joints.time[::stride])
    wide = 3.0 + 27.0 * power / max(float(np.nanmax(power, initial=0.0)), 1.0)
    drawn = axes.scatter(place[:, 0], place[:, 1], c=power, s=wide, cmap="viridis_r")
    axes.figure.colorbar(drawn, ax=axes, label="W", shrink=0.8)
    axes.plot(*cell.base_pose[:2, 3], marker="o", color="#39434f", markersize=9)


def _power_at(analysis: Analysis, time: FloatArray) -> FloatArray:
    power = analysis.recording.power
    return np.interp(time, power.time, power.power) if power is not None else np.zeros(len(time))


def _plain(axes: Axes) -> None:
    axes.grid(color="#dde3ea", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
