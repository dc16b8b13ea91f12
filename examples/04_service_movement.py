"""Service movements: candidates out of a machine's forbidden zone, ranked by the objective."""

from ir_planner import Planner


def main() -> None:
    planner = Planner("demo")
    plan = planner.plan_service("lathe_work", direction="exit", max_candidates=3)
    if not plan.status.ok:
        raise SystemExit(plan.status.message)
    for candidate in plan.candidates:
        report = candidate.report
        print(
            f"{candidate.method}: {report.duration:.2f} s, {report.energy:.0f} J at the mains, "
            f"tcp path {report.path_length:.2f} m, clearance {1000.0 * report.min_clearance:.0f} mm"
        )
        for pair in report.contacts:
            print(
                f"  allowed contact: {pair.body_a} and {pair.body_b}, "
                f"{1000.0 * pair.distance:.1f} mm"
            )
    for rejection in plan.info.rejected:
        print(f"rejected {rejection.count} times: {rejection.reason}")


if __name__ == "__main__":
    main()
