"""The scene of a request: the cell, what the robot holds, their models, bounds of motion, the cost
W.
"""

from ir_planner.scene.actuators import LinkVoltage
from ir_planner.scene.allowed_contacts import polynomials_between, spans_outside, tcp_inside
from ir_planner.scene.motion_limits import STILL, Dynamics, MotionLimits, lasting_longer, torque_use
from ir_planner.scene.movement_cost import movement_cost, path_cost
from ir_planner.scene.planning_scene import (
    CENTRE_STEP,
    END_TOLERANCE,
    PROOF_TOLERANCE,
    RUNNING,
    Drives,
    PlanningScene,
    Stops,
    load_text,
    scene_with,
    with_parts,
)
from ir_planner.scene.tool_bounds import PointBounds, ToolBounds
from ir_planner.scene.tool_cone import TILT_TOLERANCE, ToolCone

__all__ = [
    "CENTRE_STEP",
    "END_TOLERANCE",
    "PROOF_TOLERANCE",
    "RUNNING",
    "STILL",
    "TILT_TOLERANCE",
    "Drives",
    "Dynamics",
    "LinkVoltage",
    "MotionLimits",
    "PlanningScene",
    "PointBounds",
    "Stops",
    "ToolBounds",
    "ToolCone",
    "lasting_longer",
    "load_text",
    "movement_cost",
    "path_cost",
    "polynomials_between",
    "scene_with",
    "spans_outside",
    "tcp_inside",
    "torque_use",
    "with_parts",
]
