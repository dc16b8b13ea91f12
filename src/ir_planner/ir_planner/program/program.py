"""A whole program: configurations at the stations, all movements and pauses between them, loads and power
modes.

Configurations first (shortest path of eq. 9), then the movements in order, each with what is held at that
moment.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from ir_kernels.power import Regeneration
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind, PlannedMovement, PlanningInfo, TrajectoryReport
from ir_msgs_py.status import Status, StatusCode
from ir_msgs_py.transitions import TransitionTimes

from ir_description import Cell, PowerData
from ir_planner.checks import FreeSpace, total_report
from ir_planner.errors import RequestError, TimingError
from ir_planner.program.assembly import Leg, assembled
from ir_planner.program.station_graph import Certify, Gap, Node, Plan, StationGraph
from ir_planner.program.steps import Scenes, placed_steps, steps_of
from ir_planner.program.stops import posture_nodes, station_nodes
from ir_planner.regional import search_regional
from ir_planner.request import DURATION_MAX, Journal, Work
from ir_planner.scene import PlanningScene, path_cost
from ir_planner.search import GeneticSettings
from ir_planner.service import ServiceLine, WithdrawalSettings, timed_service
from ir_planner.timing import TimedMovement

Progress = Callable[[str, int, int, float], None]


@dataclass(frozen=True, eq=False)
class ProgramPlan:
    """The answer: movements and pauses in order; empty unless the status is SUCCESS."""

    status: Status
    info: PlanningInfo
    program_id: str = ""
    movements: tuple[PlannedMovement, ...] = ()
    report: TrajectoryReport = field(default_factory=TrajectoryReport)


@dataclass(frozen=True, eq=False)
class ProgramRequest:
    """What to plan: the cell, its stations to visit (empty: its program), from `start` (n,), in
    `cycle_time` s (0: free).
    """

    cell: Cell
    power: PowerData
    stations: tuple[str, ...]
    start: FloatArray
    options: PlanOptions
    cycle_time: float = 0.0
    regeneration: Regeneration = "shared"
    pauses: TransitionTimes = field(default_factory=TransitionTimes)
    withdrawal: WithdrawalSettings = field(default_factory=WithdrawalSettings)
    genetic: GeneticSettings = field(default_factory=GeneticSettings)


class _FailedError(Exception):
    """A stage found nothing; carries the status."""

    def __init__(self, status: Status) -> None:
        super().__init__(status.message)
        self.status = status


def plan_program(request: ProgramRequest, work: Work, progress: Progress) -> ProgramPlan:
    """Plan a program. Raises RequestError for a request that makes no sense, CancelledError when stopped."""
    journal = Journal(work, request.options.seed)
    try:
        movements, elapsed = _Planner(request, journal, progress).run()
        status = Status.success()
    except _FailedError as failed:
        movements, elapsed, status = (), (), failed.status
    except TimingError as error:
        movements, elapsed, status = (), (), Status(StatusCode.PLANNING_FAILED, str(error))
    journal.planner_id = "station graph"
    info = journal.info(request.start, request.cell.robot.joint_names)
    if not movements:
        return ProgramPlan(status, info)
    report = total_report(tuple(movement.report for movement in movements), elapsed)
    return ProgramPlan(status, info, program_hash(movements), movements, report)


def program_hash(movements: tuple[PlannedMovement, ...]) -> str:
    """Id of a program: hash of its steps and the ids of their trajectories."""
    digest = hashlib.sha256()
    for m in movements:
        texts = (m.kind, m.from_station, m.to_station, m.trajectory_id, repr(m.duration), m.power_mode)
        handling = (m.attach, m.detach, m.load, *m.wait_for, "|", *m.set_signals)
        digest.update("\0".join(str(value) for value in (*texts, *handling)).encode() + b"\n")
    return digest.hexdigest()[:16]


class _Planner:
    """One request on its way."""

    def __init__(self, request: ProgramRequest, journal: Journal, progress: Progress) -> None:
        self.request, self.journal, self.progress = request, journal, progress
        self.options = request.options
        cell = request.cell
        steps = steps_of(cell, request.stations)
        self.steps = placed_steps(cell, steps, cell.parts_at_start())
        if request.options.load not in ("", NO_LOAD):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"load is {request.options.load!a}: in a program the steps say what is "
                "attached, leave it empty",
            )
        if request.options.duration > 0.0:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"duration is {request.options.duration:g} s: a program has a cycle_time instead, "
                "leave it 0 s",
            )
        bare = request.options.load == NO_LOAD
        self.scenes = Scenes(cell, request.power, request.regeneration, bare)
        self.ways: dict[tuple[int, int, int], TimedMovement] = {}
        self.best_cost = 0.0  # W of the chain of configurations

    def run(self) -> tuple[tuple[PlannedMovement, ...], tuple[float, ...]]:
        """Movements in order and when each starts [s]."""
        stops = self._stops()
        nodes = self._configurations(stops)
        legs = self._legs(stops, nodes)
        planned = self._assembled(legs)
        if self.request.cycle_time > 0.0:
            planned = self._within_cycle(planned, legs, stops, nodes)
        elapsed = np.concatenate([[0.0], np.cumsum([movement.duration for movement in planned])])
        return planned, tuple(float(t) for t in elapsed[:-1])

    def _stops(self) -> list[int]:
        """Indices of the steps that go somewhere: a step at the place of the one before stays there."""
        stops, here = [], ""
        for k, placed in enumerate(self.steps):
            if placed.step.kind != "PAUSE" and placed.step.target != here:
                stops.append(k)
                here = placed.step.target
        return stops

    def _configurations(self, stops: list[int]) -> list[Node]:
        """One node per stop, the start's first."""
        request, journal = self.request, self.journal
        layers = [[Node(ServiceLine(request.start[None]))]]
        with journal.stage("configurations") as notes:
            for place, k in enumerate(stops):
                self.progress("configurations", place, len(stops), 0.0)
                leaving = (
                    self.steps[stops[place + 1]].before if place + 1 < len(stops) else self.steps[-1].after
                )
                found, status = self._nodes(k, self.scenes.of(leaving), layers[-1][0].outside)
                if not status.ok:
                    raise _FailedError(status)
                layers.append(found)
            notes.append(" x ".join(str(len(layer)) for layer in layers))
        if not stops:
            return [layers[0][0]]
        with journal.stage("station graph") as notes:
            gaps = [
                Gap.between(layers[i], layers[i + 1], self._scene(stops[i]).weights)
                for i in range(len(stops))
            ]
            graph = StationGraph(gaps, self._certify(stops), self._way_round(stops))
            total = len(stops)
            chosen, cost = graph.solve(lambda best: self.progress("station graph", 0, total, best))
            notes.append(f"W {cost:.0f}, {graph.settled} settled")
            self.best_cost = cost
        if not np.isfinite(cost):
            raise _FailedError(self._unreachable)
        return [layer[k] for layer, k in zip(layers, chosen, strict=True)]

    def _nodes(self, k: int, leaving: PlanningScene, near: FloatArray) -> tuple[list[Node], Status]:
        step, margin = self.steps[k].step, self.options.safety_distance
        if step.kind == "POSTURE":
            return posture_nodes(step.target, self._scene(k), margin, self.journal)
        settings = self.request.withdrawal
        return station_nodes(step.target, self._scene(k), leaving, near, self.options, settings, self.journal)

    _unreachable = Status(StatusCode.PLANNING_FAILED, "no chain of configurations connects the stations")

    def _scene(self, k: int) -> PlanningScene:
        return self.scenes.of(self.steps[k].before)

    def _certify(self, stops: list[int]) -> Certify:
        spaces = [
            FreeSpace.of(self._scene(k), self.options.safety_distance, self.journal.work) for k in stops
        ]
        return lambda gap, q0, q1: spaces[gap].edges_free(q0, q1)

    def _way_round(self, stops: list[int]) -> Plan:
        def plan(gap: int, first: Node, second: Node) -> float | None:
            found = self._movement(stops, gap, first, second)
            weights = self._scene(stops[gap]).weights
            return None if found is None else path_cost(weights, found.waypoints)

        return plan

    def _movement(self, stops: list[int], gap: int, first: Node, second: Node) -> TimedMovement | None:
        key = (gap, id(first), id(second))
        if key not in self.ways:
            scene = self._scene(stops[gap])
            inner = Journal(self.journal.work, self.journal.seed)
            ends, settings = (first.outside, second.outside), self.request.genetic
            status, found = search_regional(*ends, scene, self.options, inner, settings)
            self.journal.rejected.update(inner.rejected)
            if found is None:
                names = self._names(stops, gap)
                sentence = f"from {names[0]} to {names[1]}: {status.message}"
                self._unreachable = Status(status.code, sentence)
                return None
            self.ways[key] = found
        return self.ways[key]

    def _names(self, stops: list[int], gap: int) -> tuple[str, str]:
        first = self.steps[stops[gap - 1]].step.target if gap else "the start"
        return first, self.steps[stops[gap]].step.target

    def _legs(self, stops: list[int], nodes: list[Node]) -> dict[int, Leg]:
        """Movements of every stop: out of the last one, across, into this one."""
        legs: dict[int, Leg] = {}
        with self.journal.stage("movements") as notes:
            for place, k in enumerate(stops):
                self.progress("movements", place, len(stops), self.best_cost)
                legs[k] = self._leg(stops, place, nodes[place], nodes[place + 1])
            notes.append(f"{sum(len(leg.movements) for leg in legs.values())} movements")
        return legs

    def _leg(self, stops: list[int], place: int, first: Node, second: Node) -> Leg:
        scene, work = self._scene(stops[place]), self.journal.work
        from_name = self.steps[stops[place - 1]].step.target if place else ""
        to_name = self.steps[stops[place]].step.target
        movements: list[tuple[MovementKind, TimedMovement]] = []
        if len(first.line.points) > 1:
            leaving = timed_service(first.line, False, from_name, scene, self.options, work)
            movements.append((MovementKind.SERVICE_EXIT, self._proved(leaving, f"leaving {from_name}")))
        if np.abs(second.outside - first.outside).max() > 1e-9:
            across = self._movement(stops, place, first, second)
            if across is None:
                raise _FailedError(self._unreachable)
            movements.append((MovementKind.REGIONAL, across))
        if len(second.line.points) > 1:
            entering = timed_service(second.line, True, to_name, scene, self.options, work)
            movements.append((MovementKind.SERVICE_ENTRY, self._proved(entering, f"entering {to_name}")))
        return Leg(from_name, to_name, scene, tuple(movements))

    def _proved(self, movement: TimedMovement, what: str) -> TimedMovement:
        if movement.violation is not None:
            sentence = f"{what}: {movement.violation.sentence}"
            raise _FailedError(Status(StatusCode.PLANNING_FAILED, sentence))
        return movement

    def _assembled(self, legs: dict[int, Leg]) -> tuple[PlannedMovement, ...]:
        return assembled(self.steps, legs, self.scenes, self.request.pauses, self.request.start)

    def _within_cycle(
        self, planned: tuple[PlannedMovement, ...], legs: dict[int, Leg], stops: list[int], nodes: list[Node]
    ) -> tuple[PlannedMovement, ...]:
        """The movements at the pace that fills the cycle time: stretched alike, or as fast as they can."""
        cycle = self.request.cycle_time
        standing, moving = _seconds(planned)
        wanted = cycle - standing
        if wanted < moving:
            self.options = replace(self.options, objective="time")
            self.ways.clear()
            legs = self._legs(stops, nodes)
            planned = self._assembled(legs)
            standing, moving = _seconds(planned)
        if wanted < moving * (1.0 - 1e-9):
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"cycle_time is {cycle:g} s: the shortest is {moving + standing:.3f} s, "
                f"of which {standing:.3f} s are "
                "pauses",
            )
        factor = wanted / moving if moving > 0.0 else 1.0
        longest = factor * max((m.duration for m in planned if not m.is_pause), default=0.0)
        if longest > DURATION_MAX:
            raise RequestError(
                StatusCode.INVALID_GOAL_CONSTRAINTS,
                f"cycle_time is {cycle:g} s: stretched to it, a movement would take {longest:.4g} s, at most "
                f"{DURATION_MAX:g} s; a shorter cycle time with a pause in the program costs less",
            )
        margin = self.options.safety_distance
        return self._assembled({k: leg.slower(factor, margin) for k, leg in legs.items()})


def _seconds(planned: tuple[PlannedMovement, ...]) -> tuple[float, float]:
    """How long a program stands and how long it moves [s]."""
    standing = sum(movement.duration for movement in planned if movement.is_pause)
    return standing, sum(movement.duration for movement in planned if not movement.is_pause)
