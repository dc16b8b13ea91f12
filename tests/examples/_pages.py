"""Snippets of a page of the documentation, in their order, and how a reader follows them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
_BLOCK = re.compile(r"^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
_FAILS = re.compile(r"\s*# exit code (\d+)$")


@dataclass(frozen=True)
class Snippet:
    """A fenced block: its language and its lines."""

    language: str
    text: str


@dataclass(frozen=True)
class Command:
    """A command line of `ir`, without the word, and the exit code that the page states."""

    words: str
    code: int


def snippets(page: str) -> list[Snippet]:
    """All blocks of a page."""
    return [Snippet(*found) for found in _BLOCK.findall((DOCS / page).read_text("utf-8"))]


def commands(text: str) -> list[Command]:
    """The lines of a block that call `ir`."""
    found = []
    for line in text.splitlines():
        code = _FAILS.search(line)
        words = _FAILS.sub("", line).partition("  #")[0].strip()
        if words.startswith("ir "):
            found.append(Command(words.removeprefix("ir "), int(code.group(1)) if code else 0))
    return found


def patched(text: str, diff: str) -> str:
    """The text with the lines that a diff adds and without those that it removes."""
    before = "".join(f"{line[1:]}\n" for line in diff.splitlines() if line[:1] in " -")
    after = "".join(f"{line[1:]}\n" for line in diff.splitlines() if line[:1] in " +")
    assert text.count(before) == 1, f"the page changes what is not there once: {before}"
    return text.replace(before, after)
