"""How a pause should be spent: a sequence of power modes with its switch times, and when to wake.

Of a pause of known length the modes are entered one after the other, each as soon as it can be, so
that most of it is spent in the deepest, and the robot is woken in time. A pause whose end is not
known has a timeout policy (timeouts), and its end wakes the robot, which is ready later then.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.modes import REST_MODES, Mode, PowerMode, TransitionTimes
from ir_planner.checks import Interval, interval, spread
from ir_planner.program.pause_lengths import Lengths, lengths_of
from ir_planner.program.pause_slopes import pause_slope, same_steps
from ir_planner.program.rests import BRAKES, MOTORS, Rests, Step, Steps, mode_watts, rests_at
from ir_planner.program.timeouts import Timeouts
from ir_planner.scene import PlanningScene


@dataclass(frozen=True, eq=False)
class Standby:
    """The advice. energy [J]: over the pause, where its length is not known the mean over the
    lengths.

    chosen: the deepest mode that is asked for. wake_at [s] from the start of the pause, inf: its
    end wakes the robot. saving [J]: against what the controller does by itself (`timer` s on
    motors, then on brakes); saving_low, saving_high [J]: its 90 % interval. saving_on_motors [J]:
    against standing on motors all the time. alternatives: all modes, shallow to deep, each alone
    and at once, and their energies [J] (inf: the pause is too short); on motors with what the
    controller does by itself. modes: the sequence, each asked for at its switch time [s]. expected,
    worst, clairvoyant [J]: mean and largest energy, and the mean with each length known at the
    start. late, latest [s]: mean and largest time from the end of the pause until the robot is
    ready. posture: where to wait, "": where the robot stands; posture_energies [J]: at each of the
    postures; trips: what moving there takes, in words.
    """

    chosen: PowerMode
    wake_at: float
    energy: float
    saving: float
    saving_on_motors: float
    timer: float
    alternatives: tuple[PowerMode, ...]
    energies: tuple[float, ...]
    modes: tuple[str, ...]
    switch_times: tuple[float, ...]
    expected: float
    worst: float
    clairvoyant: float
    late: float = 0.0
    latest: float = 0.0
    posture: str = ""
    posture_energies: tuple[float, ...] = ()
    saving_low: float = 0.0
    saving_high: float = 0.0
    trips: tuple[str, ...] = ()

    @property
    def sentence(self) -> str:
        """How the pause is spent, what is saved against what, and what it costs that its end is not
        known.
        """
        steps = ", ".join(
            f"{mode} at {at:g} s" for mode, at in zip(self.modes, self.switch_times, strict=True)
        )
        parts = [
            f"{steps}: saves {self.saving:.0f} J (predicted, 90 % interval {self._within}) "
            f"against the controller's own timer (brakes after {self.timer:g} s on motors), "
            f"{self.saving_on_motors:.0f} J against standing on motors"
        ]
        if np.isinf(self.wake_at):
            parts.append(
                f"the end of the pause wakes the robot: expected {self.expected:.0f} J, at worst "
                f"{self.worst:.0f} J, {self.clairvoyant:.0f} J if the end were known; ready "
                f"{self.late:.1f} s after it, at worst {self.latest:.1f} s"
            )
        return "; ".join((*parts, *self.trips))

    @property
    def _within(self) -> str:
        within = f"{self.saving_low:.0f} to {self.saving_high:.0f} J"
        doubtful = self.saving_low <= 0.0 <= self.saving_high and self.saving != 0.0
        return (
            f"{within}, zero lies in it: it is open whether anything is saved"
            if doubtful
            else within
        )


def pause_energy(
    name: str, pause: float, q: FloatArray, scene: PlanningScene, times: TransitionTimes
) -> float:
    """Energy [J] of a pause [s] in a mode until the next movement can start, inf when it is too
    short for it.

    The robot stands at q (n,). On motors: with what the controller does by itself.
    """
    rests = rests_at(q, scene, times)
    return (
        rests.cost((), pause)[0] if name == MOTORS else rests.in_time((rests.named(name),), pause)
    )


def late_start(pause: float, scene: PlanningScene, times: TransitionTimes) -> float:
    """How much later than the end of a pause [s] on motors the next movement starts: the brakes
    that the controller has closed must open.
    """
    return rests_at(np.array(scene.cell.machine_home), scene, times).cost((), pause)[1]


def plan_standby(
    pause: float, q: FloatArray, scene: PlanningScene, times: TransitionTimes
) -> Standby:
    """How to spend a pause [s] at q (n,). Raises RequestError for a pause that is none."""
    return advice(lengths_of(pause), q, scene, times)


def advice(
    lengths: Lengths, q: FloatArray, scene: PlanningScene, times: TransitionTimes
) -> Standby:
    """How to spend a pause of these lengths at q (n,)."""
    rests = rests_at(q, scene, times)
    pause = lengths.most
    steps, cost = _known(rests, pause) if lengths.known else _policy(rests, lengths)
    by_itself = _mean(rests, (), lengths)
    modes, switches = _shown(rests, steps, pause)
    chosen = steps[-1].rest.name if steps else MOTORS
    saving = by_itself - cost.expected
    within = _saved_within(saving, steps, lengths, rests, q, scene)
    return Standby(
        chosen=_mode(chosen, q, scene, times),
        wake_at=pause - times.leave(chosen) if lengths.known else float("inf"),
        energy=cost.expected,
        saving=saving,
        saving_low=within.low,
        saving_high=within.high,
        saving_on_motors=rests.motors * float(lengths.likely.mean()) - cost.expected,
        timer=rests.timer,
        alternatives=tuple(_mode(name, q, scene, times) for name in _known_modes(scene)),
        energies=_alone(rests, lengths, by_itself),
        modes=modes,
        switch_times=switches,
        **cost._asdict(),
    )


def _saved_within(
    saving: float, steps: Steps, lengths: Lengths, rests: Rests, q: FloatArray, scene: PlanningScene
) -> Interval:
    """The 90 % interval of what the steps save against what the controller does by itself."""

    def saved(of: Rests) -> float:
        own = same_steps(steps, of)
        if lengths.known and own:
            spent = of.in_time([step.rest for step in own], lengths.most)
        else:
            spent = _mean(of, own, lengths)
        return _mean(of, (), lengths) - spent

    return interval(saving, spread(pause_slope(q, scene, rests, saved), scene.parameters))


class _Cost(NamedTuple):
    """Expected, worst and clairvoyant energy [J], mean and largest delay [s]."""

    expected: float
    worst: float
    clairvoyant: float
    late: float
    latest: float


def _known(rests: Rests, pause: float) -> tuple[Steps, _Cost]:
    """The sequence for a pause of known length [s], and its cost."""
    energy, steps = rests.known(pause)
    late = 0.0 if steps else rests.cost((), pause)[1]
    return steps, _Cost(energy, energy, energy, late, late)


def _policy(rests: Rests, lengths: Lengths) -> tuple[Steps, _Cost]:
    """The timeout policy for a pause of these lengths, and its cost."""
    steps = Timeouts(rests, lengths.likely).best()
    each = np.array([rests.cost(steps, float(pause)) for pause in lengths.likely])
    ends = lengths.extreme(tuple(step.at for step in steps))
    worst = np.array([rests.cost(steps, float(pause)) for pause in ends]).max(axis=0)
    clairvoyant = float(np.mean([rests.clairvoyant(float(pause)) for pause in lengths.likely]))
    expected, late = each.mean(axis=0)
    return steps, _Cost(float(expected), float(worst[0]), clairvoyant, float(late), float(worst[1]))


def _mean(rests: Rests, steps: Steps, lengths: Lengths) -> float:
    return float(np.mean([rests.cost(steps, float(pause))[0] for pause in lengths.likely]))


def _alone(rests: Rests, lengths: Lengths, by_itself: float) -> tuple[float, ...]:
    """Energies [J] of every mode alone, asked for at once; inf where a pause of known length is too
    short.
    """
    if lengths.known:
        return (by_itself, *(rests.in_time((rest,), lengths.most) for rest in rests.modes))
    return (by_itself, *(_mean(rests, (Step(rest, 0.0),), lengths) for rest in rests.modes))


def _shown(rests: Rests, steps: Steps, most: float) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Names and switch times [s] of a sequence, from the mode that the pause begins in."""
    if not steps or steps[0].at > 0.0:
        closed = not steps and rests.modes and most > rests.timer
        brakes = (Step(rests.named(BRAKES), rests.timer),) if closed else ()
        shown = (*steps, *brakes)
        return (MOTORS, *(step.rest.name for step in shown)), (0.0, *(step.at for step in shown))
    return tuple(step.rest.name for step in steps), tuple(step.at for step in steps)


def _mode(name: str, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> PowerMode:
    data = scene.power.mode(name)
    motors = mode_watts(MOTORS, q, scene)
    enter = times.enter(name)
    leave = times.leave(name)
    stay = times.minimum_stay(name)
    return PowerMode(
        mode=Mode[name],
        name=name,
        pe_mode_id=data.pe_mode_id,
        power=mode_watts(name, q, scene),
        time_min_pause=enter + leave + stay,
        time_to_pause=enter,
        regular_time_to_operate=leave,
        time_min_length_of_stay=stay,
        energy_to_pause=motors * enter,
        energy_to_operate=motors * leave,
        break_even=break_even(name, q, scene, times),
    )


def _known_modes(scene: PlanningScene) -> list[str]:
    """Names of the modes that the controller has, shallow to deep."""
    return [name for name in REST_MODES if name in [mode.name for mode in scene.power.modes]]


def break_even(name: str, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> float:
    """Pause [s] at q (n,) from which a mode saves against the next shallower one, both entered from
    motors;
    inf: never.
    """
    known = _known_modes(scene)
    k = known.index(name)
    if k == 0:
        return 0.0
    motors = mode_watts(MOTORS, q, scene)
    shallower = known[k - 1]
    deeper = name
    watts = [mode_watts(mode, q, scene) for mode in (shallower, deeper)]
    extra = [
        (motors - power) * (times.enter(mode) + times.leave(mode))
        for mode, power in zip((shallower, deeper), watts, strict=True)
    ]
    gain = watts[0] - watts[1]
    return float("inf") if gain <= 0.0 else max((extra[1] - extra[0]) / gain, 0.0)
