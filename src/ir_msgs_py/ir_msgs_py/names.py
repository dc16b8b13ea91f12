"""Names of nodes, topics, services, actions, joints and frames: a contract, spelled once.

All names are relative, so a namespace moves a whole cell; a script outside puts a "/" before them.
Topics and services of a node carry its name: `ir_planner/set_cell`; the node itself offers them in
its private namespace (`own`), so that they move with its name. On the topics that all cells share
(/diagnostics, /rosout, /parameter_events) the sender's name says whose a message is.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

JOINT_NAMES: Final = ("joint_a1", "joint_a2", "joint_a3", "joint_a4", "joint_a5", "joint_a6")
EXTERNAL_AXES: Final = ("E1", "E2", "E3", "E4", "E5", "E6")
"""Joints of these names are linear units: their positions are in m, not in rad."""


def joint_unit(joint: str, unit: str = "rad") -> str:
    """A unit of joints that turn ("rad/s") as it is for this one: of an external axis with m."""
    return unit.replace("rad", "m") if joint in EXTERNAL_AXES else unit


def axis_labels(joints: Sequence[str]) -> tuple[str, ...]:
    """What people call the axes of joints: an external axis by its name, the others A1, A2, ..."""
    arm = [joint for joint in joints if joint not in EXTERNAL_AXES]
    labels = {joint: f"A{k + 1}" for k, joint in enumerate(arm)}
    return tuple(labels.get(joint, joint) for joint in joints)


WORLD_FRAME: Final = "cell"
BASE_FRAME: Final = "base_link"

PLANNER: Final = "ir_planner"
SIM_DRIVER: Final = "ir_sim_driver"
PROGRAM_RUNNER: Final = "ir_program_runner"
RECORDER: Final = "ir_recorder"
PLAY: Final = "ir_play"
LIVE: Final = "ir_live"
STUDIES: Final = "ir_studies"
MOVEIT: Final = "ir_moveit"
CALLS: Final = "calls"  # topic of every node that answers: its requests and answers, for recordings

# of nobody in particular
JOINT_STATES: Final = "joint_states"
ROBOT_DESCRIPTION: Final = "robot_description"
TF: Final = "tf"
TF_STATIC: Final = "tf_static"
DIAGNOSTICS: Final = "/diagnostics"
ROSOUT: Final = "/rosout"
PARAMETER_EVENTS: Final = "/parameter_events"

# ir_planner: services
SET_CELL: Final = f"{PLANNER}/set_cell"
GET_CELL: Final = f"{PLANNER}/get_cell"
SET_EQUIPMENT: Final = f"{PLANNER}/set_equipment"
CHECK_STATE: Final = f"{PLANNER}/check_state"
CHECK_STATES: Final = f"{PLANNER}/check_states"
COMPUTE_IK: Final = f"{PLANNER}/compute_ik"
PLAN_SERVICE_MOVEMENT: Final = f"{PLANNER}/plan_service_movement"
PLAN_ESCAPE: Final = f"{PLANNER}/plan_escape"
PLAN_REGIONAL_MOVEMENT: Final = f"{PLANNER}/plan_regional_movement"
PLAN_TRAJECTORY: Final = f"{PLANNER}/plan_trajectory"
PLAN_CARTESIAN_MOVEMENT: Final = f"{PLANNER}/plan_cartesian_movement"
PLAN_PROGRAM: Final = f"{PLANNER}/plan_program"
PLAN_STEADY_CYCLE: Final = f"{PLANNER}/plan_steady_cycle"
PLAN_ROBOTS: Final = f"{PLANNER}/plan_robots"
OPTIMIZE_TRAJECTORY: Final = f"{PLANNER}/optimize_trajectory"
EVALUATE_TRAJECTORY: Final = f"{PLANNER}/evaluate_trajectory"
GET_TRAJECTORY: Final = f"{PLANNER}/get_trajectory"
GET_PROGRAM: Final = f"{PLANNER}/get_program"
PLAN_STANDBY: Final = f"{PLANNER}/plan_standby"
EXPORT_PROGRAM: Final = f"{PLANNER}/export_program"
# action and topics
PLAN: Final = f"{PLANNER}/plan"
CELL: Final = f"{PLANNER}/cell"
PLANNED_TRAJECTORY: Final = f"{PLANNER}/planned_trajectory"
PROGRAM_SAVINGS: Final = f"{PLANNER}/savings"
PLANNER_MARKERS: Final = f"{PLANNER}/markers"

# ir_sim_driver: services
SET_PLC_INPUT: Final = f"{SIM_DRIVER}/set_plc_input"
START_PAUSE: Final = f"{SIM_DRIVER}/start_pause"
END_PAUSE: Final = f"{SIM_DRIVER}/end_pause"
QUERY_MODES: Final = f"{SIM_DRIVER}/query_modes"
RECOVER: Final = f"{SIM_DRIVER}/recover"
SET_LOAD: Final = f"{SIM_DRIVER}/set_load"
QUERY_STATE: Final = f"{SIM_DRIVER}/query_state"
# actions and topics
EXECUTE_TRAJECTORY: Final = f"{SIM_DRIVER}/execute_trajectory"
FOLLOW_JOINT_TRAJECTORY: Final = f"{SIM_DRIVER}/follow_joint_trajectory"
COMMANDED_TRAJECTORY: Final = f"{SIM_DRIVER}/joint_trajectory"
PLC_INPUTS: Final = f"{SIM_DRIVER}/plc_inputs"
PLC_INPUTS_IN_FORCE: Final = f"{SIM_DRIVER}/plc_inputs_in_force"
PLC_OUTPUTS: Final = f"{SIM_DRIVER}/plc_outputs"
SPEED_SCALING: Final = f"{SIM_DRIVER}/speed_scaling"
SPEED_SCALING_INPUT: Final = f"{SIM_DRIVER}/speed_scaling_input"
POWER_STATE: Final = f"{SIM_DRIVER}/power_state"
CONTROLLER_TIMERS: Final = f"{SIM_DRIVER}/controller_timers"
CARRIED_LOAD: Final = f"{SIM_DRIVER}/carried_load"
PLANT: Final = f"{SIM_DRIVER}/plant"
STOP_NUMBER: Final = f"{SIM_DRIVER}/stop_number"
STOP_LATCHED: Final = f"{SIM_DRIVER}/stop_latched"
LAST_RECOVERY: Final = f"{SIM_DRIVER}/last_recovery"
LOAD_CHECK: Final = f"{SIM_DRIVER}/load_check"
CONTROLLER_STATE: Final = f"{SIM_DRIVER}/controller_state"
TRAJECTORY_CONTROLLER_STATE: Final = f"{SIM_DRIVER}/trajectory_controller_state"
ROBOT_MARKERS: Final = f"{SIM_DRIVER}/robot_markers"
CONTACTS: Final = f"{SIM_DRIVER}/contacts"
MACHINE_STATES: Final = f"{SIM_DRIVER}/machine_states"

# ir_program_runner: action and topics
RUN_PROGRAM: Final = f"{PROGRAM_RUNNER}/run_program"
SIGNALS: Final = f"{PROGRAM_RUNNER}/signals"
MACHINE_SIGNALS: Final = f"{PROGRAM_RUNNER}/machine_signals"
PROGRAM_STATE: Final = f"{PROGRAM_RUNNER}/program_state"

# ir_recorder: services
START_RECORDING: Final = f"{RECORDER}/start"
STOP_RECORDING: Final = f"{RECORDER}/stop"

# ir_play: service
CONTROL_PLAYBACK: Final = f"{PLAY}/control"

# ir_studies: action
RUN_STUDY: Final = f"{STUDIES}/run_study"

# ir_moveit: topics
MOVEIT_STATUS: Final = f"{MOVEIT}/status"
MOVEIT_REPORT: Final = f"{MOVEIT}/report"
MOVEIT_ENERGY: Final = f"{MOVEIT}/energy"

# load texts: names of the cell's loads joined by LOAD_SEPARATOR, or nothing attached
LOAD_SEPARATOR: Final = "+"
NO_LOAD: Final = "none"

STOPS_STATE: Final = "driver.stops"
"""Of a goal's `states`: with the number of the driver's last stop it relies on no later one, and on
no driver that was started anew.
"""
END_REST: Final = "end_rest"
"""Name in SetPlcInput of a program's request to leave the rest that drives_off began."""
TAKE_BACK: Final = "end_"
"""Before "ab", "hib" or "drives_off" in SetPlcInput: a client takes its own 1 back."""

# Senders on the topics that all cells share: the namespace is a part of the name, so that two cells
# in one graph are kept apart. Namespaces are absolute: "/" or "/cell_1".


def own(name: str) -> str:
    """A name of a node ("ir_planner/set_cell") as this node itself has it: "~/set_cell"."""
    return f"~/{name.rpartition('/')[2]}"


NODES = (PLANNER, SIM_DRIVER, PROGRAM_RUNNER, RECORDER)
"""The nodes of a cell."""
ACTING = (PLANNER, SIM_DRIVER, PROGRAM_RUNNER, MOVEIT, STUDIES)
"""Nodes that act on what they hear; the others record or show it."""


def diagnostic_name(namespace: str, name: str) -> str:
    """Name of a status: "ir_sim_driver: plant", in a namespace "cell_1/ir_sim_driver: plant"."""
    return f"{namespace}/{name}".strip("/")


def owns_diagnostic(namespace: str, name: str) -> bool:
    """Whether the status of this name comes from a node right in the namespace."""
    return _parent(f"/{name.partition(':')[0]}") == _bare(namespace)


def hidden_node(name: str, what: str) -> str:
    """Name in the graph of a second node that the node `name` has, for `what`.

    Tools hide names that begin with an underscore.
    """
    return f"_{name}_{what}"


def acts(node: str) -> bool:
    """Whether a node of this name, or that it is a hidden part of, acts on what it hears."""
    return node in ACTING or node.startswith(tuple(hidden_node(name, "") for name in ACTING))


def owns_node(namespace: str, fully_qualified: str) -> bool:
    """Whether a node ("/cell_1/ir_planner") is right in the namespace."""
    return _parent(fully_qualified) == _bare(namespace)


def owns_logger(namespace: str, logger: str) -> bool:
    """Whether a logger ("cell_1.ir_planner") belongs to a node right in the namespace.

    A dot also parts a logger from those below it ("ir_planner.action"): those of a cell's nodes are
    known.
    """
    prefix = "".join(f"{part}." for part in _bare(namespace).split("/") if part)
    if not logger.startswith(prefix):
        return False
    node, dot, _ = logger.removeprefix(prefix).partition(".")
    return not dot or node in NODES


def _bare(namespace: str) -> str:
    return namespace.rstrip("/")


def _parent(name: str) -> str:
    return name.rpartition("/")[0]
