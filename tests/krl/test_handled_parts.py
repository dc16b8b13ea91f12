"""What a program carries and what its signals are: written, and read."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from ir_description import cell_from_yaml, cell_to_yaml, load_cell
from ir_krl import Followed, KrlError, follow, parse
from ir_krl.run import Payload
from ir_krl.write import Numbers
from ir_krl.write.identifiers import Wiring
from ir_planner import Planner, RequestError
from ir_planner.before_after import before_after, today_of_krl
from ir_planner.checks import evaluate_trajectory
from ir_planner.krl import evaluate_krl, export_krl, tool_in_flange
from ir_planner.krl.strokes import one_after_the_other
from ir_planner.krl.surroundings import loads_with, payload_of, same_payload

_LOAD = re.compile(r"DECL LOAD (\w+)=\{M ([\d.]+),CM \{X ([-\d.]+),Y ([-\d.]+),Z ([-\d.]+)")


def skewed(numbers: str) -> Planner:
    """The demonstration's cell with a gripper whose axes of inertia lie askew, and signals by
    name.
    """
    cell = load_cell("demo")
    assert cell.tool is not None
    inertia = np.array([[9.0, 1.2, -0.8], [1.2, 7.0, 0.5], [-0.8, 0.5, 5.0]])
    tool = replace(cell.tool, com=np.array([0.2, 0.03, -0.02]), inertia=inertia)
    text = cell_to_yaml(replace(cell, tool=tool, program=cell.program[:2]))
    begin = text.index("signals:")
    end = text.index("program:")
    named = f"signals: {numbers}\n"
    return Planner(cell_from_yaml(text[:begin] + named + text[end:], "skewed"), clock=lambda: 0.0)


@pytest.fixture(scope="module")
def exported() -> tuple[Planner, Any, Any]:
    planner = skewed(
        "{lathe_open_door: {output: 17}, lathe_door_open: {follows: lathe_open_door, delay: 1.5, "
        "input: 3}, lathe_start: {}, lathe_done: {follows: lathe_start, delay: 3}, "
        "conveyor_free: {initial: true}, conveyor_start: {}, grip: {output: 5}}"
    )
    plan = planner.plan_program(start=planner.cell.posture("park"))
    assert plan.status.ok, plan.status.message
    return planner, plan, export_krl(planner, plan.movements, "takes")


def test_signals_have_the_numbers_of_the_cell(exported: tuple[Planner, Any, Any]) -> None:
    _, _, export = exported
    assert "SIGNAL LATHE_OPEN_DOOR $OUT[17]" in export.data
    assert "SIGNAL GRIP $OUT[5]" in export.data
    assert "LATHE_OPEN_DOOR" not in re.findall(r"^;   (\w+)", export.source, re.MULTILINE)


def test_the_gripper_closes_and_the_load_changes_where_a_part_is_taken(
    exported: tuple[Planner, Any, Any],
) -> None:
    planner, _, export = exported
    assert export.source.count("GRIP=TRUE\n$LOAD=IR_LOAD_1\n") == 1
    loads = {name: tuple(map(float, rest)) for name, *rest in _LOAD.findall(export.data)}
    tool = planner.cell.tool
    assert tool is not None
    gear = planner.cell.part("gear").held(planner.cell.tcp)
    for name, parts in (("IR_LOAD", (tool,)), ("IR_LOAD_1", (tool, gear))):
        mass = sum(one.mass for one in parts)
        com = sum(one.mass * one.com for one in parts) / mass
        assert loads[name][0] == pytest.approx(mass, abs=1e-3)
        # KUKA's flange looks along z, the cell's along x
        assert loads[name][1:] == pytest.approx(1e3 * np.array([-com[2], com[1], com[0]]), abs=1e-2)


def test_a_load_comes_back(exported: tuple[Planner, Any, Any]) -> None:
    planner, _, _ = exported
    tool = planner.cell.tool
    assert tool is not None
    loads = (tool, planner.cell.part("gear").held(planner.cell.tcp))
    given = payload_of(loads)
    (back,) = loads_with(given, loads, None)  # type: ignore[arg-type]
    assert same_payload(payload_of((back,)), given)
    mass = sum(one.mass for one in loads)
    com = sum(one.mass * one.com for one in loads) / mass
    steiner = [
        one.inertia
        + one.mass
        * (np.eye(3) * np.sum((one.com - com) ** 2) - np.outer(one.com - com, one.com - com))
        for one in loads
    ]
    assert back.inertia == pytest.approx(sum(steiner), abs=1e-6)
    assert back.com == pytest.approx(com)


def test_what_load_says_is_driven_and_costed(
    planner: Planner, followed: Callable[..., Followed]
) -> None:
    lines = "$LOAD={{M {m},CM {{X 0,Y 0,Z 100,A 0,B 0,C 0}},J {{X 1,Y 1,Z 1}}}}"
    moves = "PTP {A1 40,A2 -60}\nPTP XHOME"
    joules = []
    for mass in (0, 50, 150):
        found = evaluate_krl(
            planner, followed(f"PTP XHOME\n{lines.format(m=mass)}\n{moves}"), load="none"
        )
        joules.append(found.report.energy)
        assert any(f"$LOAD says {mass} kg" in note.text for note in found.notes) or mass == 0
    assert joules[0] < joules[1] < joules[2]
    assert joules[2] > 1.05 * joules[0]


def test_a_load_below_zero_is_the_cells(
    planner: Planner, followed: Callable[..., Followed]
) -> None:
    move = "PTP XHOME\nPTP {A1 40}"
    plain, unset = (
        evaluate_krl(planner, followed(text)).report.energy
        for text in (move, f"$LOAD={{M -1}}\n{move}")
    )
    assert unset == plain


def test_a_group_that_overlaps_is_refused() -> None:
    wiring = Wiring("MAIN", Numbers({"IR_PAUSE": 30, "pump": 33}, {}))
    with pytest.raises(KrlError, match=r"IR_PAUSE takes \$OUT\[30\] to \$OUT\[37\], but PUMP has"):
        wiring.own("$OUT", "IR_PAUSE", 8)
    spaced = Wiring("MAIN", Numbers({"IR_PAUSE": 2}, {}))
    assert spaced.output("pump") == "PUMP"
    assert spaced.output("lamp") == "LAMP"
    spaced.own("$OUT", "IR_PAUSE", 8)
    assert list(spaced.declarations()) == [
        "SIGNAL PUMP $OUT[1]",
        "SIGNAL LAMP $OUT[10]",
        "SIGNAL IR_PAUSE $OUT[2] TO $OUT[9]",
    ]


def test_a_hop_between_two_stations_may_touch_what_each_allows() -> None:
    """Clear with the contacts of both, each in its own zone; not with those of one alone."""
    planner = Planner("demo", clock=lambda: 0.0)
    plan = planner.plan_program(
        stations=("infeed_pick", "outfeed_place"), start=planner.cell.posture("home")
    )
    hop = [one.trajectory for one in plan.movements if one.trajectory is not None]
    whole = one_after_the_other(hop[1:])
    scene = planner.scene("gripper+gear")
    stations = ("infeed_pick", "outfeed_place")
    assert evaluate_trajectory(whole, scene, 0.02, stations).verification.keeps_clear
    for one in stations:
        assert not evaluate_trajectory(whole, scene, 0.02, one).verification.keeps_clear


def test_a_payload_is_what_the_text_says(followed: Callable[..., Followed]) -> None:
    program = followed("PTP XHOME\n$LOAD=IR_LOAD\nPTP {A1 3}", _DATA)
    assert program.commands[0].payload is None  # type: ignore[union-attr]
    assert program.commands[1].payload == Payload(  # type: ignore[union-attr]
        12.5, (0.001, 0.002, 0.1), (10.0, 20.0, 30.0), (1.0, 2.0, 3.0)
    )


_DATA = "DECL LOAD IR_LOAD={M 12.5,CM {X 1,Y 2,Z 100,A 10,B 20,C 30},J {X 1.0,Y 2.0,Z 3.0}}"


def test_an_exported_program_takes_the_part_when_it_is_read(
    exported: tuple[Planner, Any, Any],
) -> None:
    planner, plan, export = exported
    sources = [parse(export.source, "takes.src"), parse(export.data, "takes.dat")]
    cell = planner.cell
    program = follow(sources, cell.machine_home, tool_in_flange(cell.tcp))
    found = evaluate_krl(planner, program)
    assert [one.step.handled for one in found.steps if one.step.handled] == ["+gear"]
    assert not any("$LOAD" in note.text for note in found.notes)
    assert plan.movements[-1].load == found.steps[-1].step.scene.load_text


CARRIED = (
    "$LOAD={{M {mass},CM {{X 0,Y 0,Z 200,A 0,B 0,C 0}},J {{X 5,Y 5,Z 5}}}}\nPTP {{A1 0}}\n"
    "PTP {{A1 40,A3 60}}\nWAIT SEC 2\n{more}PTP {{A1 -20,A3 100}}"
)


@pytest.mark.long
@pytest.mark.parametrize(
    "mass", [*(pytest.param(mass, marks=pytest.mark.long) for mass in (0, 50)), 150]
)
def test_a_comparison_carries_what_load_says(
    mass: int, planner: Planner, followed: Callable[..., Followed]
) -> None:
    """Law: what a program costs today is the same in `ir krl import` and `ir compare`, and the
    planner's carries the same.
    """
    found = evaluate_krl(planner, followed(CARRIED.format(mass=mass, more="")))
    answer = before_after(planner, today_of_krl(found))
    assert answer.today.report.energy == pytest.approx(found.report.energy, rel=1e-9)
    for side in answer.sides:
        assert {step.load for step in side.movements} == {"$LOAD"}
    assert any("carries what $LOAD says" in note for note in answer.notes)


@pytest.mark.parametrize(
    ("more", "carried"),
    [
        pytest.param("$LOAD.M=90\n", ["$LOAD", "$LOAD_2"], marks=pytest.mark.long),
        # as the cell has it
        pytest.param("$LOAD={M -1}\n", ["$LOAD", "$LOAD_2"], marks=pytest.mark.long),
        ("$LOAD.M=90\nPTP {A1 20}\n$LOAD.M=50\n", ["$LOAD", "$LOAD_2", "$LOAD"]),
    ],
)
def test_a_load_that_changes_on_the_way_is_costed_where_it_is_carried(
    more: str, carried: list[str], planner: Planner, followed: Callable[..., Followed]
) -> None:
    """Law: movement by movement the same joules in `ir krl import` and `ir compare`, and the same
    loads in every program of the comparison.
    """
    found = evaluate_krl(planner, followed(CARRIED.format(mass=50, more=more)))
    answer = before_after(planner, today_of_krl(found))
    moving = [step.report.energy for step in found.steps if step.step.moves]
    compared = [step.report.energy for step in answer.today.movements if not step.is_pause]
    assert compared == pytest.approx(moving, rel=1e-9)
    assert answer.today.report.energy == pytest.approx(found.report.energy, rel=1e-9)
    for side in (answer.today, *answer.sides):
        loads = [step.load for step in side.movements if not step.is_pause]
        assert [key for key, _ in itertools.groupby(loads)] == carried
    assert any("carries what $LOAD says, movement by movement" in note for note in answer.notes)


@pytest.mark.sampled
@pytest.mark.parametrize("name", ["grip", "Grip", "IR_PAUSE", "ir_done"])
@pytest.mark.parametrize("style", ["spline", "kss8"])
def test_a_signal_that_the_program_has_itself_is_refused(
    exported: tuple[Planner, Any, Any], name: str, style: str
) -> None:
    planner, plan, _ = exported
    steps = (*plan.movements[:-1], replace(plan.movements[-1], set_signals=(f"{name}=0",)))
    with pytest.raises(RequestError, match=f"the signal {name}, which in a written program is"):
        export_krl(planner, steps, "takes", style=style)


@pytest.mark.parametrize(("grips", "load"), [("TFT", "gripper+gear"), ("TTF", "gripper")])
def test_what_is_left_and_taken_in_one_standstill(
    exported: tuple[Planner, Any, Any], grips: str, load: str
) -> None:
    planner, _, _ = exported
    cell = planner.cell
    at = planner.plan_program(stations=("infeed_pick",), start=cell.posture("home"))
    assert at.status.ok, at.status.message
    q = np.degrees(at.movements[-1].trajectory.positions[-1])
    there = ",".join(f"A{k} {v:.6f}" for k, v in enumerate(q, 1))
    set_ = "\n".join(f"$OUT[5]={'TRUE' if one == 'T' else 'FALSE'}" for one in grips)
    text = f"DEF P( )\nPTP XHOME\nPTP {{{there}}}\n{set_}\nPTP XHOME\nEND\n"
    program = follow([parse(text, "p.src")], cell.machine_home, tool_in_flange(cell.tcp))
    found = evaluate_krl(planner, program)
    assert found.steps[-1].step.scene.load_text == load


def test_a_load_with_a_negative_inertia_is_refused(
    planner: Planner, followed: Callable[..., Followed]
) -> None:
    load = "$LOAD={M 50,CM {X 0,Y 0,Z 100,A 0,B 0,C 0},J {X -5,Y 1,Z 1}}"
    with pytest.raises(KrlError, match=r"\$LOAD: J is X -5, Y 1, Z 1 kg m\^2, none may be below 0"):
        evaluate_krl(planner, followed(f"{load}\nPTP XHOME\nPTP {{A1 3}}"))


@pytest.mark.long
@pytest.mark.parametrize(
    "done",
    [
        pytest.param("WAIT FOR $IN[9]\n$OUT[5]=TRUE", marks=pytest.mark.long),
        pytest.param("WAIT SEC 0.5\n$OUT[5]=TRUE\nWAIT SEC 0.5", marks=pytest.mark.long),
        "WAIT FOR $IN[9]\n$OUT[5]=TRUE\nWAIT SEC 1\n$OUT[5]=FALSE\nWAIT SEC 0\n$OUT[5]=TRUE",
    ],
)
def test_what_is_taken_after_a_wait_is_carried_in_a_comparison(
    exported: tuple[Planner, Any, Any], done: str
) -> None:
    """Law: today's movements have the same loads and costs in `ir krl import` and `ir compare`."""
    planner, plan, _ = exported
    cell = planner.cell
    entry = next(step for step in plan.movements if step.kind == "service_entry")
    above, there = (
        "PTP {" + ",".join(f"A{k} {v:.6f}" for k, v in enumerate(np.degrees(q), 1)) + "}\n"
        for q in (entry.trajectory.positions[0], entry.trajectory.positions[-1])
    )
    text = f"DEF P( )\nPTP XHOME\n{above}{there}{done}\n{above}PTP XHOME\nEND\n"
    program = follow([parse(text, "p.src")], cell.machine_home, tool_in_flange(cell.tcp))
    found = evaluate_krl(planner, program)
    answer = before_after(planner, today_of_krl(found))
    assert answer.today.report.energy == pytest.approx(found.report.energy, rel=1e-9)
    loads = [one.step.scene.load_text for one in found.steps if one.step.moves]
    assert loads == ["gripper", "gripper", "gripper+gear", "gripper+gear"]
    assert [one.load for one in answer.today.movements if not one.is_pause] == loads
    assert answer.sides[0].movements[-1].load == "gripper+gear"
