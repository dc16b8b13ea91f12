"""What a movement is judged by, and the stretch of its duration that serves it best.

movement_cost: W of eq. (9); time: T; energy: E at the mains; time_and_energy: J = E + time_value x T.
"""

import numpy as np
from ir_msgs_py.report import TrajectoryReport
from ir_msgs_py.trajectory import JointTrajectory
from numpy.typing import NDArray

from ir_planner.blending import stretched
from ir_planner.energy import movement_energy
from ir_planner.scene import PlanningScene

FloatArray = NDArray[np.float64]
_FACTORS = np.array([1.0, 1.04, 1.1, 1.18, 1.3, 1.5, 1.8, 2.2])
_REFINED = 5
_COARSE_STEP = 4e-3  # s: energies are compared, not reported


def objective_value(report: TrajectoryReport, objective: str, time_value: float) -> float:
    """What is minimised; ties between equal W are broken by time."""
    values = {
        "movement_cost": report.movement_cost * (1.0 + 1e-6 * report.duration),
        "time": report.duration,
        "energy": report.energy,
        "time_and_energy": report.energy + time_value * report.duration,
    }
    return values[objective]


def pace_value(trajectory: JointTrajectory, scene: PlanningScene, objective: str, time_value: float) -> float:
    """J of a trajectory at the pace it has, or its joules where the objective is not J; sampled coarsely."""
    joules = movement_energy(trajectory, scene, _COARSE_STEP).total
    return joules + (time_value * trajectory.duration if objective == "time_and_energy" else 0.0)


def best_stretch(fastest: JointTrajectory, scene: PlanningScene, objective: str, time_value: float) -> float:
    """Factor >= 1 on the duration of the fastest movement that minimises the objective."""
    if objective in ("time", "movement_cost"):
        return 1.0

    def cost(factor: float) -> float:
        return pace_value(stretched(fastest, factor), scene, objective, time_value)

    costs = [cost(float(factor)) for factor in _FACTORS]
    k = int(np.argmin(costs))
    around = np.linspace(_FACTORS[max(k - 1, 0)], _FACTORS[min(k + 1, len(_FACTORS) - 1)], _REFINED + 2)[1:-1]
    refined = [cost(float(factor)) for factor in around]
    best = int(np.argmin(refined))
    return float(around[best]) if refined[best] < costs[k] else float(_FACTORS[k])
