"""Energy over cycle time as a picture: the front, and the programs that are named on it."""

from __future__ import annotations

from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from ir_msgs_py.file_roots import ANYWHERE
from ir_msgs_py.savings import ProgramPoint
from ir_recorder.report.files import write_output
from ir_recorder.report.picture import PICTURE_START

from .errors import CommandError

_STYLES = ("o", "*", "s", "D")
_COLOURS = ("#5b8def", "#e8590c", "#868e96", "#37b24d")


@dataclass(frozen=True)
class Mark:
    """A program with a name: its cycle time [s] and energy at the mains [J]; its id, "" for
    none.
    """

    name: str
    cycle_time: float
    energy: float
    program_id: str


@dataclass(frozen=True)
class Front:
    """Points by cycle time, and marks beside them."""

    points: tuple[ProgramPoint, ...]
    marks: tuple[Mark, ...]


def write_front(front: Front, path: Path) -> Path:
    """The picture as PNG; returns its absolute path. CommandError where matplotlib isn't
    installed.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise CommandError("a picture needs matplotlib: pip install matplotlib") from error
    figure = Figure(figsize=(8.0, 4.6), dpi=130, layout="constrained", facecolor="white")
    axes = figure.add_subplot()
    axes.plot(
        [point.cycle_time for point in front.points],
        [point.energy / 1e3 for point in front.points],
        color="#39434f",
        marker=".",
        linewidth=1.2,
        label="certified programs",
    )
    for mark, style, colour in zip(front.marks, _STYLES, _COLOURS, strict=False):
        place = f"{mark.name}: {mark.cycle_time:.2f} s, {mark.energy / 1e3:.2f} kJ"
        size = 13 if style == "*" else 8
        axes.plot(
            mark.cycle_time,
            mark.energy / 1e3,
            style,
            color=colour,
            markersize=size,
            label=place,
            linewidth=0,
        )
    axes.set(xlabel="cycle time [s], waits and pauses included", ylabel="energy at the mains [kJ]")
    axes.grid(color="#dde3ea", linewidth=0.6)
    axes.set_axisbelow(True)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    axes.legend(frameon=False, fontsize=8.5)
    picture = BytesIO()
    figure.savefig(picture, format="png")
    return write_output(path, picture.getvalue(), PICTURE_START, ANYWHERE)
