"""Memory of a running program: system variables, variables, inputs, outputs and timers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from ir_krl.errors import KrlRunError, Place
from ir_krl.run.values import FRAME_NAMES, Array, Structure, Value, copied, frame, integer, number
from ir_msgs_py.arrays import FloatArray

# What a controller brings along: system variables with the values they have at the start of a
# program.

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


# Variables by name, as they stand while a program runs: of the routine that runs, of its module,
# of all.
#
# A module is a .src with its .dat. A variable of a data list is known in its module, one that is
# GLOBAL or stands in $CONFIG everywhere; where two have the same name the nearest one counts.

Step = tuple[str, tuple[int, ...] | None]
"""A name and, where one is written, its index."""


@dataclass
class Scope:
    """Variables of a call: those that have a value, and the names of all that are declared."""

    values: dict[str, Value]
    names: set[str]


@dataclass
class Memory:
    """`shared` holds what is known everywhere, `modules` the data lists by the names of their
    modules, `scopes` the calls that run. module: whose statements run; listed: all names that data
    lists declare.
    """

    shared: dict[str, Value]
    scopes: list[Scope] = field(default_factory=list)
    modules: dict[str, dict[str, Value]] = field(default_factory=dict)
    module: str = ""
    listed: set[str] = field(default_factory=set)

    def enter(self, values: dict[str, Value], names: Iterable[str]) -> None:
        """A call begins, with these parameters and their values."""
        self.scopes.append(Scope(values, {*names, *values}))

    def leave(self) -> dict[str, Value]:
        """The call ends; what its variables hold."""
        return self.scopes.pop().values

    def declare(self, name: str, value: Value | None, everywhere: bool = False) -> None:
        """A variable of the routine that runs; of its module's data list, where none runs."""
        if self.scopes:
            self.scopes[-1].names.add(name)
            home = self.scopes[-1].values
        else:
            self.listed.add(name)
            home = self.shared if everywhere else self._own()
        if value is not None:
            home[name] = value

    def has(self, name: str) -> bool:
        """Whether a variable of this name has a value."""
        return name in self._home(name)

    def declared(self, name: str) -> bool:
        """Whether a variable of this name is declared where statements run, with or without a
        value.
        """
        own = self.scopes[-1].names if self.scopes else set()
        return self.has(name) or name in own or name in self.listed

    def get(self, path: tuple[Step, ...], place: Place) -> Value:
        """The value at a path such as XP1.X or BASE_DATA[2]. Raises KrlRunError."""
        (name, index), *rest = path
        home = self._home(name)
        if name not in home:
            if name in STANDING:
                raise KrlRunError(
                    f"{name} is known on the controller only: a program that computes with it "
                    "isn't read",
                    place,
                )
            where = ": it is known on the controller only" if name.startswith("$") else ""
            raise KrlRunError(f"{name} has no value{where}", place)
        value = _element(home[name], name, index, place)
        written = name if index is None else f"{name}[{', '.join(map(str, index))}]"
        for part, part_index in rest:
            if not isinstance(value, Structure):
                raise KrlRunError(f"{written} has no components", place)
            if part not in value.fields:
                raise KrlRunError(f"{written}.{part} has no value", place)
            written = f"{written}.{part}"
            value = _element(value.fields[part], written, part_index, place)
        return value

    def set(self, path: tuple[Step, ...], value: Value, place: Place) -> None:
        """Put a copy of `value` there; variables, elements and components are made where they
        lack.
        """
        (name, index), *rest = path
        home: dict[str, Value] = self._home(name)
        if not rest and index is None:
            home[name] = _merged(home.get(name), value)
            return
        holder = home
        for (part, part_index), following in zip(path, [*rest, None], strict=True):
            if part_index is not None:
                array = holder.setdefault(part, Array())
                if not isinstance(array, Array):
                    raise KrlRunError(f"{part} is no array", place)
                if following is None:
                    array.elements[part_index] = _merged(array.elements.get(part_index), value)
                    return
                inner = array.elements.setdefault(part_index, Structure({}))
            elif following is None:
                holder[part] = _merged(holder.get(part), value)
                return
            else:
                inner = holder.setdefault(part, Structure({}))
            if not isinstance(inner, Structure):
                raise KrlRunError(f"{part} has no components", place)
            holder = inner.fields

    def _home(self, name: str) -> dict[str, Value]:
        """Where a variable is, or would be."""
        if self.scopes and name in self.scopes[-1].names:
            return self.scopes[-1].values
        if name in self._own():
            return self._own()
        if name in self.shared or name.startswith("$"):
            return self.shared
        elsewhere = [
            one for one in self.modules.values() if name in one
        ]  # a data list of another name
        if elsewhere:
            return elsewhere[0]
        return self.shared if self.scopes else self._own()

    def _own(self) -> dict[str, Value]:
        return self.modules.setdefault(self.module, {})


def _merged(before: Value | None, value: Value) -> Value:
    """The new value of a variable: components that an aggregate leaves out stay, and so does INT or
    REAL.
    """
    new = copied(value)
    if isinstance(new, Structure) and isinstance(before, Structure):
        return Structure(
            {**before.fields, **new.fields}
            if before.kind == new.kind or not new.kind
            else new.fields,
            new.kind or before.kind,
        )
    if isinstance(before, float) and isinstance(new, int) and not isinstance(new, bool):
        return float(new)
    if isinstance(before, int) and not isinstance(before, bool) and isinstance(new, float):
        return round(new)
    return new


def _element(value: Value, name: str, index: tuple[int, ...] | None, place: Place) -> Value:
    if index is None:
        return value
    if not isinstance(value, Array):
        raise KrlRunError(f"{name} is no array", place)
    if index not in value.elements:
        raise KrlRunError(f"{name}[{', '.join(map(str, index))}] has no value", place)
    return value.elements[index]


# Inputs, outputs, flags and timers as a program reads them, single or as the number of a group.

INPUT = "$IN"
OUTPUT = "$OUT"
TIMER = "$TIMER"
TIMER_FLAG = "$TIMER_FLAG"
SINGLE = frozenset((INPUT, OUTPUT, TIMER_FLAG, "$FLAG", "$CYCFLAG"))
"""What is TRUE or FALSE by its number."""
SIGNALS = 8192
"""A KR C4 has $OUT[1] to $OUT[8192], and as many inputs."""
_GROUP_MAX = 32  # signals of a group: the bits of an INT


@dataclass(frozen=True)
class SignalRange:
    """Signals from `first` to `last` of $IN or $OUT as one number, the first its lowest bit."""

    kind: str
    first: int
    last: int

    @property
    def numbers(self) -> range:
        """Its signals, the lowest bit first."""
        return range(self.first, self.last + 1)


@dataclass
class Signals:
    """What is known of signals. inputs: what $IN[n] reads; noted: hears what is assumed, with its
    place;
    aliases and groups: what SIGNAL declares, by name.
    """

    memory: Memory
    inputs: Mapping[int, bool]
    noted: Callable[[Place, str], None]
    aliases: dict[str, tuple[Step, ...]] = field(default_factory=dict)
    groups: dict[str, SignalRange] = field(default_factory=dict)

    def read(self, name: str, index: int, place: Place) -> bool:
        """One signal or flag. Raises KrlRunError for an input that isn't given."""
        if name == INPUT:
            if index not in self.inputs:
                raise KrlRunError(
                    f"the value of $IN[{index}] decides something here and isn't given", place
                )
            return self.inputs[index]
        if name == TIMER_FLAG:
            self.noted(place, f"$TIMER[{index}] stands still: no time passes for a timer")
            return number(self._held(TIMER, index) or 0, f"$TIMER[{index}]", place) > 0.0
        held = self._held(name, index)
        if held is None:
            self.noted(place, f"{name}[{index}] was never set: taken as FALSE")
            return False
        if not isinstance(held, bool):
            raise KrlRunError(f"{name}[{index}] isn't TRUE or FALSE", place)
        return held

    def group_value(self, name: str, place: Place) -> int:
        """The number of a group."""
        group = self.groups[name]
        return sum(self.read(group.kind, n, place) << k for k, n in enumerate(group.numbers))

    def group_bits(self, name: str, value: Value, place: Place) -> list[tuple[int, bool]]:
        """Outputs of a group and what they are set to. Raises KrlRunError for a number that it
        can't hold.
        """
        group = self.groups[name]
        wanted = integer(value, f"what {name} is set to", place)
        if group.kind != OUTPUT:
            raise KrlRunError(f"{name} is a group of inputs: it can't be set", place)
        if not 0 <= wanted < 1 << len(group.numbers):
            raise KrlRunError(
                f"{name} has {len(group.numbers)} bits: it can't hold {wanted}", place
            )
        return [(n, bool(wanted >> k & 1)) for k, n in enumerate(group.numbers)]

    def declare(
        self, name: str, first: tuple[Step, ...], last: tuple[Step, ...] | None, place: Place
    ) -> None:
        """SIGNAL name first [TO last]. Raises KrlRunError for a group that makes no sense."""
        if last is None:
            self.aliases[name] = first
            return
        (kind, begin), (other, end) = first[0], last[0]
        there = kind == other and kind in (INPUT, OUTPUT) and begin is not None and end is not None
        if not there or begin is None or end is None or not 0 <= end[0] - begin[0] < _GROUP_MAX:
            raise KrlRunError(
                f"{name} must be a group of 1 to {_GROUP_MAX} inputs or outputs", place
            )
        self.groups[name] = SignalRange(kind, begin[0], end[0])

    @property
    def named(self) -> dict[str, SignalRange]:
        """What the names of signals stand for; one signal is a range of one."""
        single = {
            name: SignalRange(path[0][0], path[0][1][0], path[0][1][0])
            for name, path in self.aliases.items()
            if path[0][1] is not None
        }
        return single | self.groups

    def _held(self, name: str, index: int) -> Value | None:
        array = self.memory.shared.get(name)
        return array.elements.get((index,)) if isinstance(array, Array) else None
