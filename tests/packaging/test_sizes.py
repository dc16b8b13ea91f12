"""A module is a page about one idea: nobody has to scroll through another idea to find it."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODULE_MAX = 300  # lines
FUNCTION_MAX = 40  # lines, its docstring included
REASON = "# long:"  # on the line of the def: why this one is longer


def modules() -> list[Path]:
    """What people read to understand the project: its packages, benchmarks and tools."""
    return sorted(path for folder in ("src", "benchmarks", "tools") for path in (ROOT / folder).rglob("*.py"))


def functions(module: Path) -> Iterator[tuple[str, int, int]]:
    """Name, first line and length of every function that gives no reason for its length."""
    text = module.read_text(encoding="utf-8")
    lines = text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef) and node.end_lineno is not None:
            head = lines[node.lineno - 1 : node.body[0].lineno]
            if not any(REASON in line and line.partition(REASON)[2].strip() for line in head):
                yield node.name, node.lineno, node.end_lineno - node.lineno + 1


def test_the_walk_finds_modules_and_functions() -> None:
    assert len(modules()) > 300
    assert sum(1 for module in modules() for _ in functions(module)) > 1500


@pytest.mark.parametrize("suffixes", [("*.py",), ("*.cpp", "*.hpp")])
def test_no_module_is_longer_than_a_page(suffixes: tuple[str, ...]) -> None:
    files = [
        path
        for folder in ("src", "benchmarks", "tools")
        for suffix in suffixes
        for path in (ROOT / folder).rglob(suffix)
        if "build" not in path.parts
    ]
    assert files
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in files}
    long = [f"{path.relative_to(ROOT)}: {n} lines" for path, n in sorted(lengths.items()) if n > MODULE_MAX]
    assert long == []


def test_no_function_is_longer_than_a_screen_without_a_reason() -> None:
    long = [
        f"{module.relative_to(ROOT)}:{line} {name}: {length} lines"
        for module in modules()
        for name, line, length in functions(module)
        if length > FUNCTION_MAX
    ]
    assert long == []
