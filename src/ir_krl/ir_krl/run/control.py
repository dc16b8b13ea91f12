"""Control structures: which statements run, how often; waiting."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ir_krl.errors import KrlRunError, Place
from ir_krl.language import Tree, Word, place_of
from ir_krl.run.commands import Command, Wait, WaitFor
from ir_krl.run.expressions import Expressions
from ir_krl.run.memory import Memory, Step
from ir_krl.run.values import Value, integer

STATEMENTS_MAX = 200_000
"""Statements that one run may take: a loop that never ends is named instead of followed for
ever.
"""
WAIT_MAX = 604_800.0  # s


@dataclass(frozen=True)
class Note:
    """Something a reader should know: what was assumed, or what isn't modelled."""

    place: Place
    text: str

    def __str__(self) -> str:
        return f"{self.place}: {self.text}"


class LoopExit(Exception):  # noqa: N818 - no error: a statement
    """EXIT."""


@dataclass
class Returned(Exception):  # noqa: N818 - no error: a statement
    """RETURN, with the value of a function."""

    value: Value | None


@dataclass
class Control:
    """Runs bodies of statements: each kind has a method of its name, `_if_` of the rule `if_`."""

    memory: Memory
    loop_passes: int
    commands: list[Command] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    statements: int = 0
    continuing: bool = False  # CONTINUE was the statement before
    expressions: Expressions = field(init=False)

    def body(self, body: Tree) -> None:
        """Run all statements of a body."""
        for statement in body.children:
            self.statements += 1
            if self.statements > STATEMENTS_MAX:
                raise KrlRunError(
                    f"more than {STATEMENTS_MAX} statements: does a loop never end?",
                    self.place(statement),
                )
            getattr(self, f"_{statement.data}")(statement)
            self.continuing = statement.data == "continue_"

    def place(self, tree: Tree | Word) -> Place:
        """Where a piece of the program stands."""
        return place_of(tree, self.expressions.file)

    def note(self, tree: Tree | Word, text: str) -> None:
        """Note once what a reader should know."""
        self.note_at(self.place(tree), text)

    def note_at(self, place: Place, text: str) -> None:
        """The same of a place."""
        note = Note(place, text)
        if note not in self.notes:
            self.notes.append(note)

    def _if_(self, tree: Tree) -> None:
        condition, then, otherwise = tree.children
        if self.expressions.truth(condition, "the condition of IF"):
            self.body(then)
        elif otherwise is not None:
            self.body(otherwise)

    def _for_(self, tree: Tree) -> None:
        name, first, last, step, body = tree.children
        value, end = (
            integer(self.expressions.value(one), "a bound of FOR", self.place(one))
            for one in (first, last)
        )
        by = 1 if step is None else integer(self.expressions.value(step), "STEP", self.place(step))
        if by == 0:
            raise KrlRunError("STEP is 0", self.place(step))
        path: tuple[Step, ...] = ((str(name), None),)
        try:
            while (value <= end) if by > 0 else (value >= end):
                self.memory.set(path, value, self.place(tree))
                self.body(body)
                value += by
                self._one_more(tree)
        except LoopExit:
            pass

    def _loop(self, tree: Tree) -> None:
        body = tree.children[0]
        passes = None if _leaves(body) else self.loop_passes
        try:
            while passes is None or passes > 0:
                self.body(body)
                self._one_more(tree)
                passes = None if passes is None else passes - 1
        except LoopExit:
            return
        self.note(tree, f"LOOP without EXIT: followed {self.loop_passes} times")

    def _while_(self, tree: Tree) -> None:
        condition, body = tree.children
        try:
            while self.expressions.truth(condition, "the condition of WHILE"):
                self.body(body)
                self._one_more(tree)
        except LoopExit:
            pass

    def _repeat(self, tree: Tree) -> None:
        body, condition = tree.children
        try:
            while True:
                self.body(body)
                self._one_more(tree)
                if self.expressions.truth(condition, "the condition of UNTIL"):
                    return
        except LoopExit:
            pass

    def _one_more(self, tree: Tree) -> None:
        """A pass of a loop counts as a statement: an empty loop ends too."""
        self.statements += 1
        if self.statements > STATEMENTS_MAX:
            raise KrlRunError(
                f"more than {STATEMENTS_MAX} statements: does a loop never end?", self.place(tree)
            )

    def _switch(self, tree: Tree) -> None:
        subject, *cases, default = tree.children
        value = self.expressions.value(subject)
        for case in cases:
            *labels, body = case.children
            if any(self.expressions.value(label) == value for label in labels):
                self.body(body)
                return
        if default is not None:
            self.body(default.children[0])

    def _exit(self, tree: Tree) -> None:
        raise LoopExit

    def _return_(self, tree: Tree) -> None:
        raise Returned(
            None if tree.children[0] is None else self.expressions.value(tree.children[0])
        )

    def _halt(self, tree: Tree) -> None:
        self.note(tree, "HALT waits for the operator: taken as no pause")

    def _const_vel(self, tree: Tree) -> None:
        self.note(
            tree,
            "CONST_VEL isn't modelled: the tool accelerates and brakes within the range as well",
        )

    def _stop_when(self, tree: Tree) -> None:
        self.note(tree, "STOP WHEN isn't followed: taken as not stopping")

    def _continue_(self, tree: Tree) -> None:
        """Keeps the advance run going: an output that follows is set without a stop."""

    def _goto(self, tree: Tree) -> None:
        raise KrlRunError(f"GOTO {tree.children[0]} isn't read", self.place(tree))

    def _label(self, tree: Tree) -> None:
        """A label alone does nothing."""

    def _wait_seconds(self, tree: Tree) -> None:
        seconds = self.expressions.number(tree.children[0], "the time of WAIT SEC")
        if seconds > WAIT_MAX:
            raise KrlRunError(
                f"WAIT SEC {seconds:g}: a wait is read up to {WAIT_MAX:g} s, a week",
                self.place(tree),
            )
        if seconds > 0.0:  # negative times are passed at once, as on the controller
            self.commands.append(Wait(seconds, self.place(tree)))

    def _wait_for(self, tree: Tree) -> None:
        self._check_names(tree.children[0])
        self.commands.append(WaitFor(_written(tree.children[0]), self.place(tree)))

    def _check_names(self, tree: Any) -> None:
        """Raise KrlRunError for a name in a condition that nothing is known of."""
        if isinstance(tree, Tree) and tree.data == "access":
            name = str(tree.children[0])
            signals = self.expressions.signals
            memory = self.memory
            declared = name in signals.aliases or name in signals.groups or memory.declared(name)
            if not declared and not name.startswith("$"):
                raise KrlRunError(f"{name} isn't declared", self.place(tree))
        for child in tree.children if isinstance(tree, Tree) else ():
            self._check_names(child)


def _written(tree: Any) -> str:
    """An expression as text, for people."""
    if not isinstance(tree, Tree):
        return "" if tree is None else str(tree)
    if tree.data in ("true", "false"):
        return tree.data.upper()
    parts = [_written(child) for child in tree.children]
    if tree.data == "index":
        return f"[{', '.join(parts)}]"
    if tree.data == "joined":
        return f"({' '.join(parts)})"
    return (" " if tree.data == "negated" else "").join(parts)


def _leaves(body: Tree) -> bool:
    """Whether an EXIT of this loop stands in its body, not in a loop inside."""
    inner = ("loop", "for_", "while_", "repeat")
    return any(
        child.data == "exit" or (child.data not in inner and _leaves(child))
        for child in body.children
        if isinstance(child, Tree)
    )
