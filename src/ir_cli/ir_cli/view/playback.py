"""Playback of a plan: joint values, power and the tool's place over time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ir_description import Cell, PartPlaces, cell_in
from ir_kernels import Chain
from ir_msgs_py.report import PlannedMovement
from ir_planner.checks import movement_energy
from ir_planner.scene import PlanningScene
from ir_recorder.analysis.clearance import places_after
from ir_values.arrays import FloatArray, IntArray

RATE = 25.0  # Hz
PAUSE_SHOWN = 1.0
"""Longest pause [s] that is played; longer ones are shortened."""


@dataclass(frozen=True, eq=False)
class PlayedStep:
    """A movement or a pause: what it is, its true seconds and joules, what is held and where parts
    lie meanwhile, and the cell with its machines in their states.
    """

    label: str
    seconds: float
    joules: float
    clearance: float | None
    load: str
    places: PartPlaces
    movement: PlannedMovement
    cell: Cell


@dataclass(frozen=True, eq=False)
class PlayedMotion:
    """time (N,) s from 0, q (N, n) rad, watts (N,) W at the mains, tool (N, 3) m in the world, step
    (N,) of steps. shortened: whether pauses are played shorter than they are.
    """

    time: FloatArray
    q: FloatArray
    watts: FloatArray
    tool: FloatArray
    step: IntArray
    steps: tuple[PlayedStep, ...]
    shortened: bool

    @property
    def duration(self) -> float:
        """Seconds that it is played."""
        return float(self.time[-1])

    @property
    def peak(self) -> float:
        """Largest power at the mains [W], as the plan's reports have it; samples lie below."""
        return max(step.movement.report.peak_power for step in self.steps)

    def at(self, time: float) -> int:
        """The sample that is shown at a time [s]."""
        return min(int(np.searchsorted(self.time, time)), len(self.time) - 1)

    def segments(self) -> IntArray:
        """Samples k (M,) whose successor belongs to the same movement: the pieces of the tool's
        path.
        """
        moves = np.abs(np.diff(self.tool, axis=0)).max(axis=1, initial=0.0) > 1e-6
        return np.flatnonzero(moves & (np.diff(self.step) == 0))


def motion_of(
    movements: Sequence[PlannedMovement], cell: Cell, scene_of: Callable[[str], PlanningScene]
) -> PlayedMotion | None:
    """The movements one after the other; None where there is none. scene_of: with a load."""
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    places = cell.parts_at_start()
    begin = 0.0
    shortened = False
    states = MachineStates(cell)
    q = next((m.trajectory.sample([0.0]).q[0] for m in movements if m.trajectory is not None), None)
    if q is None:
        return None
    times = []
    qs = []
    watts = []
    numbers = []
    steps = []
    for number, movement in enumerate(movements):
        shown = min(movement.duration, PAUSE_SHOWN) if movement.is_pause else movement.duration
        shortened |= shown < movement.duration
        local = np.linspace(0.0, shown, max(int(np.ceil(shown * RATE)), 1) + 1)
        if movement.trajectory is None:
            qs.append(np.repeat(q[None], len(local), axis=0))
            watts.append(np.full(len(local), movement.report.energy / max(movement.duration, 1e-9)))
        else:
            trajectory = movement.trajectory.reordered(cell.robot.joint_names)
            qs.append(trajectory.sample(local).q)
            energy = movement_energy(trajectory, scene_of(movement.load))
            watts.append(np.interp(local, energy.times, energy.watts))
            q = qs[-1][-1]
        times.append(begin + local)
        numbers.append(np.full(len(local), number))
        steps.append(_step(movement, places, states.during(movement)))
        begin += shown
        places = places_after(cell, places, movement)
        states.after(movement)
    poses = chain.tcp_poses(np.concatenate(qs))
    time, joints, power, step = (np.concatenate(each) for each in (times, qs, watts, numbers))
    return PlayedMotion(time, joints, power, poses[:, :3, 3], step, tuple(steps), shortened)


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


def _step(movement: PlannedMovement, places: PartPlaces, cell: Cell) -> PlayedStep:
    ends = (movement.from_station, movement.to_station)
    label = f"{movement.kind} {' to '.join(dict.fromkeys(filter(None, ends)))}"
    if movement.power_mode:
        label += f" ({movement.power_mode})"
    clearance = None if movement.is_pause else movement.report.min_clearance
    joules = movement.report.energy
    return PlayedStep(
        label, movement.duration, joules, clearance, movement.load, places, movement, cell
    )


class Playback:
    """A motion and the time [s] at which it stands."""

    def __init__(self, motion: PlayedMotion | None = None) -> None:
        self.motion = motion
        self.time = 0.0
        self.runs = False

    @property
    def sample(self) -> int:
        """The sample that is shown."""
        return 0 if self.motion is None else self.motion.at(self.time)

    @property
    def step(self) -> PlayedStep | None:
        """The step that is shown."""
        return (
            None if self.motion is None else self.motion.steps[int(self.motion.step[self.sample])]
        )

    def advance(self, seconds: float) -> None:
        """Go on by so many seconds; after the end from the beginning."""
        if self.motion is not None and self.motion.duration > 0.0:
            self.time = (self.time + seconds) % self.motion.duration
