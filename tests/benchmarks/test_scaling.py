"""How cost grows: slopes are found again, inputs have the size that was asked for, runs end
well.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from _scaling_cells import crowded, tour, waves, with_turns
from scaling import Prepared, exponent, measured

from ir_description import load_cell

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("slope", [0.0, 0.5, 1.0, 2.0])
def test_the_exponent_is_the_slope_of_the_upper_half(slope: float) -> None:
    sizes = [1.0, 3.0, 10.0, 30.0, 100.0, 300.0, 1000.0]
    values = [7.0 * max(size, 10.0) ** slope for size in sizes]  # small sizes cost the same
    assert exponent(sizes, values) == pytest.approx(slope, abs=1e-9)


def test_one_size_has_no_exponent() -> None:
    assert np.isnan(exponent([10.0], [1.0]))


@pytest.mark.long
def test_a_step_is_measured_in_a_process_of_its_own() -> None:
    def busy() -> object:
        return np.ones(20_000_000).sum()  # 160 MB

    found = measured(lambda: Prepared(5.0, busy))
    assert not isinstance(found, str)
    size, cost = found
    assert size == 5.0
    assert cost.seconds > 0.0
    assert 100.0 < cost.megabytes < 1000.0


def test_a_step_that_fails_says_why() -> None:
    def broken() -> object:
        raise ValueError("too many")

    assert measured(lambda: Prepared(1.0, broken)) == "ValueError: too many"


def test_cells_have_the_bodies_and_stations_that_were_asked_for() -> None:
    cell = crowded("demo", 60, 0)
    assert len(cell.bodies()) == 60
    assert all(station.allowed_contacts for station in cell.stations[-3:])
    assert crowded("demo", 5, 0).stations == load_cell("demo").stations
    stops = tour(cell, 20, 1)
    assert len(stops) == 20
    assert all(a != b for a, b in pairwise(stops))
    assert with_turns(load_cell("demo"), 9.0).robot.position_max[5] == 9.0


@pytest.mark.parametrize("points", [10, 57, 400])
def test_waves_are_at_rest_at_their_ends_and_agree_with_their_derivatives(points: int) -> None:
    wave = waves(load_cell("open"), points)
    assert len(wave.times_ns) == points
    for values in (wave.velocities, wave.accelerations):
        assert values is not None
        assert np.abs(values[[0, -1]]).max() < 1e-9
    at = np.linspace(0.1, wave.duration - 0.1, 50)
    step = 1e-4
    numeric = (wave.sample(at + step).q - wave.sample(at - step).q) / (2.0 * step)
    assert np.abs(numeric - wave.sample(at).qd).max() < 1e-4


@pytest.mark.long
def test_a_tiny_run_prints_exponents_and_draws(tmp_path: Path) -> None:
    file = tmp_path / "scaling.json"
    picture = tmp_path / "scaling.png"
    words = [
        "--quick",
        "--axis",
        "points",
        "--most",
        "100",
        "--json",
        str(file),
        "--plot",
        str(picture),
    ]
    command = [sys.executable, str(ROOT / "benchmarks" / "scaling.py"), *words]
    done = subprocess.run(
        command, cwd=ROOT, capture_output=True, text=True, env=os.environ, check=False
    )
    assert done.returncode == 0, done.stderr
    result = json.loads(file.read_text())
    assert {row["axis"] for row in result["rows"]} == {"points"}
    assert {row["size"] for row in result["rows"]} == {10.0, 100.0}
    assert {claim["unit"] for claim in result["claims"]} == {"exponent", "s"}
    assert picture.stat().st_size > 10_000
