"""Variables by name, as they stand while a program runs: of the routine that runs, of its module,
of all.

A module is a .src with its .dat. A variable of a data list is known in its module, one that is
GLOBAL or stands in $CONFIG everywhere; where two have the same name the nearest one counts.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

from ir_krl.errors import KrlRunError, Place
from ir_krl.run.system import STANDING
from ir_krl.run.values import Array, Structure, Value, copied

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
