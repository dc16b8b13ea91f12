"""One station of the service benchmark: stage one, eq. (7) alone, and the whole movement, over seeds."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ir_description import Cell, Station, load_power_data
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.configurations.interaction_point import searched_configurations
from ir_planner.configurations.inverse_kinematics import free_configurations
from ir_planner.configurations.settings import InteractionSettings
from ir_planner.request.context import Context
from ir_planner.request.journal import Journal
from ir_planner.request.work import Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.service.exit import Exit
from ir_planner.service.modified_ga import ModifiedGa, withdraw
from ir_planner.service.service_movement import plan_service
from ir_planner.service.work_configurations import ServiceRequest

S_M = 0.02  # m
SHARE_OF_BEST = 0.8  # of the station's best clearance, where that is smaller
STARTS = 32
REPETITIONS = 50


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
    way_ms: FloatArray
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
            "way_median_ms": round(float(np.median(self.way_ms)), 2),
            "way_p95_ms": round(float(np.percentile(self.way_ms, 95)), 2),
            "answer_median_ms": round(float(np.median(self.answer_ms)), 2),
            "answer_p95_ms": round(float(np.percentile(self.answer_ms, 95)), 2),
            "methods": "+".join(f"{name}:{count}" for name, count in sorted(self.methods.items())),
        }


def scene_of(cell: Cell) -> PlanningScene:
    """The cell with its tool."""
    return scene_with(cell, load_text(cell), load_power_data())


def milliseconds(function: Callable[[], Any]) -> tuple[Any, float]:
    """Its result and how long it took."""
    begin = time.perf_counter()
    result = function()
    return result, (time.perf_counter() - begin) * 1e3


def margin_at(scene: PlanningScene, station: Station) -> float:
    """S_m [m], or 80 % of the best clearance of the configurations at the station where that is smaller."""
    q = scene.inverse_kinematics.solve(station.pose[None]).q
    if len(q) == 0:
        return S_M
    offset = np.where(scene.allowed(station.name), -np.inf, 0.0)
    best = float(scene.collision.min_distance(q, offset).distance.max())
    return min(S_M, SHARE_OF_BEST * best) if best > 0.0 else S_M


def measured(scene: PlanningScene, station: Station, seeds: int) -> StationFigures:
    """All figures of one station."""
    margin = margin_at(scene, station)
    threshold, park = scene.thresholds(margin, station.name), np.array(scene.cell.park)

    def budget() -> Work:
        return Work(60_000, time.monotonic() + 30.0, time.monotonic)

    def closed() -> Any:
        q = scene.inverse_kinematics.solve(station.pose[None]).q
        return scene.collision.min_distance(q, threshold) if len(q) else None

    analytic = min(milliseconds(closed)[1] for _ in range(REPETITIONS))
    free = free_configurations(station.pose, scene, threshold, park)
    ccd_ms, ccd_found = np.zeros(seeds), 0
    walks = {"literal": 0, "inverse": 0}
    way_ms, answer_ms, found = np.zeros(seeds), np.zeros(seeds), 0
    methods: dict[str, int] = {}
    trajectories: list[JointTrajectory] = []
    for seed in range(seeds):
        searched, ccd_ms[seed] = milliseconds(
            lambda seed=seed: searched_configurations(
                station.pose, scene, threshold, park, STARTS, seed, InteractionSettings(), budget()
            )
        )
        ccd_found += len(searched.q) > 0
        if len(free.q) == 0:
            continue
        for weighting in walks:
            options = PlanOptions(seed=seed, safety_distance=margin, planning_time=30.0)
            inside = Context(scene, options, Journal(budget(), seed)).at(station.name)
            problem = Exit.of(free.q[0], inside)
            walk = withdraw(problem, ModifiedGa(weighting=weighting), np.random.default_rng(seed), 1)
            walks[weighting] += len(walk.paths) > 0
        request = ServiceRequest(station, "exit", None, park, 1)
        options = PlanOptions(seed=seed, safety_distance=margin, planning_time=30.0)
        plan, answer_ms[seed] = milliseconds(
            lambda request=request, options=options: plan_service(
                request, Context(scene, options, Journal(budget(), options.seed))
            )
        )
        way_ms[seed] = 1e3 * sum(stage.seconds for stage in plan.info.stages if stage.name != "timing")
        for candidate in plan.candidates[:1]:
            found += candidate.report.certified
            methods[candidate.method] = methods.get(candidate.method, 0) + 1
            assert candidate.trajectory is not None
            trajectories.append(candidate.trajectory)
    return StationFigures(
        scene.cell.name,
        station.name,
        station.zone,
        margin,
        analytic,
        len(free.q),
        ccd_ms,
        ccd_found,
        walks["literal"],
        walks["inverse"],
        found,
        way_ms,
        answer_ms,
        methods,
        tuple(trajectories),
    )
