"""Who knows whom: dependencies point one way, and ROS and PyBullet stay behind their doors."""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterator
from functools import cache
from pathlib import Path

import pytest

SRC = Path(__file__).resolve().parents[2] / "src"

BASE_KNOWS: dict[str, set[str]] = {
    "ir_values": set(),
    "ir_msgs_py": {"ir_values"},
    "ir_kernels": {"ir_values", "ir_msgs_py"},
    "ir_description": {"ir_values", "ir_msgs_py", "ir_kernels"},
}
BASE = set(BASE_KNOWS)
LANGUAGE = {"ir_krl": BASE}
ROOMS = {"ir_planner", "ir_sim_driver", "ir_program_runner", "ir_recorder"}
KNOWS = {
    **BASE_KNOWS,
    **LANGUAGE,
    **dict.fromkeys(ROOMS, BASE),
    "ir_planner": BASE | set(LANGUAGE),
    "ir_studies": BASE | {"ir_planner", "ir_program_runner", "ir_recorder", "ir_sim_driver"},
    "ir_cli": BASE | ROOMS | set(LANGUAGE) | {"ir_studies"},
}
PROJECT = set(KNOWS)
CORE_READS_NO_CLOCK = {"ir_values", "ir_kernels", "ir_description", "ir_krl", "ir_planner"}


def modules(package: str) -> list[Path]:
    """All modules of a package."""
    return sorted((SRC / package / package).rglob("*.py"))


@cache
def parsed(module: Path) -> ast.Module:
    """The syntax of a module; many tests look at each."""
    return ast.parse(module.read_text(encoding="utf-8"))


def imports(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Names that a module imports, also inside functions and under TYPE_CHECKING, each with its
    line.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from ((alias.name, node.lineno) for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module, node.lineno


def is_ros(name: str) -> bool:
    """True for rclpy and generated messages, ir_msgs among them."""
    top = name.partition(".")[0]
    return top in (
        "rclpy",
        "ir_msgs",
        "std_srvs",
        "builtin_interfaces",
        "rcl_interfaces",
    ) or top.endswith("_msgs")


def may_know_ros(package: str, module: Path) -> bool:
    """Nodes and their rooms, parameters, the ROS side of the vocabulary; the command line knows
    all.
    """
    inside = module.relative_to(SRC / package / package)
    if package == "ir_cli":
        return True
    if package == "ir_msgs_py":
        return inside.parts[0] == "ros"
    return inside.parts[0] == "node" or module.name in ("node.py", "parameters.py")


@cache
def imports_of(module: Path) -> tuple[tuple[str, int], ...]:
    """The same of a file."""
    return tuple(imports(parsed(module)))


def violations(package: str, forbidden: object) -> list[str]:
    """Imports of the package for which forbidden(module, name) holds, as file:line name."""
    assert callable(forbidden)
    return [
        f"{module.relative_to(SRC)}:{line} {name}"
        for module in modules(package)
        for name, line in imports_of(module)
        if forbidden(module, name)
    ]


def test_every_package_has_a_place_in_the_architecture() -> None:
    assert {setup.parent.name for setup in SRC.glob("*/setup.py")} == PROJECT


@pytest.mark.parametrize("package", sorted(PROJECT))
def test_package_knows_only_those_below_it(package: str) -> None:
    allowed = KNOWS[package] | {package}

    def forbidden(module: Path, name: str) -> bool:
        top = name.partition(".")[0]
        return top in PROJECT and top not in allowed

    assert modules(package), f"{package} has no modules: nothing was checked"
    assert violations(package, forbidden) == []


def known_modules(package: str) -> dict[str, set[str]]:
    """Modules of a package by dotted name, each with the modules of the package that it imports."""
    root = SRC / package
    paths = {
        ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__"): path
        for path in modules(package)
    }
    return {name: known_by(parsed(path), paths.keys()) - {name} for name, path in paths.items()}


def known_by(tree: ast.AST, modules: Collection[str]) -> set[str]:
    """Which of the modules a module imports: of `from a import b` a.b where that is one, else a."""
    wanted = {name for name, _ in imports(tree)}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names = {f"{node.module}.{alias.name}" for alias in node.names}
            wanted |= names
            if names <= set(modules):
                wanted.discard(node.module)
    return wanted & set(modules)


def circle(knows: dict[str, set[str]]) -> list[str]:
    """Modules that are left when those that know nobody left are taken away again and again."""
    left = dict(knows)
    while ground := [name for name, others in left.items() if not others & left.keys()]:
        for name in ground:
            del left[name]
    return sorted(left)


@pytest.mark.parametrize("package", sorted(PROJECT))
def test_no_imports_run_in_a_circle(package: str) -> None:
    assert circle(known_modules(package)) == []


def test_the_walk_sees_circles_through_functions_faces_and_modules() -> None:
    names = ("a", "a.b", "a.c", "a.d")
    knows = {
        "a": known_by(ast.parse("from a.b import x"), names),
        "a.b": known_by(ast.parse("def f():\n    from a import c"), names),
        "a.c": known_by(ast.parse("if TYPE_CHECKING:\n    from a.b import x"), names),
        "a.d": known_by(ast.parse("import os"), names),
    }
    assert knows["a.b"] == {"a.c"}
    assert circle(knows) == ["a", "a.b", "a.c"]
    assert circle({**knows, "a.c": {"a.d"}}) == []


@pytest.mark.parametrize("package", sorted(PROJECT))
def test_ros_appears_only_in_nodes_and_parameters(package: str) -> None:
    assert (
        violations(package, lambda module, name: is_ros(name) and not may_know_ros(package, module))
        == []
    )


def foreign_insides(tree: ast.AST) -> Iterator[tuple[str, int]]:
    """Private names of other objects that a file reads or sets, and what it imports of rclpy's
    implementation.
    """
    own = {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and not (
            isinstance(node.value, ast.Name) and node.value.id in ("self", "cls")
        ):
            name = node.attr
            if name.startswith("_") and not name.startswith("__") and name not in own:
                yield name, node.lineno
    for name, line in imports(tree):
        if name.startswith("rclpy.") and (".impl" in name or "._" in name):
            yield name, line


def test_insides_of_rclpy_and_of_messages_are_used_in_one_file() -> None:
    found = [
        f"{module.relative_to(SRC)}:{line} {name}"
        for package in sorted(PROJECT)
        for module in modules(package)
        if any(is_ros(name) for name, _ in imports_of(module)) and module.name != "rclpy_inside.py"
        for name, line in foreign_insides(parsed(module))
    ]
    assert not found


def test_the_walk_sees_insides() -> None:
    source = "from rclpy.impl import x\nmessage.goal._points = made\nnode._clients[0]\nself._own"
    assert [name for name, _ in foreign_insides(ast.parse(source))] == [
        "_points",
        "_clients",
        "rclpy.impl",
    ]


@pytest.mark.parametrize("package", sorted(PROJECT))
def test_pybullet_appears_in_one_file(package: str) -> None:
    backend = SRC / "ir_sim_driver" / "ir_sim_driver" / "plant" / "pybullet_backend.py"

    def forbidden(module: Path, name: str) -> bool:
        return name.partition(".")[0] in ("pybullet", "pybullet_data") and module != backend

    assert violations(package, forbidden) == []


@pytest.mark.parametrize("package", sorted(CORE_READS_NO_CLOCK))
def test_the_core_is_handed_time_and_randomness(package: str) -> None:
    face = SRC / "ir_planner" / "ir_planner" / "planner.py"  # hands a clock to all below it

    def forbidden(module: Path, name: str) -> bool:
        return name.partition(".")[0] in (
            "time",
            "datetime",
            "random",
            "secrets",
        ) and not (may_know_ros(package, module) or module == face)

    assert violations(package, forbidden) == []


@pytest.mark.parametrize("package", sorted(PROJECT))
def test_nobody_draws_from_the_global_generator(package: str) -> None:
    seeded = {"Generator", "default_rng", "SeedSequence", "BitGenerator", "PCG64", "Philox"}
    drawn = [
        f"{module.relative_to(SRC)}:{node.lineno} {ast.unparse(node)}"
        for module in modules(package)
        for node in ast.walk(parsed(module))
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Attribute)
        and ast.unparse(node.value) in ("np.random", "numpy.random")
        and node.attr not in seeded
    ]
    assert drawn == []


def test_the_walk_sees_imports_in_functions_and_under_type_checking() -> None:
    source = (
        "import a.b\nfrom c import d\ndef f():\n    from e.f import g\nif TYPE_CHECKING:\n  "
        "  import h\n"
    )
    assert [name for name, _ in imports(ast.parse(source))] == ["a.b", "c", "e.f", "h"]
