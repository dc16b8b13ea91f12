"""The command lines of `ir` in README and docs, and which of them are not run by the walk through a
page.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
LINE = re.compile(r"^(?: {4}|\$ )?(?:\.venv/bin/)?(ir [a-z].*)$")
FENCE = re.compile(r"^```(bash|sh|)$")
OPERATORS = frozenset({"|", ">", ">>", "&", "&&"})
ABSENT = ("[", "…", "...", "COMMAND")  # of lines that show a pattern, not a command

NODES = "needs running nodes"
NOT_RUN = {
    r"(ros up|demo)\b.*": "starts nodes: tests/system/test_readme.py, tests/system/test_demo.py",
    r"ros (call|echo|list|send_goal|front|live)\b.*": f"{NODES}: tests/system/test_readme.py, "
    "tests/system",
    r"ask move .* --planner .*": "needs its package: tests/cli/test_new_search.py",
    r"view\b.*": "waits for a browser until Ctrl-C: tests/cli/test_view.py",
    r"study .* --scheduler .*": "needs a cluster: tests/studies",
    r"(study layout layout|study statistics statistics|study arena arena).yaml -o "
    r".*": "minutes: tests/studies",
    r"study arena --quick": "two minutes: tests/cli/test_arena_command.py, tests/studies",
    r"energy fit (run\.mcap|joints\.csv|run_1\.csv) "
    r".*": "needs a meter: tests/recorder/test_measuring_page.py",
    r"energy excite .*": "takes minutes: tests/recorder/test_measuring_page.py, shorter",
    r"energy (drive|fit) "
    r"out/excitation.*": "follows from excite: tests/recorder/test_measuring_page.py",
    r".* --power-parameters "
    r"out/press_line_2.yaml": "follows from fit: tests/recorder/test_measuring_page.py",
}
"""Command lines that the walk leaves out, as patterns, and why: where they are tried instead."""

FOLLOWED = {"tutorial.md": "tests/examples/test_tutorial.py"}
"""Pages that a test of their own follows, with what the reader types."""

SNIPPETS = {
    "README.md": "run: tests/system/test_readme.py",
    "cad.md": "run: tests/packaging/test_documented_commands_run.py",
    "cartesian.md": "run: tests/examples/test_cartesian_page.py",
    "compare.md": "run: tests/packaging/test_documented_commands_run.py",
    "extending.md": "a signature: tests/cli/test_new_search.py",
    "krl.md": "run: tests/examples/test_krl_page.py",
    "library.md": "run: tests/examples/test_library_page.py",
    "recording.md": "run: tests/recorder/test_documentation.py",
    "studies.md": "minutes: tests/studies",
}
"""Pages with snippets of Python, and what runs them."""


@dataclass(frozen=True)
class Line:
    """A line of a page: for the shell, and the words of each command of `ir` in it."""

    shell: str
    commands: tuple[tuple[str, ...], ...]

    @property
    def reason(self) -> str:
        """Why it is not run; empty: it is."""
        texts = [" ".join(words) for words in self.commands]
        found = (
            why
            for pattern, why in NOT_RUN.items()
            for text in texts
            if re.fullmatch(pattern, text, re.S)
        )
        return next(found, "")


def lines(page: Path) -> Iterator[Line]:
    """The lines in code that call `ir`."""
    fenced = False
    shell = False
    rest = iter(page.read_text("utf-8").splitlines())
    for line in rest:
        if line.startswith("```"):
            fenced = not fenced
            shell = FENCE.match(line) is not None
        found = LINE.match(line)
        if found is None or (fenced and not shell) or not (fenced or line.startswith("    ")):
            continue
        text = found.group(1)
        while text.count('"') % 2:  # a quoted text of several lines
            text += "\n" + next(rest)
        commands = tuple(_commands(shlex.split(text, comments=True)))
        if not any(mark in word for mark in ABSENT for words in commands for word in words):
            yield Line(text, commands)


def _commands(words: list[str]) -> Iterator[tuple[str, ...]]:
    """The words of every `ir` of a line, without pipes and redirections."""
    for k, word in enumerate(words):
        if word == "ir" and (k == 0 or words[k - 1] in OPERATORS):
            own = words[k + 1 :]
            end = next((n for n, each in enumerate(own) if each in OPERATORS), len(own))
            yield tuple(own[:end])


def walked(page: Path) -> list[Line]:
    """The lines of a page that the walk runs."""
    return [] if page.name in FOLLOWED else [line for line in lines(page) if not line.reason]
