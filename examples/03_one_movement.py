"""One regional movement: seconds, joules and clearance, certified for every instant; then the
slower one.
"""

from ir_planner import Planner

GOAL = "A1 60 A2 -70 A3 100 A4 0 A5 20 A6 0"  # degrees


def main() -> None:
    planner = Planner("demo")
    for plan in (
        planner.plan_regional(goal=GOAL, objective="time"),
        planner.plan_regional(goal=GOAL, objective="energy", duration=3.0),
    ):
        if plan.trajectory is None:
            raise SystemExit(plan.status.message)
        print(plan)
        print(f"  peak {plan.report.peak_power / 1000.0:.1f} kW at the mains")
        print(f"  {len(plan.trajectory.times)} points, id {plan.trajectory.trajectory_id}")


if __name__ == "__main__":
    main()
