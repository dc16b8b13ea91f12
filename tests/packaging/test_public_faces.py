"""What users of a package may import: the names of its `__all__`, sorted, all there, and none
forgotten.
"""

from __future__ import annotations

import ast
import importlib
import subprocess
import sys
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"
PACKAGES = sorted(
    setup.parent.name
    for setup in SRC.glob("*/setup.py")
    if "__all__" in (setup.parent / setup.parent.name / "__init__.py").read_text(encoding="utf-8")
)


MACHINERY = ("__future__", "typing", "ir_values.faces")
LAZY = sorted(
    ".".join(face.relative_to(SRC).parent.parts[1:])
    for face in SRC.glob("*/ir_*/**/__init__.py")
    if "= on_first_use(" in face.read_text(encoding="utf-8")
)


def order(name: str) -> tuple[int, str]:
    """Constants, then classes, then functions, each by the alphabet."""
    return (0 if name.isupper() else 1 if name[0].isupper() else 2, name)


def imported(package: str) -> set[str]:
    """Public names that the `__init__` takes from its modules."""
    tree = ast.parse((SRC / package / package / "__init__.py").read_text(encoding="utf-8"))
    return {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
        if not (alias.asname or alias.name).startswith("_") and node.module not in MACHINERY
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


@pytest.mark.parametrize("package", LAZY)
def test_a_face_imports_on_first_use_what_it_tells_type_checkers(package: str) -> None:
    face = importlib.import_module(package)
    assert face.__file__ is not None
    nodes = list(ast.walk(ast.parse(Path(face.__file__).read_text(encoding="utf-8"))))
    told = {
        node.module: tuple(alias.name for alias in node.names)
        for node in nodes
        if isinstance(node, ast.ImportFrom) and node.module not in MACHINERY
    }
    calls = [node for node in nodes if isinstance(node, ast.Call)]
    assert [ast.literal_eval(call.args[1]) for call in calls if len(call.args) == 2] == [told]
    assert set(face.__all__) <= set(dir(face))
    for home, names in told.items():
        for name in names:
            assert getattr(face, name) is getattr(importlib.import_module(str(home)), name)
    with pytest.raises(AttributeError, match=f"module '{package}' has no attribute 'nothing'"):
        face.nothing  # noqa: B018


def test_the_planner_is_imported_when_it_is_named_and_the_flexible_cell_when_it_plans_one() -> None:
    script = (
        "import sys, ir_planner\n"
        "assert not {'numpy', 'ir_planner.planner'} & sys.modules.keys()\n"
        "planner = ir_planner.Planner('demo')\n"
        "assert not {'highspy', 'ir_planner.flexible.steady_plan'} & sys.modules.keys()\n"
        "assert ir_planner.SteadyPlan.__module__ in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", script], check=True)
