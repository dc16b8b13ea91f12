"""The names of the commands, their help, and the names that they had."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from ir_cli.commands import (
    BY_PATH,
    COMMANDS,
    GROUPS,
    IMPLIED,
    NAMES,
    OLD,
    QUIET,
    first_page,
    renamed,
)
from ir_cli.main import main

PAGE = Path(__file__).resolve().parents[2] / "docs" / "commands.md"


def test_the_first_page_has_few_names() -> None:
    assert len({name.split()[0] for name in NAMES}) <= 16
    assert all(f"  {name} " in first_page() for name in NAMES)


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command.path)
def test_every_help_has_a_sentence_and_an_example(
    command, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as ended:
        main([*command.path.split(), "--help"])
    assert ended.value.code == 0
    said = " ".join(capsys.readouterr().out.split())
    assert command.about in said
    assert command.about.endswith(".")
    assert said.endswith(f"example: {' '.join(command.example.split())}")
    if command.path != "completion":
        words = re.findall(r"'[^']*'|\S+", command.example)[1:]
        path, count, notice = renamed(words)
        assert (path, notice) == (command.path, "")
        assert command.parser().parse_args([word.strip("'") for word in words[count:]]).run


@pytest.mark.parametrize("group", GROUPS)
def test_a_group_lists_its_commands(group: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([group, "--help"]) == 0
    said = capsys.readouterr().out
    assert all(f"  {each.path} " in said for each in COMMANDS if each.group == group)
    assert main([group, "nothing"]) == 2
    assert f"no command {group} nothing" in capsys.readouterr().err


def test_old_names_run_with_a_notice(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ik", "open", "X 1.5 Y 0 Z 1 A 0 B 90 C 0"]) == 0
    assert capsys.readouterr().err == "ir: `ir ik` is now `ir ask ik`\n"
    assert main(["check", "open", "home", "--pairs", "1"]) == 0
    said = "ir: `ir check CELL STATE` is now `ir ask state CELL STATE`\n"
    assert capsys.readouterr().err == said
    assert main(["cell", "check", "open"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("old", [old for old in OLD if old not in QUIET])
def test_every_old_name_leads_to_a_command(old: str) -> None:
    path, count, notice = renamed([*old.split(), "x"])
    assert path in BY_PATH
    assert (count, notice.count("\n")) == (len(old.split()), 1)


def test_old_names_of_options_run_with_a_notice(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    trace = tmp_path / "t.csv"
    assert main(["ask", "move", "open", "home", "park", "--trajectory", str(trace)]) == 0
    assert capsys.readouterr().err == "ir: --trajectory is now --output\n"
    assert trace.exists()


def test_the_cell_has_one_option_everywhere(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["ask", "state", "home", "--cell", "open"]) == 0
    first = capsys.readouterr().out
    assert main(["ask", "state", "open", "home"]) == 0
    assert capsys.readouterr().out == first


def test_the_page_has_every_old_and_new_name() -> None:
    text = PAGE.read_text("utf-8")
    for old, new in OLD.items():
        now = f"{new} {IMPLIED.get(old, '')}".strip()
        assert f"| `ir {old}` | `ir {now}` |" in text
