"""Every public function that takes or gives arrays says their shapes, like `(n,)`, `(N, n)` or `(4, 4)`."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"
PACKAGES = sorted(setup.parent.name for setup in SRC.glob("*/setup.py"))
ARRAYS = {"FloatArray", "IntArray", "BoolArray"}

_PLAIN = r"(?:\d+|[A-Za-z]|[A-Z]+|None|\.\.\.)(?: ?[-+*] ?(?:\d+|[A-Za-z])| [A-Za-z])?"
_LENGTH = rf"(?:\w+ [-+*] \d+|[A-Z]_[a-z]|count|samples|{_PLAIN})"
SHAPE = re.compile(rf"\({_LENGTH},(?: {_LENGTH},?)*\)")

Function = ast.FunctionDef | ast.AsyncFunctionDef


def public_functions(tree: ast.Module) -> Iterator[tuple[str, Function, str]]:
    """Public functions and methods: name, node, and the docstrings in which shapes may stand."""
    for node in tree.body:
        if isinstance(node, Function) and not node.name.startswith("_"):
            yield node.name, node, ast.get_docstring(node) or ""
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            about = ast.get_docstring(node) or ""
            for method in node.body:
                if isinstance(method, Function) and (
                    not method.name.startswith("_") or method.name == "__init__"
                ):
                    yield f"{node.name}.{method.name}", method, f"{ast.get_docstring(method) or ''}\n{about}"


def handles_arrays(function: Function) -> bool:
    """Whether an array type stands in the signature."""
    arguments = function.args
    every = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    annotations = [argument.annotation for argument in every] + [function.returns]
    return any(
        isinstance(part, ast.Name) and part.id in ARRAYS
        for annotation in annotations
        if annotation is not None
        for part in ast.walk(annotation)
    )


def shapeless(source: str) -> list[tuple[int, str]]:
    """Lines and names of the public array functions without a shape."""
    return [
        (function.lineno, name)
        for name, function, text in public_functions(ast.parse(source))
        if handles_arrays(function) and not SHAPE.search(text)
    ]


@pytest.mark.parametrize("package", PACKAGES)
def test_array_functions_say_their_shapes(package: str) -> None:
    found = [
        f"{path.relative_to(SRC)}:{line} {name}"
        for path in sorted((SRC / package / package).rglob("*.py"))
        for line, name in shapeless(path.read_text(encoding="utf-8"))
    ]
    assert found == []


@pytest.mark.parametrize(
    "shape", ["(n,)", "(N, n)", "(4, 4)", "(K - 3,)", "(2 n,)", "(..., n)", "(S, n, 6)", "(count - 3,)"]
)
def test_shapes_are_recognised(shape: str) -> None:
    assert shapeless("def f(q: FloatArray) -> None:\n    '''Points.'''") == [(1, "f")]
    assert not shapeless(f"def f(q: FloatArray) -> None:\n    '''Points {shape} [m].'''")
    assert not shapeless(f"class A:\n    '''Of q {shape}.'''\n    def f(self) -> tuple[FloatArray, int]: ...")


@pytest.mark.parametrize("words", ["(low, high)", "()", "(see below)", "(paper, eq. 5)"])
def test_other_words_in_parentheses_are_no_shapes(words: str) -> None:
    assert shapeless(f"def f(q: 'list[int]', p: IntArray) -> None:\n    '''Points {words}.'''") == [(1, "f")]
