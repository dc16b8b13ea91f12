"""What users of a package may import: the names of its `__all__`, sorted, all there, and none
forgotten.
"""

from __future__ import annotations

import ast
import importlib
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"
PACKAGES = sorted(
    setup.parent.name
    for setup in SRC.glob("*/setup.py")
    if "__all__" in (setup.parent / setup.parent.name / "__init__.py").read_text(encoding="utf-8")
)


def order(name: str) -> tuple[int, str]:
    """Constants, then classes, then functions, each by the alphabet."""
    return (0 if name.isupper() else 1 if name[0].isupper() else 2, name)


def imported(package: str) -> set[str]:
    """Public names that the `__init__` takes from its modules."""
    tree = ast.parse((SRC / package / package / "__init__.py").read_text(encoding="utf-8"))
    return {
        alias.asname or alias.name
        for node in tree.body
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if not (alias.asname or alias.name).startswith("_") and node.module != "__future__"
    }


def test_packages_have_a_face_but_for_the_vocabulary_whose_modules_are_imported_by_name() -> None:
    assert {"ir_description", "ir_kernels", "ir_planner", "ir_recorder"} <= set(PACKAGES)
    assert not {"ir_msgs_py", "ir_values"} & set(PACKAGES)


@pytest.mark.parametrize("package", PACKAGES)
def test_the_face_is_sorted_there_and_complete(package: str) -> None:
    face = importlib.import_module(package)
    assert face.__all__ == sorted(face.__all__, key=order)
    assert [name for name in face.__all__ if not hasattr(face, name)] == []
    assert imported(package) <= set(face.__all__), "imported but not in __all__"


@pytest.mark.parametrize("package", PACKAGES)
def test_the_face_says_what_it_is(package: str) -> None:
    face = importlib.import_module(package)
    assert face.__doc__
    assert face.__doc__.strip()
