"""Metric distance: which bodies are nearest to each other in a configuration, and how near."""

import numpy as np

from ir_planner import Planner

SAFETY_DISTANCE = 0.02  # m
HOME_DEG = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0)
IN_A_TABLE_DEG = (-30.0, -60.0, 95.0, 0.0, 55.0, 0.0)


def main() -> None:
    planner = Planner("demo")
    for joints_deg in (HOME_DEG, IN_A_TABLE_DEG):
        state = planner.check_state(
            np.radians(joints_deg), safety_distance=SAFETY_DISTANCE, max_pairs=4
        )
        print(f"{joints_deg} deg: {'free' if state.valid else 'not free'}")
        for pair in state.pairs:
            print(
                f"{1000.0 * pair.distance:8.1f} mm  {pair.body_a} and {pair.body_b} ({pair.kind})"
            )


if __name__ == "__main__":
    main()
