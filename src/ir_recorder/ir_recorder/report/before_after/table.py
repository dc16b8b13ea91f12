"""Every movement and pause of all programs as columns of numbers, for CSV, Parquet and pandas: SI
units.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from ir_msgs_py.before_after import BeforeAfter, Side
from ir_msgs_py.file_roots import ANYWHERE, FileRoots
from ir_recorder.report.before_after.amounts import Amount, year_of
from ir_recorder.report.costs import J_PER_KWH, Costs
from ir_recorder.report.step_table import Cell, write_columns

START = b"program,"


def before_after_columns(found: BeforeAfter, costs: Costs | None = None) -> dict[str, list[Cell]]:
    """A row for each program, for each of its movements and pauses, and for each change."""
    prices = costs or Costs()
    sides = [side for side in (found.today, *found.sides) if side.found]
    rows = [row for side in sides for row in (_whole(found, side, prices), *_hops(side))]
    rows += _changes(found, prices)
    return {name: [row.get(name, math.nan) for row in rows] for name in rows[0]}


def write_before_after_table(
    found: BeforeAfter, path: str | Path, costs: Costs | None = None, roots: FileRoots = ANYWHERE
) -> Path:
    """Writes the rows as .csv or .parquet below `roots`; RecorderError for another ending."""
    return write_columns(before_after_columns(found, costs), path, START, roots)


def _whole(found: BeforeAfter, side: Side, costs: Costs) -> Mapping[str, Cell]:
    report = side.report
    saving = side.saving
    year = year_of(found, side, costs)
    money = year.saved.of(costs.money)
    kwh = year.energy.of(lambda joules: joules / J_PER_KWH)
    return {
        **{"program": side.name, "what": "cycle", "mode": "", "seconds_s": report.duration},
        **{
            "energy_j": report.energy,
            "energy_low_j": report.energy_low,
            "energy_high_j": report.energy_high,
        },
        **{
            "saved_j": saving.saved,
            "saved_low_j": saving.saved_low,
            "saved_high_j": saving.saved_high,
        },
        **{"peak_w": report.peak_power, "peak_low_w": side.peak[0], "peak_high_w": side.peak[1]},
        **{"clearance_m": report.min_clearance, "shift_cycles": year.cycles_a_shift},
        **_amounts("shift_kwh", year.shift.of(lambda joules: joules / J_PER_KWH)),
        **_amounts("year_kwh", kwh),
        **_amounts("year_money", year.energy.of(costs.money)),
        **_amounts("year_co2_kg", year.energy.of(costs.co2)),
        **_amounts("year_saved_money", money),
    }


def _amounts(name: str, amount: Amount) -> Mapping[str, Cell]:
    return {name: amount.value, f"{name}_low": amount.low, f"{name}_high": amount.high}


def _changes(found: BeforeAfter, costs: Costs) -> Sequence[Mapping[str, Cell]]:
    """The changes in their order, with the seconds that they take then."""
    cycles = year_of(found, found.planned, costs).cycles_a_year
    return [
        {
            **{
                "program": found.towards,
                "what": f"change {k}: {change.name}",
                "mode": change.words,
            },
            **{"seconds_s": change.seconds[1]},
            **{"saved_j": change.saving.saved},
            **{"saved_low_j": change.saving.saved_low, "saved_high_j": change.saving.saved_high},
            **{"year_saved_money": costs.money(change.saving.saved * cycles)},
        }
        for k, change in enumerate(found.changes, start=1)
    ]


def _hops(side: Side) -> Sequence[Mapping[str, Cell]]:
    return [
        {
            **{
                "program": side.name,
                "what": hop.name,
                "mode": hop.power_mode,
                "seconds_s": hop.seconds,
            },
            **{
                "energy_j": hop.energy,
                "energy_low_j": hop.energy_low,
                "energy_high_j": hop.energy_high,
            },
        }
        for hop in side.hops
    ]
