"""The completion script proposes what the commands know, as bash asks for it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from ir_cli.main import COMMAND_MODULES, main

ASK = """
source "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
_ir
printf '%s\\n' "${COMPREPLY[@]}"
"""


@pytest.fixture
def completed(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    assert main(["completion"]) == 0
    script = tmp_path / "completion.bash"
    script.write_text(capsys.readouterr().out)

    def complete(*words: str) -> set[str]:
        asked = subprocess.run(
            ["bash", "-c", ASK, "bash", str(script), "ir", *words],
            capture_output=True,
            text=True,
            check=True,
        )
        return set(asked.stdout.split())

    return complete


def test_commands_options_and_choices_are_completed(completed) -> None:
    assert completed("") == {*COMMAND_MODULES, "--help", "--version"}
    assert completed("se") == {"send_goal"}
    assert {"--namespace", "--domain", "--cell", "-p"} <= completed("up", "-")
    assert completed("list", "t") == {"topics"}
    assert completed("cell", "ch") == {"check"}
    assert completed("call", "/x", "--fu") == {"--full"}
