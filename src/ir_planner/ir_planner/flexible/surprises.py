"""Surprises of a tended cell, on the schedule alone: process times that vary, and a machine that is
down. The planned run is followed by its signals as the program runner follows it; movements take
and need what was planned, waits what they have become.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ir_description import Cell
from ir_description.cell import begin_of_work
from ir_msgs_py.modes import modes_of
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.status import StatusCode
from ir_planner.errors import RequestError, unknown_name
from ir_planner.flexible.steady_plan import SteadyPlan
from ir_planner.flexible.tending_cell import route_of
from ir_planner.program import Rests, Scenes, Steps, Timeouts, rests_at
from ir_values.arrays import FloatArray

BY_ITSELF = "by itself"
"""A late machine is waited for as the controller does by itself: motors, then brakes."""
TIMEOUTS = "timeouts"
"""By the policy for waits of unknown length: deeper modes one after the other, the end wakes."""
KNOWN = "known"
"""As who knows how long every process takes: each wait in the modes that suit its length."""
POLICIES = (BY_ITSELF, TIMEOUTS, KNOWN)
_NOTICED = 0.05  # s: shorter waits are roundings, nobody asks for a mode in them
_IN_STEP = 0.01  # of the planned seconds of a part
SHARES = (0.5, 0.75, 0.9, 1.0)
"""Shares of the parts that are done within the times that a plan may count with."""

Times = Mapping[str, Sequence[float]]
"""Seconds of the parts in a machine, one after the other, by machine."""


@dataclass(frozen=True)
class ReplayedPart:
    """A part in a run that was followed: seconds and joules since the part before; late [s]: waits
    for machines beyond the planned pauses.
    """

    seconds: float
    joules: float
    late: float


@dataclass(frozen=True)
class OutageReplay:
    """A machine that is down once. parts: of the run by policy; planned: of the run without it.
    back: parts after the outage until the seconds of a part are the planned ones again.
    """

    parts: Mapping[str, tuple[ReplayedPart, ...]]
    planned: tuple[ReplayedPart, ...]
    back: int

    def joules(self, policy: str) -> float:
        """Joules more than without the outage."""
        return _joules(self.parts[policy]) - _joules(self.planned)


@dataclass(frozen=True)
class CountedTimes:
    """A plan that counts with the times [s] within which a share of the parts is done (0: their
    mean): joules and seconds a part in the mean over what was drawn; known: joules of who knows
    every time beforehand, in the same order.
    """

    share: float
    times: Mapping[str, float]
    joules: float
    seconds: float
    known: float


class Replay:
    """The run of a plan, to be followed with other process times."""

    def __init__(self, plan: SteadyPlan) -> None:
        if plan.run is None or plan.run_cell is None or plan.request is None:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS, "the plan has no run: ask for cycles"
            )
        self._steps = plan.run.movements
        self._cell = plan.run_cell
        request = plan.request
        self._times = request.settings.transitions
        drives = request.settings.drives(self._cell.robot)
        places = self._cell.parts_at_start()
        self._scene = Scenes(self._cell, request.power, drives).of(places)
        ends = [signal for signal in self._cell.signals if signal.process]
        machines = {signal.process: self._cell.machine(signal.process) for signal in ends}
        self._assumed = {name: machine.process for name, machine in machines.items()}
        self._capacities = {name: machine.capacity for name, machine in machines.items()}
        self._starts = {signal.follows: signal.process for signal in ends}
        self._answers = {signal.name: signal.follows for signal in ends}
        self._begins = np.concatenate(([0.0], np.cumsum([s.duration for s in self._steps])))

    @property
    def machines(self) -> tuple[str, ...]:
        """Machines with a process."""
        return tuple(self._assumed)

    def planned_times(self) -> dict[str, list[float]]:
        """Times as they are planned."""
        count = len(self._steps)
        return {name: [seconds] * count for name, seconds in self._assumed.items()}

    def follow(
        self, times: Times, policy: str = BY_ITSELF, lengths: FloatArray | None = None
    ) -> tuple[ReplayedPart, ...]:
        """The parts with these times. lengths (n,) [s]: equally likely lengths of late waits, that
        the timeouts are found for.
        """
        line = _Followed({name: iter(values) for name, values in times.items()}, self._capacities)
        q = np.zeros(self._cell.robot.n)
        last = route_of(self._cell).visits[-1]
        for index, step in enumerate(self._steps):
            for text in step.wait_for:
                start = self._answers.get(text)
                if start is not None:
                    wait = max(line.ready.get(start, 0.0) - line.now, 0.0)
                    line.late(*self._late(wait, policy, lengths, self._rests(q)))
            if step.trajectory is not None:
                q = step.trajectory.positions[-1]
            seconds = step.duration
            joules = step.report.energy
            if step.since in self._starts:
                end = float(line.started.get(step.since, 0.0) + self._begins[index + 1])
                end -= line.planned.get(step.since, 0.0)
                if policy == KNOWN:
                    assumed = self._assumed[self._starts[step.since]]
                    end += line.drawn.get(step.since, assumed) - assumed
                seconds = max(end - line.now, 0.0)
                joules = self._paused(step, seconds, policy, self._rests(q))
            line.spend(seconds, joules)
            for text in step.set_signals:
                if text in self._starts:
                    line.start(self._starts[text], text, float(self._begins[index + 1]))
            if step.detach and step.to_station == last:
                line.delivered()
        return tuple(line.parts)

    def _rests(self, q: FloatArray) -> Rests:
        return rests_at(q, self._scene, self._times)

    def _paused(self, step: PlannedMovement, seconds: float, policy: str, rests: Rests) -> float:
        """Joules of a planned pause that has another length."""
        if policy == KNOWN:
            return rests.known(seconds)[0]
        modes = tuple(rests.named(mode.name) for mode in modes_of(step.power_mode))
        joules = rests.in_time(modes, seconds) if modes else np.inf
        return joules if np.isfinite(joules) else rests.cost((), seconds)[0]

    @staticmethod
    def _late(
        wait: float, policy: str, lengths: FloatArray | None, rests: Rests
    ) -> tuple[float, float]:
        """Seconds and joules until the robot goes on."""
        if wait < _NOTICED:
            return wait, rests.motors * wait
        if policy == KNOWN:
            return wait, rests.known(wait)[0]
        steps: Steps = ()
        if policy == TIMEOUTS and lengths is not None:
            steps = Timeouts(rests, np.sort(lengths)).best()
        joules, more = rests.cost(steps, wait)
        return wait + more, joules


class _Followed:
    """A run while it is followed: now, what the part since the last one took, and by the signal
    that starts a machine what came of it last.
    """

    def __init__(self, times: dict[str, Iterator[float]], capacities: Mapping[str, int]) -> None:
        self._times = times
        self._capacities = capacities
        self.now = 0.0
        self.parts: list[ReplayedPart] = []
        self.started: dict[str, float] = {}
        self.planned: dict[str, float] = {}
        self.ready: dict[str, float] = {}
        self.drawn: dict[str, float] = {}
        self._ends: dict[str, list[float]] = {}
        self._begin = 0.0
        self._joules = 0.0
        self._late = 0.0

    def spend(self, seconds: float, joules: float) -> None:
        """Time passes."""
        self.now += seconds
        self._joules += joules

    def late(self, seconds: float, joules: float) -> None:
        """Time passes that wasn't planned."""
        self.spend(seconds, joules)
        self._late += seconds

    def start(self, name: str, signal: str, planned: float) -> None:
        """A machine is started by a signal now, by the plan at `planned` s."""
        self.drawn[signal] = next(self._times[name])
        self.started[signal] = self.now
        self.planned[signal] = planned
        ends = self._ends.setdefault(name, [])
        begin = begin_of_work(self.now, ends, self._capacities[name])
        self.ready[signal] = begin + self.drawn[signal]
        ends.append(self.ready[signal])

    def delivered(self) -> None:
        """A part has left."""
        self.parts.append(ReplayedPart(self.now - self._begin, self._joules, self._late))
        self._begin = self.now
        self._joules = 0.0
        self._late = 0.0


def outage_replay(
    plan: SteadyPlan, machine: str, seconds: float, part: int, lengths: FloatArray
) -> OutageReplay:
    """A machine takes so many seconds more for its part of that number, from 0, once. lengths (n,)
    [s]: as long as an outage may be, equally likely; how long this one is nobody knows. Raises
    RequestError for a machine without a process.
    """
    replay = Replay(plan)
    if machine not in replay.machines:
        raise unknown_name("machine with a process", machine, replay.machines)
    times = replay.planned_times()
    planned = replay.follow(times)
    times[machine][part] += seconds
    parts = {policy: replay.follow(times, policy, lengths) for policy in POLICIES}
    late = [
        row.seconds > (1.0 + _IN_STEP) * planned[k].seconds for k, row in enumerate(parts[TIMEOUTS])
    ]
    back = len(late) - 1 - late[::-1].index(True) - late.index(True) if any(late) else 0
    return OutageReplay(parts, planned, back)


def with_counted_times(cell: Cell, share: float) -> Cell:
    """The cell whose plans count with the times within which a share of the parts is done, 0: as
    the cell says.
    """
    if share == 0.0:
        return cell
    machines = tuple(
        machine
        if machine.process_times is None
        else replace(machine, process=machine.process_times.quantile(share))
        for machine in cell.equipment
    )
    return replace(cell, equipment=machines)


def counted_times(plan: SteadyPlan, share: float, seed: int) -> CountedTimes:
    """What a plan that counts with such times takes in the mean, over its parts with times that are
    drawn with the seed; those that fill the line are left out.
    """
    replay = Replay(plan)
    assert plan.run_cell is not None
    assert plan.cycle is not None
    times = replay.planned_times()
    for name, values in times.items():
        law = plan.run_cell.machine(name).process_times
        generator = np.random.default_rng([seed, *name.encode()])
        if law is not None:
            times[name] = [law.drawn(generator) for _ in values]
    steady = slice(len(plan.process), None)
    driven = replay.follow(times)[steady]
    known = replay.follow(times, KNOWN)[steady]
    return CountedTimes(
        share,
        {name: plan.run_cell.machine(name).process for name in replay.machines},
        _joules(driven) / len(driven),
        sum(part.seconds for part in driven) / len(driven),
        _joules(known) / len(known),
    )


def _joules(parts: Sequence[ReplayedPart]) -> float:
    return sum(part.joules for part in parts)
