"""Conversions of what driver and planner announce to and from messages: power modes, the mains
meter, PLC levels, program states, timers, the load and the cell. Each pair is a round trip.
"""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from ir_msgs.msg import CarriedLoad as CarriedLoadMsg
from ir_msgs.msg import CellState as CellStateMsg
from ir_msgs.msg import ControllerTimers as ControllerTimersMsg
from ir_msgs.msg import PlcInputs as PlcInputsMsg
from ir_msgs.msg import PlcOutputs as PlcOutputsMsg
from ir_msgs.msg import PowerMode as PowerModeMsg
from ir_msgs.msg import PowerState as PowerStateMsg
from ir_msgs.msg import ProgramState as ProgramStateMsg
from ir_msgs.msg import Signal as SignalMsg
from ir_msgs_py.announcements import CarriedLoad, CellState, ControllerTimers, ProgramState
from ir_msgs_py.modes import (
    AXES,
    METER,
    RESTS,
    PowerMode,
    PowerState,
    TransitionTimes,
    checked_mode,
)
from ir_msgs_py.plc import PlcInputs, PlcOutputs, Signal
from ir_msgs_py.ros.conversions import (
    float_array,
    point_from_msg,
    point_to_msg,
    pose_from_msg,
    pose_to_msg,
    time_from_msg,
    time_to_msg,
)
from ir_msgs_py.ros.plan_conversions import planned_movement_from_msg, planned_movement_to_msg
from ir_values.errors import InvalidValueError

_POWER_MODE = tuple(field.name for field in fields(PowerMode))
_INPUTS = tuple(field.name for field in fields(PlcInputs))
_OUTPUTS = tuple(field.name for field in fields(PlcOutputs) if field.name != "stamp_ns")


def power_mode_to_msg(mode: PowerMode) -> PowerModeMsg:
    """Mode with its power, times and energies."""
    values = {name: getattr(mode, name) for name in _POWER_MODE}
    return PowerModeMsg(**{**values, "mode": int(mode.mode), "break_even": float(mode.break_even)})


def power_mode_from_msg(msg: PowerModeMsg) -> PowerMode:
    """Mode with its power, times and energies."""
    return PowerMode(**{name: getattr(msg, name) for name in _POWER_MODE})


def power_state_to_msg(state: PowerState) -> PowerStateMsg:
    """Reading of the mains meter."""
    msg = PowerStateMsg(
        mode=int(state.mode),
        target_mode=int(state.target_mode),
        plant=state.plant,
        **{name: getattr(state, name) for name in METER},
        **{name: float_array(getattr(state, name)) for name in AXES},
    )
    msg.header.stamp = time_to_msg(state.stamp_ns)
    return msg


def power_state_from_msg(msg: PowerStateMsg) -> PowerState:
    """Reading of the mains meter."""
    return PowerState(
        stamp_ns=time_from_msg(msg.header.stamp),
        mode=msg.mode,
        target_mode=msg.target_mode,
        plant=msg.plant,
        **{name: getattr(msg, name) for name in (*METER, *AXES)},
    )


def plc_inputs_to_msg(inputs: PlcInputs) -> PlcInputsMsg:
    """Levels from the PLC."""
    values = {name: getattr(inputs, name) for name in _INPUTS}
    return PlcInputsMsg(**{**values, "operating_mode": int(inputs.operating_mode)})


def plc_inputs_from_msg(msg: PlcInputsMsg) -> PlcInputs:
    """Levels from the PLC."""
    return PlcInputs(**{name: getattr(msg, name) for name in _INPUTS})


def plc_outputs_to_msg(outputs: PlcOutputs) -> PlcOutputsMsg:
    """Levels from the controller."""
    values = {name: getattr(outputs, name) for name in _OUTPUTS}
    msg = PlcOutputsMsg(**{**values, "operating_mode": int(outputs.operating_mode)})
    msg.header.stamp = time_to_msg(outputs.stamp_ns)
    return msg


def plc_outputs_from_msg(msg: PlcOutputsMsg) -> PlcOutputs:
    """Levels from the controller."""
    return PlcOutputs(
        stamp_ns=time_from_msg(msg.header.stamp), **{name: getattr(msg, name) for name in _OUTPUTS}
    )


def signal_to_msg(signal: Signal) -> SignalMsg:
    """Signal of a machine."""
    return SignalMsg(stamp=time_to_msg(signal.stamp_ns), name=signal.name, value=signal.value)


def signal_from_msg(msg: SignalMsg) -> Signal:
    """Signal of a machine."""
    return Signal(msg.name, bool(msg.value), time_from_msg(msg.stamp))


def program_state_to_msg(state: ProgramState) -> ProgramStateMsg:
    """Event of a program; points stay out."""
    msg = ProgramStateMsg(
        program_id=state.program_id,
        index=state.index,
        total=state.total,
        event=str(state.event),
        movement=planned_movement_to_msg(state.movement, include_points=False),
        note=state.note,
    )
    msg.header.stamp = time_to_msg(state.stamp_ns)
    return msg


def program_state_from_msg(msg: ProgramStateMsg) -> ProgramState:
    """Event of a program."""
    return ProgramState(
        stamp_ns=time_from_msg(msg.header.stamp),
        program_id=msg.program_id,
        index=msg.index,
        total=msg.total,
        event=msg.event,
        movement=planned_movement_from_msg(msg.movement),
        note=msg.note,
    )


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
    """Timers of a controller; they must be those of every mode to rest in. Raises InvalidValueError
    for others.
    """
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
    return ControllerTimers(msg.brakes_after, TransitionTimes(**times))


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
    """What the robot carries. Raises InvalidValueError for figures that no load has."""
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
