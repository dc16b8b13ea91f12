"""Assignments as statements: to variables, to outputs and to the groups of signals that name
them.
"""

from __future__ import annotations

from ir_krl.errors import KrlRunError, Place
from ir_krl.language import Tree
from ir_krl.run.commands import SetOutput
from ir_krl.run.control import Control
from ir_krl.run.signals import OUTPUT, SIGNALS, Signals
from ir_krl.run.system import HARMLESS, MODELLED
from ir_krl.run.values import Symbol, kind_of


class Assigning(Control):
    """Sets values and outputs; what signals are called is known to `_signals`."""

    _signals: Signals

    def _assignment(self, tree: Tree) -> None:
        access, expression = tree.children
        path = self.expressions.path(access)
        value = self.expressions.value(expression)
        (name, index), where = path[0], self.place(tree)
        if name in self._signals.groups and index is None:
            for number, level in self._signals.group_bits(name, value, where):
                self._set_output(number, level, where)
            return
        if name == OUTPUT and index is not None:
            if not isinstance(value, bool):
                raise KrlRunError(f"$OUT[{index[0]}] is set to {kind_of(value)}", where)
            self._set_output(index[0], value, where)
            return
        if name == "$IPO_MODE" and value != Symbol("BASE"):
            raise KrlRunError(
                f"$IPO_MODE {kind_of(value)}: a tool that stands in the cell isn't read", where
            )
        if name.startswith("$") and name not in MODELLED and name not in HARMLESS:
            self.note(tree, f"{name} isn't modelled")
        self.memory.set(path, value, where)

    def _set_output(self, number: float, level: bool, place: Place, pulse: float = 0.0) -> None:
        """Set a digital output. Raises KrlRunError for one that no controller has."""
        if number != int(number) or not 1 <= number <= SIGNALS:
            raise KrlRunError(
                f"$OUT[{number:g}]: outputs have whole numbers from 1 to {SIGNALS}", place
            )
        self.commands.append(SetOutput(int(number), level, place, pulse, self.continuing))
        if pulse == 0.0:
            self.memory.set(((OUTPUT, (int(number),)),), level, place)
