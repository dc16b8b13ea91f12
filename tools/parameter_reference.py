"""Write docs/parameters.md: every parameter of the nodes, and every search, as the code describes
them.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

from ir_cli.ros.up import FIXED, NODE_SETTINGS
from ir_planner.search import registered
from ir_values.settings import settings_table

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "parameters.md"
HEAD = """# Parameters

Written by `make docs` from the settings classes; edit those. A setting is the ROS parameter of the same
name. It is checked against its range when the node starts and whenever it is changed.
"""  # noqa: E501


def searches() -> str:
    """The searches by name, with the first line of their classes."""
    rows = ["| `planner_id` | search |", "| --- | --- |"]
    for name, search in registered().items():
        first = " ".join((type(search).__doc__ or "").split("\n\n")[0].split())
        rows.append(f"| `{name}` | {first} |")
    return "\n".join(rows) + "\n"


ADVANCED = """## Advanced

Settings of one stage: its searches, gains, tolerances and times. The defaults fit; they are for
studies of the stage, and for controllers whose times were measured.
"""


def rows(node: str) -> Iterator[str]:
    """Lines of the table of a node's parameters, the head first."""
    for k, (prefix, make) in enumerate(NODE_SETTINGS[node]):
        lines = settings_table(make(), prefix.removeprefix(FIXED)).splitlines()
        yield from () if k else lines[:2]
        for line in lines[2:]:
            yield f"{line[:-2]} Fixed at start. |" if prefix.startswith(FIXED) else line


def tables(mark: str, advanced: bool) -> Iterator[str]:
    """Sections of the nodes: settings of a stage (their names have a dot) or of the whole node."""
    for node in NODE_SETTINGS:
        head, rule, *lines = rows(node)
        shown = [line for line in lines if ("." in line.split("`")[1]) is advanced]
        if shown:
            yield f"{mark} {node}\n"
            yield "\n".join([head, rule, *shown]) + "\n"


def page() -> str:
    """Return the page as text."""
    parts = [
        HEAD,
        "## Searches\n",
        "An empty `planner_id` is the portfolio; a name selects one search.\n",
        searches(),
    ]
    parts += [*tables("##", False), ADVANCED, *tables("###", True)]
    return "\n".join(parts)


def main() -> int:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
