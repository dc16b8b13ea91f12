"""The modes that a robot can rest in at a posture, and what a sequence of them costs.

A sequence goes from motors deeper and deeper, each mode asked for at a switch time. While a mode is
entered the power is that of the mode that is left; while it is left it is that of standing on
motors. A mode can be left, deeper or back to motors, when it was entered and its shortest stay is
over. Left alone on motors, the controller closes its brakes after `timer` s. These conventions of
the power data decide every break-even.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import combinations

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import REST_MODES, TransitionTimes
from ir_planner.checks import holding_watts
from ir_planner.scene import PlanningScene

MOTORS = "STAND_ON_MOTORS"
BRAKES = "STAND_ON_BRAKES"


@dataclass(frozen=True)
class Rest:
    """A mode to rest in: its power [W] and times [s]."""

    name: str
    watts: float
    enter: float
    stay: float
    leave: float

    @property
    def busy(self) -> float:
        """Seconds from asking for it until it can be left."""
        return self.enter + self.stay


@dataclass(frozen=True)
class Step:
    """A mode that is asked for at a time [s] from the start of the pause, if the pause is still on
    then.
    """

    rest: Rest
    at: float

    @property
    def free(self) -> float:
        """When the mode can be left [s]."""
        return self.at + self.rest.busy


Steps = tuple[Step, ...]


@dataclass(frozen=True)
class Rests:
    """motors: power [W] of standing on motors; timer [s]; modes: the others, shallow to deep."""

    motors: float
    timer: float
    modes: tuple[Rest, ...]

    def named(self, name: str) -> Rest:
        """The mode of that name."""
        return next(rest for rest in self.modes if rest.name == name)

    def cost(self, steps: Steps, pause: float) -> tuple[float, float]:
        """Energy [J] from the start of a pause [s] until the robot is ready, when its end wakes the
        robot, and how late that is [s].
        """
        reached = tuple(step for step in self._with_timer(steps) if step.at < pause)
        if not reached:
            return self.motors * pause, 0.0
        last = reached[-1]
        awake = max(pause, last.free)
        return self._energy(reached, awake), awake + last.rest.leave - pause

    def in_time(self, rests: Sequence[Rest], pause: float) -> float:
        """Energy [J] of a pause of known length [s] with these modes, ready at its end; inf: too
        short.
        """
        steps = at_once(rests)
        awake = pause - steps[-1].rest.leave
        return self._energy(steps, awake) if awake >= steps[-1].free else float("inf")

    def _energy(self, steps: Steps, awake: float) -> float:
        """Energy [J] from motors through the steps, woken at a time [s], until the robot is
        ready.
        """
        energy = 0.0
        since = 0.0
        watts = self.motors
        for step in steps:
            entered = step.at + step.rest.enter
            energy += watts * (entered - since)
            since = entered
            watts = step.rest.watts
        return energy + watts * (awake - since) + self.motors * steps[-1].rest.leave

    def known(self, pause: float) -> tuple[float, Steps]:
        """Least energy [J] of a pause of known length [s], ready at its end, and the sequence; no
        steps: on motors, as the controller spends it by itself.
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
            energies.append(self._energy(steps, max(pause - last.rest.leave, last.free)))
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
        if not self.modes:  # nothing to rest in: motors stay on
            return steps
        brakes = Step(self.named(BRAKES), self.timer)
        return (
            brakes,
            *(
                replace(step, at=max(step.at, brakes.free))
                for step in steps
                if step.rest != brakes.rest
            ),
        )


def at_once(rests: Sequence[Rest]) -> Steps:
    """Each mode as soon as the one before can be left."""
    steps: list[Step] = []
    for rest in rests:
        steps.append(Step(rest, steps[-1].free if steps else 0.0))
    return tuple(steps)


def mode_watts(name: str, q: FloatArray, scene: PlanningScene) -> float:
    """Mains power [W] in a mode at q (n,): controller, tool (its bus share while the drive bus is
    up), holding torque.
    """
    if name == MOTORS:
        return holding_watts(q, scene)
    return scene.power.mode(name).controller_watts + scene.tool_watts(drive_bus=name == BRAKES)


def rests_at(q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> Rests:
    """The modes of a robot that stands at q (n,)."""
    return _rests_at(tuple(q.tolist()), scene, times)


@lru_cache(maxsize=64)  # a program is compared with many of the same pauses
def _rests_at(posture: tuple[float, ...], scene: PlanningScene, times: TransitionTimes) -> Rests:
    q = np.array(posture)
    return Rests(
        mode_watts(MOTORS, q, scene),
        scene.power.motors_to_brakes_in_program,
        tuple(
            Rest(
                name,
                mode_watts(name, q, scene),
                times.enter(name),
                times.minimum_stay(name),
                times.leave(name),
            )
            for name in REST_MODES[1:]
            if name in [mode.name for mode in scene.power.modes]
        ),
    )
