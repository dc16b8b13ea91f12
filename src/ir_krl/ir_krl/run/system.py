"""What a controller brings along: system variables with the values they have at the start of a
program.
"""

from __future__ import annotations

import numpy as np

from ir_krl.run.frames import FRAME_NAMES, frame
from ir_krl.run.values import Array, Structure, Value
from ir_msgs_py.arrays import FloatArray

AXES = 6
FULL = 100.0  # %
TOOL_VELOCITY = (
    2.0  # m/s, assumed where a program sets no $VEL.CP: the usual value of the configuration file
)
TOOL_ACCELERATION = (
    2.3  # m/s^2, likewise of $ACC.CP; what 100 % of an inline form's acceleration means
)
TURNING_VELOCITY = 200.0  # deg/s, likewise of $VEL.ORI1
TURNING_ACCELERATION = 100.0  # deg/s^2, likewise of $ACC.ORI1
TOOLS = 16  # numbers of TOOL_DATA
BASES = 32  # numbers of BASE_DATA
MODELLED = frozenset(
    (
        "$VEL_AXIS",
        "$ACC_AXIS",
        "$VEL",
        "$ACC",
        "$APO",
        "$OV_PRO",
        "$TOOL",
        "$BASE",
        "$OUT",
        "$ORI_TYPE",
    )
)
"""System variables that motions follow from."""
HARMLESS = frozenset(
    (
        "$ADVANCE",
        "$BWDSTART",
        "$H_POS",
        "$GEAR_JERK",
        "$COLLMON_TOL_PRO",
        "$CIRC_TYPE",
        "$JERK",
        "$IPO_MODE",
        "$LOAD",
    )
)
"""Set by nearly every program; nothing here follows from them."""
STANDING = frozenset(("$POS_ACT", "$AXIS_ACT", "$POS_ACT_MES", "$AXIS_ACT_MEAS"))
"""Where the robot stands: known when a program is driven, not when it is followed."""
NULL: dict[str, Value] = dict.fromkeys(FRAME_NAMES, 0.0)


def system_speeds() -> dict[str, Value]:
    """Speeds, accelerations and approximation distances as BAS(#INITMOV) leaves them; override as
    it is.
    """
    turning = {"ORI1": TURNING_VELOCITY, "ORI2": TURNING_VELOCITY}
    turning_up = {"ORI1": TURNING_ACCELERATION, "ORI2": TURNING_ACCELERATION}
    return {
        "$VEL_AXIS": _all(FULL),
        "$ACC_AXIS": _all(FULL),
        "$VEL": Structure({"CP": TOOL_VELOCITY, **turning}),
        "$ACC": Structure({"CP": TOOL_ACCELERATION, **turning_up}),
        "$APO": Structure({"CPTP": 0.0, "CDIS": 0.0, "CORI": 0.0, "CVEL": 0.0}),
    }


def system_variables(home: FloatArray, tool: FloatArray) -> dict[str, Value]:
    """Variables at the start: `home` (6,) [rad] is XHOME, `tool` (4, 4) [m] in the flange every
    tool number whose data the program doesn't bring.
    """
    angles: dict[str, Value] = {
        f"A{j + 1}": float(angle) for j, angle in enumerate(np.degrees(home))
    }
    tool_frame = frame(tool)
    return {
        **system_speeds(),
        "$GEAR_JERK": _all(FULL),
        "$OV_PRO": FULL,
        "$ADVANCE": 3,
        "$TOOL": tool_frame,
        "$BASE": Structure(dict(NULL)),
        "$NULLFRAME": Structure(dict(NULL)),
        "$WORLD": Structure(dict(NULL)),
        "$ROBROOT": Structure(dict(NULL)),
        "TOOL_DATA": Array({(n,): tool_frame.copied() for n in range(1, TOOLS + 1)}),
        "LOAD_DATA": Array({(n,): Structure({}, "LOAD") for n in range(1, TOOLS + 1)}),
        "BASE_DATA": Array({(n,): Structure(dict(NULL)) for n in range(1, BASES + 1)}),
        "XHOME": Structure(dict(angles), "E6AXIS"),
        "$H_POS": Structure(dict(angles), "E6AXIS"),
        "PDEFAULT": Structure({"VEL": FULL, "ACC": FULL, "APO_DIST": FULL}),
        "FHOME": Structure({"TOOL_NO": 0, "BASE_NO": 0}),
        "$STOPMESS": False,
        "$BWDSTART": False,
        "$OUT": Array(),
    }


def _all(value: float) -> Array:
    return Array({(n,): value for n in range(1, AXES + 1)})
