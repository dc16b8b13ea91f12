"""URScript, the second make: written, read back at the same joules, refused where it must be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from ir_cli.main import main
from ir_krl import KrlError, Motion
from ir_krl.run import Effect, SetOutput, StandStill, WaitForCondition
from ir_krl.urscript import (
    JointLimits,
    follow_urscript,
    rotation_from_vector,
    vector_of_rotation,
)
from ir_planner import Planner
from ir_planner.krl import evaluate_krl, export_krl, follow_ur
from ir_planner.krl.geometry import Arm

LIMITS = JointLimits(np.full(6, 2.0), np.full(6, 8.0))


@pytest.fixture(scope="module")
def bench() -> Planner:
    return Planner("ur10e_bench", clock=lambda: 0.0)


def test_a_script_comes_back_as_it_was_written(bench: Planner) -> None:
    plan = bench.plan_program(start=bench.cell.posture("park"))
    export = export_krl(bench, plan.movements, "visit", style="urscript")
    found = evaluate_krl(bench, follow_ur(bench, export.source, "visit.script"))
    assert found.certified
    assert found.report.duration == pytest.approx(export.seconds, rel=0.005)
    assert found.report.energy == pytest.approx(export.joules, rel=0.005)
    assert found.stations == ("pick", "place")
    assert export.data == ""


def test_the_flange_is_the_makers(bench: Planner) -> None:
    """After the maker's DH parameters of the UR10e; set_tcp with nothing is the flange."""
    d = (0.1807, 0.0, 0.0, 0.17415, 0.11985, 0.11655)
    a = (0.0, -0.6127, -0.57155, 0.0, 0.0, 0.0)
    alpha = (np.pi / 2, 0.0, 0.0, np.pi / 2, -np.pi / 2, 0.0)
    q = np.array([0.3, -1.1, -0.7, 0.4, 0.9, -0.2])
    pose = np.eye(4)
    for joint, along, out, turn in zip(q, d, a, alpha, strict=True):
        c = np.cos(joint)
        s = np.sin(joint)
        ca = np.cos(turn)
        sa = np.sin(turn)
        pose = pose @ np.array(
            [
                [c, -s * ca, s * sa, out * c],
                [s, c * ca, -c * sa, out * s],
                [0, sa, ca, along],
                [0, 0, 0, 1],
            ]
        )
    text = "set_tcp(p[0,0,0,0,0,0])\nmovel(p[0.1,0.2,0.3,0,0,0])"
    (motion,) = follow_urscript(text, "x.script", np.eye(4), LIMITS).commands
    assert isinstance(motion, Motion)
    found = Arm(bench.scene("none")).tool_pose(motion.target, q)
    assert found == pytest.approx(pose, abs=1e-6)


def test_rotation_vectors_come_back() -> None:
    rng = np.random.default_rng(1)
    vectors = rng.normal(size=(300, 3))
    vectors *= (rng.uniform(0.0, np.pi, 300) / np.linalg.norm(vectors, axis=1))[:, None]
    half = np.pi * np.array([[1.0, 0.0, 0.0], [0.0, 0.6, 0.8], [0.48, 0.6, 0.64]])
    for vector in (*vectors, *half, np.zeros(3)):
        turn = rotation_from_vector(vector)
        assert turn @ turn.T == pytest.approx(np.eye(3))
        again = rotation_from_vector(vector_of_rotation(turn))
        assert again == pytest.approx(turn, abs=1e-6)


def test_speeds_signals_and_waits_are_read() -> None:
    text = """def demo():
  # a comment
  home = [0, -1.57, d2r(90), 0, 0, 0]
  movej(home, a=4, v=1.0, r=0.05)
  set_payload(3.5, [0, 0, 0.1])
  movel(p[0.5, 0.1, 0.3, 0, 3.14, 0], 1.2, 0.25)
  set_standard_digital_out(4, True)
  while (get_standard_digital_in(2) == False):
    sync()
  end
  sleep(1.5)
  rq_close()
end
"""
    found = follow_urscript(text, "demo.script", np.eye(4), LIMITS)
    first, second, out, wait, sleep = found.commands
    assert isinstance(first, Motion)
    assert first.speeds.axis_velocity == (0.5,) * 6
    assert first.speeds.axis_acceleration == (0.5,) * 6
    assert first.blend is not None
    assert first.blend.distance == 0.05
    assert isinstance(second, Motion)
    assert (second.speeds.velocity, second.speeds.acceleration) == (0.25, 1.2)
    assert second.payload is not None
    assert second.payload.mass == 3.5
    assert isinstance(out, SetOutput)
    assert (out.number, out.value) == (5, True)
    assert isinstance(wait, WaitForCondition)
    assert wait.condition == "$IN[3]"
    assert isinstance(sleep, StandStill)
    assert sleep.seconds == 1.5
    assert "rq_close isn't known" in str(found.notes[0])


@pytest.mark.parametrize(
    ("line", "sentence"),
    [
        ("servoj([0,0,0,0,0,0])", "demo.script:2:1: servoj may move the robot and isn't read"),
        ("movec(p[0,0,0,0,0,0], p[0,0,0,0,0,0])", "movec may move the robot"),
        ("if x == 1:", "if isn't read: give the straight sequence of moves"),
        ("movej([0,0,0,0,0,0], t=2)", "a move in a given time t isn't read"),
        ("movej([0,0,0])", "a move goes to six joint values or a pose"),
        ("movel([0,0,0,0,0,0])", "a move goes to a pose"),
        ("movej(nobody)", "'nobody' has no value here"),
        ("movej([0,0,0,0,0,1e400])", "must be finite"),
        ("movej([0,0,0,0,0,0], v=0)", "a and v must be above 0"),
        ("movej([0,0,0,0,0,0], speed=1)", "known arguments are q, a, v, t, r"),
        ("sleep(-1)", "it must be in 0 .. 604800 s"),
        ("set_digital_out(1, 2)", "an output takes its number and True or False"),
        ("movej([0,0", "isn't URScript"),
    ],
)
def test_what_may_move_and_is_not_read_is_refused_with_its_line(line: str, sentence: str) -> None:
    with pytest.raises(KrlError) as error:
        follow_urscript(f"def demo():\n{line}\nend", "demo.script", np.eye(4), LIMITS)
    assert sentence in str(error.value)


def test_the_commands_of_the_terminal(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "visit.script"
    stations = ["--stations", "pick", "home"]
    assert main(["krl", "export", "ur10e_bench", "-o", str(script), *stations]) == 0
    assert [one.name for one in tmp_path.iterdir()] == ["visit.script"]
    assert main(["krl", "import", str(script), "--cell", "ur10e_bench"]) == 0
    assert "free of violations" in capsys.readouterr().out


@pytest.mark.parametrize(("radius", "stops"), [(0.0, 1), (0.05, 0)])
def test_an_output_in_a_blend_stops_nothing(radius: float, stops: int) -> None:
    """A UR sets it while it drives through; after an exact stop it stands."""
    moves = f"movej(a, r={radius})\n set_digital_out(2, True)\n movej(b)"
    text = f"def p():\n a=[0,-1.5,1.5,0,1,0]\n b=[0.4,-1.5,1.5,0,1,0]\n movej(b)\n {moves}\nend\n"
    program = follow_urscript(text, "p.script", np.eye(4), LIMITS)
    (output,) = [one for one in program.commands if isinstance(one, SetOutput)]
    assert (output.number, output.on_path) == (3, not stops)
    assert (output.switch is None) is bool(stops)


@pytest.mark.parametrize("line", ["popup(1)", "set_gravity([0,0,9.8])", "movel(p[1,0,1,0,0,0])"])
def test_what_a_script_leaves_open_is_said(line: str) -> None:
    text = f"def p():\n movej([0,-1.5,1.5,0,1,0])\n {line}\nend\n"
    (note,) = follow_urscript(text, "p.script", np.eye(4), LIMITS).notes
    assert note.place.line == 3
    assert note.effect > Effect.NONE
