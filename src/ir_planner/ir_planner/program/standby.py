"""Standby: how a pause is spent best, known or uncertain in length, and at which posture."""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from ir_msgs_py.modes import REST_MODES, Mode, PowerMode, TransitionTimes, drive_bus_up
from ir_msgs_py.status import StatusCode
from ir_planner.checks import JouleInterval, interval, spread
from ir_planner.errors import RequestError
from ir_planner.presentation import plot_choices
from ir_planner.program.pauses import (
    BRAKES,
    MOTORS,
    Rest,
    Rests,
    RestStep,
    Steps,
    at_once,
    mode_watts,
    over_by,
    pause_slope,
    recharge_of,
    rests_at,
    same_steps,
)
from ir_planner.scene import PlanningScene
from ir_values.arrays import FloatArray

# How long a pause lasts: known, or as equally likely lengths, or as quantiles; checked at the
# door.

PAUSE_MAX = 604_800.0  # s: a week
SAMPLES_MAX = 10_000  # planned in 40 ms of processor time
# equally likely lengths that quantiles are taken as: the mean of a law with jumps to 0.1 %
_BETWEEN = 1000
_ROUNDS = 50  # of a break-even whose cost depends on it: far more than any needs

_NONE: FloatArray = np.zeros(0)


@dataclass(frozen=True, eq=False)
class PauseLengths:
    """likely (n,) [s]: equally likely lengths, sorted. most [s]: no pause is longer. known: there
    is one only.
    """

    likely: FloatArray
    most: float
    known: bool = False

    def less(self, seconds: float) -> "PauseLengths":
        """What is left of each pause when `seconds` are taken from it; nothing is left of shorter
        ones.
        """
        return PauseLengths(
            np.maximum(self.likely - seconds, 0.0), max(self.most - seconds, 0.0), self.known
        )

    def extreme(self, switches: tuple[float, ...]) -> FloatArray:
        """Lengths at which a policy with these switch times [s] may cost most: all that are likely,
        the longest, and where lengths between the likely ones are possible, those just longer than
        a switch.
        """
        if self.most == self.likely[-1]:
            return self.likely
        just = np.nextafter(np.array(switches), np.inf)
        between = just[(just > self.likely[0]) & (just < self.most)]
        return np.concatenate((self.likely, [self.most], between))


def lengths_of(
    pause: float, samples: FloatArray = _NONE, quantiles: FloatArray = _NONE
) -> PauseLengths:
    """Lengths of a request that gives one of the three: pause [s], samples (n,) or quantiles (n,)
    [s]. Raises RequestError for what is no pause.
    """
    given = {"pause_samples": samples, "pause_quantiles": quantiles}
    lists = [name for name, values in given.items() if len(values)]
    if len(lists) + (pause != 0.0) > 1:
        counts = [f"{name} ({len(given[name])} values)" for name in lists]
        named = " and ".join([*([f"pause ({pause:g} s)"] if pause != 0.0 else []), *counts])
        raise _refused(
            f"{named} are given: exactly one of pause, pause_samples and pause_quantiles must be"
        )
    if not lists:
        _check(pause, "pause")
        return PauseLengths(np.array([pause]), pause, known=True)
    (name,) = lists
    values = given[name]
    if len(values) > SAMPLES_MAX:
        raise _refused(f"{name} has {len(values)} values: at most {SAMPLES_MAX} are taken")
    for k, value in enumerate(values):
        _check(float(value), f"{name}[{k}]")
    if name == "pause_samples":
        return PauseLengths(np.sort(values), float(values.max()))
    return _between(values)


def _between(quantiles: FloatArray) -> PauseLengths:
    """Equally likely lengths between neighbouring quantiles."""
    if len(quantiles) < 2:
        raise _refused(
            "pause_quantiles has 1 value: at least 2 are needed, those of the levels 0 and 1"
        )
    for k, (a, b) in enumerate(pairwise(quantiles)):
        if b < a:
            raise _refused(
                f"pause_quantiles[{k + 1}] is {b:g} s: it must be at least the one before, {a:g} s"
            )
    parts = max(1, -(-_BETWEEN // (len(quantiles) - 1)))
    share = (np.arange(parts) + 0.5) / parts
    likely = quantiles[:-1, None] + share * np.diff(quantiles)[:, None]
    return PauseLengths(likely.ravel(), float(quantiles[-1]))


def _check(seconds: float, name: str) -> None:
    if not (np.isfinite(seconds) and 0.0 < seconds <= PAUSE_MAX):
        raise _refused(f"{name} is {seconds:g} s: it must be in (0, {PAUSE_MAX:g}] s")


def _refused(sentence: str) -> RequestError:
    return RequestError(StatusCode.INVALID_GOAL_CONSTRAINTS, sentence)


# When to rest deeper in a pause whose end is not known: the timeout policy of least expected
# energy.
#
# The lengths of the pause are given as equally likely samples. A policy is a sequence of modes with
# switch times; the end of the pause wakes the robot, whatever mode it is in. The best switch times
# are among few: the expected energy grows with a switch time between two samples (every pause that
# reaches it stays longer in the mode that draws more, or is ready later), and drops only where a
# sample is passed, because that pause ends before the switch. So a switch is at 0, at a sample (of
# the pauses longer than that), at the controller's own timer, or at the moment when the mode before
# can be left. Over these times the policy is found backwards, mode
# by mode, by dynamic programming: exact, in n log n.
#
# But for what charges the DC link again, which depends on how long the drive bus was off: it is
# counted as nothing and as a whole charge, and the better of both policies is taken, or one mode
# alone: at most a whole charge (0.4 kJ) above the least expectation.


@dataclass(frozen=True, eq=False)
class Timeouts:
    """Policies for the modes of `rests` and lengths (n,) [s], sorted; switched_off [J]: what
    switching the drive bus off counts in the search.
    """

    rests: Rests
    lengths: FloatArray
    switched_off: float = 0.0

    def best(self) -> Steps:
        """The policy of least expected energy."""
        steps = self._searched()
        whole = self.rests.recharge.whole
        if not whole:
            return steps
        other = replace(self, switched_off=whole)._searched()
        alone = [at_once((rest,)) for rest in self.rests.modes]
        policies = (steps, other, *alone, Steps())
        return min(policies, key=lambda each: self.rests.mean_cost(each, self.lengths))

    def _searched(self) -> Steps:
        """The policy that the search finds."""
        steps = self._first()
        while steps and (following := self._next(steps[-1])) is not None:
            steps = (*steps, following)
        return steps

    def _first(self) -> Steps:
        """The first mode and its switch time; none: no pause outlasts standing on motors."""
        rests = self.rests
        lengths = self.lengths
        times = np.concatenate(([0.0], lengths[over_by(rests.timer, lengths)]))
        best = float("inf"), Steps()
        if over_by(rests.timer, lengths[-1]):
            best = self._until(np.array([lengths[-1]]), rests.motors, 0.0)[0], Steps()
        for rest in rests.modes:
            at = np.append(times, rests.timer) if rest.name == BRAKES else times
            costs = self._until(at, rests.motors, 0.0) + self._from(at, rest, rests.motors, False)
            k = int(np.argmin(costs))
            if rest.watts <= rests.motors and costs[k] < best[0]:
                best = float(costs[k]), (RestStep(rest, float(at[k])),)
        return best[1]

    def _next(self, step: RestStep) -> RestStep | None:
        """The mode after a step and its switch time; None: it is the last."""
        rest = step.rest
        lengths = self.lengths
        at = np.concatenate(([step.free], lengths[lengths >= step.free]))
        least = self._until(lengths[-1:], rest.watts, rest.leave)[0]
        best = None
        for deeper in self._deeper(rest):
            costs = self._until(at, rest.watts, rest.leave)
            costs += self._from(at, deeper, rest.watts, rest.bus_off)
            k = int(np.argmin(costs))
            if self._going_on_after(at)[k] and costs[k] < least:
                least = costs[k]
                best = RestStep(deeper, float(at[k]))
        return best

    def _deeper(self, rest: Rest) -> tuple[Rest, ...]:
        after = self.rests.modes[self.rests.modes.index(rest) + 1 :]
        return tuple(each for each in after if each.watts <= rest.watts)

    @cached_property
    def _sums(self) -> FloatArray:
        return np.concatenate(([0.0], np.cumsum(self.lengths)))

    def _ended_by(self, times: FloatArray) -> FloatArray:
        """How many pauses are over by each time, by the rule of `over_by`."""
        return np.searchsorted(self.lengths, times, side="right").astype(np.float64)

    def _going_on_after(self, times: FloatArray) -> FloatArray:
        return len(self.lengths) - self._ended_by(times)

    def _until(self, times: FloatArray, watts: float, leave: float) -> FloatArray:
        """Energy of all pauses in one mode from time 0 until each of these times, and back to
        motors of those that end before; differences of two times are the energy between them.
        """
        ended = self._ended_by(times)
        lengths = self._sums[ended.astype(np.intp)]
        staying = watts * (lengths + self._going_on_after(times) * times)
        back: FloatArray = ended * (self.rests.motors * leave)
        return staying + back

    def _from(self, times: FloatArray, rest: Rest, watts: float, was_off: bool) -> FloatArray:
        """Least energy, of all pauses that are longer, of entering a mode at each of these times
        from one that draws `watts`, until the robot is ready; was_off: whether the drive bus is off
        before.
        """
        longer = self._going_on_after(times)
        free = times + rest.busy
        switched = self.switched_off if rest.bus_off and not was_off else 0.0
        entering = longer * (watts * rest.enter + rest.watts * rest.stay + switched)
        early = (longer - self._going_on_after(free)) * (self.rests.motors * rest.leave)
        return entering + early + self._after(free, rest)

    def _after(self, free: FloatArray, rest: Rest) -> FloatArray:
        """Least energy from each of the times on, from which a mode can be left, of all pauses that
        are longer.
        """
        ends = self._onward(self.lengths, rest)
        later = np.minimum.accumulate(ends[::-1])[::-1]
        following = np.searchsorted(self.lengths, free, side="left")
        at_samples = np.append(later, np.inf)[following]
        best = np.minimum(at_samples, self._onward(free, rest)) - self._until(
            free, rest.watts, rest.leave
        )
        return np.where(self._going_on_after(free) > 0, best, 0.0)

    def _onward(self, times: FloatArray, rest: Rest) -> FloatArray:
        """Energy in the mode from time 0 until each of these times, then deeper; the last: to the
        end.
        """
        staying = self._until(times, rest.watts, rest.leave)
        options = [
            self._from(times, deeper, rest.watts, rest.bus_off) for deeper in self._deeper(rest)
        ]
        nobody = self._going_on_after(times) == 0
        onward: FloatArray = np.min(options, axis=0) if options else np.full(len(times), np.inf)
        return staying + np.where(nobody, 0.0, onward)


# How a pause should be spent: a sequence of power modes with its switch times, and when to wake.
#
# Of a pause of known length the modes are entered one after the other, each as soon as it can be,
# so that most of it is spent in the deepest, and the robot is woken in time. A pause whose end is
# not known has a timeout policy (timeouts), and its end wakes the robot, which is ready later
# then.


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
    postures; trips: what moving there takes, in words; remark: what the modes' power rests on.
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
        return "; ".join((*parts, *self.trips, *filter(None, (self.remark,))))

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
    lengths: PauseLengths, q: FloatArray, scene: PlanningScene, times: TransitionTimes
) -> Standby:
    """How to spend a pause of these lengths at q (n,)."""
    rests = rests_at(q, scene, times)
    pause = lengths.most
    steps, cost = _known(rests, pause) if lengths.known else _policy(rests, lengths)
    by_itself = rests.mean_cost((), lengths.likely)
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


def _known(rests: Rests, pause: float) -> tuple[Steps, _Cost]:
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
        closed = not steps and rests.modes and most > rests.timer
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
    enter = times.enter(name)
    leave = times.leave(name)
    stay = times.minimum_stay(name)
    recharge = 0.0 if drive_bus_up(name) else recharge_of(scene).whole
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
        energy_to_operate=motors * leave + recharge,
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
    deeper = name
    watts = [mode_watts(mode, q, scene) for mode in (shallower, deeper)]
    extra = [
        (motors - power) * (times.enter(mode) + times.leave(mode))
        for mode, power in zip((shallower, deeper), watts, strict=True)
    ]
    gain = watts[0] - watts[1]
    if gain <= 0.0:
        return float("inf")
    recharge = recharge_of(scene)

    def charged(mode: str, pause: float) -> float:
        off = pause - times.enter(mode) - times.leave(mode)
        return 0.0 if drive_bus_up(mode) else recharge.joules(max(off, 0.0))

    pays = (extra[1] - extra[0]) / gain
    for _ in range(_ROUNDS):  # charging the DC link costs more after longer pauses, up to a bound
        more = charged(deeper, pays) - charged(shallower, pays)
        pays = (extra[1] - extra[0] + more) / gain
    shortest = times.enter(deeper) + times.minimum_stay(deeper) + times.leave(deeper)
    return float(max(pays, shortest))


# Where to wait: at which of some postures a pause costs least, moving there and back included.
#
# The movement there is the beginning of the pause. Of a pause of known length the movement back is
# its end; where the end is not known, the robot is woken at the end and ready when it is back.


@dataclass(frozen=True, eq=False)
class Trip:
    """To a posture q (n,) and back: seconds and joules at the mains of both; ids of the
    trajectories.

    problem: why it isn't possible, "" where it is.
    """

    posture: str
    q: FloatArray
    there: tuple[float, float] = (0.0, 0.0)
    back: tuple[float, float] = (0.0, 0.0)
    ids: tuple[str, str] = ("", "")
    problem: str = ""

    @property
    def joules(self) -> float:
        """Energy [J] of both movements."""
        return self.there[1] + self.back[1]

    @property
    def sentence(self) -> str:
        """What the trip takes."""
        if self.problem:
            return f"{self.posture} is out of the question: {self.problem}"
        both = (("there", self.there, self.ids[0]), ("back", self.back, self.ids[1]))
        return f"{self.posture}: " + ", ".join(
            f"{joules:.0f} J in {seconds:.2f} s {where}" + (f" ({name})" if name else "")
            for where, (seconds, joules), name in both
        )


def best_posture(
    lengths: PauseLengths,
    q: FloatArray,
    trips: tuple[Trip, ...],
    scene: PlanningScene,
    times: TransitionTimes,
) -> Standby:
    """How to spend a pause of these lengths, and where: at q (n,), where the robot stands, or
    elsewhere.
    """
    here = advice(lengths, q, scene, times)
    options = [_after(trip, here, lengths, scene, times) for trip in trips]
    energies = tuple(float("inf") if option is None else option.energy for option in options)
    best = min(
        (here, *(option for option in options if option is not None)), key=lambda each: each.energy
    )
    return replace(best, posture_energies=energies, trips=tuple(trip.sentence for trip in trips))


def _after(
    trip: Trip, here: Standby, lengths: PauseLengths, scene: PlanningScene, times: TransitionTimes
) -> Standby | None:
    """The advice with a trip; None where there is none, or not the time for it."""
    back = trip.back[0] if lengths.known else 0.0
    left = lengths.less(trip.there[0] + back)
    if trip.problem or left.most <= 0.0:
        return None
    there = advice(left, trip.q, scene, times)
    late = 0.0 if lengths.known else trip.back[0]
    energy = there.energy + trip.joules
    return replace(
        there,
        energy=energy,
        expected=energy,
        worst=there.worst + trip.joules,
        clairvoyant=there.clairvoyant + trip.joules,
        saving=here.saving + here.energy - energy,
        saving_low=there.saving_low + here.saving + here.energy - energy - there.saving,
        saving_high=there.saving_high + here.saving + here.energy - energy - there.saving,
        saving_on_motors=here.saving_on_motors + here.energy - energy,
        wake_at=there.wake_at + trip.there[0],
        switch_times=tuple(at + trip.there[0] for at in there.switch_times),
        alternatives=here.alternatives,
        energies=here.energies,
        late=there.late + late,
        latest=there.latest + late,
        posture=trip.posture,
    )
