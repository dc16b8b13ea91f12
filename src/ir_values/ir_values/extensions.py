"""Ports that installed packages may serve, by entry points: one registry per port.

What the project has comes first, under names that no package can take. What a package adds is known
by its name only: it is loaded when somebody asks for it, and no default uses it. A package that
can't be used says why when its name is asked for, and disturbs nobody else.
"""

from __future__ import annotations

import sys
import warnings
from collections.abc import Callable, Iterator, MutableMapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ir_values.errors import DescriptionError, InvalidValueError, one_line

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")

GROUPS = (
    "ir_planner.searches",
    "ir_planner.exit_searches",
    "ir_sim_driver.backends",
    "ir_sim_driver.links",
    "ir_description.controllers",
    "ir_description.worlds",
    "ir_recorder.traces",
)
"""The groups of entry points, one per port."""
_NAME_MAX = 40


class Registry(MutableMapping[str, T], Generic[T]):
    """The implementations of a port by name: `own` ones, then those that entry points of `group`
    name.

    made: the implementation from what an entry point names; raises InvalidValueError where it is
    none. stand_in: what is given for a package that can't be used, from the sentence that says why;
    None: asking for it raises DescriptionError. reserved: names that no package may take beside
    those of `own`.
    """

    def __init__(
        self,
        group: str,
        own: dict[str, T],
        made: Callable[[str, Any], T],
        *,
        stand_in: Callable[[str], T] | None = None,
        reserved: tuple[str, ...] = (),
    ) -> None:
        self.own = own
        self._group = group
        self._made = made
        self._stand_in = stand_in
        self._reserved = reserved
        self._loaded: dict[EntryPoint, T] = {}
        self._warned = set[str]()

    def __getitem__(self, name: str) -> T:
        if name in self.own:
            return self.own[name]
        found = self._installed().get(name)
        if found is None:
            raise KeyError(name)
        try:
            return self._load(name, found)
        except DescriptionError as error:
            if self._stand_in is None:
                raise
            return self._stand_in(str(error))

    def __contains__(self, name: object) -> bool:
        return name in self.own or name in self._installed()

    def __setitem__(self, name: str, value: T) -> None:
        self.own[name] = value

    def __delitem__(self, name: str) -> None:
        del self.own[name]

    def __iter__(self) -> Iterator[str]:
        yield from self.own
        yield from self._installed()

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def origin(self, name: str) -> str:
        """Package and version that a name comes from, "" for what the project has."""
        found = () if name in self.own else self._installed().get(name, ())
        return " and ".join(_package(each) for each in found)

    def why_not(self, name: str) -> str:
        """Why an installed package can't serve this name, "" where it can."""
        if name in self.own or name not in self:
            return ""
        try:
            self._load(name, self._installed()[name])
        except DescriptionError as error:
            return str(error)
        return ""

    def _installed(self) -> dict[str, tuple[EntryPoint, ...]]:
        """What packages name; warns once (RuntimeWarning) of a name that none may take."""
        found = _entry_points(self._group, tuple(sys.path))
        taken = {name: each for name, each in found.items() if self._is_taken(name)}
        for name in taken.keys() - self._warned:
            self._warned.add(name)
            packages = " and ".join(_package(each) for each in taken[name])
            sentence = (
                f"{self._group}: {name[:_NAME_MAX]!a} of {packages} is left out: a name has at "
                f"most {_NAME_MAX} letters, digits and underscores, and is none of the project's"
            )
            warnings.warn(sentence, RuntimeWarning, stacklevel=3)
        return {name: each for name, each in found.items() if name not in taken}

    def _is_taken(self, name: str) -> bool:
        plain = name.isidentifier() and name.isascii() and len(name) <= _NAME_MAX
        return not plain or name in self.own or name in self._reserved

    def _load(self, name: str, found: tuple[EntryPoint, ...]) -> T:
        where = f"{self._group}: {name[:_NAME_MAX]!a} of {self.origin(name)}"
        if len(found) > 1:
            raise DescriptionError(f"{where}: two packages serve this name: remove one of them")
        if found[0] not in self._loaded:
            try:
                self._loaded[found[0]] = self._made(name, found[0].load())
            except InvalidValueError as error:
                raise DescriptionError(f"{where} ({found[0].value}) {error}") from error
            except Exception as error:  # code of others: whatever it raises is its fault
                said = one_line(f"{type(error).__name__}: {error}", 300)
                raise DescriptionError(
                    f"{where} can't be loaded from {found[0].value}: {said}"
                ) from error
        return self._loaded[found[0]]


def installed_extensions() -> tuple[str, ...]:
    """Every package that serves a port: "package version (port: names)", sorted."""
    served: dict[str, list[str]] = {}
    for group in GROUPS:
        for name, found in _entry_points(group, tuple(sys.path)).items():
            for each in found:
                served.setdefault(_package(each), []).append(f"{group.split('.')[1]}: {name}")
    return tuple(f"{package} ({', '.join(names)})" for package, names in sorted(served.items()))


def extension_modules() -> tuple[str, ...]:
    """Top-level modules that the entry points of all ports name, sorted."""
    return tuple(
        sorted(
            {
                each.value.partition(":")[0].partition(".")[0]
                for group in GROUPS
                for found in _entry_points(group, tuple(sys.path)).values()
                for each in found
            }
        )
    )


@lru_cache(maxsize=64)
def _entry_points(group: str, path: tuple[str, ...]) -> dict[str, tuple[EntryPoint, ...]]:
    """Entry points of a group by name, sorted; path: sys.path, where packages are looked for."""
    from importlib.metadata import entry_points

    found: dict[str, dict[str, EntryPoint]] = {}
    for each in sorted(entry_points(group=group), key=lambda each: (each.name, _package(each))):
        found.setdefault(each.name, {}).setdefault(f"{_package(each)} {each.value}", each)
    return {name: tuple(several.values()) for name, several in found.items()}


def _package(entry: EntryPoint) -> str:
    distribution = entry.dist
    return (
        "an unknown package"
        if distribution is None
        else (f"{distribution.name} {distribution.version}")
    )
