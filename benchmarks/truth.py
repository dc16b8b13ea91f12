"""Are the watts right on a plant that is not the planner's model, and is what goes wrong noticed?

    python benchmarks/truth.py [--cell FILE]... [--seeds N] [--only SECTION]... [--quick] [--json
    FILE]

Each section is a module `_truth_NAME.py` with a TITLE and a function `measured(asked) -> Found`
(see `_truth_section.py`); whatever modules there are, are run. All figures are of the simulated
plant.
"""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Any

from _over_seeds import processor_time
from _results import Claim, command_line, finish, line_of
from _truth_section import Asked

CELLS = ("demo", "open", "cnc_door", "deep_box", "table_columns")
SEEDS = 20
QUICK_SEEDS = 3
NO_SECTIONS = ("section",)


def sections() -> list[str]:
    """Names of the sections that there are."""
    files = sorted(Path(__file__).resolve().parent.glob("_truth_*.py"))
    names = [file.stem.removeprefix("_truth_") for file in files]
    return [name for name in names if name not in NO_SECTIONS]


def main() -> None:
    """Run the sections and print what they found."""
    parser = command_line(__doc__, CELLS, SEEDS, f"{QUICK_SEEDS} plants, fewer movements")
    parser.add_argument(
        "--only", action="append", choices=sections(), help="run this section; repeatable"
    )
    arguments = parser.parse_args()
    seeds = min(arguments.seeds, QUICK_SEEDS) if arguments.quick else arguments.seeds
    asked = Asked(arguments.cell or CELLS, seeds, arguments.quick)
    rows: list[dict[str, Any]] = []
    claims: list[Claim] = []
    for name in arguments.only or sections():
        module = import_module(f"_truth_{name}")
        print(f"-- {name}: {module.TITLE}", flush=True)
        begun = processor_time()
        found = module.measured(asked)
        for row in found.rows:
            print(line_of(row), flush=True)
        print(f"   {processor_time() - begun:.1f} s of processor", flush=True)
        rows += [{"section": name, **row} for row in found.rows]
        claims += found.claims
    finish(arguments.json, rows, claims)


if __name__ == "__main__":
    main()
