"""Names of what a recording holds beside its messages: attachments and the record of facts."""

from __future__ import annotations

from typing import Final

CELL: Final = "cell.yaml"
URDF: Final = "robot.urdf"
FACTS: Final = "ir_recorder"  # metadata record
VERSION: Final = "version"
STARTED: Final = "started_ns"  # node clock at the start [ns]
OWN_FACTS: Final = (VERSION, STARTED)  # written by the recorder itself; all others come from its parameter

# facts with a meaning for the analysis; all others are only shown
SAFETY_DISTANCE: Final = "safety_distance"  # S_m [m] that movements are planned with: "0.02 m"
UNSHORTENED_PAUSES: Final = "unshortened_pauses"  # full lengths of the pauses in power modes: "180 s, 1800 s"
