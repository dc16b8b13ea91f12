"""A reference of docs/driver.md for tests: its tables "Stop, acknowledgement, recovery" and "A
program takes its own bits back".

Written from the tables alone: it shares no code with the driver and looks at nothing of it. Times
are whole milliseconds.
"""

from __future__ import annotations

DEBOUNCE = 20  # ms

# state: (press, fault, release, conf_mess, drives_on, recover); "": nothing changes
TABLE = {
    "run": ("pressed", "fault", "", "", "", ""),
    "pressed": ("pressed", "pressed, with a fault", "released", "", "", "refused"),
    "released": ("pressed", "fault", "", "acknowledged", "", "run"),
    "acknowledged": ("pressed", "fault", "", "", "run", "run"),
    "fault": ("pressed, with a fault", "", "", "", "", "run"),
    "pressed, with a fault": ("pressed, with a fault", "", "fault", "", "", "refused"),
}
COLUMN = {"press": 0, "fault": 1, "release": 2, "conf_mess": 3, "drives_on": 4, "recover": 5}


class Signal:
    """A level with the message and the time at which it changed, and the level that counts."""

    def __init__(self) -> None:
        self.level = False
        self.counted = False
        self.message = 0
        self.changed = 0

    def write(self, level: bool, message: int, now: int) -> bool:
        """Whether it changed."""
        if level == self.level:
            return False
        self.level = level
        self.message = message
        self.changed = now
        return True

    def settle(self, now: int) -> bool:
        """Whether it counts as risen in this millisecond."""
        if self.level == self.counted or now - self.changed < DEBOUNCE:
            return False
        self.counted = self.level
        return self.level


class Reference:
    """state: a row of the table. number: of the last stop; before: the one before the first.

    off_by: who has given the drives_off since which no drives_on came. gave: who has given the
    drives_off that is 1, or was last.
    """

    def __init__(self, before: int = 0) -> None:
        self.state = "run"
        self.number = before
        self.now = 0
        self.messages = 0
        self.barrier = 0
        self.acknowledged = 0
        self.signals = {
            name: Signal() for name in ("emergency_stop", "conf_mess", "drives_on", "drives_off")
        }
        self.let_go: int | None = None
        self.off_by: frozenset[str] = frozenset()
        self.gave: frozenset[str] = frozenset()
        self.taken_back = False  # by the program

    @property
    def drives_kept_off(self) -> bool:
        """Whether drives_on is needed before a goal."""
        return bool(self.off_by) or self.signals["drives_off"].counted

    def _happens(self, event: str) -> str:
        result = TABLE[self.state][COLUMN[event]]
        if result not in ("", "refused"):
            self.state = result
            self.number += event in ("press", "fault")
        return result

    def write(self, levels: dict[str, bool], giver: str = "plc") -> None:
        """A message with these levels."""
        self.messages += 1
        if levels.get("drives_off"):
            off = self.signals["drives_off"]
            self.gave = (self.gave if off.level else frozenset()) | {giver}
            self.off_by |= {giver} if off.counted else set()
            self.taken_back = False
        for name, signal in self.signals.items():
            if name in levels and signal.write(levels[name], self.messages, self.now):
                if name != "emergency_stop":
                    continue
                if levels[name]:
                    self._happens("press")
                    self.barrier = self.messages
                    self.let_go = None
                else:
                    self.let_go = self.now

    def fault(self) -> None:
        """The supervision stops the robot."""
        if self._happens("fault"):
            self.barrier = self.messages

    def recover(self) -> str:
        """What the table says."""
        return self._happens("recover")

    def take_back(self) -> None:
        """A program takes its drives_off back: refused where the PLC has given it too."""
        others = {"plc"} & (self.gave if self.signals["drives_off"].level else frozenset())
        self.gave -= {"program"}
        if not others:
            self.write({"drives_off": False})
        if not others | ({"plc"} & self.off_by):
            self.taken_back = True
            self._let_go()

    def _let_go(self) -> None:
        """What the program has taken back counts once the level has fallen."""
        if self.taken_back and not self.signals["drives_off"].counted:
            self.taken_back = False
            if self.off_by <= {"program"}:
                self.off_by = frozenset()

    def end_rest(self) -> None:
        """The same, and the brakes open; refused while a stop is latched."""
        if self.state == "run":
            self.take_back()

    def woken(self) -> None:
        """The controller has started again: levels are what they are, nothing rises."""
        for signal in self.signals.values():
            signal.counted = signal.level
        self.off_by = self.gave if self.signals["drives_off"].level else frozenset()

    def left_network(self) -> None:
        """The controller goes off the network."""
        if self.state == "acknowledged":
            self.state = "released"
        self.off_by = frozenset()

    def tick(self, on_the_network: bool) -> None:
        """A millisecond passes."""
        self.now += 1
        stop = self.signals["emergency_stop"]
        if self.let_go is not None and self.now - self.let_go >= DEBOUNCE:
            self.let_go = None
            if self._happens("release"):
                self.barrier = max(self.barrier, stop.message)
        if self.signals["drives_off"].settle(self.now):
            self.off_by |= self.gave
        confirmed = self.signals["conf_mess"].settle(self.now)
        switched = self.signals["drives_on"].settle(self.now)
        conf = self.signals["conf_mess"].message
        drives = self.signals["drives_on"].message
        if confirmed and on_the_network and conf > self.barrier and self._happens("conf_mess"):
            self.acknowledged = conf
        off = self.signals["drives_off"].counted
        if switched and not off:
            self.off_by = frozenset()
            if on_the_network and drives > self.acknowledged:
                self._happens("drives_on")
        self._let_go()
