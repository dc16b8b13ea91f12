"""Standby: the modes that a pause is spent in, their switch times, and when to wake.

Of a pause of known length the modes are entered one after the other, each as soon as it can be, so
that most of it is spent in the deepest, and the robot is woken in time. A pause whose end is not
known has a timeout policy (timeouts), and its end wakes the robot, which is ready later then.
"""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ir_msgs_py.modes import REST_MODES, Mode, PowerMode, TransitionTimes, drive_bus_up
from ir_planner.checks import JouleInterval, interval, spread
from ir_planner.presentation import plot_choices
from ir_planner.program.pause_lengths import PauseLengths, lengths_of
from ir_planner.program.rests import (
    BRAKES,
    MOTORS,
    Rests,
    RestStep,
    Steps,
    mode_watts,
    pause_slope,
    recharge_of,
    rests_at,
    same_steps,
)
from ir_planner.program.timeouts import Timeouts
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

_ROUNDS = 50  # of a break-even whose cost depends on it: far more than any needs


@dataclass(frozen=True, eq=False)
class Standby:
    """How to spend a pause, and what that takes.

    Energies are those of the whole pause, until the robot is ready; where its length is not known,
    means over the lengths. Times count from the start of the pause.

    chosen: the deepest mode that is asked for.
    wake_at [s]: when the robot is woken; inf: the end of the pause wakes it.
    energy [J]: what the pause takes.
    saving [J]: against the controller alone, which stands on motors for `timer` and closes the
        brakes then.
    saving_on_motors [J]: against standing on motors all the time.
    timer [s]: after which the controller closes the brakes by itself.
    alternatives: all modes of the controller, shallow to deep.
    energies [J]: of the pause in each alternative alone, asked for at once; on motors with what the
        controller does by itself; inf: the pause is too short.
    modes: names of the modes in their order, the first is the one that the pause begins in.
    switch_times [s]: when each of `modes` is asked for.
    expected [J]: mean energy; the same as `energy`.
    worst [J]: largest energy over the lengths that are possible.
    clairvoyant [J]: mean energy if each length were known at the start.
    late [s]: mean time from the end of the pause until the robot is ready.
    latest [s]: the largest of these times.
    posture: name of the posture to wait at; "": where the robot stands.
    posture_energies [J]: at each posture that was asked about, movements included; inf: it can't
        be reached, or not in time.
    saving_low, saving_high [J]: 90 % interval of `saving`.
    trips: a sentence for each posture: what moving there and back takes.
    remark: what the powers of the modes rest on, "" where there is nothing to say.
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
    remark: str = ""

    def __repr__(self) -> str:
        return f"Standby({self.sentence})"

    def plot(self) -> Any:
        """The joules of each mode over the pause; a matplotlib figure."""
        names = [mode.name for mode in self.alternatives]
        return plot_choices(names, list(self.energies), repr(self))

    @property
    def sentence(self) -> str:
        """How the pause is spent, what is saved against what, and what it costs that its end is not
        known.
        """
        steps = ", ".join(
            f"{mode} at {at:g} s" for mode, at in zip(self.modes, self.switch_times, strict=True)
        )
        parts = [
            f"{steps}: saves {self.saving:.0f} J (predicted, 90 % interval {self._interval_text}) "
            f"against the controller's own timer (brakes after {self.timer:g} s on motors), "
            f"{self.saving_on_motors:.0f} J against standing on motors"
        ]
        if np.isinf(self.wake_at):
            parts.append(
                f"the end of the pause wakes the robot: expected {self.expected:.0f} J, at worst "
                f"{self.worst:.0f} J, {self.clairvoyant:.0f} J if the end were known; ready "
                f"{self.late:.1f} s after it, at worst {self.latest:.1f} s"
            )
        return "; ".join((*parts, *self.trips, *filter(None, (self.remark,))))

    @property
    def _interval_text(self) -> str:
        """The interval of what is saved, and whether zero lies in it."""
        within = f"{self.saving_low:.0f} to {self.saving_high:.0f} J"
        doubtful = self.saving_low <= 0.0 <= self.saving_high and self.saving != 0.0
        return (
            f"{within}, zero lies in it: it is open whether anything is saved"
            if doubtful
            else within
        )


def plan_standby(
    pause: float | PauseLengths, q: FloatArray, scene: PlanningScene, times: TransitionTimes
) -> Standby:
    """How to spend a pause [s], or one of these lengths, at q (n,). Raises RequestError for a pause
    that is none.
    """
    lengths = pause if isinstance(pause, PauseLengths) else lengths_of(pause)
    rests = rests_at(q, scene, times)
    steps, cost = _sequence_for(rests, lengths.most) if lengths.known else _policy(rests, lengths)
    by_itself = rests.mean_cost((), lengths.likely)
    modes, switches = _shown(rests, steps, lengths.most)
    chosen = steps[-1].rest.name if steps else MOTORS
    saving = by_itself - cost.expected
    within = _saved_within(saving, steps, lengths, rests, q, scene)
    return Standby(
        chosen=_mode(chosen, q, scene, times),
        wake_at=times.rest(chosen).wake_at(lengths.most) if lengths.known else float("inf"),
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
        remark=scene.power.rest_remark(q.tolist(), scene.load_mass) if rests.modes else "",
        **cost._asdict(),
    )


def _saved_within(
    saving: float,
    steps: Steps,
    lengths: PauseLengths,
    rests: Rests,
    q: FloatArray,
    scene: PlanningScene,
) -> JouleInterval:
    """The 90 % interval of what the steps save against what the controller does by itself."""

    def saved(of: Rests) -> float:
        own = same_steps(steps, of)
        if lengths.known and own:
            spent = of.in_time([step.rest for step in own], lengths.most)
        else:
            spent = of.mean_cost(own, lengths.likely)
        return of.mean_cost((), lengths.likely) - spent

    return interval(saving, spread(pause_slope(q, scene, rests, saved), scene.parameters))


class _Cost(NamedTuple):
    """Expected, worst and clairvoyant energy [J], mean and largest delay [s]."""

    expected: float
    worst: float
    clairvoyant: float
    late: float
    latest: float


def _sequence_for(rests: Rests, pause: float) -> tuple[Steps, _Cost]:
    """The sequence for a pause of known length [s], and its cost."""
    energy, steps = rests.known(pause)
    late = 0.0 if steps else rests.cost((), pause)[1]
    return steps, _Cost(energy, energy, energy, late, late)


def _policy(rests: Rests, lengths: PauseLengths) -> tuple[Steps, _Cost]:
    """The timeout policy for a pause of these lengths, and its cost."""
    steps = Timeouts(rests, lengths.likely).best()
    each = np.array([rests.cost(steps, float(pause)) for pause in lengths.likely])
    ends = lengths.extreme(tuple(step.at for step in steps))
    worst = np.array([rests.cost(steps, float(pause)) for pause in ends]).max(axis=0)
    clairvoyant = float(np.mean([rests.clairvoyant(float(pause)) for pause in lengths.likely]))
    expected, late = each.mean(axis=0)
    return steps, _Cost(float(expected), float(worst[0]), clairvoyant, float(late), float(worst[1]))


def _alone(rests: Rests, lengths: PauseLengths, by_itself: float) -> tuple[float, ...]:
    """Energies [J] of every mode alone, asked for at once; inf where a pause of known length is too
    short.
    """
    if lengths.known:
        return (by_itself, *(rests.in_time((rest,), lengths.most) for rest in rests.modes))
    return (
        by_itself,
        *(rests.mean_cost((RestStep(rest, 0.0),), lengths.likely) for rest in rests.modes),
    )


def _shown(rests: Rests, steps: Steps, most: float) -> tuple[tuple[str, ...], tuple[float, ...]]:
    """Names and switch times [s] of a sequence, from the mode that the pause begins in."""
    if not steps or steps[0].at > 0.0:
        closed = not steps and rests.closes_brakes and most > rests.timer
        brakes = (RestStep(rests.named(BRAKES), rests.timer),) if closed else ()
        shown = (*steps, *brakes)
        return (MOTORS, *(step.rest.name for step in shown)), (0.0, *(step.at for step in shown))
    return tuple(step.rest.name for step in steps), tuple(step.at for step in steps)


def _mode(name: str, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> PowerMode:
    """A power mode at configuration q (n,), in PROFIenergy's terms: times and joules of the way in
    and out, and the pause from which it pays.
    """
    data = scene.power.mode(name)
    motors = mode_watts(MOTORS, q, scene)
    rest = times.rest(name)
    recharge = 0.0 if drive_bus_up(name) else recharge_of(scene).whole
    return replace(
        times.of(Mode[name]),
        pe_mode_id=data.pe_mode_id,
        power=mode_watts(name, q, scene),
        energy_to_pause=motors * rest.enter,
        energy_to_operate=motors * rest.leave + recharge,
        break_even=break_even(name, q, scene, times),
    )


def _known_modes(scene: PlanningScene) -> list[str]:
    """Names of the modes that the controller has, shallow to deep."""
    return [name for name in REST_MODES if name in [mode.name for mode in scene.power.modes]]


def break_even(name: str, q: FloatArray, scene: PlanningScene, times: TransitionTimes) -> float:
    """Pause [s] at q (n,) from which a mode saves against the next shallower one, both entered from
    motors, and never shorter than it can be entered and left in; inf: never.
    """
    known = _known_modes(scene)
    k = known.index(name)
    if k == 0:
        return 0.0
    motors = mode_watts(MOTORS, q, scene)
    shallower = known[k - 1]
    watts = mode_watts(shallower, q, scene)
    deeper_watts = mode_watts(name, q, scene)
    gain = watts - deeper_watts
    if gain <= 0.0:
        return float("inf")
    recharge = recharge_of(scene)

    def changing(mode: str, power: float) -> float:
        """Joules that entering and leaving a mode on motors takes beyond being in it."""
        rest = times.rest(mode)
        return (motors - power) * (rest.enter + rest.leave)

    def charged(mode: str, pause: float) -> float:
        """Joules that charge the DC link again after a pause [s]."""
        rest = times.rest(mode)
        off = pause - rest.enter - rest.leave
        return 0.0 if drive_bus_up(mode) else recharge.joules(max(off, 0.0))

    # the pause at which power * pause + changing + charged are the same for both modes
    extra = changing(name, deeper_watts) - changing(shallower, watts)
    pays = extra / gain
    for _ in range(_ROUNDS):  # charging the DC link costs more after longer pauses, up to a bound
        more = charged(name, pays) - charged(shallower, pays)
        pays = (extra + more) / gain
    return float(max(pays, times.rest(name).shortest))
