"""Rests: the modes that a robot can rest in at a posture, and what a sequence of them costs.

A sequence goes from motors deeper and deeper, each mode asked for at a switch time. While a
mode is entered the power is that of the mode that is left; while it is left it is that of
standing on motors. A mode can be left, deeper or back to motors, when it was entered and its
shortest stay is over. Left alone on motors, the controller closes its brakes after `timer` s.
These conventions of the power data decide every break-even.

While the drive bus is off the DC link discharges, U falling with e^(-t/T), and waking charges it
again: the mains give C U_0 (U_0 - U), of which the precharge resistor keeps C (U_0 - U)^2 / 2.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations
from typing import TypeVar

import numpy as np

from ir_msgs_py.modes import (
    PAUSE_ROUNDING,
    REST_MODES,
    RestTimes,
    TransitionTimes,
    drive_bus_up,
)
from ir_planner.checks import holding_slope, holding_watts, standing_slope
from ir_planner.scene import PlanningScene
from ir_values.arrays import BoolArray, FloatArray

_Seconds = TypeVar("_Seconds", float, FloatArray)
MOTORS = "STAND_ON_MOTORS"
BRAKES = "STAND_ON_BRAKES"


@dataclass(frozen=True)
class Rest:
    """A mode to rest in: its power [W] and times, and whether the drive bus is off in it."""

    name: str
    watts: float
    times: RestTimes
    bus_off: bool = False


@dataclass(frozen=True)
class Recharge:
    """What waking takes [J] at the mains to charge the DC link after some time with the drive bus
    off: whole: from empty; rate [1/s]: by which the voltage falls; none by default.
    """

    whole: float = 0.0
    rate: float = 0.0

    @property
    def rest(self) -> float:
        """J in the capacitor at the mains' voltage."""
        return 0.5 * self.whole

    def joules(self, seconds: _Seconds) -> _Seconds:
        """After so long, begun at the mains' voltage."""
        joules: _Seconds = -self.whole * np.expm1(-self.rate * seconds)
        return joules

    def begun_higher(self, seconds: float, stored: float) -> tuple[float, float]:
        """After so long, begun with `stored` J above the mains' voltage; and what is left of
        those.
        """
        if not self.whole:
            return 0.0, stored
        left = (self.rest + stored) * float(np.exp(-2.0 * self.rate * seconds))
        if left >= self.rest:
            return 0.0, left - self.rest
        return self.whole * (1.0 - float(np.sqrt(left / self.rest))), 0.0


@dataclass(frozen=True)
class RestStep:
    """A mode that is asked for at a time [s] from the start of the pause, if the pause is still on
    then.
    """

    rest: Rest
    at: float

    @property
    def free(self) -> float:
        """When the mode can be left [s]."""
        return self.at + self.rest.times.busy


Steps = tuple[RestStep, ...]


@dataclass(frozen=True)
class Rests:
    """motors: power [W] of standing on motors; timer [s]; modes: the others, shallow to deep;
    recharge: of the DC link, on waking from modes with the drive bus off.
    """

    motors: float
    timer: float
    modes: tuple[Rest, ...]
    recharge: Recharge = Recharge()

    @property
    def closes_brakes(self) -> bool:
        """Whether the controller closes the brakes by itself: it has a mode on them."""
        return any(rest.name == BRAKES for rest in self.modes)

    def named(self, name: str) -> Rest:
        """The mode of that name."""
        return next(rest for rest in self.modes if rest.name == name)

    def cost(self, steps: Steps, pause: float) -> tuple[float, float]:
        """Energy [J] from the start of a pause [s] until the robot is ready, when its end wakes the
        robot, and how late that is [s].
        """
        reached = tuple(step for step in self._with_timer(steps) if not over_by(step.at, pause))
        if not reached:
            return self.motors * pause, 0.0
        last = reached[-1]
        awake = max(pause, last.free)
        return self._energy(reached, awake), awake + last.rest.times.leave - pause

    def mean_cost(self, steps: Steps, pauses: FloatArray) -> float:
        """Mean of the energies [J] of `cost` over pauses (n,) [s]."""
        timed = self._with_timer(steps)
        ends = [*(step.at for step in timed), np.inf]
        total = self.motors * float(pauses[over_by(ends[0], pauses)].sum())
        for k, step in enumerate(timed):
            ended = pauses[over_by(ends[k + 1], pauses) & ~over_by(step.at, pauses)]
            total += float(self._energy(timed[: k + 1], np.maximum(ended, step.free)).sum())
        return total / len(pauses)

    def in_time(self, rests: Sequence[Rest], pause: float) -> float:
        """Energy [J] of a pause of known length [s] with these modes, ready at its end; inf: too
        short.
        """
        steps = at_once(rests)
        last = steps[-1]
        awake = last.rest.times.wake_at(pause)
        if awake < last.free - PAUSE_ROUNDING:
            return float("inf")
        return self._energy(steps, max(awake, last.free))

    def _energy(self, steps: Steps, awake: _Seconds) -> _Seconds:
        """Energy [J] from motors through the steps, woken at a time [s], until the robot is
        ready.
        """
        energy = 0.0
        since = 0.0
        watts = self.motors
        for step in steps:
            entered = step.at + step.rest.times.enter
            energy += watts * (entered - since)
            since = entered
            watts = step.rest.watts
        energy += self.motors * steps[-1].rest.times.leave
        spent = energy + watts * (awake - since)
        cut = cut_at(steps)
        return spent if cut is None else spent + self.recharge.joules(awake - cut)

    def known(self, pause: float) -> tuple[float, Steps]:
        """Least energy [J] of a pause of known length [s], ready at its end, and the sequence; no
        steps: on motors, as the controller spends it by itself.

        Of sequences that cost the same the shallower one. For a PROFIenergy pause the controller
        chooses by itself (`best_route` of ir_sim_driver, which knows no timer): the planner may not
        import the driver.
        """
        best = (self.cost((), pause)[0], Steps())
        for rests in self.sequences:
            energy = self.in_time(rests, pause)
            if energy < best[0]:
                best = energy, at_once(rests)
        return best

    def clairvoyant(self, pause: float) -> float:
        """Least energy [J] of a pause whose length [s] is known at its start, ready as early as the
        sequence allows.
        """
        energies = [self.cost((), pause)[0]]
        for steps in map(at_once, self.sequences):
            last = steps[-1]
            energies.append(self._energy(steps, max(last.rest.times.wake_at(pause), last.free)))
        return min(energies)

    @cached_property
    def sequences(self) -> tuple[tuple[Rest, ...], ...]:
        """All sequences of modes, each deeper than the one before and drawing less."""
        chosen = (
            each for n in range(1, len(self.modes) + 1) for each in combinations(self.modes, n)
        )
        return tuple(
            rests
            for rests in chosen
            if all(
                b.watts <= a
                for a, b in zip((self.motors, *(r.watts for r in rests)), rests, strict=False)
            )
        )

    def _with_timer(self, steps: Steps) -> Steps:
        """The steps with the brakes that the controller closes by itself."""
        if steps and steps[0].at <= self.timer:
            return steps
        if not self.closes_brakes:
            return steps
        brakes = RestStep(self.named(BRAKES), self.timer)
        return (
            brakes,
            *(
                replace(step, at=max(step.at, brakes.free))
                for step in steps
                if step.rest != brakes.rest
            ),
        )


def over_by(switch: float, pauses: float | FloatArray) -> BoolArray:
    """Whether pauses [s] are over at a switch time [s]: one that ends at that instant is not
    switched any more.
    """
    over: BoolArray = np.less_equal(pauses, switch)
    return over


def cut_at(steps: Steps) -> float | None:
    """When [s] the drive bus is switched off; None: it is not."""
    return next((step.at + step.rest.times.enter for step in steps if step.rest.bus_off), None)


def at_once(rests: Sequence[Rest]) -> Steps:
    """Each mode as soon as the one before can be left."""
    steps: list[RestStep] = []
    for rest in rests:
        steps.append(RestStep(rest, steps[-1].free if steps else 0.0))
    return tuple(steps)


def mode_watts(name: str, q: FloatArray, scene: PlanningScene) -> float:
    """Mains power [W] in a mode at q (n,): controller, tool (its bus share while the drive bus is
    up), holding torque; of a mode that was measured by posture and load, what its table says.
    """
    table = scene.power.measured_rest(name)
    if table is not None:
        return table.watts(name, q.tolist(), scene.load_mass)
    if name == MOTORS:
        return holding_watts(q, scene)
    return scene.power.mode(name).controller_watts + scene.tool_watts(drive_bus=drive_bus_up(name))


def rests_at(q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> Rests:
    """The modes of a robot that stands at q (n,)."""
    return _rests_at(tuple(q.tolist()), scene, times)


@lru_cache(maxsize=64)  # a program is compared with many of the same pauses
def _rests_at(posture: tuple[float, ...], scene: PlanningScene, times: TransitionTimes) -> Rests:
    """What each resting mode draws at a posture (n,) and what it takes to enter, stay and leave,
    for pauses of programs.
    """
    q = np.array(posture)
    return Rests(
        mode_watts(MOTORS, q, scene),
        scene.power.motors_to_brakes_in_program,
        tuple(
            Rest(
                name,
                mode_watts(name, q, scene),
                times.rest(name),
                not drive_bus_up(name),
            )
            for name in REST_MODES[1:]
            if name in [mode.name for mode in scene.power.modes]
        ),
        recharge_of(scene),
    )


def recharge_of(scene: PlanningScene) -> Recharge:
    """Of the controller's DC link."""
    link = scene.power.dc_link
    if link.discharge is None:
        return Recharge()
    return Recharge(link.capacitance * link.voltage**2, link.discharge_rate)


# How the energy of a pause changes with each power parameter.
#
# With given switch times the energy is linear in the powers of the modes, so the seconds that count
# for a mode are the energy of a robot that draws 1 W in it and nothing in the others.

Energy = Callable[[Rests], float]
"""Energy [J] of a pause that is spent in one given sequence."""


def pause_slope(q: FloatArray, scene: PlanningScene, rests: Rests, energy: Energy) -> FloatArray:
    """d energy / d parameter (P,) of a pause at q (n,), J per unit."""
    slope = np.zeros(len(scene.parameters.names))
    for mode in (MOTORS, *(rest.name for rest in rests.modes)):
        seconds = energy(_one_watt(rests, mode))
        if seconds != 0.0:
            slope += seconds * _mode_slope(mode, q, scene)
    return slope


def same_steps(steps: Steps, rests: Rests) -> Steps:
    """The steps with the powers of other rests."""
    return tuple(RestStep(rests.named(step.rest.name), step.at) for step in steps)


def _one_watt(rests: Rests, mode: str) -> Rests:
    modes = tuple(replace(rest, watts=float(rest.name == mode)) for rest in rests.modes)
    return replace(rests, motors=float(mode == MOTORS), modes=modes, recharge=Recharge())


def _mode_slope(mode: str, q: FloatArray, scene: PlanningScene) -> FloatArray:
    if scene.power.measured_rest(mode) is not None:  # a measured power depends on no parameter
        return np.zeros(len(scene.parameters.names))
    if mode == MOTORS:
        return holding_slope(q, scene)
    return standing_slope(1.0, scene, mode, drive_bus=drive_bus_up(mode))
