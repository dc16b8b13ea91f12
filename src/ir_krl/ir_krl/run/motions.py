"""Motions of a program as commands, with triggers and assignments."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import TypeVar, get_args

from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.language import SyntaxTree, place_of
from ir_krl.run.commands import (
    END_OF_LAST,
    Blend,
    Kind,
    Motion,
    Payload,
    SetOutput,
    Speeds,
    SplineBlock,
    Switch,
    Target,
    TimeBlock,
)
from ir_krl.run.control_flow import Clock, Control
from ir_krl.run.expressions import Expressions
from ir_krl.run.memory import Memory, Noted
from ir_krl.run.notes import Effect
from ir_krl.run.signals import CYCLIC, INPUT, OUTPUT, OUTPUT_IN_TIME, SIGNALS, TIMER, Pulse
from ir_krl.run.standing import Standing
from ir_krl.run.system import (
    AXES,
    DEFAULTS,
    FULL,
    HARMLESS,
    MODELLED,
    SITUATION,
    STANDING,
    mode_variables,
)
from ir_krl.run.values import (
    AXIS_NAMES,
    EXTERNAL_NAMES,
    FRAME_NAMES,
    RAIL_NAME,
    Structure,
    Symbol,
    Unknown,
    Value,
    axes,
    components,
    copied,
    integer,
    is_axis_value,
    kind_of,
    number,
    pose,
    rail,
)
from ir_values.arrays import FloatArray

# Assignments as statements: to variables, to outputs and to the groups of signals that name
# them.


class Assigning(Control):
    """Sets values and outputs; what signals are called is known to `_signals`."""

    def _assignment(self, tree: SyntaxTree) -> None:
        """Follow an assignment to a variable, an output, a group of these, or an expected input."""
        access, expression = tree.children
        path = self.expressions.path(access)
        (name, index), where = path[0], self.place(tree)
        if name == CYCLIC and index is not None and self._follows(index[0], expression):
            return
        self.memory.chosen.clear()
        value = self.expressions.value(expression)
        if name in self._signals.groups and index is None:
            value = self.memory.guess(value, 0, where)
            for number, level in self._signals.group_bits(name, value, where):
                self._set_output(number, level, where)
            return
        if name in (OUTPUT, OUTPUT_IN_TIME) and index is not None:
            self._output_assigned(name, index[0], value, where)
            return
        if name == INPUT and index is not None:  # of --set, and of a simulation
            self._signals.expected[index[0]] = value is True
            return
        self._check_effect(name, value, where)
        self.memory.set(path, value, where)
        if self._is_beside and not name.startswith("$"):
            self.memory.set_beside(name)
        if index is not None:
            self._follow_clock(name, index[0], value)
        self.memory.take_chosen(name)  # of STOOL2, SBASE, SVEL_CP
        for other, follows in mode_variables(name, value).items():
            self.memory.set(((other, None),), follows, where)

    def _output_assigned(self, name: str, number: int, value: Value, where: SourcePlace) -> None:
        level = self.memory.guess(value, False, where)
        if not isinstance(level, bool):
            raise KrlRunError(f"{name}[{number}] is set to {kind_of(level)}", where)
        self._set_output(number, level, where, in_time=name == OUTPUT_IN_TIME)

    def _follow_clock(self, name: str, index: int, value: Value) -> None:
        """What a timer does from its assignment on."""
        at = len(self.commands)
        if name == TIMER and isinstance(value, int | float):
            self._timers[index] = replace(self._timers.get(index, Clock()), value=value, set_at=at)
        elif name == "$TIMER_STOP" and isinstance(value, bool):
            clock = self._timers.get(index, Clock())
            begun = at if clock.runs_at is None else clock.runs_at
            self._timers[index] = replace(clock, runs_at=None if value else begun)

    def _follows(self, index: int, expression: SyntaxTree) -> bool:
        """Whether a cyclical flag is evaluated anew from its assignment on: of signals alone."""
        self._flags.pop(index, None)
        self._signals.cyclic.pop(index, None)
        if not self._is_of_signals(expression):
            return False
        self._flags[index] = expression
        anew = partial(self.expressions.truth, expression, f"{CYCLIC}[{index}]")
        self._signals.cyclic[index] = anew
        return True

    def _is_of_signals(self, tree: SyntaxTree) -> bool:
        """Whether an expression hangs on inputs and outputs, and on nothing else."""
        if tree.data == "access":
            name = str(tree.children[0])
            indexed = name in (INPUT, OUTPUT) and tree.children[1] is not None
            return name in self._signals.groups or (
                all(one.data == "number" for one in tree.children[1].children)
                if indexed
                else self._signals.aliases.get(name, ((name, None),))[0][0] in (INPUT, OUTPUT)
            )
        if tree.data == "call":
            return False
        return tree.data not in ("true", "false") and all(
            self._is_of_signals(one) for one in tree.children if isinstance(one, SyntaxTree)
        )

    def _check_effect(self, name: str, value: Value, where: SourcePlace) -> None:
        """Note what isn't modelled of a system variable, stop at an analog output. Raises
        KrlRunError for an interpolation that no controller has.
        """
        if name == ANALOG_OUTPUT:
            self.stop(where, ANALOG_OUTPUT)
        if name == "$OV_PRO":
            self.memory.override_set(where)
        if name == "$IPO_MODE" and value not in (Symbol("BASE"), Symbol("TCP")):
            raise KrlRunError(f"$IPO_MODE is {kind_of(value)}: it is #BASE or #TCP", where)
        known = MODELLED | HARMLESS | SITUATION.keys()
        if name.startswith("$") and name not in known:
            self.note_at(where, f"{name} isn't modelled", _effect_of(name))

    def _set_output(
        self,
        number: float,
        level: bool,
        place: SourcePlace,
        pulse: float = 0.0,
        *,
        in_time: bool = False,
    ) -> None:
        """Set a digital output; in_time: as the motion before ends, without a stop. Raises
        KrlRunError for one that no controller has.
        """
        if number != int(number) or not 1 <= number <= SIGNALS:
            raise KrlRunError(
                f"$OUT[{number:g}]: outputs have whole numbers from 1 to {SIGNALS}", place
            )
        on_path = self.continuing or in_time
        switch = self.triggered
        if not on_path and switch is None:
            self.memory.arrived()
        if on_path and switch is None and self._is_rounding:
            switch = END_OF_LAST
            if not in_time:
                text = (
                    "an output after CONTINUE is set by the advance run: taken as set when the "
                    "motion before ends"
                )
                self.note_at(place, text, Effect.TIMES)
        output = SetOutput(int(number), level, place, pulse, on_path, switch)
        self.commands.append(output)
        if pulse == 0.0:
            self._signals.pulses.pop(int(number), None)
            self.memory.set(((OUTPUT, (int(number),)),), level, place)
        else:
            self._signals.pulse(int(number), Pulse(level, pulse), place)


ANALOG_OUTPUT = "$ANOUT"
_MOVING = (
    "$CORR",
    "$SEN",
    "$TECH",
    "$SOFT",
    "$TRAFO",
    "$ASYNC",
    "$EX_KIN",
    "$JOINT_OFFSET",
    "$PAL_MODE",
    "$CIRC_MODE",
)
"""Beginnings of the names of system variables that change where a motion leads."""


def _effect_of(name: str) -> Effect:
    return Effect.PLACES if name.startswith(_MOVING) else Effect.SPEEDS


# Motions of a program as commands: targets, speeds and approximation as the system variables
# stand.

_COMPONENTS = frozenset((*FRAME_NAMES, *AXIS_NAMES, *EXTERNAL_NAMES, "S", "T"))
_STANDS = 1e-3  # mm or deg: an external axis that moves by less stands
_SLOWEST = 1e-6  # m/s, deg/s, m/s^2, deg/s^2 or %: a movement of years
_KINDS: dict[str, Kind] = {kind: kind for kind in get_args(Kind)}
_MM = 1e-3  # m
_ALL_JERK = (math.inf, math.inf, (1.0,) * AXES)  # of the tool, of its turning, of the axes
_BLEND_WORDS = {"C_PTP": "CPTP", "C_DIS": "CDIS", "C_ORI": "CORI", "C_VEL": "CVEL", "C_SPL": "CDIS"}


class Motions:
    """Builds motions from trees; `expressions` evaluates what stands in them, `noted` hears
    assumptions. on_rail: E1 carries the robot.
    """

    def __init__(
        self, expressions: Expressions, memory: Memory, noted: Noted, *, on_rail: bool = False
    ) -> None:
        self._on_rail = on_rail
        self._expressions = expressions
        self._memory = memory
        self._noted = noted
        self._external: dict[str, float] = {}  # where the external axes stand, as the program says

    def motion(self, tree: SyntaxTree) -> Motion:
        """One of PTP, LIN, CIRC and their relatives, SPL. Raises KrlRunError."""
        kind: Kind = _KINDS[tree.data]
        word = str(tree.children[0]) if kind != "spl" else "SPL"
        place = place_of(tree, self._expressions.file)
        relative = word.endswith("_REL")
        frames = [
            child
            for child in tree.children
            if isinstance(child, SyntaxTree) and child.data not in _OTHERS
        ]
        in_tool = relative and str(tree.children[-1]) == "#TOOL"
        if kind == "circ":
            via = self.target(frames[0], relative, in_tool)
            end = self.target(frames[1], relative, in_tool)
            angle = (
                math.radians(self._expressions.number(frames[2], "CA")) if len(frames) > 2 else None
            )
        else:
            via = None
            end = self.target(frames[0], relative, in_tool)
            angle = None
        if kind in ("lin", "circ", "spl") and end.axes is not None:
            raise KrlRunError(
                f"{word} goes to a frame, not to axis angles: PTP goes to those", place
            )
        if kind == "ptp" and end.frame == {}:
            raise KrlRunError(
                f"{word} to {RAIL_NAME} alone: {{E6AXIS: {RAIL_NAME} …}} leaves A1 to A6 as they "
                "are, a whole frame says where the tool is",
                place,
            )
        if kind != "ptp":
            self._note_orientation(kind, place)
        blend = next(
            (
                self.blend(child, axis=kind == "ptp")
                for child in tree.children
                if _is(child, "approximation")
            ),
            None,
        )
        payload = payload_of(self._memory.shared.get("$LOAD"), place)
        spline = word.startswith("S")
        return Motion(
            kind,
            end,
            self.speeds(place, spline=spline, axis=kind == "ptp" or spline, path=kind != "ptp"),
            place,
            blend,
            via,
            angle,
            self._keeps_orientation(),
            payload,
            spline,
        )

    def target(self, tree: SyntaxTree, relative: bool, in_tool: bool) -> Target:
        """Where an expression leads to. Raises KrlRunError for what is no position."""
        place = place_of(tree, self._expressions.file)
        if tree.data == "access" and str(tree.children[0]) in STANDING:
            return self.here(str(tree.children[0]), place)
        value = self._expressions.value(tree)
        if isinstance(value, Unknown):
            raise KrlRunError(value.refusal("a motion"), place)
        if not isinstance(value, Structure):
            raise KrlRunError(f"a motion can't go to {kind_of(value)}", place)
        self._check_components(value, relative, place)
        base, tool = self.frames(place)
        name = str(tree.children[0]) if tree.data == "access" else ""
        place_of_rail = rail(value, place) if self._on_rail else None
        frame = components(value, FRAME_NAMES, place)
        rail_alone = place_of_rail is not None and not frame and not is_axis_value(value)

        def target(
            given: dict[str, float] | None,
            frame: dict[str, float] | None = None,
            status: int | None = None,
            turn: int | None = None,
        ) -> Target:
            return Target(
                given,
                frame,
                status,
                turn,
                relative,
                in_tool,
                base,
                tool,
                name,
                self._has_external_tool,
                place_of_rail,
            )

        if is_axis_value(value) or (rail_alone and value.kind == "E6AXIS"):
            return target(axes(value, place))
        if not frame and not rail_alone:
            point = name or "POINT"
            raise KrlRunError(
                f"a motion can't go to {kind_of(value)}: it has neither X, Y, Z nor A1 to A6; "
                f"--set '{point}={{X …,Y …,Z …,A …,B …,C …}}' gives them",
                place,
            )
        for variable in () if relative else ("$TOOL", "$BASE"):
            self._memory.get(((variable, None),), place)  # says what is assumed of it
        status, turn = (  # a relative motion ignores them
            integer(value.fields[part], part, place)
            if part in value.fields and not relative
            else None
            for part in ("S", "T")
        )
        return target(None, frame, status, turn)

    def _check_components(self, value: Structure, relative: bool, place: SourcePlace) -> None:
        """Raise KrlRunError for a component that no position has; note external axes."""
        unknown = next((name for name in value.fields if name not in _COMPONENTS), None)
        if unknown is not None:
            raise KrlRunError(f"{unknown} is no component of a position", place)
        along = next((name for name in value.fields if name in FRAME_NAMES), None)
        if along is not None and is_axis_value(value):
            text = f"a position has axis angles or a frame, not both: leave out {along} or A1 to A6"
            raise KrlRunError(text, place)
        modelled = (RAIL_NAME,) if self._on_rail else ()
        others = tuple(name for name in EXTERNAL_NAMES if name not in modelled)
        for name, at in components(value, others, place).items():
            before = self._external.get(name, 0.0 if relative else at)
            now = before + at if relative else at
            self._external[name] = now
            if abs(now - before) > _STANDS:
                self._noted(
                    place,
                    f"{name} moves from {before:g} to {now:g}: external axes aren't modelled, the "
                    "arm alone is driven",
                    Effect.PLACES,
                )
            elif now != 0.0:
                text = f"{name} stays at {now:g}: external axes are taken as part of the cell"
                self._noted(place, text, Effect.PLACES)

    def here(self, name: str, place: SourcePlace) -> Target:
        """Where the robot stands: PTP $AXIS_ACT, as programs begin; what stands for another place
        of the path is taken as that, which is said.
        """
        if name.endswith(("_RET", "_BACK", "_FOR")):
            text = f"{name} is known on the controller only: taken as where the robot stands"
            self._noted(place, text, Effect.PLACES)
        if name.startswith("$AXIS"):
            axis: dict[str, float] | None = {"A1": 0.0}
            frame = None
        else:
            axis = None
            frame = dict.fromkeys(FRAME_NAMES[:3], 0.0)
        base, tool = self.frames(place)
        return Target(
            axis, frame, None, None, True, False, base, tool, name, self._has_external_tool
        )

    @property
    def _has_external_tool(self) -> bool:
        return self._memory.peek("$IPO_MODE") == Symbol("TCP")

    def frames(self, place: SourcePlace) -> tuple[FloatArray, FloatArray]:
        """$BASE and $TOOL as poses (4, 4) [m]."""
        found = ((name, self._memory.peek(name)) for name in ("$BASE", "$TOOL"))
        base, tool = (pose(Structure({}) if one is None else one, n, place) for n, one in found)
        return base, tool

    def speeds(self, place: SourcePlace, *, spline: bool, axis: bool, path: bool) -> Speeds:
        """How fast the system variables say, of a motion of the `spline` kind or of the other;
        each bounded by what a controller takes. axis: $VEL_AXIS and $ACC_AXIS count, as they don't
        for LIN and CIRC; path: $VEL and $ACC count, as they don't for PTP.
        """
        if path:  # says what is assumed of them
            for variable in ("$VEL", "$ACC"):
                for component in ("CP", "ORI1"):
                    self._memory.get(((variable, None), (component, None)), place)
                held = self._memory.peek(variable)
                fields = held.fields if isinstance(held, Structure) else {}
                if fields.get("ORI2", fields.get("ORI1")) != fields.get("ORI1"):
                    text = f"{variable}.ORI2 isn't {variable}.ORI1: the tool turns by ORI1 all ways"
                    self._noted(place, text, Effect.SPEEDS)
        velocity, acceleration = (
            tuple(self._share(name, (j,), place) if axis else 1.0 for j in range(1, AXES + 1))
            for name in ("$VEL_AXIS", "$ACC_AXIS")
        )
        jerk, turning_jerk, axis_jerk = self._jerks(place) if spline else _ALL_JERK
        return Speeds(
            velocity,
            acceleration,
            self._positive("$VEL", "CP", place),
            self._positive("$ACC", "CP", place),
            math.radians(self._positive("$VEL", "ORI1", place)),
            math.radians(self._positive("$ACC", "ORI1", place)),
            self._share("$OV_PRO", None, place),
            jerk,
            turning_jerk,
            axis_jerk,
            external_velocity=self._external_share("$VEL_EXTAX", place),
            external_acceleration=self._external_share("$ACC_EXTAX", place),
        )

    def _external_share(self, name: str, place: SourcePlace) -> float:
        """What a system variable leaves of a rail's speed or acceleration."""
        return self._share(name, (int(RAIL_NAME[1:]),), place) if self._on_rail else 1.0

    def _jerks(self, place: SourcePlace) -> tuple[float, float, tuple[float, ...]]:
        """$JERK.CP [m/s^3], $JERK.ORI [rad/s^3], inf where none is set, and what $GEAR_JERK leaves
        of the axes' jerk: all of it from the percentage that controllers are delivered with.
        """
        given = self._memory.peek("$JERK")
        fields = given.fields if isinstance(given, Structure) else {}
        path, turning = (
            math.inf
            if isinstance(fields.get(name, Unknown(name)), Unknown)
            else self._positive("$JERK", name, place)
            for name in ("CP", "ORI")
        )
        if isinstance(fields.get("AX"), Structure):
            text = "$JERK.AX isn't modelled: the axes' jerk is that of the robot data"
            self._noted(place, text, Effect.SPEEDS)
        full = number(DEFAULTS["DEF_GEAR_JERK"], "DEF_GEAR_JERK", place) / FULL
        axis = tuple(self._gear_jerk(j, full, place) for j in range(1, AXES + 1))
        return path, math.radians(turning), axis

    def _gear_jerk(self, axis: int, full: float, place: SourcePlace) -> float:
        """Of an axis' jerk, the share that $GEAR_JERK leaves; all where nobody says it."""
        value = self._memory.peek("$GEAR_JERK", axis)
        if value is None or isinstance(value, Unknown):
            return 1.0
        return min(self._share("$GEAR_JERK", (axis,), place) / full, 1.0)

    def blend(self, tree: SyntaxTree, *, axis: bool) -> Blend | None:
        """Approximate positioning as the words of `tree` ask for it, of an axis motion or of one of
        the tool; None without a word.
        """
        words = [str(word) for word in tree.children]
        if not words:
            return None
        place = place_of(tree, self._expressions.file)
        found = self._blend(words[0], axis=axis, place=place)
        if words[0] != "C_PTP":
            return found
        onto = words[1] if len(words) > 1 else "C_DIS"
        return replace(found, onto=self._blend(onto, axis=False, place=place))

    def _blend(self, how: str, *, axis: bool, place: SourcePlace) -> Blend:
        """What one word asks for."""
        amount = max(self._number("$APO", _BLEND_WORDS[how], place), 0.0)
        if how in ("C_ORI", "C_VEL"):
            text = f"{how} is driven as a share or a distance of the same figure"
            self._noted(place, text, Effect.SPEEDS)
        if how in ("C_PTP", "C_VEL"):
            return Blend(how, math.inf, min(amount, FULL) / FULL)
        share = 1.0
        if how == "C_SPL" and axis:
            share = min(max(self._number("$APO", "CPTP", place), 0.0), FULL) / FULL
        return Blend(how, amount * _MM, share)

    def _note_orientation(self, kind: Kind, place: SourcePlace) -> None:
        """Note where the tool turns otherwise than evenly in the base."""
        orientation = self._memory.peek("$ORI_TYPE")
        if orientation not in (None, Symbol("VAR"), Symbol("CONSTANT")):
            text = f"$ORI_TYPE {kind_of(orientation)}: the tool is turned evenly instead"
            self._noted(place, text, Effect.PLACES)
        circle = self._memory.peek("$CIRC_TYPE")
        if kind == "circ" and circle not in (None, Symbol("BASE")):
            text = f"$CIRC_TYPE {kind_of(circle)}: the tool is turned evenly in the base instead"
            self._noted(place, text, Effect.PLACES)

    def _keeps_orientation(self) -> bool:
        return self._memory.shared.get("$ORI_TYPE") == Symbol("CONSTANT")

    def _number(self, variable: str, component: str, place: SourcePlace) -> float:
        value = self._memory.get(((variable, None), (component, None)), place)
        return number(value, f"{variable}.{component}", place)

    def _positive(self, variable: str, component: str, place: SourcePlace) -> float:
        """A component of a system variable: above 0, and at most what its _MA allows."""
        held = self._memory.peek(variable)
        fields = held.fields if isinstance(held, Structure) else {}
        written = f"{variable}.{component}"
        value = number(fields.get(component, Unknown(written)), written, place)
        if value <= 0.0:
            raise KrlRunError(f"{variable}.{component} is {value:g}; it must be above 0", place)
        if value < _SLOWEST:
            raise KrlRunError(
                f"{variable}.{component} is {value:g}; it must be at least {_SLOWEST:g}", place
            )
        most = self._memory.peek(f"{variable}_MA")
        bound = most.fields.get(component) if isinstance(most, Structure) else None
        if isinstance(bound, int | float) and value > bound:
            text = (
                f"{variable}.{component} is {value:g}, above {variable}_MA.{component} {bound:g}: "
                f"a controller stops there (value invalid), driven as {bound:g}; "
                f"--set '{variable}_MA.{component}=…'"
            )
            self._noted(place, text, Effect.MOTIONS)
            return float(bound)
        return value

    def _share(self, name: str, index: tuple[int, ...] | None, place: SourcePlace) -> float:
        value = number(self._memory.get(((name, index),), place), name, place)
        if not 0.0 < value <= FULL:
            raise KrlRunError(f"{name} is {value:g} %; it must be above 0 and at most 100 %", place)
        if value < _SLOWEST:
            raise KrlRunError(f"{name} is {value:g} %; it must be at least {_SLOWEST:g} %", place)
        return value / FULL


def payload_of(value: Value | None, place: SourcePlace) -> Payload | None:
    """What a LOAD says; None where it has no mass. Raises KrlRunError."""
    if not isinstance(value, Structure) or "M" not in value.fields:
        return None
    centre = _part_of(value, "CM")
    inertia = _part_of(value, "J")
    x, y, z, a, b, c = (_given(centre, name, place) for name in FRAME_NAMES)
    jx, jy, jz = (_given(inertia, name, place) for name in FRAME_NAMES[:3])
    mass = number(value.fields["M"], "M", place)
    return Payload(mass, (_MM * x, _MM * y, _MM * z), (a, b, c), (jx, jy, jz))


def _part_of(value: Structure, name: str) -> Structure:
    found = value.fields.get(name)
    return found if isinstance(found, Structure) else Structure({})


def _given(value: Structure, name: str, place: SourcePlace) -> float:
    return number(value.fields.get(name, 0.0), name, place)


_OTHERS = ("settings", "approximation")


def _is(child: object, data: str) -> bool:
    return isinstance(child, SyntaxTree) and child.data == data


# Motions and spline blocks as statements, with what triggers do meanwhile and what stands after
# WITH.

_Built = TypeVar("_Built", Motion, SplineBlock)
_MS = 1e-3  # s


@dataclass(frozen=True, eq=False)
class _Trigger:
    """A TRIGGER that waits for its motion; its action is a statement of `file`."""

    switch: Switch
    action: SyntaxTree
    file: str

    def of_part(self, part: int) -> _Trigger:
        """The trigger at a part of a spline."""
        return replace(self, switch=replace(self.switch, part=part))

    def behind(self) -> _Trigger:
        """The trigger whose motion stands before it among the commands."""
        return replace(self, switch=replace(self.switch, ahead=False))


def _ahead(output: SetOutput) -> SetOutput:
    assert output.switch is not None  # a TRIGGER sets it
    return replace(output, switch=replace(output.switch, ahead=True))


class Moving(Assigning):
    """Runs motions; what they are is built by `_motions`."""

    _motions: Motions
    standing: Standing
    _triggers: list[_Trigger]
    _part: int = 0  # of the spline that is built: a TRIGGER is of the part that follows

    def _trigger(self, tree: SyntaxTree) -> None:
        when, where, from_start, delay, action, priority = tree.children
        at = self.expressions.number(where, str(when))
        if str(when) not in ("PATH", "DISTANCE"):
            raise KrlRunError(f"TRIGGER WHEN {when}: PATH and DISTANCE are read", self.place(tree))
        if str(when) == "DISTANCE" and at not in (0.0, 1.0):
            raise KrlRunError(
                f"TRIGGER WHEN DISTANCE={at:g}: 0 is the start of a motion, 1 its end",
                self.place(tree),
            )
        along = str(when) == "PATH"
        begins = from_start is not None if along else at == 0.0
        seconds = _MS * self.expressions.number(delay, "DELAY")
        switch = Switch(begins, begins, _MM * at if along else None, seconds, self._part)
        self._triggers.append(_Trigger(switch, action, self.expressions.file))
        if priority is not None and action.data == "call":
            level = self.expressions.number(priority, "PRIO")
            text = (
                f"{action.children[0]} runs as an interrupt of priority {level:g}, as a TRIGGER "
                "asks for: the robot goes on"
            )
            self.note(tree, text)

    def without_motion(self) -> None:
        """Note the triggers behind which no motion stands."""
        for one in self._triggers:
            place = place_of(one.action, one.file)
            self.note_at(place, "a TRIGGER with no motion behind it: it never acts")

    def _ptp(self, tree: SyntaxTree) -> None:
        if self._not_beside(tree):
            return
        due = self._triggers
        self._triggers = []
        self._act(one for one in due if one.switch.ahead)
        built = self._with_settings(tree, lambda: self._motions.motion(tree))
        self._begins(tree, built.target)
        self.commands.append(self._in_advance(built))
        self.memory.moved()
        self._signals.moved()
        self._act(one for one in due if not one.switch.ahead)

    def _begins(self, tree: SyntaxTree, target: Target) -> None:
        """Note a motion that goes from where the robot stands before anything says where."""
        if target.relative and not self.standing.moved:
            name = target.name or "a relative motion"
            text = f"{name} is the first motion: the robot stands in the cell's home"
            self.note(tree, text, Effect.PLACES)

    def _not_beside(self, tree: SyntaxTree) -> bool:
        """Whether a motion stands in what a TRIGGER calls: a controller doesn't take it there."""
        if self._is_beside:
            text = "a motion in what a TRIGGER calls: a controller refuses it, it isn't driven"
            self.note(tree, text, Effect.MOTIONS)
        return self._is_beside

    def _in_advance(self, built: _Built) -> _Built:
        """A motion as far as it is known in advance: $ADVANCE=0 rounds no corner."""
        if self.memory.peek("$ADVANCE") != 0:
            return built
        self.continuing = False
        self.stop(built.place, "$ADVANCE=0")
        if built.blend is not None:
            self.note_at(built.place, f"$ADVANCE=0: {built.blend.how} has no effect")
        return replace(built, blend=None)

    def _act(self, due: Iterable[_Trigger]) -> None:
        """What triggers do while the robot moves."""
        here = self.expressions.file
        for one in due:
            self.continuing = True
            self.triggered = one.switch
            self._at(one.file)
            getattr(self, f"_{one.action.data}")(one.action)
        self._at(here)
        self.continuing = False
        self.triggered = None

    _lin = _circ = _ptp

    def _spline_block(self, tree: SyntaxTree) -> None:
        """A block with its triggers: what they switch on first counts from its start, the rest from
        its end, so that no part of a process is taken for positioning.
        """
        if self._not_beside(tree):
            return
        due = self._triggers
        self._triggers = []
        block = self._in_advance(self._with_settings(tree, lambda: self._block(tree)))
        inside = self._triggers
        self._triggers = []
        last = len(block.parts) - 1
        due = [one.of_part(0 if one.switch.from_start else last) for one in due]
        inside = [one.of_part(min(one.switch.part, last)) for one in inside]
        self._act(one for one in due if one.switch.ahead)
        before = len(self.commands)
        self._act(one.behind() for one in inside)
        made = [one for one in self.commands[before:] if isinstance(one, SetOutput)]
        self.commands[before:] = []
        first = {one.number: one for one in reversed(made)}
        early = [one for one in first.values() if one.value]
        late = [one for one in made if one not in early]
        self.commands += [_ahead(one) for one in reversed(early)]
        self.commands += [block, *late]
        self.memory.moved()
        self._signals.moved()
        self._act(one for one in due if not one.switch.ahead)

    def _with_settings(self, tree: SyntaxTree, build: Callable[[], _Built]) -> _Built:
        """Build with what stands after WITH; it holds for this motion only."""
        settings = next(
            child
            for child in tree.children
            if isinstance(child, SyntaxTree) and child.data == "settings"
        )
        assignments = [one for one in settings.children if one is not None]
        if not assignments:
            return build()
        shared = self.memory.shared
        names = MODELLED | HARMLESS | {str(one.children[0].children[0]) for one in assignments}
        before = {name: copied(shared[name]) for name in names if name in shared}
        assumed = dict(self.memory.assumed)
        for assignment in assignments:
            self._assignment(assignment)
        built = build()
        for name in names.difference(before):
            shared.pop(name, None)
        shared.update(before)
        self.memory.assumed = assumed
        return built

    def _block(self, tree: SyntaxTree) -> SplineBlock:
        """The motions of a SPLINE block, with its TIME_BLOCKs."""
        word, _, *parts, approximation = tree.children
        motions: list[Motion] = []
        times: list[TimeBlock] = []
        start: int | None = None
        marks: list[tuple[int, float]] = []
        for part in parts:
            match part.data:
                case "time_start":
                    start = len(motions)
                    marks = []
                case "time_part":
                    marks.append(
                        (len(motions), self.expressions.number(part.children[0], "TIME_BLOCK PART"))
                    )
                case "time_end":
                    seconds = self.expressions.number(part.children[0], "TIME_BLOCK END")
                    if start is None or seconds <= 0.0 or start == len(motions):
                        raise KrlRunError(
                            "TIME_BLOCK END needs a START, motions and a time above 0 s",
                            self.place(part),
                        )
                    times.append(
                        TimeBlock(start, len(motions), tuple(marks), seconds, self.place(part))
                    )
                    start = None
                case "assignment" | "trigger" | "const_vel" | "stop_when":
                    getattr(self, f"_{part.data}")(part)
                case _:
                    motions.append(self._with_settings(part, partial(self._motions.motion, part)))
            self._part = len(motions)
        self._part = 0
        if not motions:
            raise KrlRunError("a spline block without motions", self.place(tree))
        axis = str(word) == "PTP_SPLINE"
        blend = self._motions.blend(approximation, axis=axis)
        return SplineBlock(axis, tuple(motions), tuple(times), self.place(tree), blend)
