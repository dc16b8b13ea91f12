"""The published integer model of robotic cells, in the same solver.

Bukata, Sucha, Hanzalek, Burget: Energy Optimization of Robotic Cells, IEEE TII 2017, equations 1 to
20 (arXiv 1802.05925): one energy, start and duration per activity, large constants where a choice
decides, ten segments per energy function, and two rows per collision and multiple of the cycle.
"""

from __future__ import annotations

import numpy as np

from ir_planner.cycle import LinearAnswer, LinearProgram
from ir_studies.cells import Instance
from ir_studies.cells.instance import DynamicActivity, HopMovement, InstanceRobot
from ir_studies.cells.solution import after

_SEGMENTS = 10
_LARGE_ENERGY = 1e6


class PublishedModel:
    """Variables and rows."""

    def __init__(self, instance: Instance) -> None:
        self.instance = instance
        p = LinearProgram()
        self.program = p
        far = 2.0 * len(instance.robots) * instance.cycle
        activities = [a.number for r in instance.robots for a in (*r.stops, *r.hops)]
        self.energy = {a: p.variable(0.0, _LARGE_ENERGY, cost=1.0) for a in activities}
        self.start = {a: p.variable(0.0, far) for a in activities}
        self.duration = {a: p.variable(0.0, instance.cycle) for a in activities}
        self.place: dict[tuple[int, int], int] = {}
        self.move: dict[tuple[int, int], int] = {}
        for robot in instance.robots:
            self._stays(robot)
            self._hops(robot)
            self._order(robot)
        if len(instance.robots) > 1:
            self._shared()

    def solve(self, seconds: float) -> LinearAnswer:
        """Least energy by the segments."""
        return self.program.solve(stopped=after(seconds), gap=1e-6)

    def _stays(self, robot: InstanceRobot) -> None:
        p = self.program
        for stop in robot.stops:
            v = stop.number
            p.row({self.duration[v]: 1.0}, low=stop.least, high=stop.most)
            modes = {mode: p.binary() for mode in robot.modes}
            for mode, on in modes.items():
                p.row({self.duration[v]: 1.0, on: -robot.modes[mode]}, low=0.0)
            for place in stop.places:
                here = p.binary()
                self.place[v, place.number] = here
                for mode, on in modes.items():
                    terms = {self.duration[v]: place.power[mode], self.energy[v]: -1.0}
                    p.row(
                        terms | {on: _LARGE_ENERGY, here: _LARGE_ENERGY}, high=2.0 * _LARGE_ENERGY
                    )
            p.row(dict.fromkeys(modes.values(), 1.0), low=1.0, high=1.0)
            p.row({self.place[v, q.number]: 1.0 for q in stop.places}, low=1.0, high=1.0)

    def _hops(self, robot: InstanceRobot) -> None:
        for hop in robot.hops:
            for movement in hop.movements:
                self.move[hop.number, movement.number] = self.program.binary()
                self._movement(hop, movement)
        for stop in robot.stops:
            for place in stop.places:
                for end in ("start", "end"):
                    terms = {
                        self.move[hop.number, m.number]: 1.0
                        for hop in robot.hops
                        for m in hop.movements
                        if getattr(m, end) == place.point
                    }
                    here = self.place[stop.number, place.number]
                    self.program.row(terms | {here: -1.0}, low=0.0, high=0.0)

    def _movement(self, hop: DynamicActivity, movement: HopMovement) -> None:
        p = self.program
        e = hop.number
        on = self.move[e, movement.number]
        curve = movement.curve
        cycle = self.instance.cycle
        times = np.linspace(curve.least, max(curve.most, curve.least + 1e-6), _SEGMENTS + 1)
        values = [curve.energy(t) for t in times]
        for k in range(_SEGMENTS):
            slope = (values[k + 1] - values[k]) / (times[k + 1] - times[k])
            zero = values[k] - slope * times[k]
            terms = {self.duration[e]: slope, on: _LARGE_ENERGY, self.energy[e]: -1.0}
            p.row(terms, high=_LARGE_ENERGY - zero)
        p.row({self.duration[e]: 1.0, on: -curve.least}, low=0.0)
        p.row({self.duration[e]: 1.0, on: cycle}, high=curve.most + cycle)

    def _order(self, robot: InstanceRobot) -> None:
        p = self.program
        cycle = self.instance.cycle
        closing = robot.closing.number
        for hop in robot.hops:
            e = hop.number
            v = hop.start
            rest = -cycle if v == closing else 0.0
            p.row(
                {self.start[e]: 1.0, self.start[v]: -1.0, self.duration[v]: -1.0},
                low=rest,
                high=rest,
            )
            terms = {self.start[hop.end]: 1.0, self.start[e]: -1.0, self.duration[e]: -1.0}
            if sum(other.start == v for other in robot.hops) == 1:
                p.row(terms, low=0.0, high=0.0)
                continue
            on = [self.move[e, m.number] for m in hop.movements]
            p.row(terms | dict.fromkeys(on, -cycle), low=-cycle)
            p.row(terms | dict.fromkeys(on, cycle), high=cycle)

    def _shared(self) -> None:
        p = self.program
        cycle = self.instance.cycle
        for lag in self.instance.lags:
            terms = {self.start[lag.later]: 1.0, self.start[lag.earlier]: -1.0}
            p.row(terms, low=lag.length - cycle * lag.height)
        for handover in self.instance.handovers:
            a, b = handover.stops
            for (side, one), (_, other) in (((0, a), (1, b)), ((1, b), (0, a))):
                for k in sorted({pair[side] for pair in handover.pairs}):
                    fitting = [pair[1 - side] for pair in handover.pairs if pair[side] == k]
                    terms = {self.place[other, f]: -1.0 for f in sorted(fitting)}
                    p.row(terms | {self.place[one, k]: 1.0}, high=0.0)
        choice = self.place | self.move
        robots = len(self.instance.robots)
        far = 2.0 * robots * cycle
        for conflict in self.instance.conflicts:
            a = conflict.first[0]
            b = conflict.second[0]
            taken = {choice[conflict.first]: -far, choice[conflict.second]: -far}
            for n in range(-robots, robots + 1):
                first = p.binary()
                terms = {self.start[b]: 1.0, self.start[a]: -1.0, self.duration[a]: -1.0}
                p.row(terms | taken | {first: -far}, low=-3.0 * far - n * cycle)
                terms = {self.start[a]: 1.0, self.start[b]: -1.0, self.duration[b]: -1.0}
                p.row(terms | taken | {first: far}, low=-2.0 * far + n * cycle)
