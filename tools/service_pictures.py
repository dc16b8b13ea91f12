"""Draw the pictures of docs/planning.md#service-movements: stage one, the raw walk of eq. (7), the
candidates.

    python tools/service_pictures.py [--folder docs/images]

Everything is in the machine's frame, x into the machine. The pictures are what the planner answers:
run this again when it changes.
"""

from __future__ import annotations

import itertools
import time
from pathlib import Path

import matplotlib as mpl
import numpy as np
from _pictures import folder_asked
from scipy.spatial import ConvexHull

from ir_description import load_cell, load_power_data
from ir_msgs_py.options import PlanOptions
from ir_planner.configurations.ccd_search import InteractionSettings
from ir_planner.configurations.interaction_point import searched_configurations
from ir_planner.request.context import Context, Journal, Work
from ir_planner.scene.planning_scene import PlanningScene, load_text, scene_with
from ir_planner.service.exit import Exit
from ir_planner.service.service_movement import ServicePlan, ServiceRequest, plan_service
from ir_planner.service.stochastic_withdrawal import ModifiedGa, Walk, withdraw
from ir_values.arrays import FloatArray

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

# machine axes that a panel shows
SIDE = (0, 2)
PLAN = (0, 1)
PICTURES = (("cnc_door", "press", "service_press.png"), ("deep_box", "tun", "service_tunnel.png"))
S_M = 0.02
STEEL = "#8a8f98"
ZONE = "#d08700"
ARM = "#2a6fbb"


def main() -> None:
    """Draw both."""
    folder = folder_asked(__doc__)
    for cell, station, name in PICTURES:
        draw(cell, station, folder / name)


def draw(cell_name: str, station_name: str, path: Path) -> None:
    """One picture of three panels."""
    cell = load_cell(cell_name)
    scene = scene_with(cell, load_text(cell), load_power_data())
    station = scene.station(station_name)
    park = np.array(cell.park)

    def budget() -> Work:
        return Work(60_000, time.monotonic() + 60.0, time.monotonic)

    threshold = scene.thresholds(S_M, station_name)
    goals = searched_configurations(
        station.pose, scene, threshold, park, 32, 0, InteractionSettings(), budget()
    )
    options = PlanOptions(planning_time=60.0, safety_distance=S_M)
    context = Context(scene, options, Journal(budget(), 0))
    problem = Exit.of(goals.q[0], context.at(station_name))
    walk = withdraw(problem, ModifiedGa(), np.random.default_rng(0), 12)
    request = ServiceRequest(station, "exit", goals.q[0], park, 3)
    plan = plan_service(request, context)
    figure, panels = plt.subplots(1, 3, figsize=(15.0, 5.4), constrained_layout=True)
    stage_one(panels[0], goals.q, scene, station_name)
    raw_walk(panels[1], walk, scene, station_name)
    candidates(panels[2], plan, scene, station_name)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def stage_one(panel: Axes, q: FloatArray, scene: PlanningScene, station: str) -> None:
    """The goal configurations, from the side."""
    surroundings(panel, scene, station, SIDE)
    for k, one in enumerate(q):
        arm(panel, one, scene, station, SIDE, ARM if k == 0 else "#b7c9de")
    panel.set_title(f"Stage one: {len(q)} goal configurations by CCD, from the side")


def raw_walk(panel: Axes, walk: Walk, scene: PlanningScene, station: str) -> None:
    """Paths of the population, from above."""
    surroundings(panel, scene, station, PLAN)
    for path in walk.paths:
        line = seen(scene.chain.tcp_poses(path)[:, :3, 3], scene, station)[:, PLAN]
        panel.plot(*line.T, "o-", color=ARM, alpha=0.5, markersize=3, linewidth=1)
    panel.set_title(
        f"Stage two, eq. (7): {walk.generations} generations, {walk.candidates} copies,\n"
        f"{len(walk.paths)} paths of the tcp out, from above"
    )


def candidates(panel: Axes, plan: ServicePlan, scene: PlanningScene, station: str) -> None:
    """Certified candidates, from above; the arm at work and outside, and the closest pair of the
    best.
    """
    surroundings(panel, scene, station, PLAN)
    for candidate, colour in zip(plan.candidates, (ARM, "#3a9d5d", "#8e5bb5"), strict=False):
        trajectory = candidate.trajectory
        if trajectory is None:
            continue
        q = trajectory.sample(np.linspace(0.0, trajectory.duration, 80)).q
        line = seen(scene.chain.tcp_poses(q)[:, :3, 3], scene, station)[:, PLAN]
        text = f"{candidate.report.duration:.2f} s, {candidate.report.min_clearance * 1e3:.0f} mm"
        panel.plot(*line.T, color=colour, linewidth=2, label=text)
    best = plan.candidates[0]
    for q_end, tone in ((best.work, ARM), (best.outside, "#b7c9de")):
        arm(panel, q_end, scene, station, PLAN, tone)
    pair = best.report.closest
    if pair is not None:
        ends = seen(np.stack([pair.point_a, pair.point_b]), scene, station)[:, PLAN]
        label = f"closest: {pair.body_a} to {pair.body_b}"
        panel.plot(*ends.T, "o-", color="#c2272d", markersize=4, linewidth=2, label=label)
    panel.legend(loc="lower left", fontsize=8)
    panel.set_title(
        "Shortened, timed, certified (s, least clearance),\nthe arm at work and outside"
    )


def seen(points: FloatArray, scene: PlanningScene, station: str) -> FloatArray:
    """World points (N, 3) in the machine's frame."""
    frame = scene.cell.machine(scene.station(station).equipment).pose
    return np.asarray((points - frame[:3, 3]) @ frame[:3, :3])


def surroundings(panel: Axes, scene: PlanningScene, station: str, axes: tuple[int, int]) -> None:
    """The machine's bodies and its zone."""
    machine = scene.cell.machine(scene.station(station).equipment)
    height = scene.station(station).pose[2, 3]
    for body in machine.world_bodies():
        if axes == PLAN and abs(body.pose[2, 3] - height) > 0.5 * body.size[2]:
            continue  # above or below the tool: not drawn from above
        outline(
            panel,
            seen(corners(body.pose, body.size), scene, station)[:, axes],
            STEEL,
            0.35 if axes == SIDE else 0.8,
        )
    outline(
        panel,
        seen(corners(machine.zone.pose, machine.zone.size), scene, station)[:, axes],
        ZONE,
        0.06,
    )
    panel.set_aspect("equal")
    panel.set_xlim(-1.9, 0.7)
    panel.set_ylim((-0.05, 2.15) if axes == SIDE else (-1.1, 1.1))
    panel.set_xlabel("x into the machine [m]")
    panel.set_ylabel("z [m]" if axes == SIDE else "y [m]")


def corners(pose: FloatArray, size: FloatArray) -> FloatArray:
    """Corners (8, 3) of a box; the machines of both pictures are boxes."""
    signs = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
    return np.asarray(pose[:3, 3] + (signs * size) @ pose[:3, :3].T)


def outline(panel: Axes, points: FloatArray, colour: str, alpha: float) -> None:
    """The shadow of a convex solid."""
    hull = points[ConvexHull(points).vertices]
    panel.fill(*hull.T, facecolor=colour, alpha=alpha, edgecolor=colour, linewidth=0.8)


def arm(
    panel: Axes,
    q: FloatArray,
    scene: PlanningScene,
    station: str,
    axes: tuple[int, int],
    colour: str,
) -> None:
    """Capsules from link 3 to the tool, as outlines of their true width."""
    links = scene.chain.link_poses(q[None])[0]
    loads = [capsule for load in scene.loads for capsule in load.capsules]
    turn = np.linspace(0.0, 2.0 * np.pi, 24)
    circle = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    for capsule in (*scene.cell.robot.capsules, *loads):
        if capsule.link < 3:
            continue
        link = links[capsule.link]
        ends = np.stack([capsule.p0, capsule.p1]) @ link[:3, :3].T + link[:3, 3]
        flat = seen(ends, scene, station)[:, axes]
        outline(
            panel, np.concatenate([end + capsule.radius * circle for end in flat]), colour, 0.25
        )


if __name__ == "__main__":
    main()
