"""The completion script proposes what the commands know, as bash asks for it."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from ir_cli.commands import NAMES
from ir_cli.main import main

ASK = """
source "$1"
shift
COMP_WORDS=("$@")
COMP_CWORD=$(($# - 1))
COMPREPLY=()
_shtab_ir ir "${COMP_WORDS[COMP_CWORD]}" "${COMP_WORDS[COMP_CWORD-1]}"
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
    assert {name for name in NAMES if " " not in name} <= completed("")
    assert "send_goal" in completed("ros", "se")
    assert {"--namespace", "--domain", "--cell", "-p"} <= completed("ros", "up", "-")
    assert "topics" in completed("ros", "list", "t")
    assert "check" in completed("cell", "ch")
    assert "--full" in completed("ros", "call", "/x", "--fu")


@pytest.mark.parametrize("shell", ["bash", "zsh", "tcsh"])
def test_every_shell_has_a_script(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["completion", shell]) == 0
    assert "send_goal" in capsys.readouterr().out
