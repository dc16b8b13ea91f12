"""Write the rooms of the packages into docs/architecture.md: what each is, and which room imports
which.

The parts between `<!-- rooms of PACKAGE -->` and `<!-- end -->` are written; the rest of the page
stays.
"""

from __future__ import annotations

import ast
import re
import sys
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "architecture.md"
PART = re.compile(r"(<!-- rooms of (\w+) -->\n).*?(<!-- end -->)", re.DOTALL)

Arrows = dict[str, set[str]]


def rooms(package: str) -> dict[str, list[Path]]:
    """Sub-packages and modules of a package, with their files; its own face does not count."""
    folder = ROOT / "src" / package / package
    found: dict[str, list[Path]] = {}
    for path in sorted(folder.rglob("*.py")):
        room = path.relative_to(folder).parts[0].removesuffix(".py")
        if room != "__init__":
            found.setdefault(room, []).append(path)
    return found


@cache
def parsed(path: Path) -> ast.Module:
    """The syntax of a file, read once."""
    return ast.parse(path.read_text("utf-8"))


def first_words(files: list[Path]) -> str:
    """First paragraph of a room: of its `__init__`, or of the module that it is."""
    face = next((path for path in files if path.name == "__init__.py"), files[0])
    text = ast.get_docstring(parsed(face)) or ""
    return " ".join(text.split("\n\n")[0].split())


def arrows(package: str) -> Arrows:
    """Which other rooms each room imports."""
    found: Arrows = {}
    for room, files in rooms(package).items():
        names: set[str] = set()
        for path in files:
            for node in ast.walk(parsed(path)):
                if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                    names.add(node.module)
                    names.update(f"{node.module}.{alias.name}" for alias in node.names)
                elif isinstance(node, ast.Import):
                    names.update(alias.name for alias in node.names)
        inner = {name.split(".")[1] for name in names if name.startswith(f"{package}.")}
        found[room] = inner & rooms(package).keys() - {room}
    return found


def floors(known: Arrows) -> list[list[str]]:
    """Rooms from the ground up: each floor imports only floors below it. Raises ValueError at a
    cycle.
    """
    left = dict(known)
    result = []
    while left:
        floor = sorted(room for room, others in left.items() if not others & left.keys())
        if not floor:
            raise ValueError(f"a cycle runs through {', '.join(sorted(left))}")
        result.append(floor)
        for room in floor:
            del left[room]
    return result


def direct(known: Arrows) -> Arrows:
    """The arrows that no longer path of arrows replaces."""

    @cache
    def reached(room: str) -> set[str]:
        return known[room] | {far for near in known[room] for far in reached(near)}

    return {
        room: {
            near for near in others if not any(near in reached(other) for other in others - {near})
        }
        for room, others in known.items()
    }


def part(package: str) -> str:
    """Table and drawing of a package."""
    files = rooms(package)
    known = arrows(package)
    stack = floors(known)
    rows = [f"| `{room}` | {first_words(files[room])} |" for floor in stack for room in floor]
    drawn = [
        f"  {room} --> {near}" for room in sorted(known) for near in sorted(direct(known)[room])
    ]
    return "\n".join(
        (
            "| name | content |",
            "| --- | --- |",
            *rows,
            "",
            f"{len(files)} rooms on {len(stack)} floors, no cycle. "
            "Imports, without those that follow from others:",
            "",
            "```mermaid",
            "graph TD",
            *drawn,
            "```",
            "",
        )
    )


def page() -> str:
    """Return the page with its written parts as the code is now."""
    return PART.sub(lambda match: f"{match[1]}{part(match[2])}{match[3]}", PAGE.read_text("utf-8"))


def main() -> int:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
