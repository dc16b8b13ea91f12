"""Plan a movement, look at its joules, drive it, plan the movement back at half the speed.

Start the nodes first (`.venv/bin/ir ros up`), then `.venv/bin/python examples/plan_and_drive.py`.
"""

from ir_msgs_py.options import PlanOptions
from ir_msgs_py.ros.client import Client


def main() -> None:
    with Client() as cell:
        print("stations:", ", ".join(cell.set_cell("demo")))
        for goal, speed in (("A1 30 A2 -100 A3 100 A4 0 A5 20 A6 0", 1.0), ("home", 0.5)):
            plan = cell.plan_to(goal, PlanOptions(velocity_scaling=speed))
            report = plan.report
            proof = "certified" if report.certified else "not certified"
            print(
                f"{goal}: {report.duration:.2f} s, {report.energy:.0f} J, "
                f"clearance {report.min_clearance:.3f} m, {proof}"
            )
            run = cell.execute(cell.get_trajectory(plan.trajectory_id))
            print(
                f"  driven: {run.energy:.0f} J, tool within "
                f"{run.max_tool_deviation * 1000.0:.2f} mm"
            )


if __name__ == "__main__":
    main()
