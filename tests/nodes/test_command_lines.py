"""The executables answer --help and words that make no sense by a sentence, and start nothing
then.
"""

from __future__ import annotations

import importlib
import subprocess
import sys

import pytest

MODULES = {
    "ir_planner": "ir_planner.node",
    "ir_sim_driver": "ir_sim_driver.node",
    "ir_program_runner": "ir_program_runner.node",
    "ir_studies": "ir_studies.node",
    "ir-record": "ir_recorder.node",
    "ir-play": "ir_recorder.play.node",
}
NODES = ("ir_planner", "ir_sim_driver", "ir_program_runner")
LIMIT = 180.0  # s; a node that starts would run for ever


def run(name: str, *words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", MODULES[name], *words],
        capture_output=True,
        text=True,
        timeout=LIMIT,
        check=False,
    )


@pytest.mark.parametrize("name", MODULES)
def test_help_helps(
    name: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Read before anything starts, so that it can be asked for in this process."""
    monkeypatch.setattr(sys, "argv", [name, "--help"])
    switched = sys.getswitchinterval()  # which the driver chooses for itself
    try:
        code = importlib.import_module(MODULES[name]).main()
    except SystemExit as ended:  # of argparse
        code = ended.code
    finally:
        sys.setswitchinterval(switched)
    assert code == 0
    assert capsys.readouterr().out.startswith(f"usage: {name} ")


@pytest.mark.parametrize("name", ["ir_program_runner"])
def test_a_word_of_nobody_is_named(name: str) -> None:
    ended = run(name, "cell:=demo")
    assert ended.returncode == 2
    assert "unknown argument 'cell:=demo'; parameters are given by --ros-args" in ended.stderr


UNREAD = ["-p", "x"], "Couldn't parse parameter override rule: '-p x'"
UNKNOWN = ["--nonsense"], "--nonsense"


@pytest.mark.parametrize(
    ("name", "words", "sentence"),
    [  # nodes read one way, commands another
        ("ir_program_runner", *UNREAD),
        ("ir-play", *UNKNOWN),
        pytest.param("ir_program_runner", *UNKNOWN, marks=pytest.mark.long),
        pytest.param("ir-play", *UNREAD, marks=pytest.mark.long),
    ],
)
def test_what_ros_cannot_read_is_a_sentence(name: str, words: list[str], sentence: str) -> None:
    file = [] if name in NODES else ["nowhere.mcap"]
    ended = run(name, *file, "--ros-args", *words)
    assert ended.returncode == 1
    assert sentence in ended.stderr
    assert "Traceback" not in ended.stderr
    assert ended.stderr.splitlines()[-1].startswith(f"{name}: ")


@pytest.mark.parametrize(
    "name", [pytest.param("ir_planner", marks=pytest.mark.long), "ir_program_runner"]
)
def test_a_parameter_of_another_type_is_one_line(name: str) -> None:
    ended = run(name, "--ros-args", "-p", "cell:=5")
    assert ended.returncode == 1
    assert "cell" in ended.stderr
    assert "'5'" in ended.stderr
    assert "Traceback" not in ended.stderr
