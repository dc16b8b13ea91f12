"""Sub-packages ("rooms") know each other in one direction, through their public faces, without a
cycle.
"""

from __future__ import annotations

import ast
import importlib
from functools import cache
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"

# From the ground up: a room knows only those before it. A name without a folder is a module of the
# package.
ROOMS = {
    "ir_planner": (
        "errors", "presentation", "cycle", "curves", "scene", "request", "checks", "configurations", "timing", "search", "optimize",  # noqa: E501
        "cartesian", "regional", "trajectories", "service", "settings", "program", "store",
        "current_cell", "validity", "state_queries", "waiting_postures", "flexible", "planner",
        "krl", "robots", "before_after", "what_if_table", "node", "contract",
    ),
    "ir_description": (
        "poses", "shapes", "robot", "cell", "files", "library",
        "cell_review",
    ),
    "ir_sim_driver": (
        "errors", "emergency_stop", "notices", "plant", "power", "load_check", "motion", "plc",
        "controller", "node", "contract",
    ),
}  # fmt: skip


@cache
def imported(package: str, module: Path) -> list[tuple[str, str, int]]:
    """Rooms of the package that a module imports: room, what follows its name ("": its face),
    line.
    """
    found = []
    for node in ast.walk(ast.parse(module.read_text(encoding="utf-8"))):
        names = [node.module] if isinstance(node, ast.ImportFrom) and node.level == 0 else []
        if names == [package]:
            inside = [alias.name for alias in node.names if alias.name in ROOMS[package]]
            names = [f"{package}.{room}" for room in inside]
        names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        for name in names:
            top, _, rest = (name or "").partition(".")
            if top == package and rest:
                room, _, inner = rest.partition(".")
                found.append((room, inner, node.lineno))
    return found


def modules(package: str) -> list[tuple[str, Path]]:
    """Every module of the package with its room; the package's own face is above all rooms."""
    base = SRC / package / package
    inside = [
        (path, path.relative_to(base).parts[0].removesuffix(".py")) for path in base.rglob("*.py")
    ]
    return sorted((room, path) for path, room in inside if room != "__init__")


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_every_module_is_in_a_known_room(package: str) -> None:
    assert {room for room, _ in modules(package)} == set(ROOMS[package])


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_rooms_know_only_those_below_them(package: str) -> None:
    height = {room: k for k, room in enumerate(ROOMS[package])}
    upward = [
        f"{path.relative_to(SRC)}:{line} knows {other}"
        for room, path in modules(package)
        for other, _, line in imported(package, path)
        if height.get(other, len(height)) > height[room]
    ]
    assert upward == []


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_other_rooms_are_entered_by_their_face(package: str) -> None:
    past = [
        f"{path.relative_to(SRC)}:{line} {other}.{inner}"
        for room, path in modules(package)
        for other, inner, line in imported(package, path)
        if other != room and inner
    ]
    assert past == []


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_modules_of_one_room_form_no_cycle(package: str) -> None:
    knows: dict[str, set[str]] = {}
    for room, path in modules(package):
        here = f"{room}.{path.stem}"
        knows[here] = {
            f"{other}.{inner}" for other, inner, _ in imported(package, path) if other == room
        }
    while knows:
        ground = {module for module, others in knows.items() if not others & knows.keys()}
        assert ground, f"a cycle runs through {sorted(knows)}"
        knows = {module: others for module, others in knows.items() if module not in ground}


@pytest.mark.parametrize("package", sorted(ROOMS))
def test_every_face_says_what_it_is_and_names_what_it_offers(package: str) -> None:
    for room in ROOMS[package]:
        if not (SRC / package / package / room).is_dir():
            continue
        face = importlib.import_module(f"{package}.{room}")
        assert face.__doc__, room
        first = face.__doc__.split("\n\n")[0].rstrip()
        assert first.endswith("."), f"{package}.{room}: it begins with a sentence"
        assert sorted(set(face.__all__)) == sorted(face.__all__), room
        for name in face.__all__:
            assert hasattr(face, name), f"{package}.{room} has no {name}"
