"""A whole program: the cell's stations in order, with every movement, pause and load."""

from ir_planner import Planner


def main() -> None:
    planner = Planner("demo")
    plan = planner.plan_program()
    if not plan.status.ok:
        raise SystemExit(plan.status.message)
    for step in plan.movements:
        places = f"{step.from_station or 'start'} -> {step.to_station}"
        print(
            f"{step.kind:14} {places:30} {step.power_mode or step.load:16} "
            f"{step.duration:7.2f} s {step.report.energy:9.0f} J"
        )
    print(
        f"program {plan.program_id}: {plan.report.duration:.1f} s, "
        f"{plan.report.energy / 1000.0:.1f} kJ"
    )


if __name__ == "__main__":
    main()
