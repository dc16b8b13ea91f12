"""Pauses of a program as they are sent: their modes, their energy, and the capacitor's charge."""

from dataclasses import replace
from itertools import accumulate
from typing import NamedTuple

import numpy as np

from ir_msgs_py.modes import DEEPER, PAUSE_ROUNDING, TransitionTimes, modes_of, shortest_pause
from ir_msgs_py.report import MovementKind, PlannedMovement, TrajectoryReport
from ir_planner.checks import MovementEnergy, carried, holding_watts, peak_power
from ir_planner.program.rests import BRAKES, MOTORS, Recharge, Rests, at_once, cut_at, rests_at
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

AUTO = "AUTO"


class PlannedPause(NamedTuple):
    """Where (a name, and q (n,)), how long [s], in which mode it was asked for (AUTO; "": not
    said), and what is held.
    """

    here: str
    seconds: float
    requested: str
    q: FloatArray
    scene: PlanningScene


def planned_pause(pause: PlannedPause, times: TransitionTimes) -> PlannedMovement:
    """In the mode that is asked for, where the pause is long enough for it, the sequence of least
    energy (AUTO), or on motors ("" where nothing is asked for); longer than the controller stands
    on motors: on brakes, which it would close anyway, so that they are open again in time.
    """
    rests = rests_at(pause.q, pause.scene, times)
    mode = pause.requested
    if pause.requested == AUTO:
        mode = DEEPER.join(step.rest.name for step in rests.known(pause.seconds)[1]) or MOTORS
    elif not np.isfinite(_rested(pause, mode, rests)):
        closed = rests.cost((), pause.seconds)[1] > 0.0
        mode = BRAKES if closed else mode and MOTORS
    return _spent(pause, mode, rests)


def spent(pause: PlannedPause, times: TransitionTimes) -> PlannedMovement:
    """In the modes that somebody asked for; where nobody did, as the controller spends it by
    itself.
    """
    return planned_pause(pause, times) if pause.requested else pause_by_itself(pause, times)


def switch_times(
    mode: str, seconds: float, times: TransitionTimes
) -> tuple[tuple[tuple[str, float], ...], float]:
    """The modes of a planned pause with the times [s] after its start at which each is asked for,
    and when the robot is woken to be ready at its end; no modes: it stands on motors, or the pause
    is too short.
    """
    names = [each.name for each in modes_of(mode)]
    rests = [times.rest(name) for name in names]
    if not rests or seconds < shortest_pause(rests) - PAUSE_ROUNDING:
        return (), seconds
    asked_at = accumulate((rest.busy for rest in rests[:-1]), initial=0.0)
    return tuple(zip(names, asked_at, strict=True)), rests[-1].wake_at(seconds)


def pause_by_itself(pause: PlannedPause, times: TransitionTimes) -> PlannedMovement:
    """As the controller spends it when nobody asks for a mode."""
    return _spent(pause, "", rests_at(pause.q, pause.scene, times))


def _rested(pause: PlannedPause, mode: str, rests: Rests) -> float:
    """Energy [J] in a mode that is entered and left in time; inf: on motors, or the pause is too
    short.
    """
    sequence = tuple(rests.named(each.name) for each in modes_of(mode))
    return rests.in_time(sequence, pause.seconds) if sequence else np.inf


def _spent(pause: PlannedPause, mode: str, rests: Rests) -> PlannedMovement:
    energy = _rested(pause, mode, rests)
    if not np.isfinite(energy):  # on motors
        energy = rests.cost((), pause.seconds)[0]
    report = TrajectoryReport(
        duration=pause.seconds, energy=energy, base_energy=energy, certified=True
    )
    return PlannedMovement(
        kind=MovementKind.PAUSE,
        from_station=pause.here,
        to_station=pause.here,
        duration=pause.seconds,
        power_mode=mode,
        load=pause.scene.load_text,
        report=report,
    )


# The charge of the DC link's capacitor, carried from step to step of a program.
#
# A movement leaves what its braking gave, the next one takes it first. While the motors hold the
# arm the charge feeds the holding torque; with the brakes closed it stays, and where the drive bus
# is off it goes first through the bleed resistors.


class Charge:
    """stored [J] after the steps so far; empty at first."""

    def __init__(self, times: TransitionTimes) -> None:
        self.stored = 0.0
        self._times = times

    def moved(
        self, step: PlannedMovement, alone: MovementEnergy, scene: PlanningScene
    ) -> PlannedMovement:
        """The step of a movement with the energy that it takes from the mains now; alone: what it
        takes with an empty capacitor.
        """
        assert step.trajectory is not None  # it moves
        charge = self.stored
        energy = self.taken(alone, scene)
        report = step.report
        if energy is not alone:
            peak = peak_power(step.trajectory, scene, charge)
            report = replace(
                report, energy=energy.total, burnt_energy=energy.dissipated, peak_power=peak
            )
        return replace(step, report=report)

    def taken(self, alone: MovementEnergy, scene: PlanningScene) -> MovementEnergy:
        """What a movement takes from the mains now; alone: the same with an empty capacitor."""
        energy = carried(alone, self.stored, scene)
        self.stored = energy.capacitor
        return energy

    def stood(self, step: PlannedMovement, pause: PlannedPause) -> PlannedMovement:
        """The step of a pause, whose holding torque takes the charge first; what is still there
        when the drive bus is switched off need not be charged again until it has gone too.
        """
        scene = pause.scene
        watts = max(holding_watts(pause.q, scene) - scene.base_watts, 0.0)
        rests = rests_at(pause.q, scene, self._times)
        steps = at_once([rests.named(mode.name) for mode in modes_of(step.power_mode)])
        if not steps:  # the controller's own timer closes the brakes long after the charge has gone
            saved = self._held(watts * pause.seconds)
        else:
            waking = steps[-1].rest.times.leave
            cut = cut_at(steps)
            saved = self._held(watts * min(steps[0].rest.times.enter, pause.seconds))
            if cut is not None:
                saved += self._bled(rests.recharge, pause.seconds - waking - cut)
            saved += self._held(watts * min(waking, pause.seconds))
        report = step.report
        energy = report.energy - saved
        return replace(step, report=replace(report, energy=energy, base_energy=energy))

    def _held(self, joules: float) -> float:
        """What the charge gives of the joules of a holding torque."""
        fed = min(self.stored, joules)
        self.stored -= fed
        return fed

    def _bled(self, recharge: Recharge, off: float) -> float:
        """What the charge saves [J] of charging again after `off` s without the drive bus."""
        joules, self.stored = recharge.begun_higher(off, self.stored)
        return recharge.joules(off) - joules
