"""PLC inputs: who may write them, debounce, interlocks of AB, HIB and KS, heartbeat."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace
from math import inf
from typing import NamedTuple

from ir_msgs_py.modes import REST_OF_BIT, ROW, Mode
from ir_msgs_py.plc import PLC_INPUT_NAMES, OperatingMode, PlcInputs
from ir_msgs_py.status import StatusCode
from ir_sim_driver.emergency_stop import StopMachine
from ir_sim_driver.errors import RequestRefusedError
from ir_sim_driver.notices import Level, Notices
from ir_sim_driver.plc.links import SERVICE, WRITERS
from ir_sim_driver.plc.port import STOP_BIT
from ir_values.settings import check_settings, setting

# Heartbeat of the PLC, watched from the first one on, in plant time.


class Watchdog:
    """lost: the reason while the link counts as lost, else ""."""

    def __init__(self) -> None:
        self._deadline = float("inf")
        self._timeout = 0.0
        self.lost = ""

    def beat(self, now: float, timeout: float) -> None:
        """Heartbeat at plant time `now` [s]; the next is due within `timeout` [s]."""
        self._deadline = now + timeout
        self._timeout = timeout
        self.lost = ""

    def forget(self) -> None:
        """Nobody can be heard now; watching begins again with the next heartbeat."""
        self._deadline = float("inf")
        self.lost = ""

    def step(self, now: float) -> bool:
        """Look at the time; True in the step in which the link is lost."""
        if now <= self._deadline or self.lost:
            return False
        self.lost = f"the PLC's heartbeat is missing for more than {self._timeout:g} s"
        return True


# Levels in, requests out.
#
# Rules of the KR C4 power management: the three bits count only in operating mode EXT, only one
# at a time, and never together with a PROFIenergy pause; a contradiction is ignored with a
# warning. A bit that is already 1 when the controller starts or wakes is ignored until it has
# been 0 once.

OWNERS = ("any", *WRITERS)
RESTART_BIT = "ks"
_HANDOVER = 0.5  # s in which a program may set the bit of a deeper rest and clear the one before
HIBERNATION_BIT = ROW[Mode.HIBERNATION].bit
POWER_BITS = (*REST_OF_BIT, RESTART_BIT)
BITS = tuple(name for name in PLC_INPUT_NAMES if name not in OperatingMode.__members__)
OFF_BIT = "drives_off"
OWN_BITS = (*REST_OF_BIT, OFF_BIT)
"""Those that a program gives in a pause, and takes back."""


@dataclass(frozen=True)
class PlcSettings:
    """How levels become facts."""

    debounce: float = setting(
        0.02,
        "A level has to stay that long to count; a pressed emergency stop counts at once.",
        unit="s",
        minimum=0.0,
        maximum=10.0,
        read_only=True,
    )
    startup_window: float = setting(
        0.5,
        "Levels of the first full set count as already there at the start when it comes within "
        "this time.",
        unit="s",
        minimum=0.0,
        maximum=60.0,
        read_only=True,
    )

    owner: str = setting(
        "any",
        "Who may set PLC inputs; 'any': the last writer of a bit. A pressed emergency stop "
        "counts from all.",
        choices=OWNERS,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)


class Written(NamedTuple):
    """All levels, and when they came on the host's monotonic clock [ns], 0: now.

    overtaken: by a press of the same topic, or they are that press. again: and press the button
    after it was let go, what has no number yet.
    """

    inputs: PlcInputs
    came_ns: int = 0
    overtaken: bool = False
    again: bool = False


def _stop_first(bit: str) -> bool:
    """Sort key: whatever else a message says, its emergency stop comes first."""
    return bit != STOP_BIT


_WRITTEN = tuple(sorted(BITS, key=_stop_first))


def giver_of(writer: str, client: str) -> str:
    """Who gives a level: a writer, of the service each client by itself."""
    return f"{writer} {client}".strip()


def _named(givers: Collection[str]) -> str:
    """Writers in a sentence; clients of the service have no names that people know."""
    names = {giver.partition(" ")[0] or "somebody" for giver in givers}
    others = {"another client of the service" if name == SERVICE else name for name in names}
    return " and ".join(sorted(others))


class Plc:
    """Levels in, requests out; `step` lets time pass.

    levels: what counts now (debounced, without stuck bits). rest: BUS_POWER_OFF, HIBERNATION or
    None.
    stop: the state machine of stops; a press is latched there when it is written, however short.
    order: of the last message; levels that it raised have this order.
    off_by: who has given the drives_off since which no drives_on came. off_taken_back: its only
    giver has taken it back, and nobody has given it since.
    drives_on, confirm, restart: rising edges seen in this step. no_hibernation: why HIB is ignored,
    "" where it counts.
    """

    def __init__(
        self,
        settings: PlcSettings,
        notices: Notices,
        mode: OperatingMode = OperatingMode.EXT,
        before_first_stop: int = 0,
    ) -> None:
        self._settings = settings
        self._notices = notices
        self.raw = PlcInputs(operating_mode=mode)
        self.levels = PlcInputs(operating_mode=mode)
        self.operating_mode = mode
        self.rest: Mode | None = None
        self.stop = StopMachine(before_first_stop)
        self.order = 0
        self._rose: dict[str, int] = {}
        self._stopped_by = ("", 0)  # who has stopped by a press, and the number of that stop
        self._fell = 0  # order of the message that let go of the emergency stop
        self._up = 0.0  # s since then
        self.no_hibernation = ""
        self.drives_on = False
        self.confirm = False
        self.restart = False
        self._gave: dict[str, set[str]] = {bit: set() for bit in OWN_BITS}  # since it was 0
        self.off_by: set[str] = set()
        self.off_taken_back = False
        self._ages: dict[str, float] = {}
        self._stuck: frozenset[str] = frozenset()
        self._uptime = 0.0
        self._warning = ""
        self._warn_at = inf
        self._greeted = False
        self._judged: tuple[object, bool] = (None, False)

    @property
    def in_force(self) -> PlcInputs:
        """The levels that count; a pressed emergency stop does before the next step."""
        if self.raw.emergency_stop and not self.levels.emergency_stop:
            return self.levels.with_bit(STOP_BIT, True)
        return self.levels

    def write(
        self, writer: str, levels: Mapping[str, bool], client: str = "", came_ns: int = 0
    ) -> None:
        """Set these levels in the name of a writer (one of WRITERS), the others stay.

        client: of the service. came_ns: when they came at the earliest, 0: now; before the last
        stop, unless the same writer gave it, only a press counts. Raises RequestRefusedError; a
        pressed emergency stop counts even then.
        """
        pressed = levels.get(STOP_BIT, False)
        number = self.stop.number
        if self._came_before_the_stop(writer, came_ns) and not (pressed and len(levels) == 1):
            if pressed:
                self.write(writer, {STOP_BIT: True}, client)
            self.stop.refuse_earlier(came_ns, " and ".join(levels))
        try:
            self._guard(writer, pressed, alone=pressed and len(levels) == 1)
            self._greeted = True
            self.order += 1
            for bit in sorted(levels, key=_stop_first):
                self._set(bit, levels[bit], giver=giver_of(writer, client))
        finally:
            self._note_stop(writer, number)

    def _came_before_the_stop(self, writer: str, came_ns: int) -> bool:
        """Whether what a writer wrote came before the last stop, which was not its own."""
        own = self._stopped_by == (writer, self.stop.number)
        return not own and self.stop.came_later(came_ns)

    def write_all(self, writer: str, written: Written) -> None:
        """Set all levels in the name of a writer. Raises as `write`.

        What came before the last stop, or a press has overtaken, does not let go of the button, and
        nothing that it raises acknowledges. Stops by the same writer are in the order of its
        messages.
        """
        inputs = written.inputs
        number = self.stop.number
        late = written.overtaken or self._came_before_the_stop(writer, written.came_ns)
        if written.again and self.stop.pressed:
            self.stop.press_again(self.order)
            inputs = inputs.with_bit(STOP_BIT, False)
        try:
            self._guard(writer, inputs.emergency_stop)
            self._set_all(inputs, late, writer)
        finally:
            self._note_stop(writer, number)

    def _note_stop(self, writer: str, number: int) -> None:
        """Remember who has stopped since stop `number`."""
        if self.stop.number != number:
            self._stopped_by = (writer, self.stop.number)

    def turn_switch(self, writer: str, mode: OperatingMode) -> None:
        """Turn the mode switch in the name of a writer. Raises RequestRefusedError."""
        self._guard(writer)
        self.set_operating_mode(mode)

    def check_owner(self, writer: str) -> None:
        """Raise RequestRefusedError where the inputs belong to another writer."""
        self._guard(writer)

    def _guard(self, writer: str, pressed: bool = False, *, alone: bool = False) -> None:
        """Raise what a writer may not do; pressing the emergency stop anybody may."""
        owner = self._settings.owner
        if alone or owner in ("any", writer):
            return
        if pressed:
            self.set_bit(STOP_BIT, True)
        raise RequestRefusedError(
            StatusCode.INVALID_ROBOT_STATE,
            f"PLC inputs belong to {owner!r} (parameter plc.owner): {writer} may only press "
            f"{STOP_BIT}",
        )

    def set_all(self, inputs: PlcInputs) -> None:
        """Take all levels at once, as the topic and the field bus do."""
        self._set_all(inputs, late=False)

    def _set_all(self, inputs: PlcInputs, late: bool, giver: str = "") -> None:
        if not self._greeted and self._uptime < self._settings.startup_window:
            stuck = frozenset(bit for bit in POWER_BITS if getattr(inputs, bit))
            self._stick(stuck, Level.WARN, "at the start")
        self._greeted = True
        self.order += 1
        for bit in _WRITTEN[1:] if late and not inputs.emergency_stop else _WRITTEN:
            self._set(bit, getattr(inputs, bit), late=late, giver=giver)
        if inputs.operating_mode is not OperatingMode.UNCHANGED:
            self.set_operating_mode(inputs.operating_mode)

    def set_bit(self, bit: str, level: bool) -> None:
        """Set one level, the others stay; `bit` is one of BITS."""
        self._greeted = True
        self.order += 1
        self._set(bit, level)

    def remark(self, bit: str, pause_active: bool = False) -> str:
        """Why the level that `bit` has now will not count as a request to rest, "" where it will.

        What `step` says with a warning once the level has been there for the debounce.
        """
        if bit not in POWER_BITS:
            return ""
        level = bool(getattr(self.raw, bit))
        if level and bit in self._stuck:
            return (
                f"PLC bit {bit.upper()} is 1 since the controller started: ignored until it "
                "has been 0"
            )
        on = [name for name in POWER_BITS if getattr(self.raw, name) and name not in self._stuck]
        refusal = self._refusal(on, pause_active)
        if refusal and (
            level or (self.rest is not None and self.operating_mode is not OperatingMode.EXT)
        ):
            return f"PLC bit {bit.upper()} is {int(level)} but ignored: {refusal}"
        return ""

    def set_operating_mode(self, mode: OperatingMode) -> None:
        """Turn the mode switch."""
        self.operating_mode = mode
        self.raw = replace(self.raw, operating_mode=mode)
        self.levels = replace(self.levels, operating_mode=mode)

    def wake(self) -> None:
        """The controller starts again: power bits that are 1 now are ignored until they have been
        0.
        """
        still = frozenset(bit for bit in POWER_BITS if getattr(self.raw, bit))
        self._stick(still, Level.OK, "when the controller wakes")
        self._ages.clear()
        self.levels = replace(self.raw, ab=False, hib=False, ks=False)
        if self.levels.drives_off:
            self.off_by |= self._gave[OFF_BIT]
        self.rest = None

    def step(self, dt: float, pause_active: bool = False) -> bool:
        """Let dt [s] pass; pause_active: a PROFIenergy pause is on. Returns whether anything is
        new.
        """
        self._uptime += dt
        if self._uptime >= self._warn_at:
            self._warn_at = inf
            self._notices.add(Level.WARN, self._warning)
        self.drives_on = False
        self.confirm = False
        self.restart = False
        if self.stop.pressed:
            self._let_go(dt)
        if self._ages:
            self._debounce(dt)
        if self.levels is self._judged[0] and pause_active is self._judged[1]:
            return False
        before = self._judged[0]
        self._judged = (self.levels, pause_active)
        self._judge(pause_active, before)
        return True

    def rose(self, bit: str) -> int:
        """Order of the message in which this level rose last, 0 before the first."""
        return self._rose.get(bit, 0)

    def _let_go(self, dt: float) -> None:
        """Count a released emergency stop once it has been up for the debounce."""
        if self.raw.emergency_stop:
            return
        self._up += dt
        if self._up >= self._settings.debounce - 1e-9:
            self.stop.release(self._fell)

    def take_back(self, bit: str, giver: str) -> None:
        """A giver takes its own 1 of one of OWN_BITS back: it falls where nobody else has given it.

        A 1 that counts no more, since the controller woke, is nobody's. Raises RequestRefusedError.
        """
        others = self._gave[bit] - {giver}
        if bit in self._stuck:
            others = set()
        self._gave[bit].discard(giver)
        if getattr(self.raw, bit) and others:
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE,
                f"{bit} stays 1: {_named(others)} has given it too, and has to take it back",
            )
        if getattr(self.raw, bit):
            self.set_bit(bit, False)
        if bit == OFF_BIT:
            self._take_latched_back(giver)

    def _take_latched_back(self, giver: str) -> None:
        """drives_off outlasts its level: take that back too, where nobody else has given it."""
        others = self.off_by - {giver}
        if others:
            raise RequestRefusedError(
                StatusCode.INVALID_ROBOT_STATE,
                f"drives_off was given by {_named(others)}: drives_on is needed",
            )
        self.off_taken_back = True

    def _note_giver(self, bit: str, giver: str) -> None:
        """Remember who gives a 1, also one that is there already."""
        if not getattr(self.raw, bit):
            self._gave[bit].clear()
        self._gave[bit].add(giver)
        if bit == OFF_BIT:
            self.off_taken_back = False
            self.off_by |= {giver} if self.levels.drives_off else set()

    def _set(self, bit: str, level: bool, *, late: bool = False, giver: str = "") -> None:
        if level and bit in self._gave:
            self._note_giver(bit, giver)
        if level == getattr(self.raw, bit):
            return
        self.raw = self.raw.with_bit(bit, level)
        if bit == STOP_BIT and level:
            self.stop.press(self.order)
        elif bit == STOP_BIT:
            self._fell = self.order
            self._up = 0.0
        elif level:
            self._rose[bit] = 0 if late else self.order
        if not level and bit in self._stuck:
            self._stuck -= {bit}
            return
        self._ages[bit] = 0.0

    def _stick(self, bits: frozenset[str], level: Level, when: str) -> None:
        self._stuck |= bits
        if bits:
            names = ", ".join(sorted(bit.upper() for bit in bits))
            self._notices.add(
                level, f"PLC bit {names} is already 1 {when}: ignored until it has been 0"
            )

    def _debounce(self, dt: float) -> None:
        for bit in list(self._ages):
            level = getattr(self.raw, bit)
            if level == getattr(self.levels, bit) or bit in self._stuck:
                del self._ages[bit]
                continue
            self._ages[bit] += dt
            urgent = bit == STOP_BIT and level
            if urgent or self._ages[bit] >= self._settings.debounce - 1e-9:
                del self._ages[bit]
                self.levels = self.levels.with_bit(bit, level)
                if level:
                    self.off_by |= self._gave[bit] if bit == OFF_BIT else set()
                    self.drives_on |= bit == "drives_on"
                    self.confirm |= bit == "conf_mess"
                    self.restart |= bit == RESTART_BIT

    def _judge(self, pause_active: bool, before: object) -> None:
        """Decide what AB, HIB and KS mean together; what is refused leaves `rest` as it was.

        before: the levels that were judged last.
        """
        on = [bit for bit in POWER_BITS if getattr(self.levels, bit)]
        names = " and ".join(bit.upper() for bit in on)
        refusal = self._refusal(on, pause_active)
        self._warn_at = inf
        if not refusal:
            self.rest = REST_OF_BIT.get(on[0]) if on else None
            return
        self.restart = False
        if on:
            warning = f"PLC bit {names} ignored: {refusal}"
            if (
                not self._gate(on, pause_active)
                and self.rest is not None
                and on == [ROW[self.rest].bit, HIBERNATION_BIT]
            ):
                self._warning = warning
                self._warn_at = self._uptime + _HANDOVER
            else:
                self._notices.add(Level.WARN, warning)
        elif self.rest is not None and self.operating_mode is not OperatingMode.EXT:
            bit = ROW[self.rest].bit
            if getattr(before, bit, False):
                self._notices.add(Level.WARN, f"PLC bit {bit.upper()} is 0 but ignored: {refusal}")
        if (
            self.operating_mode is OperatingMode.EXT
            and self.rest is not None
            and ROW[self.rest].bit not in on
        ):
            self.rest = None

    def _refusal(self, on: list[str], pause_active: bool) -> str:
        """Why these power bits don't count, "" where they do."""
        several = "only one of AB, HIB and KS may be 1" if len(on) > 1 else ""
        return self._gate(on, pause_active) or several

    def _gate(self, on: list[str], pause_active: bool) -> str:
        """Why none of these power bits counts now, not even one alone; "" where one does."""
        if self.operating_mode is not OperatingMode.EXT:
            return f"operating mode is {self.operating_mode.name}, must be EXT"
        if pause_active and on:
            return "a PROFIenergy pause is on, end it first"
        if self.no_hibernation and HIBERNATION_BIT in on:
            return self.no_hibernation
        return ""
