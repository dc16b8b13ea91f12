"""docs/tutorial.md, followed to the letter: every command, every line typed, and the cell that
comes out.
"""

from __future__ import annotations

import shlex
from collections.abc import Callable
from pathlib import Path

import pytest
from _pages import Command, commands, patched, snippets

from ir_cli.main import main

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
PLANS = ("plan", "ask")  # of its commands: the others make and check files


def followed(
    folder: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    asked: Callable[[Command], bool],
) -> int:
    """Everything is typed, and the commands that are asked for are called: how many these are."""
    monkeypatch.chdir(folder)
    typed = Path("first_cell.yaml")
    said = ""
    count = 0
    typed.write_text("")
    for snippet in snippets("tutorial.md"):
        if snippet.language == "yaml":
            typed.write_text(typed.read_text() + snippet.text)
        elif snippet.language == "diff":
            added = [line[1:].strip() for line in snippet.text.splitlines() if line[0] == "+"]
            assert [line for line in added if line not in said] == []
            typed.write_text(patched(typed.read_text(), snippet.text))
        for command in filter(asked, commands(snippet.text)):
            code = main(shlex.split(command.words))
            said = capsys.readouterr().out
            assert code == command.code, f"ir {command.words}: {said}"
            count += 1
    assert typed.read_text() == (EXAMPLES / "first_cell.yaml").read_text()
    return count


def test_who_types_the_tutorial_gets_the_cell_and_what_its_checks_say(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def makes_or_checks(command: Command) -> bool:
        return command.words.split()[0] not in PLANS

    assert followed(tmp_path, monkeypatch, capsys, makes_or_checks) == 5


@pytest.mark.long
def test_who_follows_the_tutorial_gets_a_cell_that_plans(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert followed(tmp_path, monkeypatch, capsys, lambda command: True) == 12
