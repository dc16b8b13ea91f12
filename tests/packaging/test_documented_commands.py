"""Every command line of `ir` in README and docs is one that `ir` understands."""

from __future__ import annotations

import argparse
import re
import shlex
from collections.abc import Iterator
from functools import cache
from importlib import import_module
from itertools import takewhile
from pathlib import Path

import pytest

from ir_cli.main import COMMAND_MODULES

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINE = re.compile(r"^(?: {4}|\$ )?(?:\.venv/bin/)?ir ([a-z].*)$")
FENCE = re.compile(r"^```(bash|sh|)$")
OPERATORS = frozenset({"|", ">", ">>", "&", "&&"})
ABSENT = ("[", "…", "...", "COMMAND")  # of lines that show a pattern, not a command


def command_lines(page: Path) -> Iterator[list[str]]:
    """Words of the lines in code that call `ir`, without comments, pipes and redirections."""
    fenced = shell = False
    lines = iter(page.read_text("utf-8").splitlines())
    for line in lines:
        if line.startswith("```"):
            fenced, shell = not fenced, FENCE.match(line) is not None
        found = LINE.match(line)
        if found is None or (fenced and not shell) or not (fenced or line.startswith("    ")):
            continue
        command = found.group(1)
        while command.count('"') % 2:  # a quoted text of several lines
            command += "\n" + next(lines)
        words = list(takewhile(lambda word: word not in OPERATORS, shlex.split(command, comments=True)))
        if not any(mark in word for mark in ABSENT for word in words):
            yield words


@cache
def parser_of(command: str) -> argparse.ArgumentParser:
    """The parser of a command, as `ir` makes it."""
    parser = argparse.ArgumentParser(prog="ir", exit_on_error=False)
    import_module(COMMAND_MODULES[command]).add_commands(parser.add_subparsers())
    return parser


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_is_understood(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = []
    for words in command_lines(page):
        line = " ".join(words)
        if words[0] not in COMMAND_MODULES:
            wrong.append(line)
            continue
        try:
            parser_of(words[0]).parse_args(words)
        except (SystemExit, argparse.ArgumentError) as refused:
            wrong.append(f"{line}: {refused} {capsys.readouterr().err.strip().splitlines()[-1:]}")
    assert wrong == []


def test_there_are_commands_to_look_at() -> None:
    assert sum(len(list(command_lines(page))) for page in PAGES) > 60
