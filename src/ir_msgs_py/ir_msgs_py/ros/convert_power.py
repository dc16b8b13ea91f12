"""Power modes, the mains meter, PLC levels, signals and events of a program, to and from
messages.
"""

from __future__ import annotations

from dataclasses import fields

from ir_msgs.msg import PlcInputs as PlcInputsMsg
from ir_msgs.msg import PlcOutputs as PlcOutputsMsg
from ir_msgs.msg import PowerMode as PowerModeMsg
from ir_msgs.msg import PowerState as PowerStateMsg
from ir_msgs.msg import ProgramState as ProgramStateMsg
from ir_msgs.msg import Signal as SignalMsg
from ir_msgs_py.plc import PlcInputs, PlcOutputs, Signal
from ir_msgs_py.power import AXES, METER, PowerMode, PowerState
from ir_msgs_py.program import ProgramState
from ir_msgs_py.ros.convert_basics import float_array, time_from_msg, time_to_msg
from ir_msgs_py.ros.convert_report import planned_movement_from_msg, planned_movement_to_msg

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
