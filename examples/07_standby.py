"""Standby: which power mode takes the least energy in a pause, when to wake the controller, what is
saved.
"""

from ir_planner import Planner

PAUSES = (2.0, 10.0, 60.0, 600.0, 3600.0)  # s


def main() -> None:
    planner = Planner("demo")
    print(
        "pause [s]  mode             wake at [s]  energy [kJ]  saved [kJ]: against the timer, "
        "against motors"
    )
    for pause in PAUSES:
        advice = planner.standby(pause)
        print(
            f"{pause:9.0f}  {advice.chosen.name:15}  {advice.wake_at:11.1f}  "
            f"{advice.energy / 1000.0:11.1f}  "
            f"{advice.saving / 1000.0:29.1f}, {advice.saving_on_motors / 1000.0:14.1f}"
        )


if __name__ == "__main__":
    main()
