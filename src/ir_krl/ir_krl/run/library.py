"""Routines that every controller has: BAS, the functions of inline forms, mathematics."""

from __future__ import annotations

import math
from collections.abc import Callable

from ir_description.poses import inverse
from ir_krl.errors import KrlRunError, Place
from ir_krl.run.memory import AXES, FULL, NULL, TOOL_ACCELERATION, Memory, Step, system_speeds
from ir_krl.run.values import Array, Structure, Symbol, Value, frame, integer, kind_of, number, pose

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
        "SGEAR_JERK",
        "SJERK",
        "SLOAD",
        "SORI_TYP",
        "USE_CM_PRO_VALUES",
    }
)
"""Called in nearly every program; neither the path nor the speeds of a motion follows from them
here.
"""

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
        self._named: dict[str, Callable[[Arguments, Place], Value]] = {
            "BAS": self._bas,
            "SVEL_JOINT": self._all_axes("$VEL_AXIS"),
            "SACC_JOINT": self._joint_acceleration,
            "SVEL_CP": self._tool_velocity,
            "SACC_CP": self._tool_acceleration,
            "SAPO_PTP": self._approximation("CPTP"),
            "SAPO": self._approximation("CDIS"),
            "SIPO_MODE": lambda given, place: _first(given, "SIPO_MODE", place),
            "STOOL2": lambda given, place: self._tool(_component(given, "TOOL_NO", place), place),
            "STOOL": lambda given, place: self._tool(_whole(given, "STOOL", place), place),
            "SBASE": lambda given, place: self._base(_whole(given, "SBASE", place), place),
            "VARSTATE": self._state,
            "INV_POS": lambda given, place: frame(
                inverse(pose(_first(given, "INV_POS", place), "INV_POS", place))
            ),
        }

    def has(self, name: str) -> bool:
        """Whether the controller has a routine of this name."""
        return name in self._named or name in _MATHEMATICS or name in WITHOUT_EFFECT

    def call(self, name: str, arguments: Arguments, place: Place) -> Value:
        """Its value; 0 where it has none. Raises KrlRunError."""
        if name in WITHOUT_EFFECT:
            return 0
        if name not in _MATHEMATICS:
            return self._named[name](arguments, place)
        numbers = [
            number(_given(one, name, place), f"an argument of {name}", place) for one in arguments
        ]
        try:
            return _MATHEMATICS[name](*numbers)
        except (TypeError, ValueError):
            raise KrlRunError(
                f"{name} can't be computed of {', '.join(f'{one:g}' for one in numbers)}", place
            ) from None

    def _bas(self, arguments: Arguments, place: Place) -> Value:  # noqa: C901, PLR0912
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
                self._memory.shared.update(system_speeds())
            case "PTP_PARAMS":
                self._frames(place)
                self._set("$ACC_AXIS", self._noted("PDAT_ACT", "ACC", FULL, place))
                self._set("$APO.CPTP", self._noted("PDAT_ACT", "APO_DIST", 0.0, place))
                self._set("$VEL_AXIS", amount())
            case "CP_PARAMS":
                self._frames(place)
                share = self._noted("LDAT_ACT", "ACC", FULL, place)
                self._set("$ACC.CP", TOOL_ACCELERATION * share / FULL)
                self._set("$APO.CDIS", self._noted("LDAT_ACT", "APO_DIST", 0.0, place))
                self._set("$VEL.CP", amount())
            case "VEL_PTP":
                self._set("$VEL_AXIS", amount())
            case "ACC_PTP":
                self._set("$ACC_AXIS", amount())
            case "VEL_CP":
                self._set("$VEL.CP", amount())
            case "ACC_CP":
                self._set("$ACC.CP", TOOL_ACCELERATION * amount() / FULL)
            case "OV_PRO":
                self._set("$OV_PRO", amount())
            case "FRAMES":
                self._frames(place)
            case "TOOL":
                self._set("$TOOL", self._tool(round(amount()), place))
            case "BASE":
                self._set("$BASE", self._base(round(amount()), place))
            case "PTP_DAT" | "CP_DAT" | "EX_BASE" | "OUT_SYNC" | "OUT_ASYNC" | "GROUP":
                pass
            case other:
                raise KrlRunError(f"BAS(#{other}) isn't known", place)
        return 0

    def _frames(self, place: Place) -> None:
        """Tool and base that the inline form's FDAT_ACT names."""
        if self._memory.has("FDAT_ACT"):
            self._set(
                "$TOOL", self._tool(round(self._noted("FDAT_ACT", "TOOL_NO", 0.0, place)), place)
            )
            self._set(
                "$BASE", self._base(round(self._noted("FDAT_ACT", "BASE_NO", 0.0, place)), place)
            )

    def _noted(self, variable: str, component: str, otherwise: float, place: Place) -> float:
        """A number of what an inline form left in PDAT_ACT, LDAT_ACT or FDAT_ACT."""
        noted = self._memory.get(((variable, None),), place) if self._memory.has(variable) else None
        if not isinstance(noted, Structure) or component not in noted.fields:
            return otherwise
        return number(noted.fields[component], f"{variable}.{component}", place)

    def _set(self, name: str, value: Value) -> None:
        """A system variable; of an array of axes all of them."""
        variable, _, component = name.partition(".")
        held = self._memory.shared.get(variable)
        if isinstance(held, Array):
            for j in range(1, AXES + 1):
                held.elements[(j,)] = value
            return
        path: tuple[Step, ...] = (
            ((variable, None), (component, None)) if component else ((variable, None),)
        )
        self._memory.set(path, value, Place())

    def _state(self, arguments: Arguments, place: Place) -> Value:
        """VARSTATE("NAME"): whether a variable has a value."""
        name = _first(arguments, "VARSTATE", place)
        if not isinstance(name, str):
            raise KrlRunError(
                f"VARSTATE is given {kind_of(name)}, not the name of a variable", place
            )
        if self._memory.has(name.upper()):
            return Symbol("INITIALIZED")
        return Symbol("DECLARED" if self._memory.declared(name.upper()) else "UNDEFINED")

    def _all_axes(self, name: str) -> Callable[[Arguments, Place], Value]:
        def applied(arguments: Arguments, place: Place) -> Value:
            value = number(_first(arguments, name, place), name, place)
            self._set(name, value)
            return value

        return applied

    def _joint_acceleration(self, arguments: Arguments, place: Place) -> Value:
        share = _component(arguments, "ACC", place)
        self._set("$ACC_AXIS", float(share))
        return float(share)

    def _tool_velocity(self, arguments: Arguments, place: Place) -> Value:
        return Structure({"CP": number(_first(arguments, "SVEL_CP", place), "SVEL_CP", place)})

    def _tool_acceleration(self, arguments: Arguments, place: Place) -> Value:
        return Structure({"CP": TOOL_ACCELERATION * _component(arguments, "ACC", place) / FULL})

    def _approximation(self, component: str) -> Callable[[Arguments, Place], Value]:
        return lambda arguments, place: Structure(
            {component: float(_component(arguments, "APO_DIST", place))}
        )

    def _tool(self, index: int, place: Place) -> Value:
        if index == 0:
            return Structure(dict(NULL))
        return self._memory.get((("TOOL_DATA", (index,)),), place)

    def _base(self, index: int, place: Place) -> Value:
        if index == 0:
            return Structure(dict(NULL))
        return self._memory.get((("BASE_DATA", (index,)),), place)


def _given(value: Value | None, what: str, place: Place) -> Value:
    if value is None:
        raise KrlRunError(f"{what} lacks an argument", place)
    return value


def _first(arguments: Arguments, what: str, place: Place) -> Value:
    return _given(arguments[0] if arguments else None, what, place)


def _whole(arguments: Arguments, what: str, place: Place) -> int:
    return integer(_first(arguments, what, place), f"the argument of {what}", place)


def _component(arguments: Arguments, name: str, place: Place) -> int:
    """A component of a form's data, such as TOOL_NO of an FDAT: the last argument that is a
    structure.
    """
    for value in reversed(arguments):
        if isinstance(value, Structure) and name in value.fields:
            return integer(value.fields[name], name, place)
    raise KrlRunError(f"no argument has a component {name}", place)
