"""The recorder's rooms know each other in one direction, and each shows a public face."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

import ir_recorder

FOLDER = Path(ir_recorder.__file__).parent
READING = {"errors", "format", "reading"}
KNOWS = {
    "errors": set(),
    "format": {"errors"},
    "arguments": set(),
    "recording": {"errors", "format"},
    "reading": {"errors", "format"},
    "play": READING | {"arguments"},
    "traces": {"errors", "reading"},
    "measure": {"errors", "traces"},
    "fit": {"analysis", "errors", "measure", "reading", "report", "traces"},
    "analysis": READING | {"measure", "traces"},
    "report": READING | {"analysis", "measure"},
    "live": {"analysis", "errors", "reading", "report"},
    "report_main": READING | {"analysis", "arguments", "report", "traces"},
    "node": {"arguments", "errors", "format", "recording"},
    "__init__": READING | {"analysis"},
}
ROOMS = [path.parent.name for path in sorted(FOLDER.glob("*/__init__.py"))]


def own_imports(module: Path) -> Iterator[str]:
    """Rooms of this package that a module imports, its own aside."""
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        if (
            isinstance(node, ast.ImportFrom)
            and node.module
            and node.module.startswith("ir_recorder.")
        ):
            yield node.module.split(".")[1]
        elif isinstance(node, ast.ImportFrom) and node.module == "ir_recorder":
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize(
    "module", sorted(FOLDER.rglob("*.py")), ids=lambda p: str(p.relative_to(FOLDER))
)
def test_a_room_knows_only_those_below_it(module: Path) -> None:
    room = module.relative_to(FOLDER).parts[0].removesuffix(".py")
    assert set(own_imports(module)) <= KNOWS[room] | {room}


def test_no_two_rooms_know_each_other() -> None:
    done: set[str] = set()
    while len(done) < len(KNOWS):
        ready = {room for room, below in KNOWS.items() if room not in done and below <= done}
        assert ready, f"a circle among {sorted(set(KNOWS) - done)}"
        done |= ready


@pytest.mark.parametrize("room", ROOMS)
def test_a_room_has_a_first_line_and_shows_what_may_be_used(room: str) -> None:
    module = import_module(f"ir_recorder.{room}")
    assert module.__doc__
    assert module.__all__ == sorted(module.__all__)
    assert all(hasattr(module, name) for name in module.__all__)


def test_the_reports_room_names_its_modules() -> None:
    """A stranger who looks for a page finds there which module makes it."""
    folder = FOLDER / "report"
    said = import_module("ir_recorder.report").__doc__ or ""
    modules = {path.stem for path in folder.glob("*.py")} - {"__init__"}
    assert {name for name in modules if f"`{name}`" not in said} == set()
