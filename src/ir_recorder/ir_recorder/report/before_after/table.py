"""Every movement and pause of all programs as columns of numbers, for CSV, Parquet and pandas: SI units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from ir_msgs_py.before_after import BeforeAfter, Side
from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_recorder.report.before_after.amounts import year_of
from ir_recorder.report.costs import Costs
from ir_recorder.report.step_table import Cell, write_columns

START = b"program,"


def before_after_columns(found: BeforeAfter, costs: Costs | None = None) -> dict[str, list[Cell]]:
    """A row for each program, and one for each of its movements and pauses."""
    prices = costs or Costs()
    sides = [side for side in (found.today, *found.sides) if side.found]
    rows = [row for side in sides for row in (_whole(found, side, prices), *_hops(side))]
    return {name: [row[name] for row in rows] for name in rows[0]}


def write_before_after_table(
    found: BeforeAfter, path: str | Path, costs: Costs | None = None, roots: FileRoots = ANYWHERE
) -> Path:
    """Writes the rows as .csv or .parquet below `roots`; RecorderError for another ending."""
    return write_columns(before_after_columns(found, costs), path, START, roots)


def _whole(found: BeforeAfter, side: Side, costs: Costs) -> Mapping[str, Cell]:
    report, saving, year = side.report, side.saving, year_of(found, side, costs)
    money = year.saved.of(costs.money)
    return {
        **{"program": side.name, "what": "cycle", "mode": "", "seconds_s": report.duration},
        **{"energy_j": report.energy, "energy_low_j": report.energy_low, "energy_high_j": report.energy_high},
        **{"saved_j": saving.saved, "saved_low_j": saving.saved_low, "saved_high_j": saving.saved_high},
        **{"peak_w": report.peak_power, "clearance_m": report.min_clearance},
        **{"year_kwh": year.energy.value / 3.6e6, "year_saved_money": money.value},
        **{"year_saved_money_low": money.low, "year_saved_money_high": money.high},
    }


def _hops(side: Side) -> Sequence[Mapping[str, Cell]]:
    nothing = float("nan")
    further = ("saved_j", "saved_low_j", "saved_high_j", "peak_w", "clearance_m", "year_kwh")
    money = ("year_saved_money", "year_saved_money_low", "year_saved_money_high")
    return [
        {
            **{"program": side.name, "what": hop.name, "mode": hop.power_mode, "seconds_s": hop.seconds},
            **{"energy_j": hop.energy, "energy_low_j": hop.energy_low, "energy_high_j": hop.energy_high},
            **dict.fromkeys((*further, *money), nothing),
        }
        for hop in side.hops
    ]
