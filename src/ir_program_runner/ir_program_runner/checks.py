"""A program is checked as a whole before its first movement: what can't end well must not start."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_msgs_py.plc import Signal
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.status import StatusCode
from ir_program_runner.errors import ProgramError

MOST_STEPS = 1000  # of a request; a program of a cell has tens
LONGEST_ID = 256  # characters
LONGEST_PAUSE = 604_800.0  # s: a week, as for the driver's pauses
JOINT_TOLERANCE = 0.01  # rad, as the driver's for the first point of a trajectory


def check_request(program_id: str, steps: int) -> None:
    """Raise ProgramError: not exactly one of both is given, or more than a program can have."""
    sentence = ""
    if bool(program_id) == bool(steps):
        sentence = "give either program_id or movements"
    elif len(program_id) > LONGEST_ID:
        sentence = f"program_id has {len(program_id)} characters: at most {LONGEST_ID} are taken"
    elif steps > MOST_STEPS:
        sentence = f"the program has {steps} movements: at most {MOST_STEPS} are taken"
    if sentence:
        raise ProgramError(sentence, StatusCode.INVALID_GOAL_CONSTRAINTS)


def check_program(movements: Sequence[PlannedMovement]) -> None:
    """Raise ProgramError: no steps, no points, a gap between two movements, a bad signal or
    load.
    """
    if not movements:
        raise ProgramError("the program has no movements")
    before: PlannedMovement | None = None
    for index, movement in enumerate(movements):
        where = step_name(index, len(movements), movement)
        try:
            signals = [Signal.parse(text) for text in (*movement.wait_for, *movement.set_signals)]
            load_after(movement)
        except InvalidValueError as error:
            raise ProgramError(f"{where}: {error}") from error
        del signals
        if movement.duration > LONGEST_PAUSE:
            raise ProgramError(
                f"{where} takes {movement.duration:g} s: at most {LONGEST_PAUSE:g} s are allowed"
            )
        if movement.is_pause:
            continue
        if movement.trajectory is None:
            raise ProgramError(f"{where} has no points")
        if before is not None:
            _check_gap(where, before, movement)
        before = movement


def station_of(movement: PlannedMovement) -> str:
    """The station or path whose allowed contacts count in a movement: into it, out of it, along it;
    "" elsewhere.
    """
    kinds = (MovementKind.SERVICE_EXIT, MovementKind.SERVICE_ENTRY, MovementKind.CARTESIAN)
    service = movement.kind in kinds
    return movement.to_station if service else ""


def load_after(movement: PlannedMovement) -> str:
    """Return the load text when the step has ended; "" where the step leaves it open."""
    if not (movement.attach or movement.detach):
        return movement.load
    if not movement.load:
        raise InvalidValueError(
            f"{movement.attach or movement.detach} is attached or detached, but load is not given"
        )
    loads = [] if movement.load == NO_LOAD else movement.load.split(LOAD_SEPARATOR)
    if movement.detach:
        if movement.detach not in loads:
            raise InvalidValueError(
                f"{movement.detach} is detached, but attached is {movement.load}"
            )
        loads.remove(movement.detach)
    if movement.attach:
        if movement.attach in loads:
            raise InvalidValueError(f"{movement.attach} is attached, but it is already")
        loads.append(movement.attach)
    return LOAD_SEPARATOR.join(loads) or NO_LOAD


def step_name(index: int, total: int, movement: PlannedMovement) -> str:
    """Name of a step in sentences: "step 2 of 5 (regional lathe -> park)"."""
    places = " -> ".join(place for place in (movement.from_station, movement.to_station) if place)
    mode = movement.power_mode if movement.is_pause else ""
    text = " ".join(part for part in (str(movement.kind), mode, places) if part)
    return f"step {index + 1} of {total} ({text})"


def _check_gap(where: str, before: PlannedMovement, movement: PlannedMovement) -> None:
    assert before.trajectory is not None
    assert movement.trajectory is not None
    end = before.trajectory.reordered(movement.trajectory.joint_names).positions[-1]
    gap = movement.trajectory.positions[0] - end
    joint = int(np.argmax(np.abs(gap)))
    if abs(gap[joint]) > JOINT_TOLERANCE:
        name = movement.trajectory.joint_names[joint]
        raise ProgramError(
            f"{where} starts {gap[joint]:+.4f} rad at {name} from where the movement before ends: "
            f"at most {JOINT_TOLERANCE} rad are allowed"
        )
