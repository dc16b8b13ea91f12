"""Execution of a program statement by statement, to the list of its commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from ir_krl.errors import KrlMotionError, KrlRunError, SourcePlace
from ir_krl.language import Parameter, Routine, SourceFile, SyntaxTree, place_of
from ir_krl.run.built_in import COMPUTED, CONTROLLERS, FILLING, STOPPING, Library
from ir_krl.run.commands import Command
from ir_krl.run.control_flow import Endless, Jump, LoopExit, Returned
from ir_krl.run.expressions import Expressions
from ir_krl.run.memory import Memory, module_of
from ir_krl.run.motions import Motions, Moving
from ir_krl.run.notes import Effect, Note, worst_first
from ir_krl.run.signals import SignalRange, Signals
from ir_krl.run.standing import AXES_NOW, PLACE_NOW, Kinematics, Standing
from ir_krl.run.system import AXES, Assumption, assumed_variables, form_age, system_variables
from ir_krl.run.texts import TEXT_FUNCTIONS, text_value
from ir_krl.run.values import TYPES, Array, Unknown, Value, copied, typed
from ir_values.arrays import FloatArray

# Routines of several files: those of the same file come first, as on the controller.


class Routines:
    """All routines of the sources. Raises KrlRunError where a file has two of one name."""

    def __init__(self, sources: Sequence[SourceFile]) -> None:
        self._found: dict[str, list[Routine]] = {}
        self._leading = {source.routines[0] for source in sources if source.routines}
        for source in sources:
            for one in source.routines:
                others = self._found.setdefault(one.name, [])
                if any(other.file == one.file for other in others):
                    raise KrlRunError(
                        f"{one.name} is defined twice: rename one", place_of(one.body, one.file)
                    )
                others.insert(0 if one in self._leading else len(others), one)

    @property
    def names(self) -> list[str]:
        """In the order in which they are defined."""
        return list(self._found)

    def named(self, name: str, file: str = "") -> Routine | None:
        """The routine that a call in `file` means: its own, one that begins a file, a GLOBAL one.
        Raises KrlRunError where two files begin with one of this name.
        """
        there = self._found.get(name, [])
        own = next((one for one in there if one.file == file), None)
        if own is not None or not there:
            return own
        leading = [one for one in there if one in self._leading]
        if len(leading) > 1:
            files = " and ".join(one.file for one in leading[:2])
            raise KrlRunError(f"{name} is defined twice, in {files}: give one of them")
        return next(iter([*leading, *(one for one in there if one.everywhere)]), None)


# Follows a program statement by statement; what reaches the controller is the list of its
# commands.

GLOBAL = "GLOBAL"
CONFIGURATION = "$CONFIG"
BACKGROUND = ".sub"
"""Files of programs that the submit interpreter runs beside the robot's."""
NESTED = "brackets, signs or blocks are nested too deeply"
_UNMODELLED = {
    "analog": "an analog signal",
    "channel": "CHANNEL",
    "confirm": "CONFIRM",
    "error_proceed": "ON_ERROR_PROCEED",
    "import": "IMPORT",
}
DEPTH_MAX = 60
"""Calls within calls."""


@dataclass(frozen=True)
class UnknownRoutine:
    """A routine that is in no file: how many arguments it is called with, whether its value is
    used.
    """

    name: str
    arguments: int
    function: bool


@dataclass(frozen=True)
class Followed:
    """What a program does: its name, the commands in their order, what was assumed, the worst
    first, what its SIGNAL declarations name, and routines that it calls and nobody gave.
    """

    name: str
    commands: tuple[Command, ...]
    notes: tuple[Note, ...]
    signals: Mapping[str, SignalRange] = field(default_factory=dict)
    unknown: tuple[UnknownRoutine, ...] = ()


def follow(
    sources: Sequence[SourceFile],
    home: FloatArray,
    tool: FloatArray,
    *,
    routine: str = "",
    inputs: Mapping[int, bool] | None = None,
    loop_passes: int = 1,
    settings: Sequence[SourceFile] = (),
    kinematics: Kinematics | None = None,
) -> Followed:
    """Run `routine` (the first of the sources where "") without moving anything.

    home (6,) [rad] is XHOME, of a robot on a rail E1 [m] first; tool (4, 4) [m] stands for tools
    whose data the program doesn't bring.
    inputs: what $IN[n] reads, FALSE where nothing is said. A loop that nothing known ends is run
    `loop_passes` times. settings: data lists whose values count more than those of the sources
    (`settings_of`). kinematics: of the robot, without it a program that computes with the place
    where it stands may be refused. Raises KrlRunError with the place.
    """
    routines = Routines(sources)
    leading = [one for source in sources for one in source.routines]
    name = routine.upper() or (leading[0].name if leading else "")
    first = routines.named(name, leading[0].file if leading else "")
    if first is None:
        there = ", ".join(routines.names[:8]) or "none"
        raise KrlRunError(f"there is no routine {name or 'at all'}; routines: {there}")
    forms = form_age({one for source in sources for one in source.versions})
    memory = Memory(system_variables(home, tool, forms), assumed=assumed_variables(forms))
    for source in sources:
        for body in (*source.data, *(one.body for one in source.routines)):
            memory.types |= _structures(body)
    on_rail = len(home) > AXES
    run = _Run(routines, memory, dict(inputs or {}), loop_passes, on_rail=on_rail)
    run.standing = Standing(run.commands, home, kinematics)
    try:
        for source in sources:
            for body in source.data:
                run.data(body, source.file, lenient=module_of(source.file) != module_of(first.file))
        run.background([one for one in sources if one.file.lower().endswith(BACKGROUND)])
        for source in settings:
            for body in source.data:
                run.settings(body, source.file)
        run.routine(first, [], SourcePlace(first.file))
        run.without_motion()
    except Endless:
        pass  # a note says so
    except RecursionError:
        raise KrlRunError(NESTED, SourcePlace(run.expressions.file)) from None
    run.name_delivered()
    notes = worst_first(run.notes)
    return Followed(name, tuple(run.commands), notes, run.signals, tuple(run.unknown.values()))


def data_of(source: SourceFile) -> dict[str, Value]:
    """What the data lists of a file give values to, as those of $config.dat; what can't be read of
    them is left out.
    """
    memory = Memory({}, types=dict(TYPES))
    for body in source.data:
        memory.types |= _structures(body)
    run = _Run(Routines([source]), memory, {}, 1)
    for body in source.data:
        run.data(body, source.file, lenient=True)
    return {
        name: value
        for one in (*memory.modules.values(), memory.shared)
        for name, value in one.items()
    }


def _structures(body: SyntaxTree) -> dict[str, dict[str, str]]:
    """The types that STRUC declares in a body: what their components are."""
    found: dict[str, dict[str, str]] = {}
    for statement in body.children:
        if statement.data != "structure":
            continue
        name, *members = (one for one in statement.children if one != GLOBAL)
        kind = ""
        for member in members:
            *own, component, _ = member.children
            kind = str(own[0]) if own else kind
            found.setdefault(str(name), {})[str(component)] = kind
    return found


def _assigned(tree: SyntaxTree) -> set[str]:
    """Names of the variables that a body sets, those of the system apart."""
    if tree.data == "assignment":
        name = str(tree.children[0].children[0])
        return set() if name.startswith("$") else {name}
    return {name for one in tree.children if isinstance(one, SyntaxTree) for name in _assigned(one)}


class _Run(Moving):
    """Calls, declarations and motions, beside the control structures."""

    def __init__(
        self,
        routines: Routines,
        memory: Memory,
        inputs: dict[int, bool],
        loop_passes: int,
        *,
        on_rail: bool = False,
    ) -> None:
        super().__init__(memory, loop_passes)
        memory.noted = self.note_at
        self._routines = routines
        self._library = Library(memory)
        self._signals = Signals(memory, inputs, self.note_at, self._stopped)
        self._running: list[Routine] = []
        self.unknown: dict[str, UnknownRoutine] = {}
        self._calling = False  # a call as a statement begins
        self.expressions = Expressions(memory, self._signals, self._called)
        self._motions = Motions(self.expressions, memory, self.note_at, on_rail=on_rail)
        self._triggers = []

    @property
    def signals(self) -> dict[str, SignalRange]:
        """What SIGNAL declarations name."""
        return self._signals.named

    def data(self, body: SyntaxTree, file: str, *, lenient: bool = False) -> None:
        """Declarations and values of a data list; lenient: what can't be read of it is noted."""
        self._at(file)
        if not lenient:
            self.body(body)
            return
        for statement in body.children:
            try:
                self._statement(statement)
            except KrlRunError as error:
                self.note_at(error.place, f"left out: {error.reason}", Effect.PLACES)

    def settings(self, body: SyntaxTree, file: str) -> None:
        """Values that count more than those of the data lists."""
        self._at(file)
        for statement in body.children:
            if statement.data != "assignment":
                raise KrlRunError("a setting is NAME=VALUE", self.place(statement))
            (name, index), *rest = self.expressions.path(statement.children[0])
            if index is None and not rest:
                self.memory.shared.setdefault(name, Unknown(name))  # known everywhere
            for module in [one for one, held in self.memory.modules.items() if name in held]:
                self.memory.module = module
                self._statement(statement)
            self._at(file)
            self._statement(statement)
            whole = self.memory.get(((name, None),), self.place(statement))
            self.memory.settings[name] = copied(whole)

    def name_delivered(self) -> None:
        """Note the figures of $config.dat that were used as controllers are delivered."""
        said = self.memory.delivered
        if said:
            named = ", ".join(said)
            text = f"of $config.dat, not in the files, as delivered: {named}; --set 'NAME=…'"
            self.note_at(next(iter(said.values())), text, Effect.SPEEDS)

    def background(self, sources: Sequence[SourceFile]) -> None:
        """What programs beside this one set is known as it stands at the start, and assumed."""
        for source in sources:
            for name in {name for one in source.routines for name in _assigned(one.body)}:
                text = f"{name} is set by {source.file}: taken as it is at the start"
                if self.memory.valued(name):
                    self.memory.assumed.setdefault(name, Assumption(text, Effect.MOTIONS))

    def _stopped(self, place: SourcePlace, name: str) -> None:
        """What stops the advance run is read: where the robot stands is known then."""
        self.stop(place, name)
        memory = self.memory
        if name in (*AXES_NOW, *PLACE_NOW) and not self.standing.moved:
            memory.guesses += 1
            text = f"{name} is read before the first motion: the robot stands in the cell's home"
            self.note_at(place, text, Effect.PLACES)
        if name in AXES_NOW:
            memory.hold(name, self.standing.axes())
        elif name in PLACE_NOW:
            memory.hold(name, self.standing.place(self._motions.here(name, place)))

    def routine(self, routine: Routine, arguments: list[Value | None], place: SourcePlace) -> Value:
        """Run a routine; the value of its RETURN, 0 without one. OUT parameters are read by the
        caller.
        """
        if len(self.memory.scopes) >= DEPTH_MAX:
            raise KrlRunError(
                f"{routine.name} is the {DEPTH_MAX}th call within calls: give what ends them by "
                "--set",
                place,
            )
        if len(arguments) > len(routine.parameters):
            raise KrlRunError(
                f"{routine.name} takes {len(routine.parameters)} arguments, {len(arguments)} are "
                "given: leave out the others",
                place,
            )
        if self._running.count(routine) >= self.loop_passes and not routine.parameters:
            self._left(place, f"{routine.name} calls itself", self.loop_passes)
            raise Endless
        before = self.expressions.file
        named = zip(routine.parameters, arguments, strict=False)
        given = {one.name: copied(value) for one, value in named if value is not None}
        self.memory.enter(given, (one.name for one in routine.parameters))
        self._at(routine.file)
        self._running.append(routine)
        try:
            self.body(routine.body)
        except Returned as returned:
            value = 0 if returned.value is None else returned.value
            return typed(routine.result, value, self.memory.types)
        except LoopExit:
            raise KrlRunError(
                "EXIT stands outside of a loop: RETURN leaves a routine",
                place_of(routine.body, routine.file),
            ) from None
        except Jump as jump:
            raise KrlRunError(
                f"there is no label {jump.label} around GOTO: put it in {routine.name}, outside of "
                "loops and branches",
                jump.place,
            ) from None
        finally:
            self._running.pop()
            self._at(before)
        return 0

    # names and values

    def _declare(self, tree: SyntaxTree) -> None:
        everywhere = GLOBAL in tree.children or self.memory.module == CONFIGURATION
        kind, *declarators = (one for one in tree.children if one != GLOBAL)
        for declarator in declarators:
            name, index, expression = declarator.children
            value: Value | None = None
            if index is not None:
                value = Array(kind=str(kind), sizes=self._sizes(index))
            if expression is not None:
                value = copied(self.expressions.value(expression))
            self.memory.declare(str(name), value, str(kind), everywhere)

    def _sizes(self, index: SyntaxTree) -> tuple[int, ...]:
        """How many elements an array has in each direction; () where that isn't known."""
        values = [self.expressions.value(one) for one in index.children if one is not None]
        known = tuple(one for one in values if isinstance(one, int))
        return known if len(known) == len(values) else ()

    def _structure(self, tree: SyntaxTree) -> None:
        """Types are known before the program runs."""

    _enumeration = _external = _structure

    def _unmodelled(self, tree: SyntaxTree) -> None:
        """A statement that moves nothing and isn't modelled."""
        what = _UNMODELLED[tree.data]
        self.note(tree, f"{what} isn't modelled: no motion assumed", Effect.NONE)

    def _analog(self, tree: SyntaxTree) -> None:
        """ANIN and ANOUT stop the advance run."""
        self._unmodelled(tree)
        self.stop(self.place(tree), "ANIN or ANOUT")

    _confirm = _error_proceed = _channel = _import = _unmodelled

    def _asynchronous(self, tree: SyntaxTree) -> None:
        self.note(tree, "ASYPTP moves external axes alone: not driven", Effect.PLACES)

    def _signal(self, tree: SyntaxTree) -> None:
        name, first, last = (one for one in tree.children if one != GLOBAL)
        end = None if last is None else self.expressions.path(last)
        self._signals.declare(str(name), self.expressions.path(first), end, self.place(tree))

    # calls

    def _call(self, tree: SyntaxTree) -> None:
        name, *arguments = tree.children
        self._calling = True  # as a statement: no value is used
        self._called(str(name), arguments, self.place(tree))

    def _called(self, name: str, arguments: list[Any], place: SourcePlace) -> Value:
        statement = self._calling
        self._calling = False
        trees = [one.children[0] for one in arguments if one is not None]
        if trees == [None]:  # ROUTINE()
            trees = []
        try:
            routine = self._routines.named(name, self.expressions.file)
        except KrlRunError as error:
            raise KrlRunError(error.reason, place) from None
        controllers = routine is not None and module_of(routine.file) in CONTROLLERS
        if (routine is None or controllers) and self._is_built_in(name):
            return self._built_in(name, trees, place)
        if controllers:
            return self.memory.shared.get(name, Unknown(name))  # of messages and the like
        if routine is None:
            value = self._unknown(name, len(trees), place, function=not statement)
            self._may_change(name, trees)
            return value
        return self._run_routine(routine, trees, place)

    def _is_built_in(self, name: str) -> bool:
        own = TEXT_FUNCTIONS | COMPUTED.keys() | {"PULSE"}
        return name in own or self._library.has(name)

    def _built_in(self, name: str, trees: list[Any], place: SourcePlace) -> Value:
        """What a routine of every controller does."""
        if name == "PULSE":
            return self._pulse(trees, place)
        if name in TEXT_FUNCTIONS:
            return text_value(name, trees, self.expressions, place)
        if name in COMPUTED:
            return self._computed(name, trees, place)
        if name in STOPPING:
            self.stop(place, name)
        if name in FILLING:
            self._may_change(name, trees)
        values = [None if one is None else self.expressions.value(one) for one in trees]
        return self._library.call(name, values, place)

    def _run_routine(self, routine: Routine, trees: list[Any], place: SourcePlace) -> Value:
        """A routine of the files with its arguments; those that come back are set."""
        values = [
            None if one is None else self._argument(one, k, routine) for k, one in enumerate(trees)
        ]
        result = self.routine(routine, values, place)
        left = self.memory.leave()
        for parameter, tree in zip(routine.parameters, trees, strict=False):
            value = left.get(parameter.name, Unknown(parameter.name))
            back = parameter.out and tree is not None and tree.data == "access"
            if back and not isinstance(value, Unknown):
                self._given_back(routine, parameter, tree, value, place)
        return result

    def _given_back(
        self,
        routine: Routine,
        parameter: Parameter,
        tree: SyntaxTree,
        value: Value,
        place: SourcePlace,
    ) -> None:
        """The value of a parameter that is one of the caller's variables."""
        path = self.expressions.path(tree)
        if not parameter.directed and self.memory.get(path, place) != value:
            text = f"{parameter.name} of {routine.name} has neither :IN nor :OUT: taken as :OUT"
            self.note_at(place, text, Effect.MOTIONS)
        self.memory.set(path, value, place)

    def _unknown(self, name: str, arguments: int, place: SourcePlace, *, function: bool) -> Value:
        """A routine that nobody gave: it moves nothing, and the advance run stops at it. Its value
        must be set where one is used.
        """
        held = self.unknown.get(name)
        most = max(arguments, held.arguments if held else 0)
        used = function or (held is not None and held.function)
        self.unknown[name] = UnknownRoutine(name, most, used)
        text = (
            f"{name} isn't in the files: no motion and a stop of the advance run assumed (--stub)"
        )
        self.note_at(place, text, Effect.MOTIONS)
        self.stop(place, name, assumed=True)
        return self.memory.shared.get(name, Unknown(name))

    def _may_change(self, name: str, trees: Sequence[Any]) -> None:
        """Variables that a routine which isn't followed is given."""
        for tree in trees:
            variable = str(tree.children[0]) if tree is not None and tree.data == "access" else "$"
            if not variable.startswith("$") and self.memory.has(variable):
                self.memory.may_change(variable, name)

    def _computed(self, name: str, trees: list[Any], place: SourcePlace) -> Value:
        """The value of FORWARD (a pose [mm, deg] of axes [deg, mm]) or INVERSE (axes of a pose), by
        the robot's kinematics with the tool and base that are valid at this place of the program.
        Their last argument becomes 0, or 1 where there is no solution, and the value is unknown.
        """
        if len(trees) != COMPUTED[name] or any(one is None for one in trees):
            raise KrlRunError(
                f"{name} takes {COMPUTED[name]} arguments, {len(trees)} are given", place
            )
        try:
            if name == "FORWARD":
                frames = self._motions.here(PLACE_NOW[0], place)
                value = self.standing.forward(self.expressions.value(trees[0]), frames, place)
            else:
                target = self._motions.target(trees[0], False, False)
                start = self.expressions.value(trees[1])
                value = self.standing.inverse(target, start, place)
            failed = 0
            if value is None:
                text = f"{name} needs a robot: what it gives is unknown"
                self.note_at(place, text, Effect.MOTIONS)
        except KrlMotionError as error:
            self.note_at(place, f"{name}: {error.reason}: 1 as an error", Effect.MOTIONS)
            value, failed = None, 1
        if trees[-1].data == "access":
            self.memory.set(self.expressions.path(trees[-1]), failed, place)
        return Unknown(name) if value is None else value

    def _argument(self, tree: SyntaxTree, k: int, routine: Routine) -> Value | None:
        """The value of an argument; one that only comes back needs none."""
        out = k < len(routine.parameters) and routine.parameters[k].out
        if out and tree.data == "access" and not self.memory.has(self.expressions.path(tree)[0][0]):
            return None
        return self.expressions.value(tree)

    def _pulse(self, trees: list[Any], place: SourcePlace) -> Value:
        if len(trees) != 3 or trees[0] is None or trees[0].data != "access":
            raise KrlRunError("PULSE takes an output, its value and a time", place)
        (name, index), *_ = self.expressions.path(trees[0])
        if name != "$OUT" or index is None:
            raise KrlRunError(f"PULSE sets outputs, not {name}", place)
        seconds = self.expressions.number(trees[2], "the time of PULSE")
        level = self.expressions.truth(trees[1], "the value of PULSE")
        self._set_output(index[0], level, place, seconds)
        return 0

    # interrupts

    def _interrupt_declared(self, tree: SyntaxTree) -> None:
        call = tree.children[-1]
        if str(call.children[0]) != "IR_STOPM":
            text = f"the interrupt that calls {call.children[0]} isn't followed"
            self.note(tree, text, Effect.MOTIONS)

    def _interrupt_switched(self, tree: SyntaxTree) -> None:
        """Interrupts aren't followed: their declaration says so."""

    _resume = _interrupt_switched

    def _brake(self, tree: SyntaxTree) -> None:
        if self._is_beside:
            text = "BRAKE in what a TRIGGER calls stops the robot: not followed"
            self.note(tree, text, Effect.MOTIONS)
