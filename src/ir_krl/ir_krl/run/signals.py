"""Inputs, outputs, flags and timers as a program reads them, single or as the number of a group."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from ir_krl.errors import KrlRunError, Place
from ir_krl.run.memory import Memory, Step
from ir_krl.run.values import Array, Value, integer, number

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
class Group:
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
    groups: dict[str, Group] = field(default_factory=dict)

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
        self.groups[name] = Group(kind, begin[0], end[0])

    def _held(self, name: str, index: int) -> Value | None:
        array = self.memory.shared.get(name)
        return array.elements.get((index,)) if isinstance(array, Array) else None
