"""An export that is imported again, held step by step against what its comments say."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

from _results import Claim, at_least, at_most
from _shop_cells import drawn_cell

from ir_description import bundled_cells
from ir_krl import follow, parse
from ir_krl.write import STYLES, plc_input, read_plc_table
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_planner import Planner, ProgramPlan, RequestError
from ir_planner.krl import EvaluatedStep, KrlExport, evaluate_krl, export_krl, tool_in_flange

DRAWN = 20  # cells
QUICK_DRAWN = 2
SHARE = 0.005  # of a step's seconds and joules
STOPPED = itertools.repeat(0.0).__next__
"""A clock that cuts no plan of a busy machine: what is shown hangs on the work alone."""
_LEAST = 1.0  # J: a step of less is as good as none
_BRIEF = 0.01  # s: a standstill that is none
_REST = 0.002  # s
_COMMENT = re.compile(r"^;(?:FOLD)? ?(\d+) (?:\S+ -> \S+|pause at .*?): ([\d.]+) s, (-?[\d.]+) J")


@dataclass(frozen=True)
class RoundTrip:
    """One program in one style: its steps; the largest share by which the seconds and the joules of
    a step differ from its comment; steps with another load, another mode, other contacts; whether
    all is certified again; what the style loses against the plan [s], [J]; why it was refused.
    """

    cell: str
    style: str
    steps: int = 0
    seconds_off: float = 0.0
    joules_off: float = 0.0
    loads_off: int = 0
    modes_off: int = 0
    contacts_off: int = 0
    certified: bool = False
    lost_s: float = 0.0
    lost_joules: float = 0.0
    refused: str = ""


def planned(planner: Planner) -> ProgramPlan:
    """The cell's program, or a visit of its stations."""
    cell = planner.cell
    stations = () if cell.program else tuple(one.name for one in cell.stations[:3])
    return planner.plan_program(stations=stations, start=cell.posture("park"))


def round_trip(planner: Planner, plan: ProgramPlan, style: str) -> RoundTrip:
    """Write a plan, read it back."""
    name = planner.cell.name
    try:
        export = export_krl(planner, plan.movements, "cycle", style=style)
    except RequestError as error:
        return RoundTrip(name, style, len(plan.movements), refused=str(error))
    return apart(name, style, planner, plan, export)


def apart(
    name: str, style: str, planner: Planner, plan: ProgramPlan, export: KrlExport
) -> RoundTrip:
    """What is read back beside what the comments of the source say."""
    sources = [parse(export.source, "cycle.src"), parse(export.data, "cycle.dat")]
    inputs = plc_input(sources, there=True)
    cell = planner.cell
    program = follow(sources, cell.machine_home, tool_in_flange(cell.tcp), inputs=inputs)
    table = read_plc_table(export.plc_table, "cycle.plc.csv") if export.plc_table else None
    read = evaluate_krl(planner, program, plc=table)
    lines = export.source.splitlines()
    said = [(float(m[2]), float(m[3])) for one in lines if (m := _COMMENT.match(one))]
    told = [pair for pair in zip(export.steps, said, strict=True) if pair[0].duration > _BRIEF]
    steps = [step for step, _ in told]
    mine = _steps_of(steps, read.steps)
    rows = [(step, one, figures) for (step, figures), one in zip(told, mine, strict=True)]
    seconds, joules = (
        max(
            abs(sum(_figures(one)[k] for one in again) - figures[k]) / max(figures[k], least)
            for _, again, figures in rows
        )
        for k, least in ((0, _BRIEF), (1, _LEAST))
    )
    before = sum(step.duration for step in plan.movements)
    paid = sum(step.report.energy for step in plan.movements)
    return RoundTrip(
        name,
        style,
        len(rows),
        seconds,
        joules,
        sum(again[0].step.scene.load_text != step.load for step, again, _ in rows),
        sum(again[0].power_mode != step.power_mode for step, again, _ in rows),
        sum(_contacts(again) != _kept(step) for step, again, _ in rows if _kept(step) is not None),
        read.certified,
        export.seconds - before,
        export.joules - paid,
    )


def _steps_of(
    written: Sequence[PlannedMovement], steps: Sequence[EvaluatedStep]
) -> list[list[EvaluatedStep]]:
    """What was read back of each step: a path may come to rest on its way."""
    lasting = [one for one in steps if one.step.moves or one.report.duration > _BRIEF]
    found = []
    for step in written:
        mine = [lasting.pop(0)]
        while (
            step.kind == MovementKind.CARTESIAN
            and lasting
            and sum(one.report.duration for one in mine) < step.duration - _REST
        ):
            mine.append(lasting.pop(0))
        found.append(mine)
    if lasting:
        raise AssertionError(f"{len(lasting)} steps more are read than were written")
    return found


def _figures(one: EvaluatedStep) -> tuple[float, float]:
    return one.report.duration, one.report.energy


def _contacts(mine: Sequence[EvaluatedStep]) -> float:
    return round(min((c.distance for one in mine for c in one.report.contacts), default=0.0), 3)


def _kept(step: Any) -> float | None:
    distances = [contact.distance for contact in step.report.contacts]
    return round(min(distances), 3) if distances else None


def round_trips(drawn: int) -> tuple[list[dict[str, Any]], list[Claim]]:
    """All bundled cells and `drawn` ones, in every style, printed as a table; what is claimed."""
    rows: list[RoundTrip] = []
    print(f"{'cell':<22} style    steps  s off  J off  loads modes contacts  lost s  lost J")
    for cell in (*sorted(bundled_cells()), *range(drawn)):
        planner = Planner(drawn_cell(cell) if isinstance(cell, int) else cell, clock=STOPPED)
        plan = planned(planner)
        if not plan.status.ok:
            print(f"{planner.cell.name:<22} no plan: {plan.status.message}")
            continue
        for style in STYLES:
            row = round_trip(planner, plan, style)
            rows.append(row)
            figures = f"{row.steps:>5}  {row.seconds_off:.1%}  {row.joules_off:.1%}"
            others = f"{row.loads_off:>5} {row.modes_off:>5} {row.contacts_off:>8}"
            lost = f"{row.lost_s:>6.1f} {row.lost_joules:>7.0f}  {row.refused}"
            print(f"{row.cell:<22} {style:<8} {figures}  {others}  {lost}", flush=True)
    written = [row for row in rows if not row.refused]
    paths = sum("SPLINE" in row.refused for row in rows)  # krc2 has none
    wrong = sum(row.loads_off + row.modes_off + row.contacts_off for row in written)
    claims = [
        at_least("exports written, paths in krc2 apart", len(written) + paths, "of", len(rows)),
        at_most("seconds of a step read back", max(r.seconds_off for r in written), "share", SHARE),
        at_most("joules of a step read back", max(r.joules_off for r in written), "share", SHARE),
        at_most("steps with another load, mode or contact", wrong, "steps", 0),
        at_least("certified again", sum(r.certified for r in written), "of", len(written)),
    ]
    return [asdict(row) for row in rows], claims
