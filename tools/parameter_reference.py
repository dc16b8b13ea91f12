"""Write docs/parameters.md: every parameter of the nodes, and every search, as the code describes them."""

from __future__ import annotations

import sys
from pathlib import Path

from ir_msgs_py.settings import settings_table
from ir_planner.search import registered
from ir_planner.settings import PlannerSettings

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "docs" / "parameters.md"
HEAD = """# Parameters

Written by `make docs` from the settings classes; edit those. A setting is the ROS parameter of the same
name. It is checked against its range when the node starts and whenever it is changed.
"""


def searches() -> str:
    """The searches by name, with the first line of their classes."""
    rows = ["| `planner_id` | search |", "| --- | --- |"]
    for name, search in registered().items():
        first = (type(search).__doc__ or "").splitlines()[0]
        rows.append(f"| `{name}` | {first} |")
    return "\n".join(rows) + "\n"


def page() -> str:
    """Return the page as text."""
    return "\n".join(
        (
            HEAD,
            "## Searches\n",
            "An empty `planner_id` is the portfolio of all of them; a name selects one search.\n",
            searches(),
            "## ir_planner\n",
            settings_table(PlannerSettings()),
        )
    )


def main() -> int:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
