"""What is known about a configuration or a trajectory: free, limits, torque, clearance, energy,
proof.
"""

from ir_planner.checks.clearance import nearest_pair, nearest_pairs, pair_value
from ir_planner.checks.clearance_checks import clearance_violation
from ir_planner.checks.energy import MovementEnergy, carried, holding_watts, movement_energy
from ir_planner.checks.energy_slopes import energy_and_slope, holding_slope, standing_slope
from ir_planner.checks.evaluation import (
    Consumption,
    Evaluation,
    evaluate_trajectory,
    measured,
    total_report,
)
from ir_planner.checks.free_space import FreeSpace
from ir_planner.checks.intervals import ROBOTS, Interval, interval, movement_spread, robots, spread
from ir_planner.checks.limit_checks import AT_REST, SLACK, Violation
from ir_planner.checks.peak_power import peak_power
from ir_planner.checks.shapes import (
    CLOSEST,
    PATH,
    ZONES,
    Colour,
    Shape,
    cell_shapes,
    movement_shapes,
)
from ir_planner.checks.states import (
    StateCheck,
    end_in_collision,
    first_too_near,
    state_check,
    too_near,
    too_near_sentence,
)
from ir_planner.checks.verification import TorqueProof, Verification, torque_proof, verified

__all__ = [
    "AT_REST",
    "CLOSEST",
    "PATH",
    "ROBOTS",
    "SLACK",
    "ZONES",
    "Colour",
    "Consumption",
    "Evaluation",
    "FreeSpace",
    "Interval",
    "MovementEnergy",
    "Shape",
    "StateCheck",
    "TorqueProof",
    "Verification",
    "Violation",
    "carried",
    "cell_shapes",
    "clearance_violation",
    "end_in_collision",
    "energy_and_slope",
    "evaluate_trajectory",
    "first_too_near",
    "holding_slope",
    "holding_watts",
    "interval",
    "measured",
    "movement_energy",
    "movement_shapes",
    "movement_spread",
    "nearest_pair",
    "nearest_pairs",
    "pair_value",
    "peak_power",
    "robots",
    "spread",
    "standing_slope",
    "state_check",
    "too_near",
    "too_near_sentence",
    "torque_proof",
    "total_report",
    "verified",
]
