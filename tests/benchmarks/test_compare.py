"""Two checkouts are compared by answers and times: the same one agrees with itself, another does
not.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import compare
import pytest

ROOT = Path(__file__).resolve().parents[2]


def compared(*words: str) -> subprocess.CompletedProcess[str]:
    """A run with this checkout as both."""
    command = [sys.executable, str(ROOT / "benchmarks" / "compare.py"), *words]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)


@pytest.mark.long
def test_a_checkout_answers_as_itself(tmp_path: Path) -> None:
    file = tmp_path / "compare.json"
    wanted = (
        "standby",
        "open home->p1 seed 0",
        "unknown",
        "out of reach",
        "outside",
        "budget",
        "duration too short",
    )
    asked = [word for each in wanted for word in ("--only", each)]
    done = compared("--before", str(ROOT), *asked, "--rounds", "1", "--json", str(file))
    assert done.returncode == 0, done.stderr
    result = json.loads(file.read_text())
    rows = {row["name"]: row for row in result["rows"] if "name" in row}
    assert len(rows) == 13
    assert all(row["identical"] for row in rows.values())
    assert rows["open home->p1 seed 0"]["status"] == 1
    assert len(rows["open home->p1 seed 0"]["id"]) == 16
    assert not any("crash" in str(row["status"]) for row in rows.values())
    claims = {claim["name"]: claim for claim in result["claims"]}
    assert claims["all answers identical: different ones of 13"]["holds"]
    assert "median ratio of all requests" in claims


def test_every_difference_is_listed() -> None:
    before = {"id": "a", "energy": 1.0, "ratio": [0.1, 0.2], "nan": float("nan"), "gone": 3}
    after = {"id": "b", "energy": 1.0 + 1e-15, "ratio": [0.1, 0.2], "nan": float("nan"), "new": 4}
    names = [line.split(":")[0] for line in compare.differences(before, after)]
    assert names == ["id", "energy", "gone", "new"]
    assert compare.differences(before, dict(before)) == []


def test_a_folder_without_core_is_refused_with_a_sentence(tmp_path: Path) -> None:
    done = compared("--before", str(tmp_path))
    assert done.returncode == 2
    assert f"{tmp_path} is no checkout of this project" in done.stderr
    (tmp_path / "src" / "ir_planner").mkdir(parents=True)
    done = compared("--before", str(tmp_path))
    assert done.returncode == 2
    assert "has no compiled core" in done.stderr
    assert "build_ext --inplace" in done.stderr


def test_times_of_a_benchmark_are_found_by_name() -> None:
    claims = [
        {"name": "median", "value": 2.0, "unit": "ms"},
        {"name": "success", "value": 100.0, "unit": "%"},
    ]
    rows = [
        {"kernel": "edge", "peer": "", "value": 3.0, "unit": "us"},
        {"cell": "open", "first_ms": 4.0, "work": 12},
    ]
    found = compare.times_in({"claims": claims, "rows": rows})
    assert found == {"claim median": 2e-3, "edge ": 3e-6, "open first_ms": 4e-3}
