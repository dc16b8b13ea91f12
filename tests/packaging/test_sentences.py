"""Code does not read sentences that are written for people: what it branches on is a code, an enum,
a typed field.
"""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SRC = Path(__file__).parents[2] / "src"
WORDS = re.compile(r"[^\W\d_]\W* \W*[^\W\d_]")  # two words with a blank between them
ASKING = {"startswith", "endswith", "removeprefix", "removesuffix"}
MEANT = {
    "long double": "a type of the interface files",
    "is unknown": "mistakes of a file are collected: what one error hides is found by its sentence",
    "; known are": "the same",
    "' is unknown": "the same",
    "from joint states": "names of checks",
    "by its plan": "names of parts of a sum",
    "line out of ": "how earlier recordings say what was blocked",
    "first feasible": "a stage says only in its note that the first path was known",
    ">cost against": "the head of a column, which a name completes",
}
"""What is compared all the same, and why."""


def words_read(tree: ast.Module) -> Iterator[tuple[int, str]]:
    """Line and text of each literal of several words that a comparison, or a look at the beginning
    or end of a text, depends on; also by a constant of the module.
    """
    named = {
        target.id: node.value
        for node in tree.body
        if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant | ast.JoinedStr)
        for target in node.targets
        if isinstance(target, ast.Name)
    }
    for node in ast.walk(tree):
        asked: list[ast.expr] = []
        if isinstance(node, ast.Compare):
            asked = [node.left, *node.comparators]
        elif isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute):
            asked = node.args if node.func.attr in ASKING else []
        elif isinstance(node, ast.MatchValue):
            asked = [node.value]
        for one in asked:
            value = named.get(one.id, one) if isinstance(one, ast.Name) else one
            for text in _literals(value):
                if WORDS.search(f"{text}"):
                    yield one.lineno, text


def _literals(node: ast.expr) -> Iterator[str]:
    if isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.value
    elif isinstance(node, ast.JoinedStr):
        for part in node.values:
            yield from _literals(part)
    elif isinstance(node, ast.Tuple | ast.List | ast.Set):
        for part in node.elts:
            yield from _literals(part)


@pytest.mark.parametrize(
    "source",
    [
        'if "too near" in reason: pass',
        'if reason.startswith(("torque", "not proved")): pass',
        'HEAVY = "the load is too heavy"\nif HEAVY in message: pass',
        'reason = sentence.removesuffix("; stopped on the path")',
        'match reason:\n    case "at the pose": pass',
    ],
)
def test_a_sentence_that_is_read_is_found(source: str) -> None:
    assert list(words_read(ast.parse(source)))


def test_codes_and_layouts_are_no_sentences() -> None:
    source = 'if kind == "PAUSE" or line.startswith("  ") or unit in ("m/s", "rad"): pass'
    assert not list(words_read(ast.parse(source)))


def test_no_branch_depends_on_the_wording_of_a_sentence() -> None:
    found = [
        f"{path.relative_to(SRC)}:{line}: {text!r}"
        for path in sorted(SRC.rglob("*.py"))
        if "build" not in path.parts
        for line, text in words_read(ast.parse(path.read_text()))
        if text not in MEANT
    ]
    assert not found
