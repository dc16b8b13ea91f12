"""A search for configurations: where the tool went from every random start, and what ended it."""

from __future__ import annotations

import numpy as np

from ir_description import Cell
from ir_msgs_py.search_log import ConfigurationLog
from ir_recorder.report.methods.view import View, drawing
from ir_recorder.report.methods.words import counted, reasons, were


def sentence(log: ConfigurationLog) -> str:
    """What was done at the station."""
    rejected = sum(count for _, count in log.rejected)
    said = (
        f"Configurations at {log.station} by cyclic coordinate descent, eqs. (1) to (6): of "
        f"{counted(log.starts, 'random start')} {were(log.accepted, 'accepted')}, {log.distinct} "
        f"of them distinct; {were(rejected, 'rejected')}"
    )
    return f"{said}: {reasons(log.rejected)}." if rejected else f"{said}."


def picture(log: ConfigurationLog, cell: Cell, number: int) -> str:
    """The cell from the side with the tool's places from sweep to sweep; "" where there is none to
    show.
    """
    station = next((each for each in cell.stations if each.name == log.station), None)
    if station is None or not log.tracks:
        return ""
    places = np.vstack([track.points for track in log.tracks])
    view = View.from_the_side(places, station.pose[:3, 3], 0.1)
    ordered = sorted(log.tracks, key=lambda track: track.outcome == "")
    lines = (
        view.line(track.points, "tried" if track.outcome else "accepted")
        + view.dots(track.points[:1], "dropped" if track.outcome else "kept", 2.6)
        + (view.dots(track.points[-1:], "dropped", 1.6) if track.outcome else "")
        for track in ordered
    )
    content = (
        view.machines(cell, log.station),
        *lines,
        view.dots(station.pose[None, :3, 3], "place", 4.5),
        view.names(cell),
        view.scale_bar("from the side"),
    )
    label = (
        f"Search for configurations at {log.station}: {log.accepted} of {log.starts} starts "
        "accepted"
    )
    return drawing(content, label, f"configurations_{number}")
