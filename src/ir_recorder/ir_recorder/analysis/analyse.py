"""A recording explained: joules, seconds and clearance per step, totals of the program, shares of
modes and stations, power at rest, the grid.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ir_description import (
    Cell,
    DescriptionError,
    PowerData,
    PowerParameters,
    cell_from_yaml,
    data_sheet_of,
)
from ir_description.robot import DATA_SHEET, ROBOTS, DcLink
from ir_kernels import KernelError
from ir_msgs_py.modes import deepest, drive_bus_up
from ir_msgs_py.names import JOINT_NAMES
from ir_recorder.analysis.clearance import StepClearance, step_clearances
from ir_recorder.analysis.indirect import IndirectMeter
from ir_recorder.analysis.loads import carried, load_timeline
from ir_recorder.analysis.meter import Meter
from ir_recorder.analysis.predicted_power import (
    BRAKES,
    MOTORS,
    BrakeTimer,
    Predictor,
    pause_joules,
    recorded_link,
    recorded_power_data,
    resting_watts,
)
from ir_recorder.analysis.resting_power import plateaus
from ir_recorder.analysis.results import (
    NAN,
    Analysis,
    FullPause,
    ProgramTotals,
    Share,
    StepResult,
    Unshortened,
    check_grid,
    mode_shares,
    station_uses,
)
from ir_recorder.analysis.steps import ExecutedStep, executed_steps
from ir_recorder.analysis.tending import SignalChange, TendedStep, Tending, tending_of
from ir_recorder.format import contents
from ir_recorder.reading.recording import Recording
from ir_values.arrays import FloatArray
from ir_values.errors import InvalidValueError

# The program as a whole: movements, pauses and waiting, planned and measured, and the cycle
# unshortened.

Watts = Callable[[str, StepResult], float]
"""W of a mode in the posture and with the load of a step, by the data."""
Added = Callable[[str, StepResult], FloatArray]
"""What drawn robots add (N,) W to it."""


def program_totals(
    results: Sequence[StepResult], meter: Meter | None, unshortened: Unshortened | None
) -> ProgramTotals | None:
    """Totals from the start of the first step to the end of the last; None where no step was
    recorded.
    """
    if not results:
        return None
    start = results[0].step.start
    end = results[-1].step.end
    moved = [result for result in results if not result.step.movement.is_pause]
    rested = [result for result in results if result.step.movement.is_pause]
    return ProgramTotals(
        Share("program", end - start, meter.energy(start, end) if meter else NAN),
        _measured("movements", moved),
        _measured("pauses", rested),
        _planned_sums("movements", moved),
        _planned_sums("pauses", rested),
        unshortened,
    )


def unshortened_cycle(
    results: Sequence[StepResult],
    fact: str,
    change: Callable[[str], float],
    recharge: Callable[[float], float],
    timer: BrakeTimer,
    watts: Watts,
    added_watts: Added,
    meter: Meter,
) -> Unshortened | None:
    """The cycle with its pauses at full length, computed from what was measured; None where none is
    shorter.

    fact: full lengths of the pauses in a power mode, in their order ("180 s, 1800 s"). change:
    seconds into a mode and back by the data. recharge: J of the DC link after so long with the
    drive bus off. timer: the controller left alone.
    """
    lengths = [float(number) for number in re.findall(r"\d+(?:\.\d+)?(?=\s*s\b)", fact)]
    if not lengths:
        return None
    pauses = [
        (place, result)
        for place, result in enumerate(results)
        if result.step.movement.is_pause and result.step.movement.power_mode
    ]
    run_pauses = sum(result.seconds for _, result in pauses)
    if len(pauses) != len(lengths):
        return Unshortened(NAN, NAN, run_pauses, sum(lengths))
    added = tuple(
        _full_pause(place, result, length, change, recharge, timer, watts, added_watts)
        for (place, result), length in zip(pauses, lengths, strict=True)
    )
    start = results[0].step.start
    end = results[-1].step.end
    return Unshortened(
        end - start + sum(pause.seconds for pause in added),
        meter.energy(start, end) + sum(pause.energy for pause in added),
        run_pauses,
        sum(lengths),
        added,
    )


def _full_pause(
    place: int,
    result: StepResult,
    length: float,
    change: Callable[[str], float],
    recharge: Callable[[float], float],
    timer: BrakeTimer,
    watts: Watts,
    added_watts: Added,
) -> FullPause:
    """What `length` [s] adds to a pause of the run, and to that of the common program."""
    sequence = result.step.movement.power_mode
    planned = result.step.movement
    mode = deepest(sequence)
    motors = watts(MOTORS, result)
    brakes = watts(BRAKES, result)
    motors_added = added_watts(MOTORS, result)
    longer = length - result.seconds
    alone = timer.joules(motors, brakes, length)
    common_added = timer.joules(motors_added, added_watts(BRAKES, result), length)
    common = alone - timer.joules(motors, brakes, planned.duration)
    if mode == MOTORS or length < change(mode):
        mode = BRAKES if length > timer.after else MOTORS
        full = alone
        saved_added = np.zeros_like(motors_added)
    else:
        full = pause_joules(watts(mode, result), motors, length, change(mode))
        full += 0.0 if drive_bus_up(mode) else recharge(length - change(mode))
        own = pause_joules(added_watts(mode, result), motors_added, length, change(mode))
        saved_added = common_added - own
    energy = full - result.energy
    predicted = full - planned.report.energy
    if deepest(sequence) != sequence and longer >= 0.0:
        # one mode after the other: the last one lasts longer
        energy = longer * watts(mode, result)
        predicted = (length - planned.duration) * watts(mode, result)
    return FullPause(
        place, mode, longer, length - planned.duration, energy, predicted, common, saved_added
    )


def _measured(name: str, results: Sequence[StepResult]) -> Share:
    return Share(name, sum(r.seconds for r in results), sum(r.energy for r in results))


def _planned_sums(name: str, results: Sequence[StepResult]) -> Share:
    """Time and joules that were planned for these steps."""
    plans = [r.step.movement for r in results]
    return Share(
        name,
        sum(p.duration or p.report.duration for p in plans),
        sum(p.report.energy for p in plans),
    )


# Charge of the DC link's capacitors that a plan counted on, and that had gone when the robot
# moved.
#
# A program's plan carries what braking leaves to the next movement, less what holding the arm takes
# in the planned time between. Nodes answer late where the machine is busy: by then more of it has
# gone.


def lost_charges(steps: Sequence[ExecutedStep], meter: Meter | None, link: DcLink) -> list[float]:
    """J for each step: in the capacitors when it should have begun, less those in them when it did.

    0 where it did not begin late, or where the voltage of the DC link was not recorded.
    """
    lost: list[float] = []
    due = math.inf
    for step in steps:
        if not step.index:  # a program begins when it is asked to
            due = math.inf
        late = meter is not None and due < step.start
        gone = (
            meter.stored(due, link) - meter.stored(step.start, link)
            if meter is not None and late
            else 0.0
        )
        lost.append(gone if gone > 0.0 else 0.0)
        due = due + step.movement.duration if step.movement.is_pause else step.end
    return lost


def analyse(recording: Recording, parameters: PowerParameters | None = None) -> Analysis:
    """All results that a recording allows; missing topics leave gaps and a sentence.

    parameters: what joules of movements are predicted and rebuilt by; None: the plan's own, and the
    data's.
    """
    return _Analyser(recording, parameters).analysis()


def _tending(
    cell: Cell, results: Sequence[StepResult], meter: Meter, recording: Recording
) -> Tending | None:
    """The parts of a route, from the steps and signals of the recording."""
    steps = []
    turn = results[0].step.start if results else 0.0
    for result in results:
        step = result.step
        waiting = meter.energy(turn, step.start)
        begin = min(turn, step.start)
        steps.append(TendedStep(step.movement, begin, step.start, step.end, waiting, result.energy))
        turn = step.end
    changes = [SignalChange(each.time, each.name, each.text == "1") for each in recording.signals]
    return tending_of(cell, steps, changes)


@dataclass
class _Analyser:
    recording: Recording
    parameters: PowerParameters | None = None
    problems: list[str] = field(default_factory=list)
    cell: Cell | None = field(init=False)
    data: PowerData = field(init=False)
    link: DcLink = field(init=False)

    def __post_init__(self) -> None:
        self.cell = self._cell()
        self.data, problem = recorded_power_data(self.recording, self.cell)
        self.problems += [problem] if problem else []
        self.link = recorded_link(self.recording, self.data)

    def analysis(self) -> Analysis:
        """All that the recording tells; without power series figures of energy are NaN."""
        recording = self.recording
        power = (
            recording.power
            if recording.power is not None and len(recording.power.time) > 1
            else None
        )
        meter = Meter(power) if power is not None else None
        cell = self.cell
        loads = load_timeline(recording)
        steps = self._predicted(executed_steps(recording), cell)
        results = self._results(steps, meter, cell)
        span = float(power.time[-1] - power.time[0]) if power is not None else recording.duration
        energy = meter.energy(-np.inf, np.inf) if meter is not None else NAN
        return Analysis(
            recording=recording,
            cell=cell,
            loads=loads,
            seconds=span,
            energy=energy,
            mean_power=energy / span if span > 0.0 else NAN,
            peak_power=float(power.power.max()) if power is not None else NAN,
            steps=results,
            program=program_totals(results, meter, self._unshortened(results, meter, cell)),
            safety_distance=self._safety_distance(results),
            stations=station_uses(results),
            modes=mode_shares(power) if power is not None else (),
            grid=check_grid(recording.joints, power) if recording.joints is not None else None,
            plateaus=plateaus(recording, meter, loads, cell, self.data) if meter and cell else (),
            problems=(*recording.problems, *self.problems),
            tending=_tending(cell, results, meter, recording) if cell and meter else None,
        )

    def _cell(self) -> Cell | None:
        if not self.recording.cell_yaml:
            self.problems.append("no cell is attached: no clearance, no machines in the picture")
            return None
        try:
            return cell_from_yaml(self.recording.cell_yaml, "the attached cell")
        except (DescriptionError, InvalidValueError, RecursionError) as error:
            self.problems.append(f"the attached cell can't be read: {error}")
            return None

    def _safety_distance(self, results: tuple[StepResult, ...]) -> float:
        """The least S_m that a movement was planned with; of plans that say none the one among the
        facts.
        """
        said = [result.step.movement.report.safety_distance for result in results]
        if planned := [distance for distance in said if distance > 0.0]:
            return min(planned)
        fact = self.recording.fact(contents.SAFETY_DISTANCE).removesuffix("m")
        try:
            return float(fact) if fact else NAN
        except ValueError:
            self.problems.append(f"the recorded safety distance {fact[:40]!r} is not a number")
            return NAN

    def _unshortened(
        self, results: tuple[StepResult, ...], meter: Meter | None, cell: Cell | None
    ) -> Unshortened | None:
        fact = self.recording.fact(contents.UNSHORTENED_PAUSES)
        if not fact or meter is None or cell is None or not results:
            return None

        def watts(mode: str, result: StepResult) -> float:
            return self._resting(mode, result.step, cell)

        def change(mode: str) -> float:
            own = self.data.resting(mode)
            return own.time_to_pause + own.regular_time_to_operate

        parameters = self.parameters or data_sheet_of(cell.robot, self.data)
        predictor = Predictor(cell.robot, self.data.dc_link, cell.base_pose, parameters)

        def added(mode: str, result: StepResult) -> FloatArray:
            q = self._posture(result.step, cell)
            if q is None:
                return np.full(ROBOTS, NAN)
            name = self.data.resting(mode).name
            return predictor.added_at_rest(name, q, carried(cell, result.step.movement.load))

        timer = BrakeTimer.of(self.data)
        recharge = self.data.dc_link.recharge
        return unshortened_cycle(results, fact, change, recharge, timer, watts, added, meter)

    def _posture(self, step: ExecutedStep, cell: Cell | None) -> FloatArray | None:
        """Joint values (n,) where a step begins; None where posture or cell are missing."""
        joints = self.recording.joints
        if (
            cell is None
            or joints is None
            or joints.position.shape[1] != cell.robot.n
            or not len(joints.time)
        ):
            return None
        row = int(np.clip(np.searchsorted(joints.time, step.start), 0, len(joints.time) - 1))
        return np.asarray(joints.position[row])

    def _resting(self, mode: str, step: ExecutedStep, cell: Cell | None) -> float:
        """W at rest where a step begins, by the data; NaN where posture or cell are missing."""
        q = self._posture(step, cell)
        if cell is None or q is None:
            return NAN
        loads = carried(cell, step.movement.load)
        return resting_watts(mode, q, cell, loads, self.data)

    def _results(
        self, steps: Sequence[ExecutedStep], meter: Meter | None, cell: Cell | None
    ) -> tuple[StepResult, ...]:
        indirect = self._indirect(cell)
        clearances = self._clearances(steps, cell)
        lost = lost_charges(steps, meter, self.link)
        return tuple(
            replace(self._result(step, clearance, meter, cell, indirect), lost_charge=charge)
            for step, clearance, charge in zip(steps, clearances, lost, strict=True)
        )

    def _result(
        self,
        step: ExecutedStep,
        clearance: StepClearance | None,
        meter: Meter | None,
        cell: Cell | None,
        indirect: IndirectMeter | None,
    ) -> StepResult:
        """What a step took, by all meters that there are: energies in J, NaN where none tells."""
        start = step.start
        end = step.end
        result = StepResult(
            step=step,
            energy=NAN,
            straddling_energy=NAN,
            joint_energy=np.full(len(JOINT_NAMES), NAN),
            base_energy=NAN,
            dissipated_energy=NAN,
            rectifier_energy=NAN,
            peak_power=NAN,
            indirect_energy=NAN,
            second_opinion=NAN,
            torque_energy=NAN,
            stored_energy=NAN,
            motors_power=self._resting(MOTORS, step, cell),
            tool_deviation=self._deviation(step),
            clearance=clearance,
        )
        if meter:
            result = replace(
                result,
                energy=meter.energy(start, end),
                straddling_energy=meter.straddling(start, end),
                joint_energy=meter.joints(start, end),
                base_energy=meter.base(start, end),
                dissipated_energy=meter.dissipated(start, end),
                rectifier_energy=meter.rectifier(start, end),
                peak_power=meter.peak(start, end),
                stored_energy=meter.stored(start, self.link),
                slip=meter.slip(start, end),
            )
        if indirect and not step.movement.is_pause:
            loads = carried(cell, step.movement.load)
            result = replace(
                result,
                indirect_energy=indirect.energy(start, end, loads),
                second_opinion=indirect.second_opinion(start, end, loads),
                torque_energy=indirect.from_torques(start, end, loads),
            )
        return result

    def _indirect(self, cell: Cell | None) -> IndirectMeter | None:
        if self.recording.joints is None or cell is None:
            return None
        parameters = self.parameters or data_sheet_of(cell.robot, self.data)
        link = self.data.dc_link
        return IndirectMeter(self.recording.joints, cell.robot, cell.base_pose, link, parameters)

    def _predicted(
        self, steps: Sequence[ExecutedStep], cell: Cell | None
    ) -> Sequence[ExecutedStep]:
        """The steps with the energies that the given parameters predict for their movements."""
        parameters = self.parameters
        if parameters is None or cell is None:
            named = {step.movement.report.power_parameters for step in steps} - {"", DATA_SHEET}
            if named and parameters is None:
                self.problems.append(
                    f"planned by the power parameters {min(named)[:80]}; energies from positions "
                    "follow the data sheet: name their file with --power-parameters"
                )
            return steps
        predictor = Predictor(cell.robot, self.data.dc_link, cell.base_pose, parameters)
        found = []
        for step in steps:
            movement = step.movement
            if movement.trajectory is not None:
                loads = carried(cell, movement.load)
                report = predictor.report(movement.report, movement.trajectory, loads)
                step = replace(step, movement=replace(movement, report=report))
            found.append(step)
        return found

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
