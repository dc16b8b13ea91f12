"""Signals of a running program: inputs, outputs, flags, timers, single or as a group's number."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.run.memory import Memory, Noted, Step
from ir_krl.run.notes import Effect
from ir_krl.run.values import Array, Value, integer, number

INPUT = "$IN"
OUTPUT = "$OUT"
OUTPUT_IN_TIME = "$OUT_C"  # the same, set when the motion before ends: no stop of the advance run
TIMER = "$TIMER"
TIMER_FLAG = "$TIMER_FLAG"
CYCLIC = "$CYCFLAG"
FLAG = "$FLAG"
SINGLE = frozenset((INPUT, OUTPUT, TIMER_FLAG, FLAG, CYCLIC))
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


@dataclass(frozen=True)
class Pulse:
    """A pulse of an output to `level` that lasts `left` s from here; moved: motions have passed
    meanwhile, nobody knows how long.
    """

    level: bool
    left: float
    moved: bool = False


@dataclass
class Signals:
    """What is known of signals. inputs: what $IN[n] reads; noted: hears what is assumed; stops:
    hears what stops the advance run; expected: inputs that a WAIT FOR has waited for; aliases and
    groups: what SIGNAL declares, by name; pulses: of outputs, that may still last; cyclic: what
    gives cyclical flags their values anew.
    """

    memory: Memory
    inputs: Mapping[int, bool]
    noted: Noted
    stops: Callable[[SourcePlace, str], None] = lambda place, name: None
    expected: dict[int, bool] = field(default_factory=dict)
    aliases: dict[str, tuple[Step, ...]] = field(default_factory=dict)
    groups: dict[str, SignalRange] = field(default_factory=dict)
    pulses: dict[int, Pulse] = field(default_factory=dict)
    cyclic: dict[int, Callable[[], bool]] = field(default_factory=dict)

    def pulse(self, index: int, pulse: Pulse, place: SourcePlace) -> None:
        """PULSE has set an output: it goes back as time passes."""
        self.memory.set(((OUTPUT, (index,)),), pulse.level, place)
        self.pulses[index] = pulse

    def moved(self) -> None:
        """A motion, or a wait of unknown length, has passed."""
        self.pulses = {n: replace(one, moved=True) for n, one in self.pulses.items()}

    def stood(self, seconds: float, place: SourcePlace) -> None:
        """A wait of known length has passed: pulses that it outlasts are over."""
        for index, one in list(self.pulses.items()):
            self.pulses[index] = replace(one, left=one.left - seconds)
            if one.left <= seconds:
                del self.pulses[index]
                self.memory.set(((OUTPUT, (index,)),), not one.level, place)

    def read(self, name: str, index: int, place: SourcePlace) -> bool:
        """One signal or flag; what isn't known is FALSE. Raises KrlRunError."""
        if name in (INPUT, OUTPUT):
            self.stops(place, f"{name}[{index}]")
        if name == INPUT:
            return self._is_input(index, place)
        if name == TIMER_FLAG:
            self.stands_still(index, place)
            return number(self._held(TIMER, index) or 0, f"$TIMER[{index}]", place) > 0.0
        if name == CYCLIC and index in self.cyclic:
            return self.cyclic[index]()
        held = self._held(name, index)
        if name == OUTPUT and index in self.pulses and self.pulses[index].moved:
            self.memory.guesses += 1
            text = f"the PULSE of $OUT[{index}] may be over after motions: taken as lasting"
            self.noted(place, text, Effect.MOTIONS)
        if held is None:
            self.memory.guesses += 1
            self.noted(place, f"{name}[{index}] was never set: taken as FALSE", Effect.MOTIONS)
            return False
        if not isinstance(held, bool):
            raise KrlRunError(f"{name}[{index}] isn't TRUE or FALSE", place)
        if name == CYCLIC:
            self.memory.guesses += 1
            text = f"{name}[{index}] is taken as it was when it was set, not evaluated anew"
            self.noted(place, text, Effect.MOTIONS)
        return held

    def stands_still(self, index: int, place: SourcePlace) -> None:
        """A timer is read: its time doesn't pass."""
        self.memory.guesses += 1
        text = f"$TIMER[{index}] stands still: no time passes for a timer"
        self.noted(place, text, Effect.MOTIONS)

    def _is_input(self, index: int, place: SourcePlace) -> bool:
        if index in self.inputs:
            return self.inputs[index]
        if index in self.expected:
            return self.expected[index]
        self.memory.guesses += 1
        text = f"$IN[{index}] isn't given: taken as FALSE; --input {index}=true"
        self.noted(place, text, Effect.MOTIONS)
        return False

    def group_value(self, name: str, place: SourcePlace) -> int:
        """The number of a group."""
        group = self.groups[name]
        return sum(self.read(group.kind, n, place) << k for k, n in enumerate(group.numbers))

    def group_bits(self, name: str, value: Value, place: SourcePlace) -> list[tuple[int, bool]]:
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
        self, name: str, first: tuple[Step, ...], last: tuple[Step, ...] | None, place: SourcePlace
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
