"""Time against energy: the Pareto front of one movement, from the fastest to the least joules."""

import time

import numpy as np

from ir_planner import Planner, PlanOptions, parse_goal


def main() -> None:
    planner = Planner(time.monotonic)
    cell = planner.set_cell("", "demo")
    goal = parse_goal("A1 60 A2 -70 A3 100 A4 0 A5 20 A6 0", cell)
    plan = planner.plan_regional(np.array(cell.machine_home), goal, PlanOptions())
    if plan.trajectory is None:
        raise SystemExit(plan.status.message)
    answer = planner.optimize_trajectory(plan.trajectory)
    print("duration [s]  energy at the mains [J]  peak power [kW]")
    for point in answer.front:
        report = point.report
        print(f"{report.duration:12.2f}  {report.energy:23.0f}  {report.peak_power / 1000.0:15.1f}")


if __name__ == "__main__":
    main()
