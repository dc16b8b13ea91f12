"""`ir plan`, `ir ask move` and the others without ROS: what they print, and how they end."""

from __future__ import annotations

import csv
import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from ir_cli.commands import COMMANDS
from ir_cli.main import main
from ir_description import load_cell
from ir_planner import Planner

DOORS = "doors at the start are assumed, as the cell has them: lathe door_open"
STATIONS = ("plan", "demo", "--stations", "gauge_measure", "home", "--planning-time", "60")


def answered(capsys: pytest.CaptureFixture[str], *words: str) -> Any:
    assert main([*words, "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def test_help_imports_nothing_that_takes_long() -> None:
    code = (
        "import sys; from ir_cli.main import main; main(['--help']); main(['ask', '--help']); "
        "print(*sys.modules)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout
    assert not {"numpy", "yaml", "scipy", "rclpy", "importlib.metadata"} & set(loaded.split())


@pytest.mark.long
def test_no_command_without_ros_imports_rclpy(tmp_path: Path) -> None:
    trace = tmp_path / "m.csv"
    lines = (
        ["ask", "move", "demo", "home", "park", "-o", str(trace)],
        ["ask", "evaluate", "demo", str(trace)],
        ["ask", "optimize", "demo", str(trace), "--planning-time", "1"],
        [
            "compare",
            "open",
            "--stations",
            "p1",
            "--start",
            "home",
            "-o",
            str(tmp_path / "compared.html"),
        ],
        ["ask", "ik", "demo", "lathe_work"],
        ["ask", "state", "demo", "home"],
        ["check", "open"],
        ["ask", "standby", "demo", "--pause", "300"],
        ["cell", "check", "open"],
        ["cell", "list"],
        ["robot", "list"],
        [*STATIONS],
    )
    code = "import json, sys; sys.modules['rclpy'] = None; from ir_cli.main import main\n"
    code += "sys.exit(max(main(line) for line in json.loads(sys.argv[1])))"
    ran = subprocess.run(
        [sys.executable, "-c", code, json.dumps(lines)], capture_output=True, text=True, check=False
    )
    assert ran.returncode == 0, ran.stdout + ran.stderr
    others = {"completion", "energy", "export", "krl", "new", "report", "study", "view"}
    first = {each.path.split()[0] for each in COMMANDS if not each.ros}
    assert {line[0] for line in lines} | others == first


def test_the_totals_of_a_program_are_the_sums_of_its_steps(
    capsys: pytest.CaptureFixture[str],
) -> None:
    found = answered(capsys, *STATIONS)
    assert found["certified"]
    assert found["notes"] == [DOORS]
    for key in ("seconds", "joules"):
        assert found[key] == pytest.approx(sum(step[key] for step in found["steps"]))
        moving = sum(step[key] for step in found["steps"] if step["kind"] != "pause")
        assert found[f"moving_{key}"] == pytest.approx(moving)
    assert found["clearance"] == min(
        s["clearance"] for s in found["steps"] if s["clearance"] is not None
    )


def test_a_program_has_its_own_pauses_in_csv(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    text = "\n".join(line for line in _yaml("demo").splitlines() if "- {station" not in line)
    (tmp_path / "pauses.yaml").write_text(text)
    assert main(["plan", str(tmp_path / "pauses.yaml"), "--csv"]) == 0
    rows = list(csv.DictReader(io.StringIO(capsys.readouterr().out)))
    pauses = [float(row["seconds"]) for row in rows if row["kind"] == "pause"]
    assert [pause for pause in pauses if pause] == [
        step.dwell for step in load_cell("demo").program if step.kind == "PAUSE"
    ]


def _yaml(name: str) -> str:
    from importlib.resources import files

    return (files("ir_description") / "data" / "cells" / f"{name}.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize("goal", ["park", "gauge_measure", "A1 20 A2 -80 A3 90 A4 10 A5 30 A6 0"])
def test_what_is_written_is_evaluated_to_the_same(
    goal: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = tmp_path / "m.csv"
    cell = "open" if goal != "gauge_measure" else "demo"
    planned = answered(capsys, "ask", "move", cell, "home", goal, "-o", str(trace))
    assert planned["notes"] == ([] if cell == "open" else [DOORS])
    evaluated = answered(capsys, "ask", "evaluate", cell, str(trace))
    assert evaluated["violations"] == []
    for key in ("seconds", "joules", "clearance", "torque_share"):
        assert evaluated[key] == pytest.approx(planned[key], rel=1e-9), key


def test_a_trace_of_positions_alone_in_degrees_costs_nearly_the_same(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = tmp_path / "m.csv"
    sampled = tmp_path / "sampled.csv"
    planned = answered(capsys, "ask", "move", "open", "home", "park", "-o", str(trace))
    rows = list(csv.DictReader(trace.open()))
    from ir_cli.traces import read_trace

    robot = load_cell("open").robot
    trajectory = read_trace(trace, robot.joint_names)
    assert len(rows) == len(trajectory.times_ns)
    times = np.arange(0.0, trajectory.duration, 0.004)
    q = np.degrees(trajectory.sample(times).q)
    with sampled.open("w") as file:
        writer = csv.writer(file)
        writer.writerow(["time", *(f"{name}_deg" for name in robot.joint_names)])
        writer.writerows(np.column_stack([times, q]).tolist())
    main(["ask", "evaluate", "open", str(sampled), "--json"])
    evaluated = json.loads(capsys.readouterr().out)
    assert evaluated["joules"] == pytest.approx(planned["joules"], rel=0.01)


def test_every_configuration_of_ik_is_free(capsys: pytest.CaptureFixture[str]) -> None:
    found = answered(capsys, "ask", "ik", "demo", "gauge_measure")["configurations"]
    assert len(found) >= 5
    for each in found[:2]:
        state = " ".join(f"A{k} {float(np.degrees(each[f'joint_a{k}']))!r}" for k in range(1, 7))
        checked = answered(capsys, "check", "demo", state)
        assert checked["valid"]
        assert checked["min_distance"] == pytest.approx(each["clearance"], abs=1e-6)


def test_a_state_in_collision_names_the_pair(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ask", "state", "open", "A1 0 A2 -10 A3 100 A4 0 A5 0 A6 0"]) == 1
    assert " and floor (environment) are in penetration" in capsys.readouterr().out


def test_a_standby_names_its_mode_and_what_it_saves(capsys: pytest.CaptureFixture[str]) -> None:
    found = answered(capsys, "ask", "standby", "demo", "--pause", "300")
    energies = {each["mode"]: each["joules"] for each in found["alternatives"]}
    assert found["modes"][-1]["mode"] == found["chosen"]
    assert found["modes"][0]["seconds"] >= 0.0
    least = min(each for each in energies.values() if each is not None)
    assert (
        0.5 * least < found["joules"] <= least
    )  # modes one after the other cost at most the best alone
    assert found["saving"] == pytest.approx(energies["STAND_ON_MOTORS"] - found["joules"])


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("plan", "dmo"), "no cell dmo: did you mean demo?"),
        (("move", "demo", "home", "lathe_wrk"), "no station lathe_wrk: did you mean lathe_work?"),
        (("plan", "demo", "--stations", "nowhere"), "no station nowhere; there is: "),
        (("plan", "demo", "--stations", "gauge_mesure"), "did you mean gauge_measure?"),
        (("plan", "demo", "--safety-distance", "7"), "safety_distance is 7 m"),
        (("plan", "open"), "has no program"),
        (("standby", "demo", "--pause", "-3"), "pause is -3 s"),
        (("check", "demo", "A1 999 A2 0 A3 0 A4 0 A5 0 A6 0"), "joint_a1"),
        (("evaluate", "demo", "nowhere.csv"), "nowhere.csv"),
        (("cell", "check", "opn"), "no cell opn: did you mean open?"),
    ],
)
def test_input_without_sense_ends_with_two_and_a_sentence(
    words: tuple[str, ...], sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(words) == 2
    printed = capsys.readouterr()
    assert sentence in printed.err
    assert printed.out == ""


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ("time\n0\n1\n", "no column joint_a1"),
        ("t,joint_a1\n0,0\n1,0\n", "column t has no unit"),
        ("clock,joint_a1\n0,0\n1,0\n", "no column time"),
        ("time,joint_a1\n0,0\n", "has 1 points"),
        ("time,joint_a1\n0,0\n1\n", ":3: has 1 values"),
        ("time,joint_a1\n0,x\n1,0\n", ":2: joint_a1 is 'x'"),
    ],
)
def test_a_broken_trace_is_refused_with_its_line(
    content: str, sentence: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "t.csv").write_text(content)
    assert main(["ask", "evaluate", "open", str(tmp_path / "t.csv")]) == 2
    assert sentence in capsys.readouterr().err


def test_what_can_not_be_planned_ends_with_one(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ask", "move", "demo", "home", "X 9 Y 0 Z 1 A 0 B 90 C 0"]) == 1
    said = capsys.readouterr().err
    assert "can't be reached" in said
    assert said.endswith(f"\nnote: {DOORS}\n")


@pytest.mark.parametrize(
    ("command", "what"),
    [
        (["move", "open", "{}", "park"], "start"),
        (["move", "open", "home", "{}"], "goal"),
        (["state", "open", "{}"], "state"),
    ],
)
def test_a_place_that_is_refused_is_named_by_its_argument(
    command: list[str], what: str, capsys: pytest.CaptureFixture[str]
) -> None:
    words = [word.format("A1 186 A2 -90 A3 90 A4 0 A5 0 A6 0") for word in command]
    assert main(["ask", *words]) == 2
    said = capsys.readouterr().err
    assert f"{what}: joint_a1 is 186 deg" in said
    assert ("ir ask escape" in said) == (what != "goal")


def test_an_interrupt_ends_with_130_and_a_clean_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(self: Planner, *_: object, **__: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(Planner, "plan_program", interrupted)
    assert main(["plan", "demo"]) == 130
    assert capsys.readouterr().out == ""


def test_all_errors_of_a_cell_are_printed_with_their_lines(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "broken.yaml"
    path.write_text(_yaml("open").replace("kind: box", "kind: cube", 2))
    assert main(["cell", "check", str(path)]) == 1
    errors = capsys.readouterr().err.splitlines()
    assert len(errors) == 3
    assert errors[-1] == "ir: 2 errors"
    assert all("broken.yaml:" in line and "'cube'" in line for line in errors[:-1])
