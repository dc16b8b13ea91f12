"""Logs of searches in the notes of planning stages, as recordings of earlier versions hold them.

The text is JSON, positions of the tool in millimetres.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import Any, Final

import numpy as np

from ir_msgs_py.search_log import (
    ConfigurationLog,
    CorrectionLog,
    Counts,
    SearchLog,
    Track,
    WithdrawalLog,
)
from ir_values.arrays import FloatArray

_LOG: Final = "log: "  # how the names of such stages begin
_MM = 1e3
_FARTHEST = 1e6  # mm: a position beyond is none
_MOST = 20_000  # numbers of one log's positions


def log_of(name: str, note: str) -> SearchLog | None:
    """The log in a stage's note; None where the stage is none, or its text makes no sense."""
    make = _READERS.get(name)
    if make is None:
        return None
    try:
        return make(json.loads(note))
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        return None


def _withdrawal(data: Mapping[str, Any]) -> WithdrawalLog:
    kept = _points(data["kept"])
    parents = np.array(data["parents"], dtype=np.int64)
    if (
        parents.shape != (len(kept),)
        or (parents < 0).any()
        or (parents > np.arange(len(kept))).any()
    ):
        raise ValueError
    return WithdrawalLog(
        str(data["station"]),
        str(data["load"]),
        str(data["method"]),
        int(data["generations"]),
        int(data["candidates"]),
        _counts(data["rejected"]),
        _pair(data["distance"]),
        kept,
        parents,
        _points(data["dropped"]),
        _points(data["path"]),
        bool(data.get("asked", False)),
        str(data.get("blocked", "")),
    )


def _configurations(data: Mapping[str, Any]) -> ConfigurationLog:
    tracks = tuple(Track(str(each["outcome"]), _points(each["points"])) for each in data["tracks"])
    return ConfigurationLog(
        str(data["station"]),
        int(data["starts"]),
        int(data["accepted"]),
        int(data["distinct"]),
        _counts(data["rejected"]),
        tracks,
    )


def _correction(data: Mapping[str, Any]) -> CorrectionLog:
    return CorrectionLog(
        str(data["start"]),
        str(data["goal"]),
        int(data["generations"]),
        tuple(tuple(_finite(value) for value in each) for each in data["fitness"]),
        _pair(data["costs"]),
        _points(data["straight"]),
        tuple(_points(each) for each in data["stretches"]),
        _points(data["path"]),
        str(data.get("met", "")),
        _points(data.get("driven", [])),
    )


_READERS: Final[Mapping[str, Callable[[Mapping[str, Any]], SearchLog]]] = {
    f"{_LOG}withdrawal": _withdrawal,
    f"{_LOG}configurations": _configurations,
    f"{_LOG}genetic correction": _correction,
}


def _points(rows: Any) -> FloatArray:
    points = np.array(rows, dtype=np.float64).reshape(-1, 3)
    if points.size > _MOST or not (np.abs(points) <= _FARTHEST).all():
        raise ValueError
    return points / _MM


def _counts(rows: Any) -> Counts:
    return tuple((str(reason), int(count)) for reason, count in rows)


def _pair(values: Any) -> tuple[float, float]:
    first, second = values
    return _finite(first), _finite(second)


def _finite(value: Any) -> float:
    number = float(value)
    if not np.isfinite(number):
        raise ValueError
    return number
