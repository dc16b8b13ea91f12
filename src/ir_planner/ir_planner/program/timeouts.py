"""Timeout policies: when to rest deeper in a pause whose end is not known.

The lengths of the pause are given as equally likely samples. A policy is a sequence of modes with
switch times; the end of the pause wakes the robot, whatever mode it is in. The best switch times
are among few: the expected energy grows with a switch time between two samples (every pause that
reaches it stays longer in the mode that draws more, or is ready later), and drops only where a
sample is passed, because that pause ends before the switch. So a switch is at 0, at a sample (of
the pauses longer than that), at the controller's own timer, or at the moment when the mode before
can be left. Over these times the policy is found backwards, mode by mode, by dynamic programming:
exact, in n log n.

But for what charges the DC link again, which depends on how long the drive bus was off: it is
counted as nothing and as a whole charge, and the better of both policies is taken, or one mode
alone: at most a whole charge (0.4 kJ) above the least expectation.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ir_planner.program.rests import BRAKES, Rest, Rests, RestStep, Steps, at_once, over_by
from ir_values.arrays import FloatArray


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
        least = self._until(lengths[-1:], rest.watts, rest.times.leave)[0]
        best = None
        for deeper in self._deeper(rest):
            costs = self._until(at, rest.watts, rest.times.leave)
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
        free = times + rest.times.busy
        switched = self.switched_off if rest.bus_off and not was_off else 0.0
        entering = longer * (watts * rest.times.enter + rest.watts * rest.times.stay + switched)
        early = (longer - self._going_on_after(free)) * (self.rests.motors * rest.times.leave)
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
            free, rest.watts, rest.times.leave
        )
        return np.where(self._going_on_after(free) > 0, best, 0.0)

    def _onward(self, times: FloatArray, rest: Rest) -> FloatArray:
        """Energy in the mode from time 0 until each of these times, then deeper; the last: to the
        end.
        """
        staying = self._until(times, rest.watts, rest.times.leave)
        options = [
            self._from(times, deeper, rest.watts, rest.bus_off) for deeper in self._deeper(rest)
        ]
        nobody = self._going_on_after(times) == 0
        onward: FloatArray = np.min(options, axis=0) if options else np.full(len(times), np.inf)
        return staying + np.where(nobody, 0.0, onward)
