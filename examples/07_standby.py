"""Standby: which power mode takes the least energy in a pause, and when to wake the controller."""

import time

from ir_planner import Planner

PAUSES = (2.0, 10.0, 60.0, 600.0, 3600.0)  # s


def main() -> None:
    planner = Planner(time.monotonic)
    planner.set_cell("", "demo")
    for pause in PAUSES:
        advice = planner.standby(pause, q=None, load="")
        print(
            f"pause of {pause:6.0f} s: {advice.chosen.name}, wake after {advice.wake_at:.1f} s, "
            f"{advice.energy / 1000.0:.1f} kJ, {advice.saving / 1000.0:.1f} kJ less than on motors"
        )


if __name__ == "__main__":
    main()
