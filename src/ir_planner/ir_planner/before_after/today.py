"""What a robot does today, wherever that is known from: movements between standstills, and
waits.
"""

from dataclasses import dataclass

import numpy as np

from ir_description import CellPath
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.before_after.process_paths import Lines, lines_of, process_notes, process_paths
from ir_planner.krl import DrivenStep, EvaluatedProgram
from ir_planner.program import Doors


@dataclass(frozen=True, eq=False)
class Stretch:
    """One movement, or a standstill of `seconds` (trajectory None), that ends at q (n,) [rad].

    works: something is done where it ends (an output, a wait for a machine), so that the stop is
    not only passed through. label: where it stands in its source. doors: machines that were not as
    the cell has them meanwhile; None: nobody recorded it, they are as the program's own signals
    move them. process: the path of the tool that it drives, alone or with neighbours that have the
    same one.
    """

    trajectory: JointTrajectory | None
    q: FloatArray
    seconds: float
    works: bool = False
    label: str = ""
    doors: Doors | None = None
    process: CellPath | None = None


@dataclass(frozen=True, eq=False)
class Today:
    """A program as it runs, from `start` (n,) [rad]; kind: what it is read from; notes: what was
    assumed.
    """

    name: str
    kind: str
    start: FloatArray
    stretches: tuple[Stretch, ...]
    notes: tuple[str, ...] = ()

    @property
    def doors(self) -> Doors | None:
        """Machines that were not as the cell has them when it began; None: nobody recorded it."""
        return self.stretches[0].doors if self.stretches else None

    @property
    def seconds(self) -> float:
        """Its cycle time."""
        return sum(one.seconds for one in self.stretches)


def today_of_krl(found: EvaluatedProgram, process: Lines | None = None) -> Today:
    """A KRL program as a KR C4 drives it.

    process: lines (first, last) whose motions are a process; None: those between an output's on and
    off, (): none. Raises RequestError for a process that can't be asked for as paths of the tool.
    """
    paths = process_paths([one.step for one in found.steps], process)
    stretches = tuple(
        _stretch(one.step, path) for one, path in zip(found.steps, paths, strict=True)
    )
    start = np.asarray(found.steps[0].step.trajectory.positions[0])
    notes = [str(note) for note in found.notes]
    waits = [step.step for step in found.steps if step.step.waits_for]
    if waits:
        notes.append(
            f"{len(waits)} waits for machines count no time: how long they take is not in a program"
        )
    notes += process_notes([one.step for one in found.steps], paths)
    return Today(found.name, "KRL program", start, stretches, tuple(notes))


def _stretch(step: DrivenStep, process: CellPath | None) -> Stretch:
    end = np.asarray(step.trajectory.positions[-1])
    works = bool(step.outputs or step.waits_for)
    trajectory = step.trajectory if step.moves else None
    label = lines_of(step.places)
    return Stretch(trajectory, end, step.trajectory.duration, works, label, process=process)
