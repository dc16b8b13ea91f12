"""Benchmarks of two checkouts run in turns, and the ratio of their times of the same name."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from _compare_sides import environment

SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "ns": 1e-9}


def script_rows(name: str, before: Path, after: Path, rounds: int) -> list[dict[str, Any]]:
    """A row with the ratio of the least times for every time that both checkouts' benchmark
    reports.
    """
    least: tuple[dict[str, float], dict[str, float]] = ({}, {})
    for _ in range(rounds):
        for place, root in enumerate((before, after)):
            for key, value in _times(name, root).items():
                least[place][key] = min(value, least[place].get(key, value))
    shared = [key for key in least[0] if least[1].get(key, 0.0) > 0.0 and least[0][key] > 0.0]
    rows = []
    for key in shared:
        old, new = (1e3 * side[key] for side in least)
        rows.append(
            {"group": f"{name}: {key}", "before_ms": old, "after_ms": new, "ratio": new / old}
        )
        print(f"{name}: {key:70s} {old:12.5g} {new:12.5g} ms  ratio {new / old:.3f}", flush=True)
    if not shared:
        print(f"benchmark {name}: the checkouts report no time of the same name")
    return rows


def _times(name: str, root: Path) -> dict[str, float]:
    """Times [s] by name that a checkout's benchmark reports in its quick form."""
    script = root.resolve() / "benchmarks" / f"{name}.py"
    if not script.exists():
        raise SystemExit(f"{root} has no benchmark {name}")
    short = ["--quick"] if '"--quick"' in script.read_text() else ["--seeds", "1"]
    with tempfile.TemporaryDirectory() as place:
        result = Path(place) / "result.json"
        command = [sys.executable, str(script), *short, "--json", str(result)]
        subprocess.run(
            command, env=environment(root), cwd=root, check=True, stdout=subprocess.DEVNULL
        )
        return times_in(json.loads(result.read_text()))


def times_in(result: dict[str, Any]) -> dict[str, float]:
    """Claims with a unit of time, rows with value and unit, and fields `*_ms` of rows."""
    found: dict[str, float] = {}
    for claim in result["claims"]:
        if claim["unit"] in SECONDS:
            found[f"claim {claim['name']}"] = claim["value"] * SECONDS[claim["unit"]]
    for row in result["rows"]:
        words = " ".join(
            str(value) for key, value in row.items() if isinstance(value, str) and key != "unit"
        )
        if row.get("unit") in SECONDS and isinstance(row.get("value"), float):
            found[words] = row["value"] * SECONDS[row["unit"]]
        for key, value in row.items():
            if key.endswith("_ms") and isinstance(value, (int, float)):
                found[f"{words} {key}"] = 1e-3 * value
    return found
