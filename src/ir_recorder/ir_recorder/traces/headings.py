"""Which columns of a table are read: by their names, with a unit or without, or by a mapping."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from ir_recorder.errors import TraceError
from ir_recorder.traces.mapping import TraceMapping
from ir_recorder.traces.trace import TIME
from ir_recorder.traces.units import parsed

Wanted = Callable[[str], bool]
"""Whether a column of this name is read where no mapping names the columns."""


def chosen(
    headings: Sequence[str], where: str, wanted: Wanted, mapping: TraceMapping
) -> dict[str, tuple[int, float]]:
    """Place and factor to SI of each column by its name; TraceError without a time, or with two of
    a name.
    """
    places: dict[str, tuple[int, float]] = {}
    for name, column in mapping.columns.items():
        if column.heading not in headings:
            raise TraceError(
                f"{where}: there is no column {column.heading[:80]!r}, {_known(headings)}"
            )
        if headings.count(column.heading) > 1:
            raise TraceError(f"{where}: column {column.heading[:80]} is there twice")
        places[name] = headings.index(column.heading), column.factor
    for k, heading in enumerate([] if mapping.columns else headings):
        name, scale = _named(heading, where, wanted)
        if not wanted(name):
            continue
        if name in places:
            raise TraceError(f"{where}: column {name} is there twice")
        places[name] = k, scale
    if TIME not in places:
        raise TraceError(f"{where}: there is no column time, {_known(headings)}")
    return places


def _named(heading: str, where: str, wanted: Wanted) -> tuple[str, float]:
    """Name and factor of a heading; a unit in brackets has to be known only where the name is
    wanted.
    """
    bare = heading.split("[")[0].split("(")[0].strip()
    if wanted(heading) or (bare != heading and not wanted(bare)):
        return heading, 1.0
    return parsed(heading, where)


def _known(headings: Sequence[str]) -> str:
    return f"there is: {', '.join(headings)[:200]}"
