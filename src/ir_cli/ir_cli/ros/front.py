"""`ir ros front`: a program's energy over its cycle time, as a table and a picture."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from ir_cli.errors import CommandError
from ir_cli.output import Progress, add_renamed, table
from ir_cli.planning import add_blend
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.client import Client
from ir_msgs_py.savings import ProgramPoint
from ir_recorder.report.files import write_output
from ir_recorder.report.picture import PICTURE_START
from ir_values.files import ANYWHERE

_STYLES = ("o", "*", "s", "D")
_COLOURS = ("#5b8def", "#e8590c", "#868e96", "#37b24d")


@dataclass(frozen=True)
class FrontProgram:
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
    marks: tuple[FrontProgram, ...]


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


def add_front(front: argparse.ArgumentParser) -> None:
    """Arguments of `ir ros front`."""
    front.add_argument(
        "stations", nargs="*", help="stations and postures to visit; none: the cell's program"
    )
    front.add_argument(
        "--cycle-time", type=float, default=0.0, help="s that are chosen (the cheapest)"
    )
    front.add_argument(
        "--points", type=int, default=12, help="programs of the front, at most 50 (12)"
    )
    add_blend(front)
    front.add_argument("--seed", type=int, default=0, help="seed of the planner (0)")
    output = front.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("out/front.png"),
        metavar="FILE.png",
        help="the picture (out/front.png)",
    )
    add_renamed(front, "--out", output)
    front.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Plan the front, print it, write the picture."""
    progress = Progress()
    options = PlanOptions(seed=arguments.seed)
    with Client(node_name="ir_front") as client:
        progress.begin("plan the front")
        free = client.plan_program(
            arguments.stations,
            options=options,
            progress=lambda at: progress.update(f"{at.phase} {at.done}/{at.total}"),
            front_points=arguments.points,
            blend=arguments.blend,
        )
        cheapest = min(free.front, key=lambda point: point.energy)
        choice = FrontProgram(
            "cheapest cycle time", cheapest.cycle_time, cheapest.energy, cheapest.program_id
        )
        if arguments.cycle_time > 0.0:
            progress.update(f"cycle time {arguments.cycle_time:g} s")
            plan = client.plan_program(
                arguments.stations,
                arguments.cycle_time,
                options,
                savings=False,
                blend=arguments.blend,
            )
            choice = FrontProgram(
                "chosen cycle time", plan.report.duration, plan.report.energy, plan.program_id
            )
        progress.end(f"{len(free.front)} programs ({free.info.planning_time:.1f} s of planning)")
    marks = [
        FrontProgram("free plan", free.report.duration, free.report.energy, free.program_id),
        choice,
    ]
    if free.savings.available:
        total = free.savings.total
        marks.append(FrontProgram("common program", total.seconds, total.common, ""))
        marks.append(
            FrontProgram(
                "planned in its time", total.seconds, total.planned, free.savings.program_id
            )
        )
    front = Front(free.front, tuple(marks))
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    picture = write_front(front, arguments.output)
    sys.stdout.write(_text(front) + f"\n\n{free.savings.sentence}\n{picture}\n")
    return 0


def _text(front: Front) -> str:
    rows = [
        [f"{p.cycle_time:.2f}", f"{p.energy / 1e3:.2f}", p.program_id, ""] for p in front.points
    ]
    rows += [
        [f"{m.cycle_time:.2f}", f"{m.energy / 1e3:.2f}", m.program_id, m.name] for m in front.marks
    ]
    return table(
        ["cycle time s", "E at the mains kJ", "program", ""],
        sorted(rows, key=lambda r: float(r[0])),
    )
