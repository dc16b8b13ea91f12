"""What a search did, as it travels with an answer: the note of a stage of its planning info, in
JSON.

The text is short: positions of the tool in millimetres, reasons with their counts. Whoever reads an
answer, also years later from a recording, can show what was drawn, what was rejected and why.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np

from ir_msgs_py.report import PlanningStage
from ir_values.arrays import FloatArray, IntArray

LOG: Final = "log: "  # how the names of such stages begin
_MM = 1e3
_FARTHEST = 1e6  # mm: a position beyond is none
_MOST = 20_000  # numbers of one log's positions

Counts = tuple[tuple[str, int], ...]


def _nowhere() -> FloatArray:
    return np.zeros((0, 3))


@dataclass(frozen=True, eq=False)
class WithdrawalLog:
    """A withdrawal from a station (eq. 7). kept (N, 3) m: positions of the tool at the
    configurations that were kept, the station first, each with the index of its parent (N,);
    dropped (M, 3): some of those that came too near something. path (L, 3): along what was left of
    the best path. load: what was held.
    distance: the total metric distance D [m] at the station and the largest one reached. asked:
    whether the cell asks for a withdrawal there. blocked: why the straight line back along the tool
    leads nowhere from the same configuration, "": it is free, or nobody knows.
    """

    station: str
    load: str
    method: str
    generations: int
    candidates: int
    rejected: Counts
    distance: tuple[float, float]
    kept: FloatArray
    parents: IntArray
    dropped: FloatArray
    path: FloatArray
    asked: bool = False
    blocked: str = ""


@dataclass(frozen=True, eq=False)
class Track:
    """One random start: positions (K, 3) m of the tool from sweep to sweep; why it was rejected,
    "": it was accepted.
    """

    outcome: str
    points: FloatArray


@dataclass(frozen=True, eq=False)
class ConfigurationLog:
    """A search for configurations at a station by cyclic coordinate descent (eqs. 1 to 6): of
    `starts` random ones so many were accepted, of which so many are distinct; tracks: of the first
    starts.
    """

    station: str
    starts: int
    accepted: int
    distinct: int
    rejected: Counts
    tracks: tuple[Track, ...]


@dataclass(frozen=True, eq=False)
class CorrectionLog:
    """A genetic correction of a straight movement: positions (K, 3) m of the tool along it, along
    the parts of it that collide, and along the corrected path of least W (L, 3). fitness: by
    stretch that was corrected, of this movement and of paths on which something still collided, of
    the best individual of each generation; 1 is the cost of the straight stretch. costs: W of eq.
    (9) before and after. met: the first pair that is too near. driven (M, 3): along the movement
    that is driven, optimised from the corrected paths; empty where nobody says.
    """

    start: str
    goal: str
    generations: int
    fitness: tuple[tuple[float, ...], ...]
    costs: tuple[float, float]
    straight: FloatArray
    stretches: tuple[FloatArray, ...]
    path: FloatArray
    met: str = ""
    driven: FloatArray = field(default_factory=_nowhere)


SearchLog = WithdrawalLog | ConfigurationLog | CorrectionLog
_NAMES: Final = {
    WithdrawalLog: f"{LOG}withdrawal",
    ConfigurationLog: f"{LOG}configurations",
    CorrectionLog: f"{LOG}genetic correction",
}


def stage_of(log: SearchLog) -> PlanningStage:
    """The log as a stage of a planning info."""
    text = json.dumps(_plain(log), separators=(",", ":"), allow_nan=False)
    return PlanningStage(_NAMES[type(log)], 0.0, text)


def log_of(name: str, note: str) -> SearchLog | None:
    """The log in a stage's note; None where the stage is none, or its text makes no sense."""
    make = _READERS.get(name)
    if make is None:
        return None
    try:
        return make(json.loads(note))
    except (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError):
        return None


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        whole = value.dtype.kind == "i"
        return (value if whole else np.rint(_MM * value).astype(np.int64)).tolist()
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    if hasattr(value, "__dataclass_fields__"):
        return {name: _plain(getattr(value, name)) for name in value.__dataclass_fields__}
    return round(value, 4) if isinstance(value, float) else value


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
    _NAMES[WithdrawalLog]: _withdrawal,
    _NAMES[ConfigurationLog]: _configurations,
    _NAMES[CorrectionLog]: _correction,
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
