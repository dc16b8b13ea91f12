"""Programs written as KRL: read back, driven and certified again, near to what was planned."""

from __future__ import annotations

import json
import re
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_cli.main import main
from ir_description.cell import CellPath
from ir_description.poses import rotation_from_abc
from ir_krl import KrlError, Motion, follow, parse
from ir_krl.run import Payload, SetOutput
from ir_krl.settings import settings_of
from ir_krl.write import (
    Attached,
    FrameNumbers,
    Style,
    WrittenHandling,
    WrittenMove,
    WrittenSignals,
    base_numbers,
    check_name,
    frame_numbers,
    tool_numbers,
    written,
)
from ir_krl.write.identifiers import SignalNames
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_planner import Planner, RequestError
from ir_planner.krl import DEVIATION_MAX, evaluate_krl, export_krl, tool_in_flange
from ir_planner.krl.export import attached
from ir_planner.krl.splines import passing_times, resting_spline

sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
from cartesian import seen


@pytest.fixture(scope="module")
def planned() -> tuple[Planner, object]:
    planner = Planner("demo", clock=lambda: 0.0)
    plan = planner.plan_program(
        stations=("gauge_measure", "home"), start=planner.cell.posture("park")
    )
    return planner, plan


def test_an_exported_program_is_certified_and_near_the_plan(planned) -> None:
    planner, plan = planned
    export = export_krl(planner, plan.movements, "visit")
    assert export.exported.certified
    assert export.deviation <= DEVIATION_MAX
    assert export.exported.duration <= 1.02 * export.planned.duration
    assert export.exported.energy == pytest.approx(export.planned.energy, rel=0.05)
    cell = planner.cell
    texts = [parse(export.source, "visit.src"), parse(export.data, "visit.dat")]
    again = evaluate_krl(planner, follow(texts, cell.machine_home, tool_in_flange(cell.tcp)))
    moving = [step for step in plan.movements if not step.is_pause]
    driven = [step for step in again.steps if step.step.moves]
    assert "gauge_measure" in again.stations
    for step, movement in zip(driven, moving, strict=True):
        for end in (0, -1):
            away = np.degrees(
                step.step.trajectory.positions[end] - movement.trajectory.positions[end]
            )
            assert np.abs(away).max() < 1e-4


def test_a_controller_would_take_the_files(planned) -> None:
    """After the language's documentation: names of 24 characters, lines of 471, no values for other
    lists.
    """
    planner, plan = planned
    export = export_krl(planner, plan.movements, "visit")
    declared = re.findall(r"DECL \w+ (\w+)=", export.data)
    assert len(set(declared)) == len(declared) > 10
    assert max(map(len, declared)) <= 24
    assert max(map(len, (export.source + export.data).splitlines())) <= 471
    assert export.data.isascii()
    assert export.source.isascii()
    for line in export.data.splitlines()[3:-1]:
        assert line.startswith(("DECL ", "EXT ", "SIGNAL ", ";")), line
    for block in re.findall(r"PTP_SPLINE\n(.*?)ENDSPLINE", export.source, re.DOTALL):
        shares = [float(share) for share in re.findall(r"PART=([\d.]+)", block)]
        assert len(shares) == block.count("SPTP") - 1
        assert min(shares) > 0.0
        assert sum(shares) < 100.0


def test_points_are_passed_within_the_limits_and_hardly_later(planned) -> None:
    planner, plan = planned
    movements = [step.trajectory for step in plan.movements if step.trajectory is not None]
    scene = planner.scene()
    movement = min(movements, key=lambda one: one.duration)
    even = np.linspace(0.0, movement.duration, 13)
    points = movement.sample(even).q
    jerk = np.abs(resting_spline(even, points).derivative(3)(np.linspace(0.0, even[-1], 2001)))
    assert (jerk / scene.limits.jerk).max() > 1.02, "the planned times would do: nothing is proved"
    times = passing_times(points, even, scene)
    spline = resting_spline(times, points)
    fine = np.linspace(0.0, times[-1], 2001)
    bounds = (scene.limits.velocity, scene.limits.acceleration, scene.limits.jerk)
    for order, bound in enumerate(bounds, start=1):
        assert (np.abs(spline.derivative(order)(fine)) / bound).max() <= 1.01
    assert times[-1] <= 1.005 * even[-1]


def path_movement(planner: Planner, name: str, path: CellPath) -> PlannedMovement:
    plan = planner.plan_cartesian(path)
    assert plan.trajectory is not None, plan.status.message
    return PlannedMovement(
        kind=MovementKind.CARTESIAN,
        from_station=name,
        to_station=name,
        trajectory=plan.trajectory,
        report=plan.report,
        duration=plan.report.duration,
    )


@pytest.fixture(scope="module")
def bench() -> Planner:
    return Planner("kr6_bench", clock=lambda: 0.0)


@pytest.mark.long
def test_a_path_of_the_tool_is_a_spline_at_its_speed(bench: Planner) -> None:
    cell = bench.cell
    path = replace(bench.cell.path("bead"), free_angle=0.0)
    own = replace(cell.own_path("bead"), path=path)
    export = export_krl(bench, [path_movement(bench, "bead", own)], "bead")
    assert (
        export.source.count("$VEL.CP=0.1000") == export.source.count("ENDSPLINE") == 3
    )  # two corners
    assert export.exported.certified
    assert export.exported.duration == pytest.approx(export.planned.duration, rel=0.05)
    texts = [parse(export.source, "bead.src"), parse(export.data, "bead.dat")]
    program = follow(texts, cell.machine_home, tool_in_flange(cell.tcp))
    steps = [one.step for one in evaluate_krl(bench, program).steps]
    assert len(steps) == 3
    bead = steps[1].trajectory
    found = seen(bead, replace(path, approach=0.0, retract=0.0), bench.scene())
    assert found.error <= 2e-4  # 0.1 mm of the plan, and as much of the export
    tool = bench.scene().chain.tcp_poses(bead.sample(np.linspace(1.0, 4.0, 301)).q)[:, :3, 3]
    speed = np.linalg.norm(np.diff(tool, axis=0), axis=1) / 0.01
    assert speed == pytest.approx(path.tool_speed, rel=0.01)


def test_a_path_whose_speed_changes_is_refused(bench: Planner) -> None:
    path = bench.cell.path("bead")
    first, *others = path.segments
    other = replace(path, segments=(replace(first, tool_speed=0.04), *others), free_angle=0.0)
    own = replace(bench.cell.own_path("bead"), path=other)
    movement = path_movement(bench, "bead", own)
    with pytest.raises(RequestError, match="along bead: the tool's speed changes along the path"):
        export_krl(bench, [movement], "bead")


def test_asynchronous_movements_are_refused(planned) -> None:
    planner, plan = planned
    with pytest.raises(RequestError, match="timing is asynchronous"):
        export_krl(planner, plan.movements, "visit", PlanOptions(timing="asynchronous"))


@pytest.mark.parametrize(
    "name", ["", "1st", "has space", "x" * 25, "semi;colon", "línea", "Spline"]
)
def test_names_that_a_controller_does_not_take(planned, name: str) -> None:
    planner, plan = planned
    with pytest.raises(RequestError, match="the program's name is"):
        export_krl(planner, plan.movements, name)


def test_signals_get_names_that_a_controller_takes() -> None:
    names = SignalNames("MAIN")
    cell = [
        "gripper_open",
        "Door-Open",
        "wait",
        "1st",
        "XHOME",
        "main",
        "xm1_2",
        "a" * 30,
        "a" * 31,
        "a b",
        "a_b",
    ]
    found = [names.of(signal) for signal in cell]
    assert found[:5] == ["GRIPPER_OPEN", "DOOR_OPEN", "S_WAIT", "S_1ST", "S_XHOME"]
    assert len(set(found)) == len(found)
    assert "MAIN" not in found
    for name in found:
        check_name(name)
    assert [names.of(signal.upper()) for signal in cell] == found


def test_written_signals_are_read_back(planner: Planner) -> None:
    tool = attached(planner.scene("none"))
    signals = WrittenSignals((("part there", True),), (("wait", True), ("Door-Open", False)))
    texts = written("SPEAKS", planner.cell.machine_home, [signals], tool, [])
    program = follow(
        [parse(texts.source, "speaks.src"), parse(texts.data, "speaks.dat")],
        planner.cell.machine_home,
        np.eye(4),
    )
    assert [one.value for one in program.commands if isinstance(one, SetOutput)] == [True, False]
    assert "WAIT FOR PART_THERE" in texts.source
    assert "SIGNAL S_WAIT $OUT[1]" in texts.data


@pytest.mark.long
def test_the_commands_of_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    source = tmp_path / "visit.src"
    assert main(["krl", "export", "open", "-o", str(source), "--stations", "p1", "home"]) == 0
    assert "certified" in capsys.readouterr().out
    assert (
        main(["krl", "import", str(source), str(source.with_suffix(".dat")), "--cell", "open"]) == 0
    )
    shown = capsys.readouterr().out
    assert "stations: p1" in shown
    assert "free of violations" in shown
    assert (
        main(["krl", "export", "open", "-o", str(source)]) == 2
    )  # never over a file that is there
    assert "is there already" in capsys.readouterr().err


@pytest.mark.long
def test_what_is_exported_is_what_was_planned_as_the_loop_goes_on(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a start all doors begin where the program ends; a start of one's own counts more."""
    stations = ["--stations", "p1", "home"]
    source = tmp_path / "visit.src"

    def exported(*more: str) -> str:
        assert main(["export", "open", "-o", str(source), *stations, *more]) == 0
        return capsys.readouterr().out

    assert main(["plan", "open", "--json", *stations]) == 0
    planned = json.loads(capsys.readouterr().out)
    said = f"planned: {planned['moving_seconds']:.2f} s, {planned['moving_joules']:.0f} J"
    assert said in exported()
    text = source.read_text()
    assert "PTP XHOME" in text  # a further cycle moves nothing before its first movement
    read = ["krl", "import", str(source), str(source.with_suffix(".dat")), "--cell", "open"]
    assert main([*read, "--json"]) == 0
    steps = json.loads(capsys.readouterr().out)["steps"]
    assert steps[0]["from"] == steps[-1]["to"] == "home"
    planner = Planner("open", clock=lambda: 0.0)
    first = planner.plan_program(stations=("p1", "home")).movements[0].trajectory
    assert first is not None
    assert np.array_equal(first.positions[0], planner.cell.machine_home)
    for path in (source, source.with_suffix(".dat")):
        path.unlink()
    assert said not in exported("--start", "park")


def test_a_complaint_names_file_line_and_column(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = tmp_path / "old.src"
    broken.write_text("DEF OLD( )\nPTP XHOME\nLIN NOBODY\nEND\n")
    assert main(["krl", "import", str(broken), "--cell", "open"]) == 2
    assert "old.src:3:5: NOBODY has no value" in capsys.readouterr().err


def test_one_station_is_nothing_to_plan_between(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / "old.src"
    source.write_text("DEF OLD( )\nPTP XHOME\nPTP {A1 3}\nPTP XHOME\nEND\n")
    assert main(["krl", "import", str(source), "--cell", "open", "--compare"]) == 2
    assert (
        "stations recognised: home; --compare plans between at least two" in capsys.readouterr().err
    )


@pytest.mark.parametrize("style", ["kss8", "krc2"])
def test_points_are_written_in_the_bases_of_their_machines(style: Style) -> None:
    """Law: read back they are where they were; who moves a base moves its points alone."""
    rng = np.random.default_rng(4)
    poses = []
    for _ in range(4):
        pose = np.eye(4)
        pose[:3, :3] = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        pose[:3, :3] *= np.sign(np.linalg.det(pose[:3, :3]))
        pose[:3, 3] = rng.uniform(-2.0, 2.0, 3)
        poses.append(pose)
    lathe, washer, *goals = poses
    none = Payload(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    tool = Attached(np.eye(4), (none,), (("lathe", lathe), ("washer", washer)))
    moves = [
        WrittenMove("", goals[k % 2], 2, 10, straight=k == 2, velocity=1, base=k) for k in (1, 2, 0)
    ]
    texts = written("P", np.zeros(6), moves, tool, [], style=style)
    assert dict(texts.bases) == {"lathe": 15, "washer": 14}
    assert [f"Base[{n}]" in texts.source for n in (15, 14, 0)] == [True] * 3

    def places(data: str) -> list[np.ndarray]:
        program = follow(
            [parse(texts.source, "p.src"), parse(data, "p.dat")], np.zeros(6), tool.tool
        )
        assert not [note for note in program.notes if "isn't in the files" in note.text]
        found = [one for one in program.commands if isinstance(one, Motion)][1:]
        return [one.target.base @ rounded(one.target.frame or {}) for one in found]

    back = places(texts.data)
    for one, k in zip(back, (1, 2, 0), strict=True):
        assert one == pytest.approx(goals[k % 2], abs=1e-6)  # 2 m as a REAL
    moved = re.sub(r"(IR_BASE_2=\{X )[-\d.]+", r"\g<1>9000.0", texts.data)
    shifted = [not np.allclose(a, b) for a, b in zip(places(moved), back, strict=True)]
    assert shifted == [False, True, False]


@pytest.mark.parametrize("style", ["kss8", "krc2"])
def test_a_stretched_wrist_is_written_by_its_axes(style: Style) -> None:
    """Law: where A5 is 0 the axes are read back as they were, none of them from rounding."""
    joints = np.radians([10.0, -90.0, 90.0, -0.3, 0.0, 0.3])
    move = WrittenMove("", np.eye(4), 2, 2, straight=False, velocity=100, joints=joints)
    none = Payload(0.0, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    texts = written("P", np.zeros(6), [move], Attached(np.eye(4), (none,)), [], style=style)
    files = [parse(texts.source, "p.src"), parse(texts.data, "p.dat")]
    last = [
        one for one in follow(files, np.zeros(6), np.eye(4)).commands if isinstance(one, Motion)
    ]
    assert last[-1].target.axes is not None
    back = [last[-1].target.axes[f"A{k}"] for k in range(1, 7)]
    assert back == pytest.approx(joints, abs=1e-8)


EMPTY = Payload(12.0, (0.0, 0.0, 0.1), (0.0, 0.0, 0.0), (0.1, 0.2, 0.3))
GEAR = replace(EMPTY, mass=30.0)
TOOL = np.diag([-1.0, -1.0, 1.0, 1.0])
TOOL[:3, 3] = [0.1, 0.2, 0.3]
LATHE = np.eye(4)
LATHE[:3, 3] = [1.5, -0.5, 0.25]
FRAMES = {  # as the plant writes them
    "tool": "{X 100.0,Y 200.0,Z 300.0,A 180.0,B 0.0,C 0.0}",
    "lathe": "{X 1500.0,Y -500.0,Z 250.0,A 0.0,B 0.0,C 0.0}",
    "other": "{X 7.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
    "none": "{X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
}
LOADS = {
    "empty": "{M 12.0,CM {X 0.0,Y 0.0,Z 100.0,A 0.0,B 0.0,C 0.0},J {X 0.1,Y 0.2,Z 0.3}}",
    "gear": "{M 30.0,CM {X 0.0,Y 0.0,Z 100.0,A 0.0,B 0.0,C 0.0},J {X 0.1,Y 0.2,Z 0.3}}",
    "none": "{M -1.0,CM {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0},J {X 0.0,Y 0.0,Z 0.0}}",
}


def plant(tools: list[tuple[str, str]], bases: list[str]) -> FrameNumbers:
    """A plant whose $config.dat has these tools with their loads, and these bases, from 1 on."""
    lines = [f"TOOL_DATA[{n}]={FRAMES[tool]}" for n, (tool, _) in enumerate(tools, 1)]
    lines += [f"LOAD_DATA[{n}]={LOADS[load]}" for n, (_, load) in enumerate(tools, 1)]
    lines += [f"BASE_DATA[{n}]={FRAMES[base]}" for n, base in enumerate(bases, 1)]
    text = "\n".join(["DEFDAT $CONFIG PUBLIC", *lines, "ENDDAT", ""])
    return FrameNumbers(plant=parse(text, "$config.dat"))


@pytest.mark.parametrize("seed", range(20))
def test_numbers_are_the_plants_own_or_free(seed: int) -> None:
    """Law: a number that is taken holds the same in the plant, or nothing; no two are the same."""
    rng = np.random.default_rng(seed)
    names, held, places = (list(one) for one in (FRAMES, LOADS, FRAMES))
    tools = [(str(rng.choice(names)), str(rng.choice(held))) for _ in range(6)]
    bases = [str(rng.choice(places)) for _ in range(6)]
    asked = plant(tools, bases)
    loads = {"": EMPTY, "gear": GEAR}
    found = tool_numbers(asked, TOOL, loads)
    assert len({one.number for one in found}) == 2
    for one, load in zip(found, ("empty", "gear"), strict=True):
        there = tools[one.number - 1] if one.number <= len(tools) else ("none", "none")
        assert there == (("tool", load) if one.origin == "plant" else ("none", "none"))
        assert (one.origin == "plant") is (("tool", load) in tools)
    (base,) = base_numbers(asked, {"lathe": LATHE})
    there_too = bases[base.number - 1] if base.number <= len(bases) else "none"
    assert there_too == ("lathe" if "lathe" in bases else "none")


def test_numbers_that_are_asked_for_are_in_the_forms() -> None:
    attached_to = Attached(TOOL, (EMPTY, GEAR), (("lathe", LATHE),), (3, 7), (9,))
    move = WrittenMove("", LATHE, 2, 10, straight=True, velocity=1, base=1)
    parts = [move, WrittenHandling("takes gear", True, 1), move]
    texts = written("P", np.zeros(6), parts, attached_to, [], style="kss8")
    assert (texts.tools, texts.bases) == ((3, 7), {"lathe": 9})
    assert re.findall(r"Tool\[(\d+)\] Base\[(\d+)\]", texts.source) == [("3", "9"), ("7", "9")]
    assert "TOOL_DATA[7]=IR_TOOL" in texts.source
    assert "LOAD_DATA[7]=IR_LOAD_1" in texts.source
    assert "BASE_DATA[9]=IR_BASE_1" in texts.source


ASKED_WRONGLY = {
    "a part that isn't carried": ({"bolt": 2}, "--tool 2=bolt: the program has nothing, gear"),
    "one number twice": ({"": 2, "gear": 2}, "two have one number"),
    "a number that no controller has": ({"": 200}, "--tool 200: numbers are from 1 to 128"),
}


@pytest.mark.parametrize("name", ASKED_WRONGLY)
def test_numbers_are_refused_with_what_there_is(name: str) -> None:
    tools, sentence = ASKED_WRONGLY[name]
    with pytest.raises(KrlError, match=re.escape(sentence)):
        tool_numbers(FrameNumbers(tools=tools), TOOL, {"": EMPTY, "gear": GEAR})


def test_numbers_are_read_from_texts() -> None:
    """As options and the service give them: of the tool, of it with a part, of machines."""
    found = frame_numbers(["3", "4=gear"], ["2=lathe"])
    assert found == FrameNumbers({"": 3, "gear": 4}, {"lathe": 2})
    wrong = (
        (["x"], []),
        (["3", "4"], []),
        (["3=a", "4=a"], []),
        ([], ["2"]),
        (["\N{SUPERSCRIPT TWO}"], []),
    )
    for tools, bases in wrong:
        with pytest.raises(KrlError, match="each once"):
            frame_numbers(tools, bases)


def test_a_program_with_a_gripper_halts_until_it_is_open() -> None:
    parts = [WrittenHandling("takes gear", True, 1)]
    texts = written("P", np.zeros(6), parts, Attached(TOOL, (EMPTY, GEAR)), [])
    files = [parse(texts.source, "p.src"), parse(texts.data, "p.dat")]
    closed = [settings_of(["$OUT[1]=TRUE"])]
    halted = [
        "HALT" in str(follow(files, np.zeros(6), np.eye(4), settings=one).notes)
        for one in ([], closed)
    ]
    assert halted == [False, True]
    assert texts.source.index("ENDWHILE") < texts.source.index("PTP XSTART")


def rounded(frame: dict[str, float]) -> np.ndarray:
    pose = np.eye(4)
    pose[:3, 3] = [1e-3 * frame[name] for name in "XYZ"]
    pose[:3, :3] = rotation_from_abc([frame[name] for name in "ABC"])
    return pose
