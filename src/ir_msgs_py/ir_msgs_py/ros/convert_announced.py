"""Timers, load and cell, as driver and planner announce them, to and from messages."""

from __future__ import annotations

import numpy as np

from ir_msgs.msg import CarriedLoad as CarriedLoadMsg
from ir_msgs.msg import CellState as CellStateMsg
from ir_msgs.msg import ControllerTimers as ControllerTimersMsg
from ir_msgs_py.announced import CarriedLoad, CellState, ControllerTimers
from ir_msgs_py.errors import InvalidValueError, ParameterError
from ir_msgs_py.modes import RESTS, checked_mode
from ir_msgs_py.ros.convert_basics import float_array, point_from_msg, point_to_msg
from ir_msgs_py.ros.convert_pose import pose_from_msg, pose_to_msg
from ir_msgs_py.transitions import TransitionTimes

_UPPER = np.triu_indices(3)


def controller_timers_to_msg(timers: ControllerTimers) -> ControllerTimersMsg:
    """Timers of a controller."""
    times = timers.transitions
    names = [row.mode.name for row in RESTS]
    return ControllerTimersMsg(
        brakes_after=timers.brakes_after,
        modes=[int(row.mode) for row in RESTS],
        enter=[times.enter(name) for name in names],
        stay=[times.minimum_stay(name) for name in names],
        leave=[times.leave(name) for name in names],
    )


def controller_timers_from_msg(msg: ControllerTimersMsg) -> ControllerTimers:
    """Timers of a controller; they must be those of every mode to rest in."""
    lists = (msg.modes, msg.enter, msg.stay, msg.leave)
    if len({len(values) for values in lists}) != 1:
        lengths = ", ".join(str(len(values)) for values in lists)
        raise InvalidValueError(
            f"modes, enter, stay and leave have {lengths} values: as many of each"
        )
    modes = [checked_mode(int(mode)) for mode in msg.modes]
    missing = [row.mode.name for row in RESTS if row.mode not in modes]
    if missing:
        raise InvalidValueError(f"the timers of {', '.join(missing)} are missing")
    times: dict[str, float] = {}
    for mode, enter, stay, leave in zip(modes, msg.enter, msg.stay, msg.leave, strict=True):
        if mode in {row.mode for row in RESTS}:
            key = mode.name.lower()
            times |= {f"{key}_enter": enter, f"{key}_minimum_stay": stay, f"{key}_leave": leave}
    try:
        return ControllerTimers(msg.brakes_after, TransitionTimes(**times))
    except ParameterError as error:
        raise InvalidValueError(str(error)) from error


def carried_load_to_msg(load: CarriedLoad) -> CarriedLoadMsg:
    """What the robot carries."""
    return CarriedLoadMsg(
        load=load.text,
        mass=load.mass,
        center_of_mass=point_to_msg(load.center_of_mass),
        inertia=float_array(load.inertia[_UPPER]),
        watts_always=load.watts_always,
        watts_drive_bus=load.watts_drive_bus,
    )


def carried_load_from_msg(msg: CarriedLoadMsg) -> CarriedLoad:
    """What the robot carries."""
    if len(msg.inertia) != 6:
        raise InvalidValueError(f"inertia has {len(msg.inertia)} values: it must have 6")
    inertia = np.zeros((3, 3))
    inertia[_UPPER] = inertia.T[_UPPER] = msg.inertia
    return CarriedLoad(
        msg.load,
        msg.mass,
        point_from_msg(msg.center_of_mass),
        inertia,
        msg.watts_always,
        msg.watts_drive_bus,
    )


def cell_state_to_msg(cell: CellState) -> CellStateMsg:
    """The planner's cell."""
    return CellStateMsg(
        name=cell.name,
        hash=cell.hash,
        equipment=list(cell.equipment),
        poses=[pose_to_msg(pose) for pose in cell.poses],
        enabled=list(cell.enabled),
        states=list(cell.states),
        cell_yaml=cell.cell_yaml,
    )


def cell_state_from_msg(msg: CellStateMsg) -> CellState:
    """The planner's cell."""
    return CellState(
        msg.name,
        msg.hash,
        msg.cell_yaml,
        tuple(msg.equipment),
        tuple(pose_from_msg(pose) for pose in msg.poses),
        tuple(msg.enabled),
        tuple(msg.states),
    )
