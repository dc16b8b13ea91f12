"""Every command line of `ir` in README and docs is one that `ir` understands, and is run
somewhere.
"""

from __future__ import annotations

import argparse
import re
from functools import cache
from pathlib import Path

import pytest
from _documented import FOLLOWED, NOT_RUN, PAGES, ROOT, SNIPPETS, lines

from ir_cli.commands import BY_PATH, renamed, with_cell


@cache
def parser_of(command: str) -> argparse.ArgumentParser:
    """The parser of a command, as `ir` makes it."""
    return BY_PATH[command].parser()


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_command_is_understood(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    wrong = []
    for words in (words for line in lines(page) for words in line.commands):
        line = " ".join(words)
        path, count, notice = renamed(words)
        if not path or notice:
            wrong.append(f"{line}: {notice}")
            continue
        try:
            parser = parser_of(path)
            parser.parse_args(with_cell(words[count:], parser))
            said = capsys.readouterr().err
            if said:
                wrong.append(f"{line}: {said}")
        except (SystemExit, argparse.ArgumentError) as refused:
            wrong.append(f"{line}: {refused} {capsys.readouterr().err.strip().splitlines()[-1:]}")
    assert wrong == []


def test_there_are_commands_to_look_at() -> None:
    assert sum(len(line.commands) for page in PAGES for line in lines(page)) > 60


def test_what_is_not_run_has_a_reason_that_names_a_test() -> None:
    """Whatever no pattern of NOT_RUN names is run by test_documented_commands_run.py."""
    texts = [" ".join(words) for page in PAGES for line in lines(page) for words in line.commands]
    unused = [each for each in NOT_RUN if not any(re.fullmatch(each, text, re.S) for text in texts)]
    assert unused == []
    for reason in (*NOT_RUN.values(), *FOLLOWED.values(), *SNIPPETS.values()):
        named = re.findall(r"tests/[\w/.]+", reason)
        assert named, reason
        assert [name for name in named if not (ROOT / name).exists()] == []


def test_every_page_with_snippets_says_what_runs_them() -> None:
    assert {page.name for page in PAGES if "```python" in page.read_text("utf-8")} == set(SNIPPETS)
