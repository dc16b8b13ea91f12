"""A small file that says what the columns of a trace are, where their headings do not.

::

    format: ir_trace/1
    columns:
      time: {column: "t", unit: ms}
      power: {column: "P total", unit: kW}
    clock_offset: 0.12     # s, added to the file's time
    power_is: mean         # of the time since the row before, or: sample
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import Any

from ir_description import DescriptionFileError
from ir_description.files import plain_yaml
from ir_msgs_py.errors import InvalidValueError
from ir_recorder.errors import TraceError
from ir_recorder.traces.units import factor

FORMAT = "ir_trace/1"
_KEYS = ("format", "columns", "clock_offset", "power_is")


@dataclass(frozen=True)
class Column:
    """A column of a file: its heading, and what its values are multiplied by."""

    heading: str
    factor: float = 1.0


@dataclass(frozen=True)
class TraceMapping:
    """Columns of a file by the names that they mean; empty: the headings say it themselves.

    clock_offset [s] is added to the file's time, NaN where it is to be found by comparing. sampled:
    power is the value of an instant, else the mean since the row before.
    """

    columns: Mapping[str, Column] = field(default_factory=lambda: MappingProxyType({}))
    clock_offset: float = math.nan
    sampled: bool = False


def read_mapping(path: Path) -> TraceMapping:
    """The mapping of a file; TraceError with the key that is wrong."""
    try:
        tree = plain_yaml(path)
    except DescriptionFileError as error:
        raise TraceError(str(error)) from error
    except InvalidValueError as error:
        raise TraceError(f"{path}: {error}") from error
    if not isinstance(tree, dict) or tree.get("format") != FORMAT:
        raise TraceError(f"{path}: is no mapping of a trace, which begins with format: {FORMAT}")
    unknown = [str(key)[:40] for key in tree if key not in _KEYS]
    if unknown:
        raise TraceError(f"{path}: key {unknown[0]!r} is unknown, known are {', '.join(_KEYS)}")
    meaning = tree.get("power_is", "mean")
    if meaning not in ("mean", "sample"):
        raise TraceError(f"{path}: power_is is {str(meaning)[:40]!r}, it must be mean or sample")
    return TraceMapping(
        _columns(path, tree.get("columns")), _offset(path, tree), meaning == "sample"
    )


def _columns(path: Path, tree: Any) -> Mapping[str, Column]:
    if not isinstance(tree, dict) or "time" not in tree:
        raise TraceError(f"{path}: columns must name at least time")
    return MappingProxyType(
        {str(name): _column(f"{path}: {name}", each) for name, each in tree.items()}
    )


def _column(where: str, tree: Any) -> Column:
    if isinstance(tree, str):
        return Column(tree)
    if not isinstance(tree, dict) or not set(tree) <= {"column", "unit"} or "column" not in tree:
        raise TraceError(f"{where[:200]}: must be {{column: heading, unit: unit}}")
    return Column(str(tree["column"]), factor(str(tree["unit"]), where) if "unit" in tree else 1.0)


def _offset(path: Path, tree: Mapping[str, Any]) -> float:
    offset = tree.get("clock_offset", math.nan)
    if isinstance(offset, bool) or not isinstance(offset, int | float) or math.isinf(offset):
        raise TraceError(
            f"{path}: clock_offset is {str(offset)[:40]!r}, it must be a number of seconds"
        )
    return float(offset)
