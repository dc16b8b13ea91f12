"""Steps of recordings as columns of numbers, for CSV, Parquet and pandas: SI units, the unit in
each name.

``pandas.DataFrame(step_columns([analysis]))`` is the table of a program.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from io import BytesIO, StringIO
from pathlib import Path

from ir_recorder.analysis import Analysis, StepResult
from ir_recorder.errors import PathError, RecorderError
from ir_recorder.report.files import write_output
from ir_values.files import ANYWHERE, FileRoots

TableValue = str | float | int
_TEXTS = ("recording", "origin", "plant", "label", "kind", "mode", "load", "outcome")
CSV_START = b"recording,"
PARQUET_START = b"PAR1"


def step_columns(analyses: Sequence[Analysis]) -> dict[str, list[TableValue]]:
    """All steps of all recordings, a column for each figure; NaN where it wasn't recorded."""
    rows = [_row(analysis, result) for analysis in analyses for result in analysis.steps]
    names = list(dict.fromkeys(name for row in rows for name in row)) or ["recording"]
    return {
        name: [row.get(name, "" if name in _TEXTS else math.nan) for row in rows] for name in names
    }


def _row(analysis: Analysis, result: StepResult) -> dict[str, TableValue]:
    step = result.step
    near = result.clearance
    movement = step.movement
    report = step.movement.report
    recording = analysis.recording
    return {
        **{"recording": recording.path.name, "origin": recording.origin, "plant": recording.plant},
        **{"step": step.index + 1, "label": step.label, "kind": str(movement.kind)},
        **{"mode": movement.power_mode, "load": movement.load, "outcome": step.outcome},
        **{"start_s": step.start, "seconds_s": result.seconds},
        **{"energy_j": result.energy, "predicted_j": report.energy},
        **{"predicted_low_j": report.energy_low, "predicted_high_j": report.energy_high},
        **{"base_j": result.base_energy, "brake_resistor_j": result.dissipated_energy},
        **{f"axis_{k + 1}_net_j": float(value) for k, value in enumerate(result.joint_energy)},
        **{"from_positions_j": result.indirect_energy, "from_torques_j": result.torque_energy},
        **{"peak_w": result.peak_power, "tool_deviation_m": result.tool_deviation},
        "clearance_m": near.least if near is not None else math.nan,
        "clearance_pair": near.least_pair if near is not None else "",
    }


def write_table(
    analyses: Sequence[Analysis], path: str | Path, roots: FileRoots = ANYWHERE
) -> Path:
    """Writes the steps as .csv or .parquet below `roots`; RecorderError for another ending."""
    return write_columns(step_columns(analyses), path, CSV_START, roots)


def write_columns(
    columns: Mapping[str, Sequence[TableValue]],
    path: str | Path,
    start: bytes,
    roots: FileRoots = ANYWHERE,
) -> Path:
    """Writes columns as .csv or .parquet below `roots`, in place of a table that begins alike;
    RecorderError for another ending.
    """
    if str(path).endswith(".csv"):
        return write_output(path, _csv(columns), start, roots)
    if str(path).endswith(".parquet"):
        return write_output(path, _parquet(columns), PARQUET_START, roots)
    raise PathError(f"{path}: a table ends in .csv or .parquet")


def _csv(columns: Mapping[str, Sequence[TableValue]]) -> bytes:
    """Texts that a spreadsheet would take for a formula get an apostrophe; NaN is an empty cell."""
    out = StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        writer.writerow([_shown(value) for value in row])
    return out.getvalue().encode()


def _shown(value: TableValue) -> str:
    if isinstance(value, str):
        return f"'{value}" if value[:1] in ("=", "+", "-", "@", "\t", "\r") else value
    return "" if math.isnan(value) else repr(value)


def _parquet(columns: Mapping[str, Sequence[TableValue]]) -> bytes:
    try:
        import pyarrow as arrow
        from pyarrow import parquet
    except ImportError as error:
        raise RecorderError("a Parquet file needs pyarrow: pip install pyarrow") from error
    out = BytesIO()
    parquet.write_table(arrow.table(dict(columns)), out)
    return out.getvalue()
