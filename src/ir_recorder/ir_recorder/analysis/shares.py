"""Time and energy by mode of the controller and by station of the program."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_msgs_py.modes import Mode
from ir_msgs_py.report import MovementKind
from ir_recorder.analysis.results import Share, StationUse, StepResult
from ir_recorder.read.recording import PowerSeries


def mode_name(number: int) -> str:
    """The name of a mode's number."""
    try:
        return Mode(number).name
    except ValueError:
        return f"mode {number}"


def mode_shares(power: PowerSeries) -> tuple[Share, ...]:
    """Seconds and joules of each mode; a reading belongs to the mode it reports."""
    seconds = np.diff(power.time, prepend=power.time[:1])
    joules = np.diff(power.energy, prepend=power.energy[:1])
    shares = []
    for number in np.unique(power.mode):
        own = power.mode == number
        shares.append(
            Share(mode_name(int(number)), float(seconds[own].sum()), float(joules[own].sum()))
        )
    return tuple(shares)


def station_uses(results: Sequence[StepResult]) -> tuple[StationUse, ...]:
    """Every step belongs to one stop: service movements, paths and pauses to theirs, a regional
    movement to the one where it ends.
    """
    kinds: dict[str, dict[str, list[StepResult]]] = {}
    for result in results:
        movement = result.step.movement
        if movement.is_pause:
            kind = "rest"
            station = movement.to_station or movement.from_station
        elif movement.kind == MovementKind.SERVICE_EXIT:
            kind = "service"
            station = movement.from_station
        elif movement.kind in (MovementKind.SERVICE_ENTRY, MovementKind.CARTESIAN):
            kind = "service"
            station = movement.to_station
        else:
            kind = "travel"
            station = movement.to_station
        kinds.setdefault(station or "elsewhere", {}).setdefault(kind, []).append(result)
    return tuple(
        StationUse(
            station, *(_share(kind, own.get(kind, [])) for kind in ("rest", "service", "travel"))
        )
        for station, own in kinds.items()
    )


def _share(kind: str, results: Sequence[StepResult]) -> Share:
    return Share(
        kind, sum(result.seconds for result in results), sum(result.energy for result in results)
    )
