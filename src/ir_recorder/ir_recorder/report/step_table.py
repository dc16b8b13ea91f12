"""Steps of recordings as columns of numbers, for CSV, Parquet, pandas and spreadsheets: SI units,
the unit in each name.

``pandas.DataFrame(step_columns([analysis]))`` is the table of a program.
"""

from __future__ import annotations

import csv
import math
import re
from codecs import BOM_UTF8
from collections.abc import Mapping, Sequence
from io import BytesIO, StringIO
from pathlib import Path
from xml.sax.saxutils import escape
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from ir_recorder.analysis import Analysis, StepResult
from ir_recorder.errors import RecorderError
from ir_recorder.report.files import write_output
from ir_recorder.report.number_text import ENGLISH
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
        **{
            f"axis_{label.removeprefix('A').lower()}_net_j": float(joules)
            for label, joules in zip(analysis.axes, result.joint_energy, strict=False)
        },
        **{"from_positions_j": result.indirect_energy, "from_torques_j": result.torque_energy},
        **{"peak_w": result.peak_power, "tool_deviation_m": result.tool_deviation},
        "clearance_m": near.least if near is not None else math.nan,
        "clearance_pair": near.least_pair if near is not None else "",
    }


def write_table(
    analyses: Sequence[Analysis],
    path: str | Path,
    roots: FileRoots = ANYWHERE,
    locale: str = ENGLISH,
) -> Path:
    """Writes the steps as .csv, .xlsx or .parquet below `roots`; RecorderError for another
    ending.
    """
    return write_columns(step_columns(analyses), path, CSV_START, roots, locale)


def write_columns(
    columns: Mapping[str, Sequence[TableValue]],
    path: str | Path,
    start: bytes,
    roots: FileRoots = ANYWHERE,
    locale: str = ENGLISH,
) -> Path:
    """Writes columns as .csv, .xlsx or .parquet below `roots`, in place of a table that begins
    alike; RecorderError for another ending. locale: how a .csv writes its decimals.
    """
    if str(path).endswith(".csv"):
        content = _csv(columns, locale)
        begins = start if locale == ENGLISH else BOM_UTF8 + start.replace(b",", b";")
        return write_output(path, content, begins, roots)
    if str(path).endswith(".xlsx"):
        content = workbook(columns)
        return write_output(path, content, content[:_SAME], roots)
    if str(path).endswith(".parquet"):
        return write_output(path, _parquet(columns), PARQUET_START, roots)
    raise RecorderError(f"{path}: a table ends in .csv, .xlsx or .parquet")


def _csv(columns: Mapping[str, Sequence[TableValue]], locale: str) -> bytes:
    """Texts that a spreadsheet would take for a formula get an apostrophe; NaN is an empty cell."""
    out = StringIO()
    with_comma = locale != ENGLISH
    writer = csv.writer(out, lineterminator="\n", delimiter=";" if with_comma else ",")
    writer.writerow(columns)
    for row in zip(*columns.values(), strict=True):
        shown = [_shown(value) for value in row]
        if with_comma:
            pairs = zip(row, shown, strict=True)
            shown = [t if isinstance(v, str) else t.replace(".", ",") for v, t in pairs]
        writer.writerow(shown)
    return (BOM_UTF8 if with_comma else b"") + out.getvalue().encode()


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


# A workbook of one sheet (ECMA-376): numbers as numbers, in whatever way the reader writes them.

_SAME = 49  # bytes: header and name of the first member, the same in every workbook written here
_MAIN = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
_PACKAGE = "http://schemas.openxmlformats.org/package/2006"
_OFFICE = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
_KIND = "application/vnd.openxmlformats-officedocument.spreadsheetml"
_XML = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>\n'
_MEMBERS = {
    "[Content_Types].xml": f'<Types xmlns="{_PACKAGE}/content-types">'
    '<Default Extension="rels" '
    'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
    f'<Override PartName="/xl/workbook.xml" ContentType="{_KIND}.sheet.main+xml"/>'
    f'<Override PartName="/xl/worksheets/sheet1.xml" ContentType="{_KIND}.worksheet+xml"/>'
    "</Types>",
    "_rels/.rels": f'<Relationships xmlns="{_PACKAGE}/relationships"><Relationship Id="r1" '
    f'Type="{_OFFICE}/officeDocument" Target="xl/workbook.xml"/></Relationships>',
    "xl/workbook.xml": f'<workbook xmlns="{_MAIN}" xmlns:r="{_OFFICE}"><sheets>'
    '<sheet name="table" sheetId="1" r:id="r1"/></sheets></workbook>',
    "xl/_rels/workbook.xml.rels": f'<Relationships xmlns="{_PACKAGE}/relationships">'
    f'<Relationship Id="r1" Type="{_OFFICE}/worksheet" Target="worksheets/sheet1.xml"/>'
    "</Relationships>",
}
_UNWRITABLE = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


def workbook(columns: Mapping[str, Sequence[TableValue]]) -> bytes:
    """Columns as the bytes of an .xlsx file, the same for the same columns."""
    rows = [list(columns), *zip(*columns.values(), strict=True)]
    lines = (f"<row>{''.join(_cell(value) for value in row)}</row>" for row in rows)
    sheet = f'<worksheet xmlns="{_MAIN}"><sheetData>{"".join(lines)}</sheetData></worksheet>'
    out = BytesIO()
    with ZipFile(out, "w", ZIP_DEFLATED) as file:
        for name, content in {**_MEMBERS, "xl/worksheets/sheet1.xml": sheet}.items():
            file.writestr(ZipInfo(name), _XML + content, ZIP_DEFLATED)
    return out.getvalue()


def _cell(value: TableValue) -> str:
    if not isinstance(value, str):
        return f"<c><v>{value!r}</v></c>" if math.isfinite(value) else "<c/>"
    written = escape(_UNWRITABLE.sub("\ufffd", value))
    return f'<c t="inlineStr"><is><t xml:space="preserve">{written}</t></is></c>'
