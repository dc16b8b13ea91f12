"""Measure the structure of the sources: size, density, rooms, and what one request passes.

    python tools/house.py [--root CHECKOUT] [--requests] [--times]

Prints one line per quantity. A miss of a goal is a place to look, not a fault: the gates are ruff's
complexity, the walk over the imports (tests/packaging/test_rooms.py) and the tests.
"""

from __future__ import annotations

import argparse
import ast
import io
import json
import os
import re
import statistics
import subprocess
import sys
import tempfile
import time
import tokenize
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

SMALL = 70  # lines: a helper module that may belong to its only importer
WORD = re.compile(r"\S*\w\S*")
RUNS = 20  # warm runs of which the median is printed
GENERATED = (
    "interface_reference.md",
    "parameters.md",
    "mistakes.md",
    "architecture.md",
    "reproduction.md",
)


@dataclass(frozen=True)
class Module:
    """A source file: dotted name, path, text and syntax tree."""

    name: str
    path: Path
    text: str
    tree: ast.Module

    @property
    def is_face(self) -> bool:
        """Whether it is the `__init__` of a package."""
        return self.path.name == "__init__.py"

    @property
    def lines(self) -> int:
        """Lines of the file."""
        return self.text.count("\n")


def modules_of(root: Path) -> dict[str, Module]:
    """All Python modules below src, by dotted name; set-up scripts are among them."""
    found = {}
    for path in sorted((root / "src").rglob("*.py")):
        if "build" in path.relative_to(root).parts:
            continue
        parts = path.relative_to(root / "src").with_suffix("").parts[1:]
        name = ".".join(parts).removesuffix(".__init__") or path.parent.name
        if path.name == "setup.py":
            name = f"{path.parent.name}/setup"
        text = path.read_text("utf-8")
        found[name] = Module(name, path, text, ast.parse(text))
    return found


def imports(module: Module, known: dict[str, Module]) -> set[str]:
    """Modules of the house that a module imports, at any place of it."""
    package = module.name if module.is_face else module.name.rpartition(".")[0]
    found = set()
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name in known}
        if isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *([node.module] if node.module else [])])
            for alias in node.names:
                inner = f"{base}.{alias.name}"
                if inner in known:
                    found.add(inner)
                elif base in known:
                    found.add(base)
    return found - {module.name}


def importers(known: dict[str, Module]) -> dict[str, set[str]]:
    """For each module those that import it."""
    found: dict[str, set[str]] = defaultdict(set)
    for module in known.values():
        for other in imports(module, known):
            found[other].add(module.name)
    return found


def lonely(known: dict[str, Module]) -> list[Module]:
    """Modules with one importer, which is a module of the same folder."""
    by = importers(known)
    return [
        module
        for module in known.values()
        if not module.is_face
        and len(by[module.name]) == 1
        and known[next(iter(by[module.name]))].path.parent == module.path.parent
        and not known[next(iter(by[module.name]))].is_face
    ]


def dense_statements(tree: ast.Module) -> int:
    """Parallel assignments of unrelated values, and walruses inside calls."""
    count = 0
    for node in ast.walk(tree):
        if (
            isinstance(node, ast.Assign)
            and isinstance(node.targets[0], ast.Tuple)
            and isinstance(node.value, ast.Tuple)
            and not _is_swap(node.targets[0], node.value)
        ):
            count += 1
        if isinstance(node, ast.Call):
            inside = [*node.args, *(each.value for each in node.keywords)]
            count += sum(
                isinstance(part, ast.NamedExpr) for one in inside for part in ast.walk(one)
            )
    return count


def _is_swap(targets: ast.Tuple, values: ast.Tuple) -> bool:
    """Whether a value reads a target, so that the order matters."""
    left = {ast.unparse(each) for each in targets.elts}
    right = {ast.unparse(part) for each in values.elts for part in ast.walk(each)
             if isinstance(part, ast.expr)}  # fmt: skip
    return bool(left & right)


def explained(module: Module) -> int:
    """Lines of comments and docstrings."""
    count = sum(
        1
        for token in tokenize.generate_tokens(io.StringIO(module.text).readline)
        if token.type == tokenize.COMMENT
    )
    for node in ast.walk(module.tree):
        match node:
            case ast.Expr(value=ast.Constant(value=str())):
                count += (node.end_lineno or node.lineno) - node.lineno + 1
    return count


def code_lines(module: Module) -> int:
    """Lines that hold code, not only comments, docstrings or nothing."""
    rows: set[int] = set()
    skip = (
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    )
    for token in tokenize.generate_tokens(io.StringIO(module.text).readline):
        if token.type not in skip:
            rows |= set(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            rows -= set(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(rows)


def storeys(knows: dict[str, set[str]]) -> int:
    """Floors of a graph without a cycle: the length of its longest chain."""
    height: dict[str, int] = {}

    def of(name: str, seen: tuple[str, ...]) -> int:
        if name not in height:
            below = [of(each, (*seen, name)) for each in knows[name] if each not in seen]
            height[name] = 1 + max(below, default=0)
        return height[name]

    return max((of(name, ()) for name in knows), default=0)


def rooms(package: str, known: dict[str, Module]) -> dict[str, set[str]]:
    """Rooms (folders and single modules) below a dotted package, and which others each knows."""
    start = f"{package}."

    def room(name: str) -> str:
        return name[len(start) :].partition(".")[0]

    inside = [module for module in known.values() if module.name.startswith(start)]
    knows: dict[str, set[str]] = {room(module.name): set() for module in inside}
    for module in inside:
        others = {room(each) for each in imports(module, known) if each.startswith(start)}
        knows[room(module.name)] |= others - {room(module.name)}
    return knows


def exceptions(known: dict[str, Module]) -> int:
    """Classes that are exceptions, by their bases' names."""
    bases = {
        node.name: {ast.unparse(base).rpartition(".")[2] for base in node.bases}
        for module in known.values()
        for node in ast.walk(module.tree)
        if isinstance(node, ast.ClassDef)
    }
    builtin = {
        name for name, value in vars(__import__("builtins")).items()
        if isinstance(value, type) and issubclass(value, BaseException)
    }  # fmt: skip
    found: set[str] = set()
    while True:
        more = {name for name, of in bases.items() if of & (builtin | found)} - found
        if not more:
            return len(found)
        found |= more


def public_names(known: dict[str, Module]) -> int:
    """Names in `__all__` of the packages themselves; those of their rooms are inside."""
    count = 0
    for module in known.values():
        if module.is_face and "." not in module.name:
            for node in module.tree.body:
                if isinstance(node, ast.Assign) and ast.unparse(node.targets[0]) == "__all__":
                    count += len(ast.literal_eval(node.value))
    return count


def words(root: Path) -> tuple[int, int]:
    """Words of the documentation that is written by hand, and of the changelog; signs that draw
    tables are none.
    """
    pages = [root / "README.md", root / "CONTRIBUTING.md", *(root / "docs").rglob("*.md")]
    hand = [page for page in pages if page.name not in GENERATED]
    count = sum(len(WORD.findall(page.read_text("utf-8"))) for page in hand)
    return count, len(WORD.findall((root / "CHANGELOG.md").read_text("utf-8")))


PASSED = """
import json, sys
seen = set()
def look(frame, event, argument):
    file = frame.f_code.co_filename
    if event == "call" and file not in seen and not importing(frame):
        seen.add(file)
def importing(frame):
    while frame is not None and frame.f_back is not None:
        if frame.f_code.co_name == "<module>":
            return True
        frame = frame.f_back
    return False
sys.setprofile(look)
import threading
threading.setprofile(look)
seen.clear()
{work}
sys.setprofile(None)
print("\\nPASSED" + json.dumps(sorted(each for each in seen if "/src/ir_" in each)))
"""
REQUESTS = {
    "a plan_regional request": (
        "from ir_planner import Planner\n"
        "planner = Planner('demo')\n"
        "seen.clear()\n"
        "planner.plan_regional(goal='washer_rinse')"
    ),
    "ir plan demo": "from ir_cli.main import main\nmain(['plan', 'demo'])",
}


def passed(root: Path, work: str) -> int:
    """Modules of src in which a function ran; imports alone don't count."""
    script = PASSED.replace("{work}", work)
    done = subprocess.run(
        [sys.executable, "-c", script], cwd=root, capture_output=True, text=True, check=False
    )
    for line in done.stdout.splitlines():
        if line.startswith("PASSED"):
            return len(json.loads(line.removeprefix("PASSED")))
    raise SystemExit(done.stderr[-2000:])


def seconds(*command: str) -> tuple[float, float]:
    """Medians of wall and processor time over `RUNS` warm runs; processor time is also true on a
    busy machine. Bytecode is kept: warm means that nothing is compiled.
    """
    walls = []
    processors = []
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "PYTHONPYCACHEPREFIX": folder}
        environment.pop("PYTHONDONTWRITEBYTECODE", None)
        for _ in range(RUNS + 1):
            used = os.times()
            begin = time.perf_counter()
            subprocess.run(command, stdout=subprocess.DEVNULL, check=True, env=environment)
            walls.append(time.perf_counter() - begin)
            now = os.times()
            processors.append(
                now.children_user + now.children_system - used.children_user - used.children_system
            )
    return statistics.median(walls[1:]), statistics.median(processors[1:])


def rows(root: Path) -> Iterator[tuple[str, str]]:
    """Each quantity with its value."""
    known = modules_of(root)
    lines = sum(module.lines for module in known.values())
    own = [each for each in known.values() if not each.is_face and each.path.name != "setup.py"]
    yield "modules in src, without faces (__init__)", str(len(own))
    yield "lines of Python in src", str(lines)
    alone = lonely(known)
    yield "modules with one importer, in its own folder", str(len(alone))
    yield "  lines of these", str(sum(module.lines for module in alone))
    yield f"  below {SMALL} lines", str(sum(module.lines < SMALL for module in alone))
    dense = sum(dense_statements(module.tree) for module in known.values())
    yield "parallel assignments, walruses in calls, per 1,000 lines", f"{1e3 * dense / lines:.2f}"
    nodes = sum(1 for module in known.values() for _ in ast.walk(module.tree))
    code = sum(code_lines(module) for module in known.values())
    yield "syntax nodes per line of code", f"{nodes / code:.1f}"
    comments = sum(explained(module) for module in known.values())
    yield "comments and docstrings of lines", f"{1e2 * comments / lines:.0f} %"
    for package in ("ir_planner", "ir_planner.program"):
        graph = rooms(package, known)
        arrows = sum(map(len, graph.values()))
        yield f"{package}: rooms, floors, arrows", f"{len(graph)}, {storeys(graph)}, {arrows}"
    yield "exception classes", str(exceptions(known))
    yield "names in __all__ of the packages", str(public_names(known))
    hand, changes = words(root)
    yield "words of docs written by hand; of the changelog", f"{hand}; {changes}"
    scripts = (path.read_text("utf-8") for path in (root / "benchmarks").glob("*.py"))
    yield "benchmarks, lines", str(sum(text.count("\n") for text in scripts))
    page = root / "docs" / "parameters.md"
    first = re.split(r"^#+ .*[Aa]dvanced", page.read_text("utf-8"), maxsplit=1, flags=re.MULTILINE)
    yield "parameters before `advanced`", str(len(re.findall(r"^\| `", first[0], re.MULTILINE)))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--root", type=Path, default=Path(__file__).resolve().parents[1])
    parser.add_argument("--requests", action="store_true", help="run requests, count modules")
    parser.add_argument("--times", action="store_true", help=f"medians of {RUNS} warm runs")
    given = parser.parse_args()
    for name, value in rows(given.root):
        print(f"{name:62} {value}", flush=True)
    if given.requests:
        for name, work in REQUESTS.items():
            print(f"{'modules that ' + name + ' passes':62} {passed(given.root, work)}")
    if given.times:
        python = sys.executable
        ir = str(Path(python).with_name("ir"))
        for name, command in (
            ("import ir_planner", (python, "-c", "import ir_planner")),
            ("from ir_planner import Planner", (python, "-c", "from ir_planner import Planner")),
            ("import scipy", (python, "-c", "import scipy")),
            ("import scipy.optimize", (python, "-c", "import scipy.optimize")),
            ("ir --help", (ir, "--help")),
        ):
            wall, processor = seconds(*command)
            print(f"{name:62} {wall:.2f} s; processor {processor:.2f} s", flush=True)


if __name__ == "__main__":
    main()
