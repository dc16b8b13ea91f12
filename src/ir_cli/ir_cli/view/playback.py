"""Playback of a plan: where the robot is at a time, what it holds, and where parts lie."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, PartPlaces
from ir_description.cell import cell_in
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import Side
from ir_recorder.analysis.clearance import places_after
from ir_recorder.report.motion_scene import side_of_steps
from ir_values.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class PlayedStep:
    """A movement or a pause from `begin` [s] on: what it is, what is held and where parts lie
    meanwhile, and the cell with its machines in their states. q (n,): where the robot stands
    before it.
    """

    begin: float
    label: str
    load: str
    places: PartPlaces
    movement: PlannedMovement
    cell: Cell
    q: FloatArray

    def at(self, time: float) -> FloatArray:
        """Joint values (n,) at a time of the program [s]."""
        trajectory = self.movement.trajectory
        if trajectory is None:
            return self.q
        own = trajectory.reordered(self.cell.robot.joint_names)
        inside = min(max(time - self.begin + own.times[0], own.times[0]), own.duration)
        return np.asarray(own.sample([inside]).q[0])


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """A program with its power, and its steps one after the other."""

    side: Side
    steps: tuple[PlayedStep, ...]

    def step(self, time: float) -> PlayedStep:
        """The step that runs at a time [s]."""
        begins = [step.begin for step in self.steps]
        place = int(np.searchsorted(begins, time, side="right")) - 1
        return self.steps[min(max(place, 0), len(self.steps) - 1)]

    def watts(self, time: float) -> float:
        """Power at the mains [W]."""
        return float(np.interp(time, self.side.time, self.side.watts))


def motion_of(movements: Sequence[PlannedMovement], cell: Cell) -> PlayedMotion | None:
    """The movements one after the other; None where nothing moves."""
    ordered = [
        movement.trajectory.reordered(cell.robot.joint_names)
        for movement in movements
        if movement.trajectory is not None
    ]
    side = side_of_steps(movements, cell)
    if side is None:
        return None
    places = cell.parts_at_start()
    states = MachineStates(cell)
    q = np.asarray(ordered[0].positions[0])
    begin = 0.0
    steps = []
    for movement in movements:
        step = PlayedStep(
            begin, _label(movement), movement.load, places, movement, states.during(movement), q
        )
        steps.append(step)
        begin += movement.duration
        q = step.at(begin)
        places = places_after(cell, places, movement)
        states.after(movement)
    return PlayedMotion(side, tuple(steps))


class MachineStates:
    """States of machines along a program: as its movements rely on them, and as its signals turn
    them.
    """

    def __init__(self, cell: Cell) -> None:
        self._cell = cell
        self._now = {machine.name: machine.state for machine in cell.equipment}
        self._cells: dict[tuple[str, ...], Cell] = {tuple(self._now.values()): cell}

    def during(self, movement: PlannedMovement) -> Cell:
        """The cell while a movement runs; the same object for the same states."""
        for text in movement.states:
            self._turn(*text.split("=", 1))
        key = tuple(self._now.values())
        if key not in self._cells:
            changed = {name: (state,) for name, state in self._now.items() if state}
            self._cells[key] = cell_in(self._cell, changed)
        return self._cells[key]

    def after(self, movement: PlannedMovement) -> None:
        """Signals that it sets count from its end on."""
        for text in movement.set_signals:
            name, _, level = text.partition("=")
            for machine in self._cell.equipment:
                if machine.switch is not None and machine.switch.signal == name:
                    self._turn(
                        machine.name, machine.switch.off if level == "0" else machine.switch.on
                    )

    def _turn(self, machine: str, state: str) -> None:
        if state in [each.name for each in self._cell.machine(machine).states]:
            self._now[machine] = state


def _label(movement: PlannedMovement) -> str:
    ends = (movement.from_station, movement.to_station)
    label = f"{movement.kind} {' to '.join(dict.fromkeys(filter(None, ends)))}"
    return f"{label} ({movement.power_mode})" if movement.power_mode else label
