"""All chains of configurations of a small program, and the cheapest of them.

The configurations at the stops are the planner's own. Every edge costs what the planner finds for
it with the request's options; a chain is enumerated by dynamic programming. Edges are planned in
the order of a lower bound that nothing can undercut: what is left unplanned cannot belong to a
cheaper chain.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import TrajectoryReport
from ir_planner import Goal, Planner, TimingError
from ir_planner.program.station_chain import layers_of
from ir_planner.program.steps import Route, Scenes, placed_steps, steps_of
from ir_planner.program.stop_nodes import StopNode
from ir_planner.request import Context, Journal, Work
from ir_planner.scene import PlanningScene
from ir_planner.service import exit_searches, timed_service
from ir_values.arrays import BoolArray, FloatArray

# What no movement between two configurations can undercut: its time, its drive energy and W of eq.
# (9).
#
# Time: every joint alone, from rest to rest within speed, acceleration and jerk. Energy: Coulomb
# friction over the distance that each joint has to turn, viscous friction (at least b d^2 / T), and
# the potential energy of arm, load and gas spring that is gained; the capacitor starts empty, so
# that it gives nothing. These are exact inequalities: a search that prunes by them loses nothing.

_SAMPLES = 200  # of a straight line along which static torque is integrated


def least_times(distance: FloatArray, v: FloatArray, a: FloatArray, j: FloatArray) -> FloatArray:
    """Least time [s] from rest to rest over distances (..., n) within speed, acceleration, jerk
    (n,).
    """
    ramp = np.where(
        v * j >= a * a, a / j + v / a, 2.0 * np.sqrt(v / j)
    )  # time to reach the speed v
    cruising = 2.0 * ramp + (distance - v * ramp) / v
    speed = 0.5 * (np.sqrt((a * a / j) ** 2 + 4.0 * a * distance) - a * a / j)
    accelerating = 2.0 * (a / j + speed / a)
    jerking = 4.0 * np.cbrt(distance / (2.0 * j))
    short = np.where((distance >= 2.0 * a**3 / j**2) & (v * j >= a * a), accelerating, jerking)
    return np.asarray(np.where(distance >= v * ramp, cruising, short))


def potential_gain(scene: PlanningScene, start: FloatArray, goals: FloatArray) -> FloatArray:
    """Potential energy (K,) J gained from start (n,) to goals (K, n): static torque is
    conservative.
    """
    t = (np.arange(_SAMPLES) + 0.5) / _SAMPLES
    steps = goals - start
    q = start + t[None, :, None] * steps[:, None, :]
    flat = np.ascontiguousarray(q.reshape(-1, q.shape[-1]))
    still = np.zeros_like(flat)
    torque = scene.dynamics.inverse_dynamics(flat, still, still).reshape(q.shape)
    return np.asarray((torque * steps[:, None, :]).sum(axis=(1, 2)) / _SAMPLES)


def least_cost(
    scene: PlanningScene, start: FloatArray, goals: FloatArray, time_value: float
) -> FloatArray:
    """Lower bound (K,) of J = drive energy + time_value [W] x T from start (n,) to goals (K, n)."""
    robot = scene.cell.robot
    distance = np.abs(goals - start)
    least = least_times(distance, robot.velocity_max, robot.acceleration_max, robot.jerk_max).max(
        axis=1
    )
    viscous = distance**2 @ robot.friction_viscous
    constant = distance @ robot.friction_coulomb + potential_gain(scene, start, goals)
    T = np.maximum(np.maximum(least, np.sqrt(viscous / time_value)), 1e-9)  # of the least sum
    return np.asarray(np.maximum(constant + viscous / T + time_value * T, time_value * least))


def least_travel(scene: PlanningScene, start: FloatArray, goals: FloatArray) -> FloatArray:
    """Lower bound (K,) of W: that of the straight movement."""
    return np.asarray(np.abs(goals - start) @ scene.weights)


CEILING = 120.0  # s: work ends a search, never the clock
EdgeCosts = dict[tuple[bytes, ...], float]  # of edges of a cell that other instances share


def cost_of(report: TrajectoryReport, options: PlanOptions) -> float:
    """J [J], or W of eq. (9) where that is the objective."""
    if options.objective == "movement_cost":
        return report.movement_cost
    return report.energy - report.base_energy + options.time_value * report.duration


@dataclass(eq=False)
class Chains:
    """Layers of nodes with costs (A, B) of the edges between them, lower bounds first; `planned`
    (A, B).

    `known` is shared by the instances of one cell. `edges`: how many were planned here.
    """

    planner: Planner
    route: Route
    options: PlanOptions
    layers: list[list[StopNode]]
    known: EdgeCosts
    costs: list[FloatArray] = field(default_factory=list)
    planned: list[BoolArray] = field(default_factory=list)
    edges: int = 0

    def __post_init__(self) -> None:
        for place in range(len(self.route)):
            first = self.layers[place]
            second = self.layers[place + 1]
            lines = [self._lines(place, node, entry=True) for node in second]
            exits = [self._lines(place, node, entry=False) for node in first]
            self.costs.append(np.add.outer(exits, lines) + self._bounds(place))
            self.planned.append(np.zeros(self.costs[-1].shape, dtype=np.bool_))

    @staticmethod
    def of(
        planner: Planner,
        stations: tuple[str, ...],
        start: FloatArray,
        options: PlanOptions,
        known: EdgeCosts,
    ) -> Chains:
        """Chains through stations from start (n,). Raises StageError where a stop has no
        configuration.
        """
        cell = planner.cell
        settings = planner.settings
        steps = placed_steps(cell, steps_of(cell, stations), cell.parts_at_start())
        scenes = Scenes(
            cell, planner.scene().power, settings.drives(cell.robot), options.load == NO_LOAD
        )
        route = Route.over(steps, scenes)
        context = Context(
            scenes.of(cell.parts_at_start()), options, _journal(planner, options, len(stations))
        )
        searches = exit_searches(settings.withdrawal)
        layers = layers_of(route, start, context, searches, lambda *_: None)
        return Chains(planner, route, context.options, layers, known)

    @property
    def count(self) -> float:
        """How many chains there are."""
        return float(np.prod([float(len(layer)) for layer in self.layers]))

    def cheapest(self, until: Callable[[], bool] = lambda: False) -> tuple[list[int], float, bool]:
        """Configuration at each stop of the cheapest chain, its cost (inf: none), whether it is
        proved.
        """
        while True:
            chosen, cost = self._shortest()
            open_edges = [
                k for k in range(len(self.costs)) if not self.planned[k][chosen[k], chosen[k + 1]]
            ]
            if not open_edges or not np.isfinite(cost):
                return chosen, cost, True
            if until():
                return chosen, cost, False
            for place in open_edges:
                self._plan(place, chosen[place], chosen[place + 1])

    def cost_along(self, chosen: list[int]) -> float:
        """Cost of one chain, all of its edges planned."""
        for place in range(len(self.costs)):
            self._plan(place, chosen[place], chosen[place + 1])
        steps = zip(self.costs, chosen, chosen[1:], strict=False)
        return float(sum(cost[a, b] for cost, a, b in steps))

    def nearest(self, stops: list[tuple[FloatArray, FloatArray]]) -> list[int]:
        """Index of the node at each stop whose configuration there, and the one outside, are
        nearest to those of stops [((n,), (n,))]: one configuration may have several withdrawals.
        """
        chosen = [0]
        for layer, (q, outside) in zip(self.layers[1:], stops, strict=True):
            off = [np.abs([node.interaction - q, node.arrival - outside]).max() for node in layer]
            chosen.append(int(np.argmin(off)))
        return chosen

    def _shortest(self) -> tuple[list[int], float]:
        total = np.zeros(len(self.layers[0]))
        came = []
        for cost in self.costs:
            through = total[:, None] + cost
            came.append(np.argmin(through, axis=0))
            total = np.min(through, axis=0)
        chosen = [int(np.argmin(total))]
        for step in reversed(came):
            chosen.append(int(step[chosen[-1]]))
        return chosen[::-1], float(np.min(total))

    def _bounds(self, place: int) -> FloatArray:
        scene = self.route.arriving(place)
        goals = np.array([node.arrival for node in self.layers[place + 1]])
        if self.options.objective == "movement_cost":
            return np.array(
                [least_travel(scene, node.departure, goals) for node in self.layers[place]]
            )
        value = self.options.time_value
        return np.array(
            [least_cost(scene, node.departure, goals, value) for node in self.layers[place]]
        )

    def _plan(self, place: int, a: int, b: int) -> None:
        """Replace the bound of an edge by what the planner finds."""
        if self.planned[place][a, b]:
            return
        first = self.layers[place][a]
        second = self.layers[place + 1][b]
        bound = self._bound(place, first, second)
        found = self._across(place, first, second)
        if found < bound - 1e-6 * abs(bound):
            raise AssertionError(f"an edge costs {found:g}, less than its lower bound of {bound:g}")
        self.costs[place][a, b] += found - bound
        self.planned[place][a, b] = True

    def _bound(self, place: int, first: StopNode, second: StopNode) -> float:
        scene = self.route.arriving(place)
        goals = second.arrival[None]
        if self.options.objective == "movement_cost":
            return float(least_travel(scene, first.departure, goals)[0])
        return float(least_cost(scene, first.departure, goals, self.options.time_value)[0])

    def _across(self, place: int, first: StopNode, second: StopNode) -> float:
        """Cost of the regional movement that the planner answers with; inf: none."""
        key = (first.departure.tobytes(), second.arrival.tobytes(), self._asked())
        if key not in self.known:
            goal = Goal(configuration=second.arrival)
            if np.abs(second.arrival - first.departure).max() < 1e-9:
                return 0.0
            plan = self.planner.plan_regional(
                start=first.departure, goal=goal, options=self.options
            )
            self.known[key] = cost_of(plan.report, self.options) if plan.status.ok else np.inf
            self.edges += 1
        return self.known[key]

    def _lines(self, place: int, node: StopNode, *, entry: bool) -> float:
        """Cost of a service line into the stop of a place or out of the one before it; inf: not
        possible.
        """
        if len(node.line.points) < 2:
            return 0.0
        key = (node.line.points.tobytes(), self._asked(), b"in" if entry else b"out")
        if key not in self.known:
            report = self.line(place, node, entry=entry)
            self.known[key] = np.inf if report is None else cost_of(report, self.options)
        return self.known[key]

    def line(self, place: int, node: StopNode, *, entry: bool) -> TrajectoryReport | None:
        """The service line into the stop of a place or out of the one before it; None: none, or not
        free.
        """
        if len(node.line.points) < 2:
            return None
        name = self.route.name(place if entry else place - 1)
        journal = _journal(self.planner, self.options, 1)
        context = Context(self.route.arriving(place), self.options, journal).at(name)
        try:
            movement = timed_service(node.line, entry, context)
        except TimingError:
            return None
        return movement.report if movement.prove().violation is None else None

    def _asked(self) -> bytes:
        o = self.options
        return f"{o.objective} {o.load} {o.seed} {o.time_value} {o.safety_distance}".encode()


def _journal(planner: Planner, options: PlanOptions, movements: int) -> Journal:
    """A journal with the work of a request of so many movements."""
    work = Work(
        planner.settings.max_iterations * movements,
        time.monotonic() + CEILING * movements,
        time.monotonic,
        improvement=planner.settings.improvement_iterations,
    )
    return Journal(work, options.seed)
