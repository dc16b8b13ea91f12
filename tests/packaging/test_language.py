"""One vocabulary: words that the project does not use, in names, comments, texts and documentation."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Word:
    """A word (regular expression), what is written instead, and the phrases in which it stays."""

    pattern: str
    instead: str
    allowed: tuple[str, ...] = ()


WORDS = (
    Word(
        "ways?",
        "path; homotopy class; obstructing; method",
        (
            "either way",
            "one way",
            "by way of",
            "(in )?the same way(?! round)",
            "under way",
            "in (many|two) ways",
        ),
    ),
    Word("pac(e|es|ed|ing)", "time scaling; speed profile"),
    Word("drafts?|drafted|drafting", "coarse solution"),
    Word("retreat(s|ed|ing)?", "retract; withdrawal"),
    Word("drawn back", "retracted"),
    Word("dips?", "local minimum"),
    Word("wish(es|ed)?", "requested"),
    Word("burnt", "dissipated", ("burnt_energy", "burnt_power")),  # fields of messages
    Word("(go|goes|going|gone|went) down", "descend; be optimised"),
    Word("dear", "expensive"),
    Word("guilty", "violating"),
    Word("hopeless", "infeasible"),
    Word("tells?|telling|told", "state; report; notify", (r"\w+\.tell\(\)",)),  # a file's position
    Word("(more|less|enough|no|little|leaves?|leaving) room", "margin"),
    Word("then prove it", "run the tests"),
)

SUFFIXES = {
    ".py",
    ".cpp",
    ".hpp",
    ".js",
    ".html",
    ".css",
    ".sh",
    ".toml",
    ".xml",
    ".md",
    ".yaml",
    ".msg",
    ".srv",
    ".action",
}
TREES = ("src", "tests", "benchmarks", "tools", "examples", "ros_ws", "docs", "docker")
PAGES = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "Makefile")
GENERATED = {"build", "install", "log", "__pycache__", "egg-info"}

GAP = r"[\s#/*_-]+"  # between two words: also the end of a commented line, or an underscore
CAMEL = re.compile(r"(?<=[a-z0-9])(?=[A-Z])")


def compiled(word: Word) -> re.Pattern[str]:
    """Matches the allowed phrases first, so that only what is left is in the group `found`."""
    allowed = "|".join(word.allowed).replace(" ", GAP)
    found = word.pattern.replace(" ", GAP)
    edges = r"(?<![a-z])(?:{})(?![a-z])"
    fine = f"{edges.format(allowed)}|" if allowed else ""
    return re.compile(f"{fine}(?P<found>{edges.format(found)})", re.IGNORECASE)


PATTERNS = tuple((word, compiled(word)) for word in WORDS)


def prose(path: Path) -> str:
    """Text of a file; names in `backticks` of a page are left to the files that hold them."""
    text = path.read_text("utf-8")
    return re.sub(r"`[^`\n]+`|\]\([^)\s]+\)", "``", text) if path.suffix == ".md" else text


def unwanted(text: str) -> Iterator[str]:
    """Each unwanted word of a text, as 'line: word (write: ...)'; CamelCase and snake_case count as words."""
    words = CAMEL.sub(" ", text)
    for word, pattern in PATTERNS:
        for match in pattern.finditer(words):
            if match["found"]:
                line = words.count("\n", 0, match.start()) + 1
                yield f"{line}: {match['found']!r} (write: {word.instead})"


def sources() -> list[Path]:
    """Files whose words are read."""
    found = [path for tree in TREES for path in (ROOT / tree).rglob("*") if path.suffix in SUFFIXES]
    written = [path for path in found if not GENERATED.intersection(path.relative_to(ROOT).parts)]
    written.remove(Path(__file__).resolve())  # it holds the words
    return sorted(written) + [ROOT / page for page in PAGES]


def test_only_words_of_the_field_are_used() -> None:
    read = sources()
    assert len(read) > 500, "too few files: nothing was checked"
    found = [f"{path.relative_to(ROOT)}:{each}" for path in read for each in unwanted(prose(path))]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "text",
    [
        "the pair in the way",
        "def _best_pace() -> None:",
        "class WayOut:",
        "path and time go\n    # down together",
        "the same way round",
        "watts burnt in the resistor",
        "_HOPELESS = 3",
        "told = []",
        "a pair that gets more room",
    ],
)
def test_an_unwanted_word_is_found(text: str) -> None:
    assert len(list(unwanted(text))) == 1


@pytest.mark.parametrize(
    "text",
    [
        "always halfway",
        "Dependencies point one way",
        "burnt_energy=0.0",
        "log.tell()",
        "endear",
        "by\n# way of",
    ],
)
def test_other_words_are_left_alone(text: str) -> None:
    assert list(unwanted(text)) == []
