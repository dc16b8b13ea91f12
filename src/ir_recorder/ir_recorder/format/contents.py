"""Names of what a recording holds beside its messages: attachments and the record of facts."""

from __future__ import annotations

from typing import Final

CELL: Final = "cell.yaml"
URDF: Final = "robot.urdf"
ROBOT: Final = "robot.yaml"  # data of the robot that the cell names
POWER: Final = "power.yaml"  # data of its controller
POWER_PARAMETERS: Final = "power_parameters.yaml"  # the file that the planner's parameter names
PARAMETERS: Final = "{node}.parameters.yaml"
FACTS: Final = "ir_recorder"  # metadata record
VERSION: Final = "version"
STARTED: Final = "started_ns"  # node clock at the start [ns]
PACKAGES: Final = (
    "packages"  # fact: versions of the project's packages and of those that decide numbers
)
RECORDING: Final = "recording"  # of a recording in several files: the same in all of them
PART: Final = "part"  # which of them, from 0
REPEATED: Final = "repeated"  # JSON: messages by topic that a part has again at its begin
PARTS: Final = "ir_recorder_part"  # metadata record of these three
OWN_FACTS: Final = (
    VERSION,
    STARTED,
    PACKAGES,
    RECORDING,
    PART,
    REPEATED,
)  # all others come from the recorder's parameter

# facts with a meaning for the analysis; all others are only shown
SAFETY_DISTANCE: Final = "safety_distance"  # S_m [m] that movements are planned with: "0.02 m"
PLAN: Final = "plan"  # "never driven": a plan, found or not, without a robot
UNSHORTENED_PAUSES: Final = (
    "unshortened_pauses"  # full lengths of the pauses in power modes: "180 s, 1800 s"
)
