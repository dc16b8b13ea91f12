"""Draw the picture of docs/planning.md: a trajectory before and after, and its trade of time for
energy.

    python tools/optimization_pictures.py [--folder docs/images]

The pictures are what the planner answers: run this again when it changes. The figures that the page
names are printed.
"""

from __future__ import annotations

import matplotlib as mpl
import numpy as np
from _pictures import folder_asked

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.checks.energy import movement_energy
from ir_planner.planner import Planner
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.timing.blended_steps import stretched
from ir_planner.trajectories.optimization import OptimizationPlan

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes

CELL = "deep_box"
TASK = "bin->pal"
BEFORE = "#c2272d"
AFTER = "#2a6fbb"
STEEL = "#8a8f98"


def main() -> None:
    """Draw it."""
    folder = folder_asked(__doc__)
    scene, given, plan = optimized()
    assert plan.trajectory is not None, plan.status.message
    figure, panels = plt.subplots(1, 2, figsize=(12.0, 4.6), constrained_layout=True)
    distances(panels[0], given, plan.trajectory, scene)
    front(panels[1], plan, scene)
    figure.savefig(folder / "optimized.png", dpi=80)
    plt.close(figure)
    for point in plan.front:
        print(f"{point.report.duration:.3f} s {point.report.energy:.0f} J")
    print(f"{plan.info.iterations} iterations, {plan.info.planning_time:.2f} s")


def optimized() -> tuple[PlanningScene, JointTrajectory, OptimizationPlan]:
    """The scene, the straight movement of 3 s, and what the planner makes of it."""
    planner = Planner(CELL)
    scene = planner.scene()
    task = scene.cell.task(TASK)
    ends = np.stack([task.start, task.goal])
    rest = np.zeros_like(ends)
    given = JointTrajectory.from_seconds(scene.cell.robot.joint_names, [0.0, 3.0], ends, rest, rest)
    return scene, given, planner.optimize_trajectory(given, options=PlanOptions(planning_time=60.0))


def distances(
    panel: Axes, before: JointTrajectory, after: JointTrajectory, scene: PlanningScene
) -> None:
    """Smallest distance of all pairs over the share of the duration."""
    share = np.linspace(0.0, 1.0, 400)
    for trajectory, colour, text in ((before, BEFORE, "before"), (after, AFTER, "after")):
        q = trajectory.sample(share * trajectory.duration).q
        smallest = scene.collision.distances(q).min(axis=1)
        label = f"{text}: {trajectory.duration:.2f} s, at least {smallest.min() * 1e3:.0f} mm"
        panel.plot(100.0 * share, 1e3 * smallest, color=colour, label=label)
    panel.axhline(20.0, color=STEEL, linewidth=0.8, label="safety distance")
    panel.set_xlabel("share of the duration [%]")
    panel.set_ylabel("smallest distance [mm], negative: penetration")
    panel.legend(fontsize=8)
    panel.set_title("A straight movement through the box, pushed out of it")


def front(panel: Axes, plan: OptimizationPlan, scene: PlanningScene) -> None:
    """Energy over duration, beside the fastest movement slowed down."""
    durations = [point.report.duration for point in plan.front]
    energies = [point.report.energy for point in plan.front]
    fastest = plan.front[0].trajectory
    factors = np.linspace(1.0, durations[-1] / durations[0], 40)
    slowed = [movement_energy(stretched(fastest, float(factor)), scene).total for factor in factors]
    panel.plot(
        factors * durations[0],
        np.array(slowed) / 1e3,
        color=STEEL,
        label="the fastest, slowed down",
    )
    panel.plot(
        durations,
        np.array(energies) / 1e3,
        "o-",
        color=AFTER,
        label="least energy at each duration, certified",
    )
    panel.plot(
        plan.after.duration,
        plan.after.energy / 1e3,
        "*",
        markersize=13,
        color=BEFORE,
        label="least J",
    )
    panel.set_xlabel("duration [s]")
    panel.set_ylabel("energy at the mains with base load [kJ]")
    panel.legend(fontsize=8)
    panel.set_title("Time against energy, in the same answer")


if __name__ == "__main__":
    main()
