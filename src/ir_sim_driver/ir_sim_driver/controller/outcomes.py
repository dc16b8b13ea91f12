"""How goals ended: numbered when they start, with their energy, what their load was, and their
contact.
"""

from __future__ import annotations

from dataclasses import replace

from ir_sim_driver.controller.cell_watch import CellWatch
from ir_sim_driver.controller.mains import Mains
from ir_sim_driver.load_check import LoadChecks
from ir_sim_driver.motion import ErrorCode, Executor, Outcome


class Outcomes:
    """Of the goals of `executor`; energy is what `mains` counts while they run."""

    def __init__(
        self, executor: Executor, mains: Mains, cell_watch: CellWatch, load_checks: LoadChecks
    ) -> None:
        self._executor = executor
        self._mains = mains
        self._cell_watch = cell_watch
        self._load_checks = load_checks
        self._goals = 0
        self._energy = 0.0
        self._ended: list[Outcome] = []

    def next_id(self) -> int:
        """Id of the goal that starts now."""
        self._goals += 1
        return self._goals

    def started(self) -> None:
        """A goal has started; the one before has ended."""
        self.collect()
        self._energy = self._mains.energy()

    def collect(self) -> None:
        """Take what has ended; a goal that ended by a contact when the robot stands."""
        if not self._executor.ended or self._cell_watch.unsettled:
            return
        for outcome in self._executor.take_outcomes():
            energy = self._mains.energy() - self._energy
            self._ended.append(self._completed(replace(outcome, energy=energy)))

    def _completed(self, outcome: Outcome) -> Outcome:
        contact = self._cell_watch.last
        if (
            outcome.code is ErrorCode.CONTACT and contact is not None
        ):  # its torques are not the load's
            self._load_checks.begin()
            return replace(outcome, contact=contact, sentence=contact.sentence)
        return outcome.weighed(self._load_checks.ended(outcome.label))

    def take(self) -> list[Outcome]:
        """Goals that ended since the last call."""
        ended = self._ended
        self._ended = []
        return ended
