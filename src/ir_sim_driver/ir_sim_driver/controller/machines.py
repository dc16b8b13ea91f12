"""The states of the cell's machines, as signals switch them; a change takes its time.

A machine with a switch is in the state that its cell says until its signal is heard for the first
time. While
it changes it is in both states: their bodies are all there, with what they sweep.
"""

from __future__ import annotations

from collections.abc import Iterable

from ir_description import Cell, Equipment
from ir_msgs_py.contact import MachineState

# s: a change that ends within this is waited for, as the clocks of PLC and plant differ a little
SOON = 0.5


class Machines:
    """Machines of `cell`; times [s] are of the plant."""

    def __init__(self, cell: Cell) -> None:
        self._states: dict[str, str] = {}
        self._moving: dict[str, tuple[str, float]] = {}  # the next state, and when it is reached
        self.stand_in(cell)

    def stand_in(self, cell: Cell) -> None:
        """Machines of another cell; a door that is switched as before stays as it is."""
        before = {name: state for name, state in self._states.items() if self._switched(name)}
        self.cell = cell
        self._states = {machine.name: machine.state for machine in cell.equipment}
        for machine in cell.equipment:
            known = [state.name for state in machine.states]
            if machine.switch is not None and before.get(machine.name) in known:
                self._states[machine.name] = before[machine.name]
        self._moving = {
            name: change
            for name, change in self._moving.items()
            if name in before and self._switched(name)
        }

    def _switched(self, name: str) -> bool:
        return any(
            machine.name == name and machine.switch is not None for machine in self.cell.equipment
        )

    @property
    def next_change(self) -> float:
        """When the next machine reaches its state; inf where none changes."""
        return min((when for _, when in self._moving.values()), default=float("inf"))

    def hear(self, signal: str, level: bool, now: float) -> bool:
        """Take the level of a signal; returns whether a machine begins to change."""
        begun = False
        for machine in self.cell.equipment:
            if machine.switch is not None and machine.switch.signal == signal:
                begun |= self._turn(
                    machine, machine.switch.on if level else machine.switch.off, now
                )
        return begun

    def _turn(self, machine: Equipment, target: str, now: float) -> bool:
        assert machine.switch is not None
        name = machine.name
        time = machine.switch.time
        state = self._states[name]
        (ahead, when) = self._moving.get(name, ("", now))
        if target == (ahead or state):
            return False
        if ahead and target == state:  # turned round in between
            self._states[name] = ahead
            time = max(0.0, time - (when - now))
        self._moving[name] = target, now + time
        return True

    def step(self, now: float) -> bool:
        """End what is due; returns whether anything was."""
        due = [name for name, (_, when) in self._moving.items() if when <= now]
        for name in due:
            self._states[name], _ = self._moving.pop(name)
        return bool(due)

    def present(self, machine: Equipment) -> tuple[str, ...]:
        """The states whose bodies are there."""
        ahead = self._moving.get(machine.name)
        return (self._states[machine.name], *(() if ahead is None else ahead[:1]))

    def present_states(self) -> dict[str, tuple[str, ...]]:
        """The same of all machines, by name."""
        return {machine.name: self.present(machine) for machine in self.cell.equipment}

    def states(self, now: float) -> tuple[MachineState, ...]:
        """What every machine is in, and changes to."""
        result = []
        for name, state in self._states.items():
            ahead, when = self._moving.get(name, ("", now))
            result.append(MachineState(name, state, ahead, max(0.0, when - now)))
        return tuple(result)

    def soon(self, wanted: Iterable[str], now: float) -> bool:
        """Whether a machine will be in a wanted state ("lathe=door_open") within SOON, but isn't
        yet.
        """
        for text in wanted:
            name, _, state = text.partition("=")
            ahead, when = self._moving.get(name, ("", now))
            if ahead == state and when - now <= SOON:
                return True
        return False

    def refusal(self, wanted: Iterable[str], now: float) -> str:
        """Why a movement that relies on these states can't start, "" when it can."""
        sentences = (self._refusal(text, now) for text in wanted)
        return next((sentence for sentence in sentences if sentence), "")

    def _refusal(self, text: str, now: float) -> str:
        name, _, wanted = text.partition("=")
        machine = next((each for each in self.cell.equipment if each.name == name), None)
        if machine is None:
            known = ", ".join(self._states)
            return (
                f"the trajectory relies on {text[:80]!a}: no machine has that name; known are "
                f"{known}"
            )
        states = [state.name for state in machine.states]
        if wanted not in states:
            known = ", ".join(states) or "none"
            return (
                f"the trajectory relies on {text[:80]!a}: {name} has no such state; known are "
                f"{known}"
            )
        state = self._states[name]
        (ahead, when) = self._moving.get(name, ("", now))
        if state == wanted and not ahead:
            return ""
        going = f", changing to {ahead} for another {when - now:.2f} s" if ahead else ""
        return (
            f"{name} is {state}{going}: the trajectory relies on {wanted}; "
            f"{self._advice(machine, wanted)}"
        )

    def _advice(self, machine: Equipment, wanted: str) -> str:
        switch = machine.switch
        if switch is None or wanted not in (switch.on, switch.off):
            return "no signal switches it: change the cell or plan again"
        answers = [signal.name for signal in self.cell.signals if signal.follows == switch.signal]
        no = "" if wanted == switch.on else "not "
        last = answers[0] if answers else switch.signal
        return f"wait for signal {no}{last} ({no}{switch.signal} takes {switch.time:g} s)"
