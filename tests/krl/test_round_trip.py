"""An export that is imported again costs what its comments say, with the same loads and modes."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_description import Cell, ProgramStep, bundled_cells, load_cell
from ir_description.poses import abc_from_rotation
from ir_krl import follow, parse
from ir_krl.write import STYLES, plc_input, read_plc_table
from ir_msgs_py.modes import REST_MODES
from ir_planner import Planner, RequestError
from ir_planner.before_after import before_after, today_of_krl
from ir_planner.krl import EvaluatedProgram, KrlExport, evaluate_krl, export_krl, tool_in_flange
from ir_planner.krl.surroundings import principal_axes

SHARE = 0.005  # of seconds and joules
_STEP = re.compile(r"(\d+) (?:\S+ -> \S+|pause at .*?): ([\d.]+) s, (-?[\d.]+) J")


def again(planner: Planner, export: KrlExport, *, plc: bool = True) -> EvaluatedProgram:
    """The export as an import reads it, with or without its table of the PLC."""
    sources = [parse(export.source, "out.src"), parse(export.data, "out.dat")]
    cell = planner.cell
    inputs = plc_input(sources, there=plc)
    home = cell.machine_home
    program = follow(sources, home, tool_in_flange(cell.tcp), inputs=inputs)
    table = read_plc_table(export.plc_table, "out.plc.csv") if plc and export.plc_table else None
    return evaluate_krl(planner, program, plc=table)


def said(export: KrlExport) -> list[tuple[float, float]]:
    """Seconds and joules of each step, as the comments of the source say."""
    comments = (re.sub(r"^;(FOLD)? ", "", line) for line in export.source.splitlines())
    found = [match for line in comments if (match := _STEP.match(line))]
    assert [int(match[1]) for match in found] == list(range(1, len(found) + 1))
    return [(float(match[2]), float(match[3])) for match in found]


def check(planner: Planner, export: KrlExport) -> None:
    """Seconds, joules, loads, contacts and modes of every step."""
    read = again(planner, export)
    assert read.certified
    lasting = [one for one in read.steps if one.step.moves or one.report.duration > 0.01]
    rows: list[tuple[Any, list[Any]]] = []
    comments = [
        (step, words)
        for step, words in zip(export.steps, said(export), strict=True)
        if step.duration > 0.0  # else signals at the start alone
    ]
    for planned, _ in comments:  # a movement may come to rest in between: on lines of a path
        mine = [lasting.pop(0)]
        while abs(sum(one.report.duration for one in mine) - planned.duration) > 0.002:
            mine.append(lasting.pop(0))
        rows.append((planned, mine))
    assert not lasting
    for (planned, mine), (_, (seconds, joules)) in zip(rows, comments, strict=True):
        assert sum(one.report.duration for one in mine) == pytest.approx(seconds, rel=SHARE)
        paid = sum(one.report.energy for one in mine)
        assert paid == pytest.approx(joules, rel=SHARE, abs=2.0), planned
        assert mine[0].step.scene.load_text == planned.load
        assert mine[0].power_mode == planned.power_mode
        left = [pair.distance for one in mine for pair in one.report.contacts]
        kept = [pair.distance for pair in planned.report.contacts]
        assert not kept or min(left) == pytest.approx(min(kept), abs=2e-4)


@pytest.fixture(scope="module")
def demo() -> tuple[Planner, Any]:
    planner = Planner("demo", clock=lambda: 0.0)
    plan = planner.plan_program(
        stations=("infeed_pick", "home"), start=planner.cell.posture("home")
    )
    assert plan.status.ok
    return planner, plan


def with_pauses(planner: Planner, plan: Any, rng: np.random.Generator) -> tuple[Any, ...]:
    """The steps of a plan with a part taken, signals, and pauses of every sequence of modes."""
    sequences = [*REST_MODES, "", "STAND_ON_BRAKES>BUS_POWER_OFF>HIBERNATION"]
    sequences += ["STAND_ON_BRAKES>BUS_POWER_OFF", "BUS_POWER_OFF>HIBERNATION"]
    steps = []
    for step in plan.movements:
        steps.append(step)
        if step.to_station == "infeed_pick" and step.kind == "service_entry":
            steps[-1] = replace(step, attach="gear", set_signals=("lathe_start",))
    pause = replace(steps[-1], kind="pause", trajectory=None, trajectory_id="", from_station="home")
    for mode in sequences:
        seconds = float(rng.choice([0.4, 3.0, 24.0, 40.0, 700.0]))
        modes = {"power_mode": mode, "duration": round(seconds * rng.uniform(1.0, 1.2), 3)}
        steps.append(replace(pause, **modes, set_signals=("lathe_start=0",)))
    return tuple(steps)


@pytest.mark.sampled
@pytest.mark.parametrize("style", STYLES)
def test_an_export_costs_what_its_comments_say(demo: tuple[Planner, Any], style: str) -> None:
    planner, plan = demo
    check(planner, export_krl(planner, plan.movements, "visit", style=style))


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, pytest.param(1, marks=pytest.mark.long)])
def test_every_sequence_of_modes_comes_back(demo: tuple[Planner, Any], seed: int) -> None:
    planner, plan = demo
    steps = list(with_pauses(planner, plan, np.random.default_rng(seed)))
    loads = [planner.scene("gripper+gear").load_text, planner.scene().load_text]
    taken = next(k for k, one in enumerate(steps) if one.attach)
    steps = [replace(one, load=loads[0 if k > taken else 1]) for k, one in enumerate(steps)]
    export = export_krl(planner, steps, "rests")
    check(planner, export)
    plain = again(planner, export, plc=False)
    assert any("without the PLC's table" in note.text for note in plain.notes)
    assert plain.report.duration == pytest.approx(export.seconds, abs=0.02)
    assert not any(one.power_mode for one in plain.steps)


@pytest.mark.long
@pytest.mark.parametrize(
    ("free", "steps"),
    [
        (True, (0, 1, 6, 7)),  # home, a machine, home and a pause
        pytest.param(True, range(13), marks=pytest.mark.long),
        pytest.param(False, range(13), marks=pytest.mark.long),
    ],
)
def test_an_export_leaves_nothing_to_save_but_what_the_cells_program_fixes(
    free: bool, steps: Sequence[int]
) -> None:
    cell = load_cell("demo")
    cell = replace(cell, program=tuple(cell.program[k] for k in steps))
    if free:
        cell = replace(cell, program=tuple(one for step in cell.program for one in freed(step)))
    planner = Planner(cell, clock=lambda: 0.0)
    plan = planner.plan_program()
    assert plan.status.ok
    export = export_krl(planner, plan.movements, "cycle")
    assert "PTP XHOME" in export.source  # where the program ends
    check(planner, export)
    compared = before_after(planner, today_of_krl(again(planner, export)))
    assert compared.planned.found
    fixed = [note for note in compared.notes if "the cell's own program fixes" in note]
    moving = [one for one in compared.changes if not one.name.startswith("pause")]
    lost = export.joules - plan.report.energy
    assert sum(one.saving.saved for one in moving) <= lost + 1e-3 * plan.report.energy
    if free:
        assert not fixed
        assert compared.planned.saving.saved <= lost + 1e-3 * plan.report.energy
    else:
        modes = "BUS_POWER_OFF (180 s); HIBERNATION (1800 s)"
        assert modes in fixed[0]
        assert compared.planned.saving.share > 0.05


def freed(step: ProgramStep) -> list[ProgramStep]:
    """A step of a program whose standstill may be spent in any mode."""
    if step.dwell == 0.0:
        return [step]
    pause = ProgramStep("PAUSE", dwell=step.dwell, power_mode="AUTO")
    return [pause] if step.kind == "PAUSE" else [replace(step, dwell=0.0), pause]


@pytest.mark.long
@pytest.mark.parametrize("style", STYLES)
@pytest.mark.parametrize("name", bundled_cells())
def test_every_bundled_cell_comes_back(name: str, style: str) -> None:
    cell = load_cell(name)
    planner = Planner(name, clock=lambda: 0.0)
    stations = () if cell.program else _visits(cell)
    if not stations and not cell.program:
        pytest.skip("nothing to visit")
    plan = planner.plan_program(stations=stations)
    if not plan.status.ok:
        pytest.skip(plan.status.message)
    if style == "krc2" and any(step.kind == "cartesian" for step in plan.movements):
        with pytest.raises(RequestError, match="style kss8 or spline"):
            export_krl(planner, plan.movements, "cycle", style=style)
        return
    check(planner, export_krl(planner, plan.movements, "cycle", style=style))


def _visits(cell: Cell) -> tuple[str, ...]:
    return tuple(station.name for station in cell.stations[:3]) if len(cell.stations) > 1 else ()


def test_an_inertia_comes_back_from_its_principal_axes() -> None:
    rng = np.random.default_rng(3)
    for _ in range(200):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        inertia = turn @ np.diag(rng.uniform(0.01, 20.0, 3)) @ turn.T
        inertia = (inertia + inertia.T) / 2.0
        moments, axes = principal_axes(inertia)
        assert axes @ np.diag(moments) @ axes.T == pytest.approx(inertia, abs=1e-7)
        assert np.linalg.det(axes) == pytest.approx(1.0)
        assert np.isfinite(abc_from_rotation(axes)).all()
