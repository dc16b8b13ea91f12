"""One regional movement: seconds, joules and clearance, certified for every instant; then the
slower one.
"""

import time

import numpy as np

from ir_planner import Planner, PlanOptions, parse_goal


def main() -> None:
    planner = Planner(time.monotonic)
    cell = planner.set_cell("", "demo")
    start = np.array(cell.machine_home)
    goal = parse_goal("A1 60 A2 -70 A3 100 A4 0 A5 20 A6 0", cell)
    for options in (PlanOptions(objective="time"), PlanOptions(objective="energy", duration=3.0)):
        plan = planner.plan_regional(start, goal, options)
        if plan.trajectory is None:
            raise SystemExit(plan.status.message)
        report = plan.report
        print(
            f"objective {options.objective}: {report.duration:.2f} s, {report.energy:.0f} J at "
            f"the mains, peak {report.peak_power / 1000.0:.1f} kW, clearance "
            f"{1000.0 * report.min_clearance:.0f} mm, "
            f"{'certified' if report.certified else 'not certified'}"
        )
        print(f"  {len(plan.trajectory.times)} points, id {plan.trajectory.trajectory_id}")


if __name__ == "__main__":
    main()
