"""Routines that every controller has: BAS, the functions of inline forms, mathematics."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TypeGuard

from ir_description.poses import inverse
from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.run.memory import Memory, Step
from ir_krl.run.notes import Effect
from ir_krl.run.system import DEFAULTS, FULL, NULL, all_axes
from ir_krl.run.values import (
    Array,
    Structure,
    Symbol,
    Unknown,
    Value,
    copied,
    frame,
    integer,
    kind_of,
    number,
    pose,
    real,
)

Arguments = list[Value | None]

WITHOUT_EFFECT = frozenset(
    {
        "BAS_EX",
        "H70",
        "IR_STOPM",
        "MSGNOTIFY",
        "MSGQUIT",
        "MSGSTATE",
        "SET_CD_PARAMS",
        "USE_CM_PRO_VALUES",
        "ERR_CLEAR",
        "RESET_CD_PARAMS",
        "SET_KRLMSG",
        "SET_KRLDLG",
        "CLEAR_KRLMSG",
        "EXISTS_KRLMSG",
        "EXISTS_KRLDLG",
        "GET_MSGBUFFER",
    }
)
"""Called in many programs; neither the path nor the speeds of a motion follows from them here."""
STOPPING = frozenset({"CWRITE", "CREAD", "COPEN", "CCLOSE", "CIOCTL"})
"""What speaks with other programs: the advance run stops, nothing moves."""
FILLING = frozenset({"CREAD", "SREAD", "SWRITE", "CAST_FROM", "CAST_TO"})
"""What gives its arguments values that nobody knows here: texts, what a channel sent."""
COMPUTED = {"INVERSE": 3, "FORWARD": 2}
"""Functions of the controller's kinematics, and how many arguments they take."""
CONTROLLERS = frozenset(
    ("BAS", "BAS_EX", "IR_STOPM", "MSGLIB", "COLLMONLIB", "TM_BIB", "KRLMSG", "SPS", "CELL_TEACH")
)
"""Modules that come with a controller: what they are here counts, not their text in a folder."""

_FAR = 1e6  # mm: bounds nothing
_EXTERNAL_TOO = {"$VEL_AXIS": "$VEL_EXTAX", "$ACC_AXIS": "$ACC_EXTAX"}
_MATHEMATICS: dict[str, Callable[..., float]] = {
    "ABS": abs,
    "SQRT": math.sqrt,
    "SIN": lambda angle: math.sin(math.radians(angle)),
    "COS": lambda angle: math.cos(math.radians(angle)),
    "TAN": lambda angle: math.tan(math.radians(angle)),
    "ACOS": lambda x: math.degrees(math.acos(x)),
    "ATAN2": lambda y, x: math.degrees(math.atan2(y, x)),
}


class Library:
    """The controller's own routines, on the memory of the program that runs."""

    def __init__(self, memory: Memory) -> None:
        self._memory = memory
        self._named: dict[str, Callable[[Arguments, SourcePlace], Value]] = {
            "BAS": self._bas,
            "SVEL_JOINT": self._joint_velocity,
            "SACC_JOINT": self._joint_acceleration,
            "SVEL_CP": self._tool_velocity,
            "SACC_CP": self._path_acceleration,
            "SGEAR_JERK": lambda given, place: _field(given, "GEAR_JERK", Unknown("$GEAR_JERK")),
            "SJERK": lambda given, place: Unknown("$JERK"),  # the controller's own
            "SAPO_PTP": self._axis_approximation,
            "SAPO": lambda given, place: Structure({"CDIS": _component(given, "APO_DIST", place)}),
            "SORI_TYP": lambda given, place: _field(given, "ORI_TYP", Symbol("VAR")),
            "SLOAD": lambda given, place: self._load(_whole(given, "SLOAD", place), place),
            "SIPO_MODE": lambda given, place: _first(given, "SIPO_MODE", place),
            "STOOL2": self._form_tool,
            "STOOL": lambda given, place: self._tool(_whole(given, "STOOL", place)),
            "SBASE": lambda given, place: self._base(_whole(given, "SBASE", place)),
            "VARSTATE": self._state,
            "INV_POS": lambda given, place: frame(
                inverse(pose(_first(given, "INV_POS", place), "INV_POS", place))
            ),
        }

    def has(self, name: str) -> bool:
        """Whether the controller has a routine of this name."""
        known = WITHOUT_EFFECT | STOPPING | FILLING
        return name in self._named or name in _MATHEMATICS or name in known

    def call(self, name: str, arguments: Arguments, place: SourcePlace) -> Value:
        """Its value; 0 where it has none. Raises KrlRunError."""
        if name in FILLING:
            text = f"{name} isn't followed: what it would fill in is taken as it stands"
            self._memory.noted(place, text, Effect.MOTIONS)
        if name in WITHOUT_EFFECT | STOPPING | FILLING:
            return 0
        if name not in _MATHEMATICS:
            return self._named[name](arguments, place)
        numbers = [
            number(_given(one, name, place), f"an argument of {name}", place) for one in arguments
        ]
        try:
            return real(_MATHEMATICS[name](*numbers))
        except (TypeError, ValueError):
            raise KrlRunError(
                f"{name} can't be computed of {', '.join(f'{one:g}' for one in numbers)}", place
            ) from None

    def _bas(self, arguments: Arguments, place: SourcePlace) -> Value:  # noqa: C901, PLR0912
        command = _first(arguments, "BAS", place)
        value = arguments[1] if len(arguments) > 1 else None
        if not isinstance(command, Symbol):
            raise KrlRunError(
                f"BAS is given {kind_of(command)}, not a command such as #INITMOV", place
            )

        def amount() -> float:
            return number(_given(value, f"BAS({command})", place), f"BAS({command})", place)

        match command.name:
            case "INITMOV":
                self._initialised()
            case "PTP_PARAMS":
                self._axis_data(place)
                self._frames(place)
                self._axis_speed(amount())
            case "CP_PARAMS":
                self._tool_data(place)
                self._frames(place)
                self._tool_speed(amount())
            case "PTP_DAT":
                self._axis_speed(self._noted("PDAT_ACT", "VEL", FULL, place))
                self._axis_data(place)
            case "CP_DAT":
                if _holds(self._own("LDAT_ACT", place), "VEL"):
                    self._tool_speed(self._noted("LDAT_ACT", "VEL", 0.0, place))
                else:
                    self._tool_speed(self._default("DEF_VEL_CP", "$VEL.CP"))
                self._tool_data(place)
            case "VEL_PTP":
                self._axis_speed(amount())
            case "ACC_PTP":
                self._set("$ACC_AXIS", min(amount(), FULL))
            case "VEL_CP":
                self._tool_speed(amount())
            case "ACC_CP":
                self._tool_acceleration(amount())
            case "OV_PRO":
                self._memory.override_set(place)
                self._set("$OV_PRO", amount())
            case "FRAMES":
                self._frames(place)
            case "TOOL":
                self._take_tool(round(amount()), place)
            case "BASE":
                self._take_base(round(amount()))
            case "GROUP":
                pass
            case "EX_BASE":
                text = "BAS(#EX_BASE): a base that external axes move isn't followed"
                self._memory.noted(place, text, Effect.PLACES)
            case other:
                text = f"BAS(#{other}) isn't known: no effect assumed"
                self._memory.noted(place, text, Effect.SPEEDS)
        return 0

    def _default(self, name: str, used: str = "") -> float:
        """A figure of $config.dat, which may be the program's own; used: the system variable that
        is set with it, so that motions which follow from it say where it isn't.
        """
        value = self._memory.peek(name)
        if used:
            self._memory.chosen[used] = self._memory.assumed.get(name)
        given = value if isinstance(value, int | float) else DEFAULTS[name]
        return number(given, name, SourcePlace())

    def _initialised(self) -> None:
        """BAS(#INITMOV): speeds, approximation, tool 1, base 0 as $config.dat has them."""
        memory = self._memory
        memory.shared["$VEL_AXIS"] = all_axes(FULL)
        memory.shared["$ACC_AXIS"] = all_axes(FULL)
        memory.shared["$VEL_EXTAX"] = all_axes(FULL)
        memory.shared["$ACC_EXTAX"] = all_axes(FULL)
        self._axis_speed(FULL)
        self._set("$ACC_AXIS", FULL)
        for variable, parts in (
            ("VEL", ("CP", "ORI1", "ORI2")),
            ("ACC", ("CP", "ORI1", "ORI2")),
            ("APO", ("CPTP", "CDIS", "CVEL", "CORI")),
        ):
            given: dict[str, Value] = {
                part: self._default(f"DEF_{variable}_{part}", f"${variable}.{part}")
                for part in parts
            }
            self._set(f"${variable}", Structure(given))
        self._set("$ORI_TYPE", Symbol("VAR"))
        self._set("$IPO_MODE", Symbol("BASE"))
        self._set("$CIRC_TYPE", self._memory.peek("DEF_CIRC_TYP") or Symbol("BASE"))
        self._set("$ADVANCE", round(self._default("DEF_ADVANCE")))
        self._take_base(0)
        self._set("$TOOL", self._tool(1))

    def _axis_data(self, place: SourcePlace) -> None:
        """What PDAT_ACT says of an axis motion: an APO_MODE #CDIS means mm, else per cent."""
        self._set("$ACC_AXIS", min(self._noted("PDAT_ACT", "ACC", FULL, place), FULL))
        distance = self._noted("PDAT_ACT", "APO_DIST", 0.0, place)
        noted = self._own("PDAT_ACT", place)
        if _holds(noted, "APO_MODE") and noted.fields["APO_MODE"] == Symbol("CDIS"):
            self._set("$APO.CDIS", distance)
        else:
            self._set("$APO.CPTP", min(distance, FULL))

    def _tool_data(self, place: SourcePlace) -> None:
        """What LDAT_ACT says of a motion of the tool."""
        self._tool_acceleration(self._noted("LDAT_ACT", "ACC", FULL, place))
        self._set("$APO.CDIS", self._noted("LDAT_ACT", "APO_DIST", 0.0, place))
        noted = self._own("LDAT_ACT", place)
        self._set("$ORI_TYPE", _field([noted], "ORI_TYP", Symbol("VAR")))
        self._set("$CIRC_TYPE", _field([noted], "CIRC_TYP", Symbol("BASE")))

    def _own(self, name: str, place: SourcePlace) -> Value | None:
        return self._memory.get(((name, None),), place) if self._memory.has(name) else None

    def _tool_speed(self, velocity: float) -> None:
        """$VEL.CP as BAS sets it [m/s]: no more than a controller takes."""
        most = self._fastest(velocity)
        self._set("$VEL.CP", min(velocity * self._default("DEF_VEL_FACT"), most))

    def _fastest(self, otherwise: float) -> float:
        """The most that $VEL_MA allows the tool [m/s]."""
        known = self._memory.peek("$VEL_MA")
        if not _holds(known, "CP"):
            return otherwise
        return number(known.fields["CP"], "$VEL_MA.CP", SourcePlace())

    def _tool_acceleration(self, share: float) -> None:
        """$ACC of the tool as BAS sets it, `share` [%] of the figures of $config.dat."""
        for part, name in (
            ("CP", "DEF_ACC_CP"),
            ("ORI1", "DEF_ACC_ORI1"),
            ("ORI2", "DEF_ACC_ORI2"),
        ):
            full = self._default(name, f"$ACC.{part}")
            self._set(f"$ACC.{part}", full * min(share, FULL) / FULL)

    def _frames(self, place: SourcePlace) -> None:
        """Tool, load and base that the inline form's FDAT_ACT names."""
        noted = self._own("FDAT_ACT", place)
        if not isinstance(noted, Structure):
            return
        self._take_tool(round(self._noted("FDAT_ACT", "TOOL_NO", 0.0, place)), place)
        self._take_base(round(self._noted("FDAT_ACT", "BASE_NO", 0.0, place)))
        mode = noted.fields.get("IPO_FRAME", Symbol("BASE"))
        if mode not in (Symbol("BASE"), Symbol("TCP")):
            raise KrlRunError(f"IPO_FRAME is {kind_of(mode)}: it is #BASE or #TCP", place)
        self._set("$IPO_MODE", mode)

    def _take_tool(self, index: int, place: SourcePlace) -> None:
        self._set("$TOOL", self._tool(index))
        self._set("$LOAD", self._load(index, place))

    def _take_base(self, index: int) -> None:
        self._set("$BASE", self._base(index))

    def _form_tool(self, arguments: Arguments, place: SourcePlace) -> Value:
        return self._tool(round(_component(arguments, "TOOL_NO", place)))

    def _tool(self, index: int) -> Value:
        """TOOL_DATA of a number, the flange where that is 0."""
        return self._frame("TOOL_DATA", index, "$TOOL")

    def _base(self, index: int) -> Value:
        """BASE_DATA of a number, the world where that is 0."""
        return self._frame("BASE_DATA", index, "$BASE")

    def _frame(self, name: str, index: int, used: str) -> Value:
        value = self._memory.peek(name, index) if index > 0 else None
        self._memory.chosen[used] = self._memory.assumed.get(f"{name}[{index}]")
        return Structure(dict(NULL)) if value is None else copied(value)

    def _noted(self, variable: str, component: str, otherwise: float, place: SourcePlace) -> float:
        """A number of what an inline form left in PDAT_ACT, LDAT_ACT or FDAT_ACT."""
        noted = self._memory.get(((variable, None),), place) if self._memory.has(variable) else None
        if not isinstance(noted, Structure) or component not in noted.fields:
            return otherwise
        return number(noted.fields[component], f"{variable}.{component}", place)

    def _set(self, name: str, value: Value) -> None:
        """A system variable; of an array of axes all of them."""
        if name in _EXTERNAL_TOO:  # BAS and the forms set external axes with the robot's
            self._set(_EXTERNAL_TOO[name], value)
        variable, _, component = name.partition(".")
        held = self._memory.shared.get(variable)
        if isinstance(held, Array):
            value = Array(dict.fromkeys(held.elements, value), held.kind, held.sizes)
        path: tuple[Step, ...] = (
            ((variable, None), (component, None)) if component else ((variable, None),)
        )
        self._memory.set(path, value, SourcePlace())
        self._memory.take_chosen(name)

    def _state(self, arguments: Arguments, place: SourcePlace) -> Value:
        """VARSTATE("NAME"): whether a variable has a value."""
        name = _first(arguments, "VARSTATE", place)
        if not isinstance(name, str):
            raise KrlRunError(
                f"VARSTATE is given {kind_of(name)}, not the name of a variable", place
            )
        if self._memory.has(name.upper()):
            return Symbol("INITIALIZED")
        return Symbol("DECLARED" if self._memory.declared(name.upper()) else "UNDEFINED")

    def _joint_velocity(self, arguments: Arguments, place: SourcePlace) -> Value:
        return self._axis_speed(number(_first(arguments, "SVEL_JOINT", place), "speed", place))

    def _axis_speed(self, percent: float) -> float:
        """$VEL_AXIS of all axes, `percent` of DEF_VEL_PTP, which it is at most."""
        share = self._default("DEF_VEL_PTP", "$VEL_AXIS") * min(percent, FULL) / FULL
        chosen = self._memory.chosen.get("$VEL_AXIS")
        self._set("$VEL_AXIS", share)
        self._memory.chosen["$VEL_AXIS"] = chosen  # of an assignment to one of the axes
        return share

    def _joint_acceleration(self, arguments: Arguments, place: SourcePlace) -> Value:
        share = min(_component(arguments, "ACC", place), FULL)
        self._set("$ACC_AXIS", share)
        return share

    def _tool_velocity(self, arguments: Arguments, place: SourcePlace) -> Value:
        """SVEL_CP: the speed of the tool, and as much of the axes' as the form's data say."""
        share = number(_field(arguments, "AXIS_VEL", FULL), "AXIS_VEL", place)
        self._set("$VEL_AXIS", min(share, FULL))
        speed = number(_first(arguments, "SVEL_CP", place), "SVEL_CP", place)
        turning = self._default("DEF_VEL_ORIS", "$VEL.ORI1")
        return _turning_too(min(speed, self._fastest(speed)), turning)

    def _path_acceleration(self, arguments: Arguments, place: SourcePlace) -> Value:
        own = _component(arguments, "ACC", place)
        percent = min(number(_field(arguments, "AXIS_ACC", own), "AXIS_ACC", place), FULL)
        self._set("$ACC_AXIS", percent)
        share = percent / FULL
        turning = self._default("DEF_ACC_ORIS", "$ACC.ORI1") * share
        along = self._default("DEF_ACC_CP", "$ACC.CP") * share
        return _turning_too(along, turning)

    def _axis_approximation(self, arguments: Arguments, place: SourcePlace) -> Value:
        """SAPO_PTP: millimetres, and a share of the motion where APO_MODE is #CPTP."""
        distance = _component(arguments, "APO_DIST", place)
        mode = _field(arguments, "APO_MODE", "")
        if mode == Symbol("CPTP"):
            return Structure({"CDIS": _FAR, "CPTP": distance})
        share = FULL if mode else self._default("DEF_APO_CPTP", "$APO.CPTP")
        return Structure({"CDIS": distance, "CPTP": share})

    def _load(self, index: int, place: SourcePlace) -> Value:
        """LOAD_DATA of a tool; a mass of -1, as the machine data have it, where nothing is said."""
        value = self._memory.peek("LOAD_DATA", index)
        if index > 0 and _holds(value, "M"):
            return copied(value)
        if index > 0:
            text = f"LOAD_DATA[{index}] isn't in the files: what the cell holds"
            self._memory.noted(place, text, Effect.TIMES)
        return Structure({"M": -1.0}, "LOAD")


def _turning_too(along: float, turning: float) -> Structure:
    """What $VEL or $ACC is: of the path, and of the tool's turning, all ways."""
    return Structure({"CP": along, "ORI1": turning, "ORI2": turning})


def _given(value: Value | None, what: str, place: SourcePlace) -> Value:
    if value is None:
        raise KrlRunError(f"{what} lacks an argument", place)
    return value


def _first(arguments: Arguments, what: str, place: SourcePlace) -> Value:
    return _given(arguments[0] if arguments else None, what, place)


def _whole(arguments: Arguments, what: str, place: SourcePlace) -> int:
    return integer(_first(arguments, what, place), f"the argument of {what}", place)


def _field(arguments: Sequence[Value | None], name: str, otherwise: Value) -> Value:
    """A component of a form's data (TOOL_NO of an FDAT), of the last argument that has it."""
    has = (one.fields[name] for one in reversed(arguments) if _holds(one, name))
    return next(has, otherwise)


def _holds(value: Value | None, name: str) -> TypeGuard[Structure]:
    return isinstance(value, Structure) and name in value.fields


def _component(arguments: Arguments, name: str, place: SourcePlace) -> float:
    """A component of an argument as a number. Raises KrlRunError where no argument has it."""
    if not any(_holds(value, name) for value in arguments):
        raise KrlRunError(
            f"no argument has a component {name}: give the .dat with the form's data", place
        )
    return number(_field(arguments, name, 0.0), name, place)
