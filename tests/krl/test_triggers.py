"""When a TRIGGER acts, judged by tables made by hand: the tool's place then, or durations alone."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest

from ir_description import cell_from_yaml, cell_to_yaml, load_cell
from ir_krl import Followed, KrlError, follow, parse
from ir_krl.run import SetOutput
from ir_planner import Planner, RequestError
from ir_planner.before_after.today import today_of_krl
from ir_planner.krl import evaluate_krl, tool_in_flange
from ir_planner.krl.execution import DrivenStep, drive

Follow = Callable[..., Followed]
HEAD = "BAS(#INITMOV,0)\nPTP XHOME\nPTP {A1 0,A2 -90,A3 90,A4 0,A5 45,A6 0}\n$VEL.CP=0.25\n"
STEP = 1.5e-3  # s: instants lie on a grid of a millisecond
NEAR = 6e-4  # m


def driven(planner: Planner, program: Followed) -> list[DrivenStep]:
    return list(drive(program, planner.scene("none"), planner.cell.machine_home)[0])


def moving(planner: Planner, program: Followed) -> list[DrivenStep]:
    return [step for step in driven(planner, program) if step.moves][1:]  # after the approach


def switched(planner: Planner, program: Followed) -> list[tuple[int, bool, float]]:
    """Outputs with the seconds after the approach, which ends at rest."""
    steps = driven(planner, program)
    ends = np.cumsum([one.trajectory.duration for one in steps])
    return [
        (number, value, float(end - one.trajectory.duration - ends[0]) + at)
        for one, end in zip(steps, ends, strict=True)
        for number, value, at in one.outputs
    ]


# one motion between exact stops: the instant by its duration T [s]
EXACT = {
    "DISTANCE=0 DELAY=0": lambda t: 0.0,
    "DISTANCE=0 DELAY=40": lambda t: 0.04,
    "DISTANCE=0 DELAY=-40": lambda t: 0.0,  # no farther than its start
    "DISTANCE=0 DELAY=99000": lambda t: t,  # no farther than its end
    "DISTANCE=1 DELAY=0": lambda t: t,
    "DISTANCE=1 DELAY=-70": lambda t: t - 0.07,
    "DISTANCE=1 DELAY=70": lambda t: t,
    "DISTANCE=1 DELAY=-99000": lambda t: 0.0,
    "PATH=0 DELAY=0": lambda t: t,
    "PATH=0 DELAY=-55": lambda t: t - 0.055,
    "PATH=0 ONSTART DELAY=30": lambda t: 0.03,
    "PATH=30 DELAY=0": lambda t: t,
    "PATH=-9000 DELAY=0": lambda t: 0.0,
}


@pytest.mark.parametrize("motion", ["PTP {A1 20}", "LIN_REL {Z -300}", "SLIN_REL {Y 200}"])
@pytest.mark.parametrize("when", EXACT)
def test_an_instant_between_exact_stops(
    when: str, motion: str, planner: Planner, followed: Follow
) -> None:
    program = followed(f"{HEAD}TRIGGER WHEN {when} DO $OUT[4]=TRUE\n{motion}")
    (step,) = moving(planner, program)
    ((number, value, at),) = switched(planner, program)
    assert (number, value) == (4, True)
    assert at == pytest.approx(EXACT[when](step.trajectory.duration), abs=STEP)


@pytest.mark.parametrize(("path", "onstart"), [(-50, ""), (-299, ""), (20, "ONSTART"), (0, "")])
def test_a_path_is_measured_along_the_tools_way(
    path: int, onstart: str, planner: Planner, followed: Follow
) -> None:
    """Judge: where the tool is on its straight line at that instant; a delay adds to it."""
    found = []
    for delay in (0, -20):
        trigger = f"TRIGGER WHEN PATH={path} {onstart} DELAY={delay} DO $OUT[4]=TRUE"
        program = followed(f"{HEAD}{trigger}\nLIN_REL {{Z -300}}")
        found.append(switched(planner, program)[0][2])
    (step,) = moving(planner, program)
    places = planner.scene("none").chain.tcp_poses(step.trajectory.sample([found[0], 0.0]).q)
    gone = float(np.linalg.norm(places[0, :3, 3] - places[1, :3, 3]))
    assert gone == pytest.approx(1e-3 * (path if onstart else 300 + path), abs=NEAR)
    assert found[1] == pytest.approx(max(found[0] - 0.02, 0.0), abs=STEP)


def durations(planner: Planner, followed: Follow, first: str, second: str) -> tuple[float, ...]:
    """Seconds of two motions that are rounded into each other, and of each alone with the jerk that
    rounded ones have.
    """
    apart = f"{HEAD}$APO.CDIS=40\n$APO.CPTP=60\n{first}\nWAIT SEC 0\n{second}\nWAIT SEC 0"
    both = apart.replace("WAIT SEC 0\n", "", 1)
    one, two = moving(planner, followed(apart))
    (whole,) = moving(planner, followed(both))
    return whole.trajectory.duration, one.trajectory.duration, two.trajectory.duration


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ("PTP {A1 20} C_PTP", "PTP {A1 20,A2 -80} C_PTP"),
        ("LIN_REL {Y 300} C_DIS", "LIN_REL {Z -300} C_DIS"),
        ("SPTP {A1 20} C_SPL", "SPTP {A1 20,A2 -80} C_SPL"),
    ],
)
def test_an_instant_at_a_rounded_corner(
    first: str, second: str, planner: Planner, followed: Follow
) -> None:
    """By durations alone: the rounding lasts what both motions together save."""
    whole, one, two = durations(planner, followed, first, second)
    rounding = one + two - whole
    assert rounding > 0.05
    begins = one - rounding
    table = [
        ("a", "DISTANCE=1 DELAY=0", one - rounding / 2),
        ("a", "DISTANCE=1 DELAY=10", one - rounding / 2 + 0.01),
        ("a", "DISTANCE=1 DELAY=9000", one),  # within the rounding
        ("a", "DISTANCE=1 DELAY=-9000", begins),
        ("a", "DISTANCE=0 DELAY=9000", begins),
        ("a", "PATH=0 DELAY=0", one - rounding / 2),
        ("b", "DISTANCE=0 DELAY=0", one),  # where the rounding ends
        ("b", "DISTANCE=0 DELAY=-20", one),
        ("b", "DISTANCE=1 DELAY=-15", whole - 0.015),
        ("b", "DISTANCE=1 DELAY=-9000", one),
        ("b", "PATH=-9000 DELAY=0", begins),
    ]
    for where, when, expected in table:
        trigger = f"TRIGGER WHEN {when} DO $OUT[6]=FALSE\n"
        lines = [trigger if where == "a" else "", f"{first}\n", trigger if where == "b" else ""]
        program = followed(
            f"{HEAD}$APO.CDIS=40\n$APO.CPTP=60\n{''.join(lines)}{second}\nWAIT SEC 0"
        )
        ((_, _, at),) = switched(planner, program)
        assert at == pytest.approx(expected, abs=STEP), when


@pytest.mark.parametrize("output", ["$OUT_C[4]=TRUE", "CONTINUE\n$OUT[4]=TRUE"])
@pytest.mark.parametrize("word", ["", " C_DIS"])
def test_an_output_that_stops_nothing_is_set_where_the_motion_before_ends(
    output: str, word: str, planner: Planner, followed: Follow
) -> None:
    """Law: as a TRIGGER at that end sets it; the robot moves as without it."""
    head = f"{HEAD}$APO.CDIS=40\n"
    first = f"LIN_REL {{Y 300}}{word}"
    rest = "LIN_REL {Z -300} C_DIS\nLIN_REL {Y -300}"
    own = followed(f"{head}{first}\n{output}\n{rest}")
    trigger = "TRIGGER WHEN DISTANCE=1 DELAY=0 DO $OUT[4]=TRUE"
    judged = followed(f"{head}{trigger}\n{first}\n{rest}")
    assert switched(planner, own) == switched(planner, judged)
    plain = followed(f"{head}{first}\n{rest}")
    assert len(moving(planner, own)) == len(moving(planner, plain))


def test_a_path_leads_over_a_rounded_corner(planner: Planner, followed: Follow) -> None:
    """PATH=60 after a rounded corner acts on the next motion, measured along the driven path."""
    instants = []
    for path in (0, 60, 120):
        trigger = f"TRIGGER WHEN PATH={path} DELAY=0 DO $OUT[6]=TRUE"
        lines = f"$APO.CDIS=40\n{trigger}\nLIN_REL {{Y 300}} C_DIS\nLIN_REL {{Z -300}}"
        program = followed(HEAD + lines)
        instants.append(switched(planner, program)[0][2])
    (step,) = moving(planner, program)
    times = np.linspace(instants[0], instants[2], 4000)
    tcp = planner.scene("none").chain.tcp_poses(step.trajectory.sample(times).q)[:, :3, 3]
    lengths = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(tcp, axis=0), axis=1))])
    assert lengths[-1] == pytest.approx(0.12, abs=NEAR)
    assert float(np.interp(instants[1], times, lengths)) == pytest.approx(0.06, abs=NEAR)


def test_a_pulse_that_is_set_again_begins_anew(planner: Planner, followed: Follow) -> None:
    """Its first end came nevertheless, in the middle of the second."""
    program = followed(
        f"{HEAD}PULSE($OUT[6],TRUE,1.0)\nWAIT SEC 0.5\nPULSE($OUT[6],TRUE,1.0)\nWAIT SEC 2\n"
        "PULSE($OUT[6],TRUE,1.0)\n$OUT[6]=TRUE\nWAIT SEC 2"
    )
    found = [(value, round(at, 2)) for _, value, at in switched(planner, program)]
    assert found == [(True, 0.0), (True, 0.5), (False, 1.5), (True, 2.5), (True, 2.5)]


def test_what_a_trigger_calls_goes_on_beside_the_motion(planner: Planner, followed: Follow) -> None:
    """Its waits delay what it sets, over the end of the motion into the next and into a wait."""
    program = followed(
        f"{HEAD}TRIGGER WHEN DISTANCE=0 DELAY=100 DO BLOW( ) PRIO=-1\nPTP {{A1 20}}\nWAIT SEC 2\n"
        "PTP {A1 0}\nEND\nDEF BLOW( )\n$OUT[1]=TRUE\nWAIT SEC 0.2\nPULSE($OUT[2],TRUE,0.3)\n"
        "WAIT SEC 1.5\n$OUT[1]=FALSE"
    )
    found = switched(planner, program)
    expected = [(1, True, 0.1), (2, True, 0.3), (2, False, 0.6), (1, False, 1.8)]
    assert [one[:2] for one in found] == [one[:2] for one in expected]
    assert [one[2] for one in found] == pytest.approx([one[2] for one in expected], abs=STEP)
    assert sum(step.trajectory.duration for step in driven(planner, program)[1:]) > 1.8
    said = [note.text for note in program.notes]
    assert any("BLOW runs as an interrupt of priority -1" in text for text in said)


def test_parts_of_a_spline_have_instants_of_their_own(planner: Planner, followed: Follow) -> None:
    """A TRIGGER in a block is of the part behind it: judged by where the tool is."""
    program = followed(
        f"{HEAD}SPLINE\nSLIN_REL {{Y 100}}\nTRIGGER WHEN PATH=0 ONSTART DELAY=0 DO $OUT[1]=TRUE\n"
        "TRIGGER WHEN PATH=-30 DELAY=0 DO $OUT[2]=TRUE\nSLIN_REL {Y 100}\n"
        "TRIGGER WHEN PATH=-250 DELAY=0 DO $OUT[3]=TRUE\nSLIN_REL {Y 100}\nENDSPLINE"
    )
    (step,) = moving(planner, program)
    found = {number: at for number, _, at in switched(planner, program)}
    places = planner.scene("none").chain.tcp_poses(
        step.trajectory.sample([0.0, found[1], found[2], found[3]]).q
    )[:, 1, 3]
    assert places[1:] - places[0] == pytest.approx([0.1, 0.17, 0.05], abs=NEAR)


def test_timed_splines_switch_at_their_marks(planner: Planner, followed: Follow) -> None:
    program = followed(
        f"{HEAD}PTP_SPLINE\nTIME_BLOCK START\nSPTP {{A1 5}}\nTIME_BLOCK PART=40\n"
        "TRIGGER WHEN PATH=0 ONSTART DELAY=50 DO $OUT[1]=TRUE\nSPTP {A1 15}\n"
        "TIME_BLOCK END=4.0\nENDSPLINE"
    )
    ((_, _, at),) = switched(planner, program)
    assert at == pytest.approx(1.65, abs=STEP)


@pytest.mark.parametrize(
    ("when", "reason"),
    [
        ("DISTANCE=2", "DISTANCE=2: 0 is the start of a motion, 1 its end"),
        ("TIME=2", "TRIGGER WHEN TIME: PATH and DISTANCE are read"),
    ],
)
def test_what_no_trigger_is_is_refused(when: str, reason: str, followed: Follow) -> None:
    with pytest.raises(KrlError, match=r"test\.src:2.*" + reason):
        followed(f"TRIGGER WHEN {when} DELAY=0 DO $OUT[1]=TRUE\nPTP XHOME")


# What is carried, and doors, change at that instant


def tending(lines: str) -> tuple[Planner, Followed]:
    """The demonstration's cell, whose gripper is output 5 and whose lathe's door output 17."""
    text = cell_to_yaml(load_cell("demo"))
    begin = text.index("signals:")
    end = text.index("program:")
    numbers = (
        "signals: {lathe_open_door: {output: 17}, lathe_door_open: {follows: lathe_open_door, "
        "delay: 1.5, input: 3}, lathe_start: {}, lathe_done: {follows: lathe_start, delay: 3}, "
        "conveyor_free: {initial: true}, conveyor_start: {}, grip: {output: 5}}\n"
    )
    planner = Planner(cell_from_yaml(text[:begin] + numbers + text[end:], "t"), clock=lambda: 0.0)
    cell = planner.cell
    source = parse(f"DEF T( )\n{lines}\nEND\n", "t.src")
    return planner, follow([source], cell.machine_home, tool_in_flange(cell.tcp))


def angles(q: np.ndarray) -> str:
    return ",".join(f"A{j + 1} {one:.6f}" for j, one in enumerate(np.degrees(q)))


def test_a_door_moves_from_the_instant_on() -> None:
    moves = "PTP XHOME\nPTP {A1 20}\n{t}PTP {A1 60,A2 -70}\nPTP XHOME"
    trigger = "TRIGGER WHEN DISTANCE=0 DELAY=300 DO $OUT[17]=FALSE\n"
    planner, plain = tending(moves.replace("{t}", ""))
    _, cut = tending(moves.replace("{t}", trigger))
    whole = evaluate_krl(planner, plain)
    parts = evaluate_krl(planner, cut)
    assert len(parts.steps) == len(whole.steps) + 1
    first, second = parts.steps[1:3]
    assert first.step.at_rest == (True, False)
    assert second.step.at_rest == (False, True)
    assert first.report.duration == pytest.approx(0.3, abs=STEP)
    assert [one.name for one in first.step.signals] == ["lathe_open_door"]
    assert parts.report.duration == pytest.approx(whole.report.duration, abs=1e-6)
    assert parts.report.energy == pytest.approx(whole.report.energy, rel=2e-3)
    doors = [one.step.scene.cell.machine("lathe").state for one in (first, second)]
    assert doors == ["door_open", "door_open>door_closed"]
    assert all(one.found.verification.certified for one in (first, second))


def test_a_process_in_whose_course_a_door_moves_names_its_lines_and_what_to_do() -> None:
    lines = "PTP XHOME\nPTP {A1 20}\n$VEL.CP=0.1\n$OUT[9]=TRUE\n{t}LIN_REL {Z -80}\n$OUT[9]=FALSE"
    trigger = "TRIGGER WHEN DISTANCE=0 DELAY=300 DO $OUT[17]=FALSE\n"
    for between, refused in (("", False), (trigger, True)):
        planner, program = tending(lines.replace("{t}", between))
        found = evaluate_krl(planner, program)
        if not refused:
            assert [one.process is not None for one in today_of_krl(found).stretches].count(
                True
            ) == 1
            continue
        with pytest.raises(
            RequestError, match=r"t\.src:7:1 is a process in whose course \$OUT\[17\]"
        ):
            today_of_krl(found)


@pytest.mark.parametrize("delay", [0, 350])
def test_a_part_that_is_left_on_the_way_changes_the_load_there(delay: int) -> None:
    """Judge: the same motion with the part all along and without it."""
    planner, _ = tending("PTP XHOME")
    scene = planner.scene("")
    pose = planner.cell.station("infeed_pick").pose
    found = scene.inverse_kinematics.solve(pose[None]).of_pose(0)
    there = found[np.abs(found - planner.cell.machine_home).max(axis=1).argmin()]
    lines = (
        f"PTP XHOME\nPTP {{{angles(there)}}}\n{{take}}TRIGGER WHEN DISTANCE=0 DELAY={delay} DO "
        "{drop}\nPTP XHOME"
    )
    drops = {"loaded": "$OUT[9]=TRUE", "dropped": "$OUT[5]=FALSE"}
    joules = {}
    for name, drop in drops.items():
        text = lines.replace("{take}", "$OUT[5]=TRUE\n").replace("{drop}", drop)
        read = evaluate_krl(planner, tending(text)[1])
        joules[name] = read.report.energy
        handled = [one.step.handled for one in read.steps if one.step.handled]
        assert (
            handled
            == {
                "loaded": ["+gear"],
                "dropped": ["+gear", "-gear"] if delay else [],  # left where it was taken
            }[name]
        )
    empty = lines.replace("{take}", "").replace("{drop}", "$OUT[9]=TRUE")
    bare = evaluate_krl(planner, tending(empty)[1]).report.energy
    assert bare <= joules["dropped"] <= joules["loaded"]
    if delay:
        gone = [note for note in read.notes if "taken as gone from the cell" in note.text]
        assert gone


def test_a_gripper_that_is_told_early_takes_the_part_where_it_lies() -> None:
    planner, _ = tending("PTP XHOME")
    scene = planner.scene("")
    pose = planner.cell.station("infeed_pick").pose
    found = scene.inverse_kinematics.solve(pose[None]).of_pose(0)
    there = found[np.abs(found - planner.cell.machine_home).max(axis=1).argmin()]
    _, program = tending(
        "PTP XHOME\nTRIGGER WHEN DISTANCE=1 DELAY=-80 DO $OUT[5]=TRUE\n"
        f"PTP {{{angles(there)}}}\nPTP XHOME"
    )
    read = evaluate_krl(planner, program)
    (taken, _) = read.steps
    assert taken.step.handled == "+gear"
    ((_, _, at),) = taken.step.outputs
    assert at == pytest.approx(taken.report.duration - 0.08, abs=STEP)
    assert any("closes 80 ms before the motion ends" in note.text for note in read.notes)


def drawn(seed: int) -> tuple[str, str, list[tuple[int, bool]]]:
    """A chain of motions with triggers and without, and what is set in it, in any order."""
    rng = np.random.default_rng(seed)
    plain = ["BAS(#INITMOV,0)", "PTP XHOME", "$APO.CDIS=60", "$APO.CPTP=70"]
    lines = list(plain)
    outputs = []
    for k in range(6):
        for _ in range(rng.integers(0, 3)):
            when = rng.choice(
                ["DISTANCE=0", "DISTANCE=1", "PATH=-80", "PATH=40", "PATH=30 ONSTART"]
            )
            number = int(rng.choice([1, 5, 17]))
            value = bool(rng.integers(2))
            outputs.append((number, value))
            lines.append(
                f"TRIGGER WHEN {when} DELAY={rng.integers(-300, 300)} DO "
                f"$OUT[{number}]={'TRUE' if value else 'FALSE'}"
            )
        angle = 12 * (k + 1) * (1 if k % 2 else -1)
        word = rng.choice(["", "C_DIS", "C_PTP"])
        motion = f"PTP {{A1 {angle},A2 {-85 + 3 * k},A5 {20 + 4 * k}}} {word}"
        plain.append(motion)
        lines.append(motion)
        if rng.integers(4) == 0:
            plain.append("WAIT SEC 0.2")
            lines.append("WAIT SEC 0.2")
    return "\n".join(plain), "\n".join(lines), outputs


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(6))
def test_triggers_change_no_motion(seed: int) -> None:
    """Law, on generated chains: with triggers the same motions, cut without a gap; everything is
    set once; what nothing changes costs the same.
    """
    plain, lines, outputs = drawn(seed)
    planner, bare = tending(plain)
    _, program = tending(lines)
    one, other = (evaluate_krl(planner, each) for each in (bare, program))
    assert other.report.duration == pytest.approx(one.report.duration, abs=2e-3 * len(outputs))
    found = [(number, value) for step in other.steps for number, value, _ in step.step.outputs]
    assert sorted(found) == sorted(outputs)
    assert other.report.energy == pytest.approx(one.report.energy, rel=5e-3)
    steps = [step.step for step in other.steps]
    for before, after in pairwise(steps):
        last = before.trajectory.sample([before.trajectory.duration])
        first = after.trajectory
        assert np.abs(last.q[0] - first.positions[0]).max() < 1e-9
        if not before.at_rest[1]:
            assert not after.at_rest[0]
            assert np.abs(last.qd[0] - first.sample([0.0]).qd[0]).max() < 1e-6
    for step in steps:
        assert all(0.0 <= at <= step.trajectory.duration + 1e-9 for _, _, at in step.outputs)


def test_a_trigger_without_a_motion_is_said(followed: Follow) -> None:
    program = followed("PTP XHOME\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO $OUT[1]=TRUE")
    assert any("it never acts" in note.text for note in program.notes)


def test_a_trigger_acts_as_a_statement_of_its_own_file(home: np.ndarray) -> None:
    """Its motion may stand in another module: variables and routines are those of the trigger's."""
    main = "DEF MAIN( )\nPTP {A1 0}\nARM( )\nPTP {A1 9}\nEND\nDEF SHOT( )\n$OUT[8]=TRUE\nEND\n"
    arm = "DEF ARM( )\nTRIGGER WHEN DISTANCE=0 DELAY=0 DO SHOT( )\nEND\n"
    sub = f"{arm}DEF SHOT( )\n$OUT[N]=TRUE\nEND\n"
    data = "DEFDAT ARM\nINT N=4\nENDDAT\n"
    texts = [parse(main, "main.src"), parse(sub, "arm.src"), parse(data, "arm.dat")]
    (output,) = [
        one for one in follow(texts, home, np.eye(4)).commands if isinstance(one, SetOutput)
    ]
    assert output.number == 4
    assert (output.place.file, output.place.line) == ("arm.src", 5)
