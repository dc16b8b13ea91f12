"""The program as a whole: movements, pauses and waiting, planned and measured, and the cycle
unshortened.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

from ir_msgs_py.modes import deepest
from ir_recorder.analysis.meter import Meter
from ir_recorder.analysis.resting import BRAKES, MOTORS, left_alone_joules, pause_joules
from ir_recorder.analysis.results import NAN, ProgramTotals, Share, StepResult, Unshortened

Watts = Callable[[str, StepResult], float]
"""W of a mode in the posture and with the load of a step, by the data."""


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
        _planned("movements", moved),
        _planned("pauses", rested),
        unshortened,
    )


def unshortened_cycle(
    results: Sequence[StepResult],
    fact: str,
    change: Callable[[str], float],
    timer: float,
    watts: Watts,
    meter: Meter,
) -> Unshortened | None:
    """The cycle with its pauses at full length, computed from what was measured; None where none is
    shorter.

    fact: full lengths of the pauses in a power mode, in their order ("180 s, 1800 s"). change:
    seconds into a mode and back by the data. timer: seconds after which the controller closes the
    brakes by itself.
    """
    lengths = [float(number) for number in re.findall(r"\d+(?:\.\d+)?(?=\s*s\b)", fact)]
    if not lengths:
        return None
    pauses = [r for r in results if r.step.movement.is_pause and r.step.movement.power_mode]
    start = results[0].step.start
    end = results[-1].step.end
    if len(pauses) != len(lengths):
        return Unshortened(NAN, NAN, sum(r.seconds for r in pauses), sum(lengths))
    energy = meter.energy(start, end)
    seconds = end - start
    for result, length in zip(pauses, lengths, strict=True):
        sequence = result.step.movement.power_mode
        mode = deepest(sequence)
        motors = watts(MOTORS, result)
        if (
            mode != sequence and length >= result.seconds
        ):  # one after the other: the last one lasts longer
            full = result.energy + (length - result.seconds) * watts(mode, result)
        elif mode == MOTORS or length < change(mode):
            full = left_alone_joules(motors, watts(BRAKES, result), length, timer, change(BRAKES))
        else:
            full = pause_joules(watts(mode, result), motors, length, change(mode))
        energy = energy + full - result.energy
        seconds = seconds + length - result.seconds
    return Unshortened(seconds, energy, sum(r.seconds for r in pauses), sum(lengths))


def _measured(name: str, results: Sequence[StepResult]) -> Share:
    return Share(name, sum(r.seconds for r in results), sum(r.energy for r in results))


def _planned(name: str, results: Sequence[StepResult]) -> Share:
    plans = [r.step.movement for r in results]
    return Share(
        name,
        sum(p.duration or p.report.duration for p in plans),
        sum(p.report.energy for p in plans),
    )
