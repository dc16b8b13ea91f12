"""One station of the service benchmark: stage one, eq. (7) alone, and the whole movement, over
seeds.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ir_description import Station
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.configurations.ccd_search import InteractionSettings
from ir_planner.configurations.interaction_point import searched_configurations
from ir_planner.configurations.inverse_kinematics import free_configurations
from ir_planner.request.context import Context, Journal, Work
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.service.exit import Exit
from ir_planner.service.modified_ga import ModifiedGa, withdraw
from ir_planner.service.service_movement import ServicePlan, ServiceRequest, plan_service

T = TypeVar("T")
S_M = 0.02  # m
SHARE_OF_BEST = 0.8  # of the station's best clearance, where that is smaller
STARTS = 32
REPETITIONS = 50
# certified edges, s
EDGES = 60_000
CEILING = 30.0


@dataclass(frozen=True)
class StationFigures:
    """Milliseconds (one per seed) and successes at one station."""

    cell: str
    station: str
    zone: str
    margin: float
    analytic_ms: float
    free: int
    ccd_ms: FloatArray
    ccd_found: int
    literal: int
    inverse: int
    found: int
    path_ms: FloatArray
    answer_ms: FloatArray
    methods: dict[str, int]
    trajectories: tuple[JointTrajectory, ...]

    def row(self) -> dict[str, Any]:
        """As it goes into the table and the JSON."""
        seeds = len(self.ccd_ms)
        return {
            "cell": self.cell,
            "station": self.station,
            "zone": self.zone,
            "S_m_mm": round(self.margin * 1e3, 2),
            "analytic_ms": round(self.analytic_ms, 4),
            "ccd_median_ms": round(float(np.median(self.ccd_ms)), 2),
            "ccd_found": f"{self.ccd_found}/{seeds}",
            "eq7_literal": f"{self.literal}/{seeds}",
            "eq7_inverse": f"{self.inverse}/{seeds}",
            "certified": f"{self.found}/{seeds}",
            "path_median_ms": round(float(np.median(self.path_ms)), 2),
            "path_p95_ms": round(float(np.percentile(self.path_ms, 95)), 2),
            "answer_median_ms": round(float(np.median(self.answer_ms)), 2),
            "answer_p95_ms": round(float(np.percentile(self.answer_ms, 95)), 2),
            "methods": "+".join(f"{name}:{count}" for name, count in sorted(self.methods.items())),
        }


def milliseconds(function: Callable[[], T]) -> tuple[T, float]:
    """Its result and how long it took."""
    begin = time.perf_counter()
    result = function()
    return result, (time.perf_counter() - begin) * 1e3


def margin_at(scene: PlanningScene, station: Station) -> float:
    """S_m [m], or 80 % of the best clearance of the configurations at the station where that is
    smaller.
    """
    q = scene.inverse_kinematics.solve(station.pose[None]).q
    if len(q) == 0:
        return S_M
    offset = np.where(scene.allowed(station.name), -np.inf, 0.0)
    best = float(scene.collision.min_distance(q, offset).distance.max())
    return min(S_M, SHARE_OF_BEST * best) if best > 0.0 else S_M


def measured(scene: PlanningScene, station: Station, seeds: int) -> StationFigures:
    """All figures of one station."""
    margin = margin_at(scene, station)
    park = np.array(scene.cell.park)
    threshold = scene.thresholds(margin, station.name)

    def closed() -> Any:
        q = scene.inverse_kinematics.solve(station.pose[None]).q
        return scene.collision.min_distance(q, threshold) if len(q) else None

    analytic = min(milliseconds(closed)[1] for _ in range(REPETITIONS))
    free = free_configurations(station.pose, scene, threshold, park).q
    searched = [_searched(scene, station, threshold, seed) for seed in range(seeds)]
    there = seeds if len(free) else 0
    plans = [_planned(_context(scene, margin, seed), station) for seed in range(there)]

    def walks(weighting: str) -> int:
        here = [_context(scene, margin, seed).at(station.name) for seed in range(there)]
        return sum(_walks_out(free[0], context, weighting) for context in here)

    candidates = [plan.candidates[0] for plan, _ in plans if plan.candidates]
    paths = [
        1e3 * sum(s.seconds for s in plan.info.stages if s.name != "timing") for plan, _ in plans
    ]
    return StationFigures(
        cell=scene.cell.name,
        station=station.name,
        zone=station.zone,
        margin=margin,
        analytic_ms=analytic,
        free=len(free),
        ccd_ms=np.array([took for _, took in searched]),
        ccd_found=sum(found for found, _ in searched),
        literal=walks("literal"),
        inverse=walks("inverse"),
        found=sum(candidate.report.certified for candidate in candidates),
        path_ms=np.array(paths or [0.0] * seeds),
        answer_ms=np.array([took for _, took in plans] or [0.0] * seeds),
        methods=Counter(candidate.method for candidate in candidates),
        trajectories=tuple(c.trajectory for c in candidates if c.trajectory is not None),
    )


def _context(scene: PlanningScene, margin: float, seed: int) -> Context:
    """A request with this clearance [m] and seed, and a budget of its own."""
    options = PlanOptions(seed=seed, safety_distance=margin, planning_time=CEILING)
    return Context(scene, options, Journal(_work(), seed))


def _work() -> Work:
    return Work(EDGES, time.monotonic() + CEILING, time.monotonic)


def _searched(
    scene: PlanningScene, station: Station, threshold: FloatArray, seed: int
) -> tuple[bool, float]:
    """Whether CCD finds a free configuration, and its milliseconds."""
    park = np.array(scene.cell.park)
    settings = InteractionSettings()
    found, took = milliseconds(
        lambda: searched_configurations(
            station.pose, scene, threshold, park, STARTS, seed, settings, _work()
        )
    )
    return len(found.q) > 0, took


def _walks_out(q: FloatArray, context: Context, weighting: str) -> bool:
    """Whether eq. (7) alone finds a path out from q (n,), in the context of a station."""
    generator = np.random.default_rng(context.options.seed)
    walk = withdraw(Exit.of(q, context), ModifiedGa(weighting=weighting), generator, 1)
    return len(walk.paths) > 0


def _planned(context: Context, station: Station) -> tuple[ServicePlan, float]:
    """The whole movement out, and its milliseconds."""
    request = ServiceRequest(station, "exit", None, np.array(context.scene.cell.park), 1)
    return milliseconds(lambda: plan_service(request, context))
