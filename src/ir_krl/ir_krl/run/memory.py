"""Variables of a running program, as they stand: of the routine that runs, of its module, of all.

A module is a .src with its .dat. A variable of a data list is known in its module, one that is
GLOBAL or stands in $CONFIG everywhere; where two have the same name the nearest one counts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import PurePath
from typing import Any

from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.run.notes import Effect
from ir_krl.run.system import Assumption
from ir_krl.run.values import (
    TYPES,
    Array,
    Structure,
    Types,
    Unknown,
    Value,
    copied,
    in_range,
    real,
    rounded,
    typed,
)


def module_of(file: str) -> str:
    """The module that a file belongs to: a .src and its .dat have one."""
    return PurePath(file).stem.upper()


Step = tuple[str, tuple[int, ...] | None]
"""A name and, where one is written, its index."""


@dataclass
class Scope:
    """Variables of a call: those that have a value, and the names of all that are declared."""

    values: dict[str, Value]
    names: set[str]


Watched = dict[tuple[int, str], tuple[dict[str, Value], Value | None]]
"""What variables held when they were set first, by the memory that holds them and their name."""
Noted = Callable[[SourcePlace, str, Effect], None]
"""Hears what is assumed: place, sentence, what it could change."""


@dataclass
class Memory:
    """All variables, what the program didn't bring, and what the advance run has to know of them.

    Where variables are, the nearest first:
    scopes: the calls that run; module: whose statements run; modules: data lists by the names of
    their modules; listed: all names that data lists declare; shared: what is known everywhere;
    settings: what a user has set, which variables of a call begin with too; types: components of
    structures.

    What the program didn't bring:
    assumed: values by name or name[index]; chosen: the same of system variables that a function has
    just found; noted: hears of those that are used; guesses: how many were; delivered: what is said
    of figures of $config.dat that were used as controllers are delivered, and where first.

    The advance run:
    beside: what triggers have set since it stopped last; ahead: it is ahead of a motion since then;
    watched: see `watch`.
    """

    shared: dict[str, Value]
    scopes: list[Scope] = field(default_factory=list)
    module: str = ""
    modules: dict[str, dict[str, Value]] = field(default_factory=dict)
    listed: set[str] = field(default_factory=set)
    settings: dict[str, Value] = field(default_factory=dict)
    types: dict[str, Mapping[str, str]] = field(default_factory=lambda: dict(TYPES))

    assumed: dict[str, Assumption] = field(default_factory=dict)
    chosen: dict[str, Assumption | None] = field(default_factory=dict)
    noted: Noted = lambda place, text, effect: None
    guesses: int = 0
    delivered: dict[str, SourcePlace] = field(default_factory=dict)

    beside: set[str] = field(default_factory=set)
    ahead: bool = False
    watched: list[Watched] = field(default_factory=list)

    def enter(self, values: dict[str, Value], names: Iterable[str]) -> None:
        """A call begins, with these parameters and their values."""
        self.scopes.append(Scope(values, {*names, *values}))

    def leave(self) -> dict[str, Value]:
        """The call ends; what its variables hold."""
        return self.scopes.pop().values

    def declare(self, name: str, value: Value | None, kind: str, everywhere: bool = False) -> None:
        """A variable of the type `kind`, of the routine that runs; of its module's data list, where
        none runs.
        """
        if self.scopes:
            self.scopes[-1].names.add(name)
            home = self.scopes[-1].values
        else:
            self.listed.add(name)
            home = self.shared if everywhere else self._own()
        if isinstance(value, Array) and not value.elements:
            held = home.get(name, self.shared.get(name))
            value = held if isinstance(held, Array) else value  # a parameter, or the controller's
        if self.scopes and name in self.settings and name not in home:
            value = _begun(value, self.settings[name])
        if value is None:
            home[name] = typed(kind, home.get(name, Unknown(name, kind)), self.types)
            return
        self._watch(home, name)
        home[name] = typed(kind, value, self.types)
        if not isinstance(value, Array):
            self.assumed.pop(name, None)

    def has(self, name: str) -> bool:
        """Whether a variable of this name has a value."""
        return not isinstance(self._home(name).get(name, Unknown(name)), Unknown)

    def valued(self, name: str) -> bool:
        """Whether data lists give a variable of this name a value."""
        homes = (self.shared, *self.modules.values())
        return any(not isinstance(one.get(name, Unknown(name)), Unknown) for one in homes)

    def declared(self, name: str) -> bool:
        """Whether a variable of this name is declared where statements run, with or without a
        value.
        """
        own = self.scopes[-1].names if self.scopes else set()
        return self.has(name) or name in own or name in self.listed

    def watch(self) -> Watched:
        """From here on what is set is remembered, until `changed` is asked."""
        self.watched.append({})
        return self.watched[-1]

    def forget(self, watched: Watched) -> None:
        """Nothing more is remembered for a `watch`."""
        self.watched = [one for one in self.watched if one is not watched]

    def changed(self, watched: Watched) -> bool:
        """Whether a variable that still exists holds something else than at `watch`."""
        alive = {id(self.shared), *map(id, self.modules.values())}
        alive |= {id(scope.values) for scope in self.scopes}
        return any(
            home.get(name) != before
            for (holder, name), (home, before) in watched.items()
            if holder in alive
        )

    def _watch(self, home: dict[str, Value], name: str) -> None:
        for one in self.watched:
            key = (id(home), name)
            if key not in one:
                before = home.get(name)
                one[key] = (home, None if before is None else copied(before))

    def hold(self, name: str, value: Value | None) -> None:
        """A system variable that follows from what happens; it stays as it is where that isn't
        known.
        """
        if value is not None:
            self.shared[name] = value

    def guess(self, value: Value, otherwise: Value, place: SourcePlace) -> Value:
        """The value, or where there is none `otherwise`, which is said."""
        if not isinstance(value, Unknown):
            return value
        self.guesses += 1
        taken = otherwise
        if otherwise is False:
            taken = "FALSE"
        elif otherwise == "":
            taken = "an empty text"
        text = f"{value.name} has no value: taken as {taken}; --set '{value.name}=…'"
        self.noted(place, text, Effect.MOTIONS)
        return otherwise

    def peek(self, name: str, index: int | None = None) -> Value | None:
        """A value of all modules without a word about what is assumed; None without one."""
        value = self.shared.get(name)
        if index is None:
            return value
        return value.elements.get((index,)) if isinstance(value, Array) else None

    def may_change(self, name: str, routine: str) -> None:
        """A routine that nobody gave, or that isn't followed, was given a variable: it may have got
        another value.
        """
        text = f"{name} may get another value from {routine}: taken as it stands; --set '{name}=…'"
        self.assumed[name] = Assumption(text, Effect.MOTIONS)

    def set_beside(self, name: str) -> None:
        """A TRIGGER has set a variable, at an instant that the advance run doesn't wait for."""
        text = (
            f"{name} is set by a TRIGGER while the robot moves: taken as set before; a "
            "controller's advance run reads it sooner, put WAIT SEC 0 before"
        )
        self.assumed[name] = Assumption(text, Effect.MOTIONS)
        self.beside.add(name)

    def arrived(self) -> None:
        """The advance run has stopped: what triggers set is set."""
        for name in self.beside:
            self.assumed.pop(name, None)
        self.beside.clear()
        self.ahead = False

    def moved(self) -> None:
        """A motion is handed on, while the advance run goes ahead of it."""
        self.ahead = self.peek("$ADVANCE") != 0

    def override_set(self, place: SourcePlace) -> None:
        """Say that $OV_PRO, which acts at once, is set while motions before are still driven."""
        if self.ahead:
            text = (
                "$OV_PRO is set by the advance run and acts at once, on motions before as well: "
                "taken as set when they end; put WAIT SEC 0 before"
            )
            self.noted(place, text, Effect.SPEEDS)

    def _guessed(self, name: str, index: tuple[int, ...] | None, place: SourcePlace) -> None:
        """Say that a value which isn't the program's is used."""
        if index is not None and len(index) == 1 and f"{name}[{index[0]}]" in self.assumed:
            name = f"{name}[{index[0]}]"
        if name not in self.assumed:
            return
        self.guesses += 1
        assumed = self.assumed[name]
        if assumed.delivered:
            self.delivered.setdefault(assumed.text, place)
        else:
            self.noted(place, assumed.text, assumed.effect)

    def get(self, path: tuple[Step, ...], place: SourcePlace) -> Value:
        """The value at a path such as XP1.X or BASE_DATA[2]. Raises KrlRunError."""
        (name, index), *rest = path
        home = self._home(name)
        if name not in home:
            written = name if index is None else f"{name}[{', '.join(map(str, index))}]"
            return Unknown(".".join([written, *(part for part, _ in rest)]))
        self._guessed(name, index, place)
        if rest:
            self._guessed(f"{name}.{rest[0][0]}", None, place)
        if home is not self.shared and home is self.modules.get(self._elsewhere(name)):
            text = f"{name} is taken from the data list {self._elsewhere(name)}, it isn't GLOBAL"
            self.noted(place, text, Effect.PLACES)
        value = _element(home[name], name, index, place)
        written = name if index is None else f"{name}[{', '.join(map(str, index))}]"
        for part, part_index in rest:
            if isinstance(value, Unknown):
                value = Unknown(f"{value.name}.{part}")
                continue
            if not isinstance(value, Structure):
                raise KrlRunError(f"{written} has no components", place)
            written = f"{written}.{part}"
            value = _element(value.fields.get(part, Unknown(written)), written, part_index, place)
        return value

    def set(self, path: tuple[Step, ...], value: Value, place: SourcePlace) -> None:
        """Put a copy of `value` there; variables, elements and components are made where they
        lack.
        """
        (name, index), *rest = path
        home: dict[str, Value] = self._home(name)
        self._watch(home, name)
        if self.assumed:
            self._known(name, index, rest)
        holder = home
        parts: Mapping[str, str] = {}
        for (part, part_index), following in zip(path, [*rest, None], strict=True):
            elements: dict[Any, Value] = holder
            key: Any = part
            kind = parts.get(part, "")
            if part_index is not None:
                held_text = holder.get(part)
                if isinstance(held_text, str) and following is None:
                    holder[part] = _with_letter(held_text, part, part_index, value, place)
                    return
                array = _array_at(holder, part, kind, place)
                array.check(part_index, part, place)
                elements = array.elements
                key = part_index
                kind = array.kind
            if following is None:
                elements[key] = _merged(elements.get(key), value, kind, self.types)
                return
            held = _structure_at(elements, key, part, kind, place)
            holder = held.fields
            parts = self.types.get(held.kind, {})

    def take_chosen(self, name: str) -> None:
        """A variable has been set by what a function found: it is an assumption where that was."""
        for key in [one for one in self.chosen if one == name or one.startswith(f"{name}.")]:
            assumed = self.chosen.pop(key)
            if assumed is not None:
                self.assumed[key] = assumed

    def _known(self, name: str, index: tuple[int, ...] | None, rest: list[Step]) -> None:
        """What is set is no assumption any more."""
        self.assumed.pop(name, None)
        if index is not None:
            self.assumed.pop(f"{name}[{', '.join(map(str, index))}]", None)
        elif rest:
            self.assumed.pop(f"{name}.{rest[0][0]}", None)
        elif name.startswith("$"):
            for part in [one for one in self.assumed if one.startswith((f"{name}.", f"{name}["))]:
                del self.assumed[part]

    def _home(self, name: str) -> dict[str, Value]:
        """Where a variable is, or would be."""
        if self.scopes and name in self.scopes[-1].names:
            return self.scopes[-1].values
        if name in self._own():
            return self._own()
        if name in self.shared or name.startswith("$"):
            return self.shared
        elsewhere = self._elsewhere(name)
        if elsewhere:
            return self.modules[elsewhere]
        return self.shared if self.scopes else self._own()

    def _elsewhere(self, name: str) -> str:
        """The one data list of another module that has a variable of this name, else ""."""
        found = [
            module
            for module, one in self.modules.items()
            if not isinstance(one.get(name, Unknown(name)), Unknown)
        ]
        return found[0] if len(found) == 1 and found[0] != self.module else ""

    def _own(self) -> dict[str, Value]:
        return self.modules.setdefault(self.module, {})


def _begun(value: Value | None, setting: Value) -> Value:
    """What a declared variable begins with where a setting gives it; what it is declared with
    counts more.
    """
    given = copied(setting)
    if isinstance(value, Array) and isinstance(given, Array):
        given.sizes = value.sizes
    return given if value is None or isinstance(value, Array) else value


def _merged(before: Value | None, value: Value, kind: str, types: Types) -> Value:
    """The new value of a variable of the type `kind`: components that an aggregate leaves out stay,
    and so does INT or REAL.
    """
    kind = kind or (before.kind if isinstance(before, Unknown | Structure) else "")
    new = typed(kind, copied(value), types)
    if isinstance(new, Structure) and isinstance(before, Structure):
        return Structure(
            {**before.fields, **new.fields}
            if before.kind == new.kind or not new.kind
            else new.fields,
            new.kind or before.kind,
        )
    if isinstance(before, float) and isinstance(new, int) and not isinstance(new, bool):
        return real(new)
    if isinstance(before, int) and not isinstance(before, bool) and isinstance(new, float):
        return in_range(rounded(new), SourcePlace())
    return new


def _array_at(holder: dict[str, Value], name: str, kind: str, place: SourcePlace) -> Array:
    """The array of a name, made where there is none. Raises KrlRunError."""
    held = holder.get(name)
    if held is None or isinstance(held, Unknown):
        held = holder[name] = Array(kind=kind or (held.kind if held else ""))
    if not isinstance(held, Array):
        raise KrlRunError(f"{name} is no array: leave out the index", place)
    return held


def _structure_at(
    elements: dict[Any, Value], key: Any, name: str, kind: str, place: SourcePlace
) -> Structure:
    """The structure at a key, made where there is none. Raises KrlRunError."""
    held = elements.get(key)
    if held is None or isinstance(held, Unknown):
        held = elements[key] = Structure({}, kind or (held.kind if held else ""))
    if not isinstance(held, Structure):
        raise KrlRunError(f"{name} has no components", place)
    return held


def _with_letter(
    text: str, name: str, index: tuple[int, ...], letter: Value, place: SourcePlace
) -> str:
    """A text with another letter at an index from 1; blanks fill what lacks before. Raises
    KrlRunError.
    """
    if not isinstance(letter, str) or len(letter) != 1 or len(index) != 1 or index[0] < 1:
        raise KrlRunError(f"{name} is a text: one letter is set at an index from 1", place)
    at = index[0] - 1
    padded = text.ljust(at)
    return padded[:at] + letter + padded[at + 1 :]


def _element(value: Value, name: str, index: tuple[int, ...] | None, place: SourcePlace) -> Value:
    if index is None:
        return value
    written = f"{name}[{', '.join(map(str, index))}]"
    if isinstance(value, Unknown):
        return Unknown(written)
    if isinstance(value, str) and len(index) == 1:  # a letter of a text
        within = 1 <= index[0] <= len(value)
        return value[index[0] - 1] if within else Unknown(written)
    if not isinstance(value, Array):
        raise KrlRunError(f"{name} is no array: leave out the index", place)
    value.check(index, name, place)
    return value.elements.get(index, Unknown(written))
