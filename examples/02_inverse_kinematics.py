"""Inverse kinematics: all free configurations at a station, in closed form and by the paper's
search.
"""

import numpy as np

from ir_planner import Planner


def main() -> None:
    planner = Planner("demo")
    for method in ("analytic", "ccd"):
        answer = planner.compute_ik("gauge_measure", method=method)
        print(f"{method}: {len(answer.solutions)} configurations, cheapest first by W of eq. (9)")
        for solution in answer.solutions[:3]:
            joints = ", ".join(f"{angle:7.1f}" for angle in np.degrees(solution.q))
            print(
                f"  {joints} deg  W {solution.movement_cost:6.0f} kg rad^3/s^2  "
                f"clearance {1000.0 * solution.clearance:4.0f} mm"
            )


if __name__ == "__main__":
    main()
