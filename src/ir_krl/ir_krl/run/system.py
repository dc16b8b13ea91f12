"""What a controller brings along: system variables, and data that every configuration has."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ir_krl.run.notes import Effect
from ir_krl.run.values import (
    AXIS_NAMES,
    FRAME_NAMES,
    RAIL_NAME,
    Array,
    Structure,
    Symbol,
    Value,
    frame,
)
from ir_values.arrays import FloatArray

AXES = 6
_WITH_APO_MODE = (8, 3)  # KSS
FULL = 100.0  # %
TOOLS = 128  # numbers of TOOL_DATA and LOAD_DATA that a KR C4 has at most
BASES = 128  # numbers of BASE_DATA
MODELLED = frozenset(
    (
        "$VEL_AXIS",
        "$ACC_AXIS",
        "$VEL_EXTAX",
        "$ACC_EXTAX",
        "$VEL",
        "$ACC",
        "$APO",
        "$OV_PRO",
        "$TOOL",
        "$BASE",
        "$OUT",
        "$ORI_TYPE",
        "$ADVANCE",
        "$LOAD",
        "$JERK",
        "$GEAR_JERK",
    )
)
"""System variables that motions follow from."""
HARMLESS = frozenset(
    (
        "$BWDSTART",
        "$H_POS",
        "$COLLMON_TOL_PRO",
        "$CIRC_TYPE",
        "$IPO_MODE",
        "$ACT_TOOL",
        "$ACT_BASE",
        "$FLAG",
        "$CYCFLAG",
        "$TIMER",
        "$TIMER_STOP",
        "$LOOP_MSG",
        "$LOOP_CONT",
        "$MSG_T",
        "$TORQMON",
        "$TORQMON_DEF",
        "$TORQMON_COM",
        "$TORQMON_COM_DEF",
        "$ERR",
        "$ANOUT",
        "$FCT_CALL",
    )
)
"""Known where they are read, or without any effect on motions: what is neither here nor modelled
is noted where it is assigned.
"""
STANDING = frozenset(
    (
        "$POS_ACT",
        "$AXIS_ACT",
        "$POS_ACT_MES",
        "$AXIS_ACT_MEAS",
        "$POS_INT",
        "$AXIS_INT",
        "$POS_RET",
        "$AXIS_RET",
        "$POS_BACK",
        "$AXIS_BACK",
        "$POS_FOR",
        "$AXIS_FOR",
    )
)
"""Where the robot stands, or stood: known when a program is driven, not when it is followed."""
STOPS_ADVANCE = STANDING | frozenset(
    (
        "$IN",
        "$OUT",
        "$ANIN",
        "$ANOUT",
        "$ALARM_STOP",
        "$CONF_MESS",
        "$CURR_ACT",
        "$DRIVES_OFF",
        "$DRIVES_ON",
        "$EM_STOP",
        "$EXT",
        "$EXT_START",
        "$I_O_ACT",
        "$I_O_ACTCONF",
        "$NEAR_POSRET",
        "$ON_PATH",
        "$PRO_ACT",
        "$PRO_MOVE",
        "$ROB_CAL",
        "$AUT",
        "$T1",
        "$T2",
        "$MODE_OP",
        "$INPOSITION",
        "$IN_HOME",
        "$MOVE_ENABLE",
        "$PERI_RDY",
        "$POWER_FAIL",
        "$ROB_STOPPED",
        "$STOPMESS",
        "$TORQUE_AXIS_ACT",
        "$USER_SAF",
        "$VEL_ACT",
        "$VEL_AXIS_ACT",
    )
)
"""System variables whose use stops the advance run: what is read is the state at that moment."""
NULL: dict[str, Value] = dict.fromkeys(FRAME_NAMES, 0.0)
DEFAULTS: dict[str, Value] = {
    "DEF_ADVANCE": 3,
    "DEF_VEL_PTP": 100,  # %
    "DEF_ACC_PTP": 50,  # %
    "DEF_ACC_SPTP": FULL,
    "DEF_VEL_CP": 2.0,  # m/s
    "DEF_VEL_ORI1": 200.0,  # deg/s
    "DEF_VEL_ORI2": 200.0,
    "DEF_VEL_ORIS": 200.0,
    "DEF_VEL_FACT": 1.0,
    "DEF_ACC_CP": 2.3,  # m/s^2
    "DEF_ACC_ORI1": 100.0,  # deg/s^2
    "DEF_ACC_ORI2": 100.0,
    "DEF_ACC_ORIS": 200.0,
    "DEF_APO_CPTP": 50,  # %
    "DEF_APO_CDIS": 3.0,  # mm
    "DEF_APO_CORI": 5.0,  # deg
    "DEF_APO_CORIS": 80.0,
    "DEF_APO_CVEL": 100,  # %
    "DEF_CIRC_TYP": Symbol("BASE"),
    "DEF_GEAR_JERK": 50.0,
}
"""Of the configuration file as a KR C4 is delivered with; a $config.dat that is given counts."""
DELIVERED: dict[str, str] = {
    "DEF_VEL_PTP": "%",
    "DEF_VEL_CP": "m/s",
    "DEF_VEL_ORI1": "deg/s",
    "DEF_VEL_ORIS": "deg/s",
    "DEF_ACC_CP": "m/s^2",
    "DEF_ACC_ORI1": "deg/s^2",
    "DEF_ACC_ORIS": "deg/s^2",
    "DEF_APO_CPTP": "%",
    "DEF_APO_CDIS": "mm",
    "DEF_APO_CORI": "deg",
    "DEF_APO_CVEL": "%",
}
"""Units of those that motions follow from: where such a motion is driven, they are named."""


@dataclass(frozen=True)
class Assumption:
    """A value that the program doesn't bring: what is said of it where it is used. delivered: the
    name of the figure of $config.dat that it is, of which one sentence names all.
    """

    text: str
    effect: Effect
    delivered: str = ""


def _modes(mode: str) -> dict[str, Value]:
    """What the operating mode T1, T2, AUT or EX makes of the variables that tell it."""
    return {
        "$MODE_OP": Symbol(mode),
        "$T1": mode == "T1",
        "$T2": mode == "T2",
        "$AUT": mode == "AUT",
        "$EXT": mode == "EX",
    }


SITUATION: dict[str, Value] = {
    **_modes("AUT"),
    "$ALARM_STOP": True,
    "$CURR_ACT": Array({(n,): 0.0 for n in range(1, 2 * AXES + 1)}),
    "$DATE": Structure(
        {"CSEC": 0, "SEC": 0, "MIN": 0, "HOUR": 12, "DAY": 1, "MONTH": 1, "YEAR": 2020}
    ),
    "$DRIVES_OFF": False,
    "$DRIVES_ON": True,
    "$EM_STOP": False,
    "$INPOSITION": True,
    "$IN_HOME": True,
    "$IN_HOME1": False,
    "$IN_HOME2": False,
    "$IN_HOME3": False,
    "$IN_HOME4": False,
    "$IN_HOME5": False,
    "$I_O_ACT": True,
    "$I_O_ACTCONF": True,
    "$KCP_CONNECT": True,
    "$MOVE_ENABLE": True,
    "$NEAR_POSRET": True,
    "$ON_PATH": False,  # at the start, where programs ask for it
    "$OV_ROB": FULL,
    "$PERI_RDY": True,
    "$POWER_FAIL": False,
    "$PRO_ACT": True,
    "$PRO_MODE": Symbol("GO"),
    "$PRO_MODE1": Symbol("GO"),
    "$PRO_MOVE": True,
    "$PRO_STATE": Symbol("P_ACTIVE"),
    "$PRO_STATE0": Symbol("P_ACTIVE"),
    "$PRO_STATE1": Symbol("P_ACTIVE"),
    "$ROB_CAL": True,
    "$ROB_STOPPED": True,
    "$ROBRUNTIME": 0,
    "$SOFTPLCBOOL": Array({(n,): False for n in range(1, 1025)}),
    "$SOFTPLCINT": Array({(n,): 0 for n in range(1, 1025)}),
    "$SOFTPLCREAL": Array({(n,): 0.0 for n in range(1, 1025)}),
    "$STOPMESS": False,
    "$TORQUE_AXIS_ACT": Array({(n,): 0.0 for n in range(1, 2 * AXES + 1)}),
    "$USER_SAF": True,
    "$VEL_ACT": 0.0,
}
"""How a controller stands that starts its program in automatic mode, without a fault."""
FACTS: dict[str, Value] = {
    "$ADAP_ACC": Symbol("STEP1"),
    "$EX_AX_NUM": 0,
    "$KINCLASS": Symbol("STANDARD"),
    "$NUM_AX": AXES,
    "$TCP_IPO": True,
    "$VEL_MA": Structure({"CP": 3.0, "ORI1": 400.0, "ORI2": 400.0}),
    "$ACC_MA": Structure({"CP": 10.0, "ORI1": 1000.0, "ORI2": 1000.0}),
    "$ERR": Structure({"NUMBER": 0}),
    "$BWDSTART": False,
    "$NULLFRAME": Structure(dict(NULL)),
    "$WORLD": Structure(dict(NULL)),
    "$ROBROOT": Structure(dict(NULL)),
    "FALSE": False,
    "TRUE": True,
}
"""Of every six-axis robot of this make that stands in the origin of its world."""


def mode_variables(name: str, value: Value) -> dict[str, Value]:
    """What follows for the other variables where one that tells the operating mode is set."""
    if name == "$MODE_OP" and isinstance(value, Symbol):
        return _modes(value.name)
    told = {"$T1": "T1", "$T2": "T2", "$AUT": "AUT", "$EXT": "EX"}
    return _modes(told[name]) if name in told and value is True else {}


class FormAge(Enum):
    """Which system software wrote inline forms, as far as PDEFAULT hangs on it: its APO_DIST is in
    mm (APO_MODE #CDIS) from KSS 8.3 on, in % before.
    """

    OLD = "100 %, as before KSS 8.3, whose inline forms these are"
    NEW = "100 mm, as from KSS 8.3 on, whose inline forms these are"
    OPEN = "100 mm, as from KSS 8.3 on; older ones have 100 %"


def form_age(versions: Collection[tuple[int, int]]) -> FormAge:
    """By the versions that a program's inline forms name; OPEN where they name none, or both."""
    newer = {one >= _WITH_APO_MODE for one in versions}
    if len(newer) != 1:
        return FormAge.OPEN
    return FormAge.NEW if newer.pop() else FormAge.OLD


def axis_fields(q: FloatArray) -> dict[str, float]:
    """A1 to A6 [deg] of a configuration (6,) [rad], of a robot on a rail with E1 [mm], which it has
    first [m].
    """
    angles = zip(AXIS_NAMES, np.degrees(q[-AXES:]), strict=True)
    rails = zip((RAIL_NAME,), q[:-AXES] * 1e3, strict=False)
    return {name: float(value) for name, value in (*angles, *rails)}


def system_variables(
    home: FloatArray, tool: FloatArray, forms: FormAge = FormAge.OPEN
) -> dict[str, Value]:
    """Variables at the start: `home` (6,) [rad] is XHOME, of a robot on a rail E1 [m] first, `tool`
    (4, 4) [m] in the flange every tool number whose data the program doesn't bring.
    """
    apo_mode: dict[str, Value] = {} if forms is FormAge.OLD else {"APO_MODE": Symbol("CDIS")}
    angles: dict[str, Value] = dict(axis_fields(home))
    tool_frame = frame(tool)
    turning = {"ORI1": DEFAULTS["DEF_VEL_ORI1"], "ORI2": DEFAULTS["DEF_VEL_ORI2"]}
    turning_up = {"ORI1": DEFAULTS["DEF_ACC_ORI1"], "ORI2": DEFAULTS["DEF_ACC_ORI2"]}
    percent: dict[str, Value] = {"VEL": FULL, "ACC": FULL, "APO_DIST": FULL}
    path: dict[str, Value] = {**percent, "VEL": 2.0, "APO_FAC": 50.0, "ORI_TYP": Symbol("VAR")}
    return {
        **DEFAULTS,
        **SITUATION,
        **FACTS,
        "$VEL_AXIS": all_axes(FULL),
        "$ACC_AXIS": all_axes(FULL),
        "$VEL_EXTAX": all_axes(FULL),
        "$ACC_EXTAX": all_axes(FULL),
        "$VEL": Structure({"CP": DEFAULTS["DEF_VEL_CP"], **turning}),
        "$ACC": Structure({"CP": DEFAULTS["DEF_ACC_CP"], **turning_up}),
        "$APO": Structure({p: DEFAULTS[f"DEF_APO_{p}"] for p in ("CPTP", "CDIS", "CORI", "CVEL")}),
        "$GEAR_JERK": all_axes(FULL),
        "$OV_PRO": FULL,
        "$ADVANCE": 3,
        "$TOOL": tool_frame,
        "$BASE": Structure(dict(NULL)),
        "$IPO_MODE": Symbol("BASE"),
        "TOOL_DATA": Array({(n,): tool_frame.copied() for n in range(1, TOOLS + 1)}),
        "LOAD_DATA": Array({(n,): Structure({}, "LOAD") for n in range(1, TOOLS + 1)}),
        "BASE_DATA": Array({(n,): Structure(dict(NULL)) for n in range(1, BASES + 1)}),
        "XHOME": Structure(dict(angles), "E6AXIS"),
        "$H_POS": Structure(dict(angles), "E6AXIS"),
        "PDEFAULT": Structure({**percent, **apo_mode, "GEAR_JERK": 50.0}, "PDAT"),
        "LDEFAULT": Structure({**path, "AXIS_VEL": FULL, "AXIS_ACC": FULL}, "LDAT"),
        "FHOME": Structure({"TOOL_NO": 1, "BASE_NO": 0, "IPO_FRAME": Symbol("BASE")}, "FDAT"),
        "$OUT": Array(),
    }


def assumed_variables(forms: FormAge = FormAge.OPEN) -> dict[str, Assumption]:
    """Those of `system_variables` that a controller may have otherwise, by name or name[index]."""
    found = {
        name: Assumption(f"{name} is taken as {_spelled(value)}: --set '{name}=…'", Effect.MOTIONS)
        for name, value in SITUATION.items()
    }
    home = "isn't in the files: the cell's home"
    found["XHOME"] = Assumption(f"XHOME {home}", Effect.PLACES)
    found["$H_POS"] = Assumption(f"$H_POS {home}", Effect.PLACES)
    for name in ("CPTP", "CDIS", "CORI", "CVEL"):
        delivered = f"DEF_APO_{name}"
        apo = f"{DEFAULTS[delivered]:g} {DELIVERED[delivered]}"
        text = f"$APO.{name} isn't set: as BAS(#INITMOV) sets it, {apo}"
        found[f"$APO.{name}"] = Assumption(text, Effect.SPEEDS)
    path = (
        "$VEL or $ACC isn't set whole: what lacks is as BAS(#INITMOV) sets it, 2 m/s, 200 deg/s, "
        "2.3 m/s^2, 100 deg/s^2"
    )
    for name in ("$VEL.CP", "$VEL.ORI1", "$ACC.CP", "$ACC.ORI1"):
        found[name] = Assumption(path, Effect.SPEEDS)
    axis = "$VEL_AXIS or $ACC_AXIS isn't set for every axis: what lacks is 100 %"
    for n in range(1, AXES + 1):
        found[f"$VEL_AXIS[{n}]"] = Assumption(axis, Effect.SPEEDS)
        found[f"$ACC_AXIS[{n}]"] = Assumption(axis, Effect.SPEEDS)
    external = f"$VEL_EXTAX or $ACC_EXTAX isn't set: {RAIL_NAME} has all of its speed"
    for name in ("$VEL_EXTAX", "$ACC_EXTAX"):
        found[f"{name}[{RAIL_NAME[1:]}]"] = Assumption(external, Effect.SPEEDS)
    for name, unit in DELIVERED.items():
        said = f"{name} {DEFAULTS[name]:g} {unit}"
        found[name] = Assumption(said, Effect.SPEEDS, delivered=name)
    form = f"PDEFAULT isn't in the files: APO_DIST of {forms.value}; --set 'PDEFAULT={{…}}'"
    found["PDEFAULT"] = Assumption(form, Effect.SPEEDS)
    found["$TOOL"] = Assumption("no $TOOL is chosen: the cell's tool", Effect.PLACES)
    found["$BASE"] = Assumption("no $BASE is chosen: the robot's foot", Effect.PLACES)
    for n in range(1, TOOLS + 1):
        text = f"TOOL_DATA[{n}] isn't in the files: the cell's tool"
        found[f"TOOL_DATA[{n}]"] = Assumption(text, Effect.PLACES)
    for n in range(1, BASES + 1):
        text = f"BASE_DATA[{n}] isn't in the files: the robot's foot"
        found[f"BASE_DATA[{n}]"] = Assumption(text, Effect.PLACES)
    return found


def all_axes(value: float) -> Array:
    """An array with one value for every axis."""
    return Array({(n,): value for n in range(1, AXES + 1)})


def _spelled(value: Value) -> str:
    if isinstance(value, bool):
        return "TRUE" if value else "FALSE"
    return str(value) if isinstance(value, int | float | str | Symbol) else "at rest"
