"""A withdrawal: what eq. (7) kept, what it dropped, and the path that was left."""

from __future__ import annotations

import numpy as np

from ir_description import Cell
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.search_log import WithdrawalLog
from ir_recorder.report.methods.view import View, drawing
from ir_recorder.report.methods.words import counted, reasons, were

_LEAST = 0.05  # m: a path that goes less far sideways is seen across the direction to the robot
_DEPTH = 0.12  # m: bodies farther from the plane of the drawing are outlines
_ENTERING = "Entering is the same path reversed."


def sentence(log: WithdrawalLog) -> str:
    """What was done at the station."""
    if not log.generations:
        return f"Leaving {log.station}: {_why(log)}two trees found the path out. {_ENTERING}"
    kept = len(log.kept) - 1
    dropped = max(log.candidates - kept, 0)
    why = f" ({reasons(log.rejected)})" if log.rejected else ""
    return (
        f"Leaving {log.station} by eq. (7): {_why(log)}{counted(log.generations, 'generation')} "
        f"drew {counted(log.candidates, 'configuration')} around those before; "
        f"{were(kept, 'kept')}, {dropped} dropped{why}. The total metric distance D to the "
        f"machine grew from {log.distance[0]:.1f} m to {log.distance[1]:.1f} m, and the best "
        f"path out was shortened. {_ENTERING}"
    )


def _why(log: WithdrawalLog) -> str:
    """Why it isn't the straight line; "" for recordings that don't say."""
    if log.blocked:
        reason = log.blocked.removeprefix(f"line out of {log.station}: ")
        return f"the straight line back along the tool is not free ({reason}); "
    return (
        "the cell asks for it, though the straight line back along the tool is free; "
        if log.asked
        else ""
    )


def picture(log: WithdrawalLog, cell: Cell, number: int) -> str:
    """The machine from the side with all of the search; "" for a station that the cell hasn't."""
    station = next((each for each in cell.stations if each.name == log.station), None)
    if station is None or len(log.path) < 2:
        return ""
    view = View.from_the_side(
        log.path, _sideways(log, station.pose[:3, 3] - cell.base_pose[:3, 3]), 0.4
    )
    child = log.kept[1:]
    parent = log.kept[log.parents[1:]]
    content = (
        view.held(cell, log.load, station.pose),
        view.machines(cell, log.station, log.path[0], _DEPTH),
        view.segments(parent, child, "tried"),
        view.dots(log.dropped, "dropped", 1.6),
        view.dots(child, "kept", 2.2),
        view.line(log.path, "path"),
        view.dots(log.path[:1], "place", 4.5),
        view.names(cell, only=station.equipment),
        view.scale_bar("from the side"),
    )
    label = (
        f"Withdrawal from {log.station}, seen from the side: {len(log.kept)} kept configurations"
    )
    return drawing(content, label, f"withdrawal_{number}")


def _sideways(log: WithdrawalLog, radial: FloatArray) -> FloatArray:
    """The horizontal direction (3,) in which the path goes farthest, away from the robot; `radial`
    (3,): from the robot to the station.
    """
    away = (log.path - log.path[0]) * [1.0, 1.0, 0.0]
    reach = np.linalg.norm(away, axis=1)
    farthest: FloatArray = away[int(np.argmax(reach))] if reach.max() > _LEAST else radial
    return farthest if farthest @ radial >= 0.0 else -farthest
