"""Is the PLC still there? Watched from its first heartbeat on, in plant time."""

from __future__ import annotations


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
