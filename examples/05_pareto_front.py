"""Time against energy: the Pareto front of one movement, from the fastest to the least joules."""

from ir_planner import Planner


def main() -> None:
    planner = Planner("demo")
    plan = planner.plan_regional(goal="A1 60 A2 -70 A3 100 A4 0 A5 20 A6 0")
    if plan.trajectory is None:
        raise SystemExit(plan.status.message)
    answer = planner.optimize_trajectory(plan.trajectory)
    print("duration [s]  energy at the mains [J]  peak power [kW]")
    for point in answer.front:
        report = point.report
        print(f"{report.duration:12.2f}  {report.energy:23.0f}  {report.peak_power / 1000.0:15.1f}")


if __name__ == "__main__":
    main()
