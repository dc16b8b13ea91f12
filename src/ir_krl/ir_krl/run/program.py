"""Execution of a program statement by statement, to the list of its commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from ir_krl.errors import KrlRunError, Place
from ir_krl.language import Routine, Source, Tree, place_of
from ir_krl.run.commands import Command
from ir_krl.run.control import LoopExit, Note, Returned
from ir_krl.run.expressions import Expressions
from ir_krl.run.library import Library
from ir_krl.run.memory import Memory, SignalRange, Signals, system_variables
from ir_krl.run.motions import Motions, Moving
from ir_krl.run.values import Array, Value, copied, typed
from ir_msgs_py.arrays import FloatArray

# Routines of several files: those of the same file come first, as on the controller.


def module_of(file: str) -> str:
    """The module that a file belongs to: a .src and its .dat have one."""
    return PurePath(file).stem.upper()


class Routines:
    """All routines of the sources. Raises KrlRunError where a file has two of one name, or two
    files begin with one of the same name, which other files then can't call.
    """

    def __init__(self, sources: Sequence[Source]) -> None:
        self._found: dict[str, list[Routine]] = {}
        leading = {source.routines[0] for source in sources if source.routines}
        for source in sources:
            for one in source.routines:
                others = self._found.setdefault(one.name, [])
                if any(other.file == one.file or {other, one} <= leading for other in others):
                    raise KrlRunError(f"{one.name} is defined twice", place_of(one.body, one.file))
                others.insert(0 if one in leading else len(others), one)

    @property
    def names(self) -> list[str]:
        """In the order in which they are defined."""
        return list(self._found)

    def named(self, name: str, file: str = "") -> Routine | None:
        """The routine that a call in `file` means."""
        there = self._found.get(name, [])
        return next((one for one in there if one.file == file), there[0] if there else None)


# Follows a program statement by statement; what reaches the controller is the list of its
# commands.

GLOBAL = "GLOBAL"
CONFIGURATION = "$CONFIG"
NESTED = "brackets, signs or blocks are nested too deeply"
DEPTH_MAX = 60
"""Calls within calls."""


@dataclass(frozen=True)
class Followed:
    """What a program does: its name, the commands in their order, what was assumed, and what its
    SIGNAL declarations name.
    """

    name: str
    commands: tuple[Command, ...]
    notes: tuple[Note, ...]
    signals: Mapping[str, SignalRange] = field(default_factory=dict)


def follow(
    sources: Sequence[Source],
    home: FloatArray,
    tool: FloatArray,
    *,
    routine: str = "",
    inputs: Mapping[int, bool] | None = None,
    loop_passes: int = 1,
) -> Followed:
    """Run `routine` (the first of the sources where "") without moving anything.

    home (6,) [rad] is XHOME; tool (4, 4) [m] stands for tools whose data the program doesn't bring.
    inputs: what $IN[n] reads; one that isn't given and decides something is an error. A LOOP
    without EXIT is run `loop_passes` times. Raises KrlRunError with the place.
    """
    routines = Routines(sources)
    name = routine.upper() or next(iter(routines.names), "")
    first = routines.named(name)
    if first is None:
        there = ", ".join(routines.names[:8]) or "none"
        raise KrlRunError(f"there is no routine {name or 'at all'}; routines: {there}")
    run = _Run(routines, Memory(system_variables(home, tool)), dict(inputs or {}), loop_passes)
    try:
        for source in sources:
            for body in source.data:
                run.data(body, source.file)
        run.routine(first, [], Place(first.file))
    except RecursionError:
        raise KrlRunError(NESTED, Place(run.expressions.file)) from None
    return Followed(name, tuple(run.commands), tuple(run.notes), run.signals)


class _Run(Moving):
    """Calls, declarations and motions, beside the control structures."""

    def __init__(
        self, routines: Routines, memory: Memory, inputs: dict[int, bool], loop_passes: int
    ) -> None:
        super().__init__(memory, loop_passes)
        self._routines = routines
        self._library = Library(memory)
        self._signals = Signals(memory, inputs, self.note_at)
        self.expressions = Expressions(memory, self._signals, self._called)
        self._motions = Motions(self.expressions, memory, self.note_at)
        self._triggers: list[tuple[float, Tree]] = []

    @property
    def signals(self) -> dict[str, SignalRange]:
        """What SIGNAL declarations name."""
        return self._signals.named

    def data(self, body: Tree, file: str) -> None:
        """Declarations and values of a data list."""
        self._at(file)
        self.body(body)

    def _at(self, file: str) -> None:
        """Statements of this file run from here on."""
        self.expressions.file = file
        self.memory.module = module_of(file)

    def routine(self, routine: Routine, arguments: list[Value | None], place: Place) -> Value:
        """Run a routine; the value of its RETURN, 0 without one. OUT parameters are read by the
        caller.
        """
        if len(self.memory.scopes) >= DEPTH_MAX:
            raise KrlRunError(f"{routine.name} is the {DEPTH_MAX}th call within calls", place)
        if len(arguments) > len(routine.parameters):
            raise KrlRunError(
                f"{routine.name} takes {len(routine.parameters)} arguments, {len(arguments)} are "
                "given",
                place,
            )
        before = self.expressions.file
        named = zip(routine.parameters, arguments, strict=False)
        given = {one.name: copied(value) for one, value in named if value is not None}
        self.memory.enter(given, (one.name for one in routine.parameters))
        self._at(routine.file)
        try:
            self.body(routine.body)
        except Returned as returned:
            return 0 if returned.value is None else returned.value
        except LoopExit:
            raise KrlRunError(
                "EXIT stands outside of a loop", place_of(routine.body, routine.file)
            ) from None
        finally:
            self._at(before)
        return 0

    # names and values

    def _declare(self, tree: Tree) -> None:
        everywhere = GLOBAL in tree.children or self.memory.module == CONFIGURATION
        kind, *declarators = (one for one in tree.children if one != GLOBAL)
        for declarator in declarators:
            name, index, expression = declarator.children
            value: Value | None = None if index is None else Array(kind=str(kind))
            if expression is not None:
                value = typed(str(kind), copied(self.expressions.value(expression)))
            self.memory.declare(str(name), value, everywhere)

    def _structure(self, tree: Tree) -> None:
        """A type of structures needs no entry: components are made where they are set."""

    _enumeration = _external = _structure

    def _signal(self, tree: Tree) -> None:
        name, first, last = tree.children
        end = None if last is None else self.expressions.path(last)
        self._signals.declare(str(name), self.expressions.path(first), end, self.place(tree))

    # calls

    def _call(self, tree: Tree) -> None:
        name, *arguments = tree.children
        self._called(str(name), arguments, self.place(tree))

    def _called(self, name: str, arguments: list[Any], place: Place) -> Value:
        trees = [one.children[0] for one in arguments if one is not None]
        if trees == [None]:  # ROUTINE()
            trees = []
        if name == "PULSE":
            return self._pulse(trees, place)
        routine = self._routines.named(name, self.expressions.file)
        if routine is None and self._library.has(name):
            values = [None if one is None else self.expressions.value(one) for one in trees]
            return self._library.call(name, values, place)
        if routine is None:
            raise KrlRunError(f"there is no routine {name} in the files that are given", place)
        values = [
            None if one is None else self._argument(one, k, routine) for k, one in enumerate(trees)
        ]
        result = self.routine(routine, values, place)
        left = self.memory.leave()
        for parameter, tree in zip(routine.parameters, trees, strict=False):
            if (
                parameter.out
                and parameter.name in left
                and tree is not None
                and tree.data == "access"
            ):
                self.memory.set(self.expressions.path(tree), left[parameter.name], place)
        return result

    def _argument(self, tree: Tree, k: int, routine: Routine) -> Value | None:
        """The value of an argument; one that only comes back needs none."""
        out = k < len(routine.parameters) and routine.parameters[k].out
        if out and tree.data == "access" and not self.memory.has(self.expressions.path(tree)[0][0]):
            return None
        return self.expressions.value(tree)

    def _pulse(self, trees: list[Any], place: Place) -> Value:
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

    def _interrupt_declared(self, tree: Tree) -> None:
        call = tree.children[-1]
        if str(call.children[0]) != "IR_STOPM":
            self.note(tree, f"the interrupt that calls {call.children[0]} isn't followed")

    def _interrupt_switched(self, tree: Tree) -> None:
        """Interrupts aren't followed: their declaration says so."""

    _brake = _resume = _interrupt_switched
