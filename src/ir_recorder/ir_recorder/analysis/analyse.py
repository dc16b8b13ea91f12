"""A recording explained: joules, seconds and clearance per step, shares of modes and stations, Table II,
the grid.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ir_description import Cell, DescriptionError, Load, cell_from_yaml, load_power_data
from ir_kernels import KernelError
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.names import JOINT_NAMES, LOAD_SEPARATOR
from ir_recorder.analysis.clearance import StepClearance, held_part, step_clearances
from ir_recorder.analysis.grid import check_grid
from ir_recorder.analysis.indirect import IndirectMeter
from ir_recorder.analysis.loads import load_timeline, normal
from ir_recorder.analysis.meter import Meter
from ir_recorder.analysis.plateaus import table_2_plateaus
from ir_recorder.analysis.results import Analysis, StepResult
from ir_recorder.analysis.shares import mode_shares, station_uses
from ir_recorder.analysis.steps import ExecutedStep, executed_steps
from ir_recorder.read.recording import Recording

NAN = float("nan")


def analyse(recording: Recording) -> Analysis:
    """All results that a recording allows; missing topics leave gaps and a sentence."""
    return _Analyser(recording).analysis()


@dataclass
class _Analyser:
    recording: Recording
    problems: list[str] = field(default_factory=list)

    def analysis(self) -> Analysis:
        recording = self.recording
        power = recording.power if recording.power is not None and len(recording.power.time) > 1 else None
        meter = Meter(power) if power is not None else None
        cell = self._cell()
        loads = load_timeline(recording)
        steps = executed_steps(recording)
        results = self._results(steps, meter, cell)
        span = float(power.time[-1] - power.time[0]) if power is not None else recording.duration
        energy = meter.energy(-np.inf, np.inf) if meter is not None else NAN
        plateaus = (
            table_2_plateaus(recording, meter, loads, cell, load_power_data())
            if meter is not None and cell is not None
            else ()
        )
        return Analysis(
            recording=recording,
            cell=cell,
            loads=loads,
            seconds=span,
            energy=energy,
            mean_power=energy / span if span > 0.0 else NAN,
            peak_power=float(power.power.max()) if power is not None else NAN,
            steps=results,
            stations=station_uses(results),
            modes=mode_shares(power) if power is not None else (),
            grid=check_grid(recording.joints, power) if recording.joints is not None else None,
            plateaus=plateaus,
            problems=(*recording.problems, *self.problems),
        )

    def _cell(self) -> Cell | None:
        if not self.recording.cell_yaml:
            self.problems.append("no cell is attached: no clearance, no machines in the picture")
            return None
        try:
            return cell_from_yaml(self.recording.cell_yaml, "the attached cell")
        except DescriptionError as error:
            self.problems.append(f"the attached cell can't be read: {error}")
            return None

    def _results(
        self, steps: Sequence[ExecutedStep], meter: Meter | None, cell: Cell | None
    ) -> tuple[StepResult, ...]:
        indirect = self._indirect(cell)
        clearances = self._clearances(steps, cell)
        results = []
        for step, clearance in zip(steps, clearances, strict=True):
            start, end = step.start, step.end
            moved = indirect is not None and not step.movement.is_pause
            loads = _loads(cell, step.movement.load)
            results.append(
                StepResult(
                    step=step,
                    energy=meter.energy(start, end) if meter else NAN,
                    joint_energy=meter.joints(start, end) if meter else np.full(len(JOINT_NAMES), NAN),
                    base_energy=meter.base(start, end) if meter else NAN,
                    dissipated_energy=meter.dissipated(start, end) if meter else NAN,
                    peak_power=meter.peak(start, end) if meter else NAN,
                    indirect_energy=indirect.energy(start, end, loads) if indirect and moved else NAN,
                    tool_deviation=self._deviation(step),
                    clearance=clearance,
                )
            )
        return tuple(results)

    def _indirect(self, cell: Cell | None) -> IndirectMeter | None:
        if self.recording.joints is None or cell is None:
            return None
        return IndirectMeter(self.recording.joints, cell.robot, load_power_data())

    def _clearances(
        self, steps: Sequence[ExecutedStep], cell: Cell | None
    ) -> tuple[StepClearance | None, ...]:
        if cell is None or self.recording.joints is None:
            return (None,) * len(steps)
        try:
            return step_clearances(cell, self.recording.joints, steps)
        except (DescriptionError, InvalidValueError, KernelError) as error:
            self.problems.append(f"clearance can't be computed: {error}")
            return (None,) * len(steps)

    def _deviation(self, step: ExecutedStep) -> float:
        controller = self.recording.controller
        if controller is None or step.movement.is_pause:
            return NAN
        inside = (controller.time >= step.start) & (controller.time <= step.end)
        return float(controller.tool_deviation[inside].max()) if inside.any() else NAN


def _loads(cell: Cell | None, load: str) -> tuple[Load, ...]:
    if cell is None:
        return ()
    names = normal(load).split(LOAD_SEPARATOR)
    return tuple(item for item in cell.loads(held_part(cell, load)) if item.name in names)
