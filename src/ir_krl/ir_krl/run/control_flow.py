"""Control structures: which statements run, how often; waiting; what stops the advance run."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.language import SyntaxTree, Word, place_of
from ir_krl.run.commands import (
    AdvanceStop,
    Command,
    Motion,
    SplineBlock,
    StandStill,
    Switch,
    WaitForCondition,
)
from ir_krl.run.expressions import Expressions, same
from ir_krl.run.memory import Memory, Step, Watched, module_of
from ir_krl.run.notes import Effect, Note
from ir_krl.run.signals import CYCLIC, FLAG, INPUT, TIMER, TIMER_FLAG, Signals
from ir_krl.run.values import Unknown, Value, integer

STATEMENTS_MAX = 200_000
"""Statements that one run may take: a loop that never ends is named instead of followed for
ever.
"""
WAIT_MAX = 604_800.0  # s
_TICK = 1e-3  # s, of a timer
_ENDLESS = "give what ends it by --set or --input"
Again = Callable[[], tuple[bool, bool | None]]
"""Whether a loop goes on, and whether that hangs on nothing that is known; None: on its exits."""


class LoopExit(Exception):  # noqa: N818 - no error: a statement
    """EXIT."""


class Endless(Exception):  # noqa: N818 - no error: nothing follows
    """A loop that nothing leaves: what stands behind it is never reached."""


@dataclass
class Jump(Exception):  # noqa: N818 - no error: a statement
    """GOTO a label. known: a branch around it was taken by values that are known."""

    label: str
    place: SourcePlace
    known: bool = False


@dataclass
class Returned(Exception):  # noqa: N818 - no error: a statement
    """RETURN, with the value of a function."""

    value: Value | None


@dataclass
class _Turn:
    """Jumps back to a label: how often, and how things stood when it was reached last."""

    count: int
    watched: Watched
    exits: int


@dataclass(frozen=True)
class Clock:
    """A timer: `value` [ms] that it was set to, and after how many commands that was and it began
    to run; None: never, it stands.
    """

    value: float = 0.0
    set_at: int | None = None
    runs_at: int | None = None


@dataclass
class Control:
    """Runs bodies of statements: each kind has a method of its name, `_if_` of the rule `if_`."""

    memory: Memory
    loop_passes: int
    commands: list[Command] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    statements: int = 0
    continuing: bool = False  # CONTINUE was the statement before
    triggered: Switch | None = None  # statements run beside a motion, as a TRIGGER asks for
    expressions: Expressions = field(init=False)
    _signals: Signals = field(init=False)
    _guessed_exits: int = 0  # times that an assumed value decided about leaving a loop
    _known_exits: int = 0  # and a known one
    _timers: dict[int, Clock] = field(default_factory=dict)
    _flags: dict[int, SyntaxTree] = field(default_factory=dict)  # what cyclical flags are set to
    _said: dict[tuple[str, Effect], int] = field(default_factory=dict)  # where among the notes
    # of a note that is said again
    _places: dict[int, set[SourcePlace]] = field(default_factory=dict)

    def _at(self, file: str) -> None:
        """Statements of this file run from here on."""
        self.expressions.file = file
        self.memory.module = module_of(file)

    def body(self, body: SyntaxTree) -> None:
        """Run all statements of a body; jumps to its labels are followed."""
        turns: dict[str, _Turn] = {}
        try:
            self._statements(body, turns)
        finally:
            for turn in turns.values():
                self.memory.forget(turn.watched)

    def _statements(self, body: SyntaxTree, turns: dict[str, _Turn]) -> None:
        at = 0
        while at < len(body.children):
            try:
                self._statement(body.children[at])
                at += 1
            except Jump as jump:
                target = _label_in(body, jump.label)
                if target is None:
                    raise
                back = target <= at
                again = not back or self._turns_back(body.children[target : at + 1], jump, turns)
                at = target if again else at + 1

    def _statement(self, statement: SyntaxTree) -> None:
        self.statements += 1
        self._check_budget(statement)
        try:
            getattr(self, f"_{statement.data}")(statement)
        except KrlRunError as error:  # of a value that doesn't know where it stands
            if error.place.line:
                raise
            raise KrlRunError(error.reason, self.place(statement)) from None
        self.continuing = self._is_beside or statement.data == "continue_"

    def _turns_back(
        self, between: Sequence[SyntaxTree], jump: Jump, turns: dict[str, _Turn]
    ) -> bool:
        """Whether a jump back is followed: not for ever, where nothing that is known ends it."""
        turn = turns.get(jump.label)
        if turn is None:
            turn = _Turn(0, self.memory.watch(), self._guessed_exits)
            turns[jump.label] = turn
        turn.count += 1
        still = turn.count > 1 and not self.memory.changed(turn.watched)
        bound = not any(_has_way_out(one) for one in between[:-1])
        open_ = not jump.known and (bound or self._guessed_exits > turn.exits)
        if turn.count >= self.loop_passes and (still or open_):
            self._left(jump.place, f"GOTO {jump.label}", turn.count)
            if bound and between[-1].data == "goto":
                raise Endless
            return False
        self.memory.forget(turn.watched)
        turn.watched = self.memory.watch()
        turn.exits = self._guessed_exits
        return True

    def place(self, tree: SyntaxTree | Word) -> SourcePlace:
        """Where a piece of the program stands."""
        return place_of(tree, self.expressions.file)

    def note(self, tree: SyntaxTree | Word, text: str, effect: Effect = Effect.NONE) -> None:
        """Note once what a reader should know."""
        self.note_at(self.place(tree), text, effect)

    def note_at(self, place: SourcePlace, text: str, effect: Effect = Effect.NONE) -> None:
        """Note once what a reader should know, of a place."""
        at = self._said.setdefault((text, effect), len(self.notes))
        if at == len(self.notes):
            self.notes.append(Note(place, text, effect))
        elif place not in self._places.setdefault(at, {self.notes[at].place}):
            self._places[at].add(place)
            self.notes[at] = replace(self.notes[at], places=len(self._places[at]))

    def stop(self, place: SourcePlace, why: str, *, assumed: bool = False) -> None:
        """The advance run stops here, unless CONTINUE stands before: no corner is rounded. assumed:
        a note says so already.
        """
        if not self.continuing:
            self.memory.arrived()
        if not self.continuing and self._is_rounding:
            self.commands.append(AdvanceStop(why, place))
            if not assumed:
                self.note_at(place, f"{why} stops the advance run: the motion before ends at rest")

    @property
    def _is_beside(self) -> bool:
        """Whether what runs is called by a TRIGGER: the robot goes on meanwhile."""
        return self.triggered is not None

    @property
    def _is_rounding(self) -> bool:
        """Whether the last motion is to be left for a next one that didn't come yet."""
        for command in reversed(self.commands):
            if isinstance(command, Motion | SplineBlock):
                return command.blend is not None
            if (
                isinstance(command, AdvanceStop | StandStill | WaitForCondition)
                or not command.on_path
            ):
                return False
        return False

    def _decided(self, tree: SyntaxTree, what: str) -> tuple[bool, bool]:
        """A condition, and whether it hangs on an assumed value or on nothing at all."""
        before = self.memory.guesses
        holds = self.expressions.truth(tree, what)
        self.continuing = self._is_beside
        return holds, self.memory.guesses > before or _is_constant(tree)

    def _if_(self, tree: SyntaxTree) -> None:
        condition, then, otherwise = tree.children
        holds, open_ = self._decided(condition, "the condition of IF")
        self._count_exits(tree, open_=open_)
        chosen = then if holds else otherwise
        if chosen is not None:
            self._branch(chosen, open_=open_)

    def _branch(self, body: SyntaxTree, *, open_: bool) -> None:
        """A branch that a condition has chosen; open_: by an assumed value, or by none."""
        try:
            self.body(body)
        except Jump as jump:
            jump.known = jump.known or not open_
            raise

    def _count_exits(self, tree: SyntaxTree, *, open_: bool) -> None:
        """Count a condition that decides whether a loop is left."""
        if _leaves(tree):
            self._guessed_exits += open_
            self._known_exits += not open_

    def _for_(self, tree: SyntaxTree) -> None:
        name, first, last, step, body = tree.children
        value, end = (self.expressions.bound(one) for one in (first, last))
        by = 1 if step is None else integer(self.expressions.value(step), "STEP", self.place(step))
        if by == 0:
            raise KrlRunError("STEP is 0; it must be another number", self.place(step))
        path: tuple[Step, ...] = ((str(name), None),)
        place = self.place(tree)
        self.memory.set(path, value, place)
        try:
            while (value <= end) if by > 0 else (value >= end):
                self.body(body)
                value = integer(self.memory.get(path, place), str(name), place) + by
                self.memory.set(path, value, place)
                self._one_more(tree)
        except LoopExit:
            pass

    def _loop(self, tree: SyntaxTree) -> None:
        body = tree.children[0]
        open_ = None if _leaves(body) else True
        self._repeated(tree, body, "LOOP", lambda: (True, open_))

    def _while_(self, tree: SyntaxTree) -> None:
        condition, body = tree.children
        holds, _ = self._decided(condition, "the condition of WHILE")
        if holds:
            self._repeated(tree, body, "WHILE", self._again(condition, body, wanted=True))

    def _repeat(self, tree: SyntaxTree) -> None:
        body, condition = tree.children
        self._repeated(tree, body, "REPEAT", self._again(condition, body, wanted=False))

    def _again(self, condition: SyntaxTree, body: SyntaxTree, *, wanted: bool) -> Again:
        """Asks whether a loop goes on, and whether that hangs on nothing that is known."""
        exits = _is_constant(condition) and _leaves(body)

        def asked() -> tuple[bool, bool | None]:
            holds, open_ = self._decided(condition, "the condition of a loop")
            return holds is wanted, None if exits else open_

        return asked

    def _repeated(self, tree: SyntaxTree, body: SyntaxTree, word: str, again: Again) -> None:
        """Passes of a loop while `again` says so. One that nothing known ends, since it hangs on
        assumed values or leaves everything as it was, is left after `loop_passes`.
        """
        passes = 0
        try:
            while True:
                goes_on, settled = self._pass(tree, body, again)
                passes += 1
                if not goes_on:
                    return
                if passes >= self.loop_passes and not settled:
                    break
        except LoopExit:
            return
        self._left(self.place(tree), word, passes)
        if not _leaves(body) and all(
            _is_constant(one)
            for one in tree.children
            if one is not body and isinstance(one, SyntaxTree)
        ):
            raise Endless

    def _pass(self, tree: SyntaxTree, body: SyntaxTree, again: Again) -> tuple[bool, bool]:
        """One pass of a loop: whether it goes on, and whether something known may end it."""
        guessed = self._guessed_exits
        known = self._known_exits
        watched = self.memory.watch()
        try:
            self.body(body)
            self._one_more(tree)
            goes_on, open_ = again()
            still = not self.memory.changed(watched)
        finally:
            self.memory.forget(watched)
        if open_ is None:
            open_ = self._guessed_exits > guessed and self._known_exits == known
        return goes_on, not (open_ or still)

    def _left(self, place: SourcePlace, word: str, passes: int) -> None:
        times = "once" if passes == 1 else f"{passes} times"
        self.note_at(
            place,
            f"{word}: nothing that is known ends it, followed {times} (--loop-passes)",
            Effect.MOTIONS,
        )

    def _one_more(self, tree: SyntaxTree) -> None:
        """A pass of a loop counts as a statement: an empty loop ends too."""
        self.statements += 1
        self._check_budget(tree)

    def _check_budget(self, tree: SyntaxTree) -> None:
        if self.statements > STATEMENTS_MAX:
            raise KrlRunError(
                f"more than {STATEMENTS_MAX} statements: does a loop never end? {_ENDLESS}",
                self.place(tree),
            )

    def _switch(self, tree: SyntaxTree) -> None:
        subject, *cases, default = tree.children
        before = self.memory.guesses
        value = self.memory.guess(self.expressions.value(subject), 0, self.place(tree))
        self.continuing = self._is_beside
        open_ = self.memory.guesses > before
        self._count_exits(tree, open_=open_)
        for case in cases:
            *labels, body = case.children
            if any(same(self.expressions.value(label), value) for label in labels):
                self._branch(body, open_=open_)
                return
        if default is not None:
            self._branch(default.children[0], open_=open_)

    def _exit(self, tree: SyntaxTree) -> None:
        raise LoopExit

    def _return_(self, tree: SyntaxTree) -> None:
        raise Returned(
            None if tree.children[0] is None else self.expressions.value(tree.children[0])
        )

    def _halt(self, tree: SyntaxTree) -> None:
        self.stop(self.place(tree), "HALT")
        self.note(tree, "HALT waits for the operator: taken as no pause", Effect.TIMES)

    def _const_vel(self, tree: SyntaxTree) -> None:
        self.note(
            tree,
            "CONST_VEL isn't modelled: the tool accelerates and brakes within the range as well",
            Effect.SPEEDS,
        )

    def _stop_when(self, tree: SyntaxTree) -> None:
        self.note(tree, "STOP WHEN isn't followed: taken as not stopping", Effect.TIMES)

    def _continue_(self, tree: SyntaxTree) -> None:
        """Keeps the advance run going: an output that follows is set without a stop."""

    def _goto(self, tree: SyntaxTree) -> None:
        raise Jump(str(tree.children[0]), self.place(tree))

    def _label(self, tree: SyntaxTree) -> None:
        """A label alone does nothing."""

    def _wait_seconds(self, tree: SyntaxTree) -> None:
        seconds = self.expressions.number(tree.children[0], "the time of WAIT SEC")
        if seconds > WAIT_MAX:
            raise KrlRunError(
                f"WAIT SEC {seconds:g}: a wait is read up to {WAIT_MAX:g} s, a week",
                self.place(tree),
            )
        if self.triggered is not None:  # the robot goes on; what follows is done later
            waited = self.triggered.waited + max(seconds, 0.0)
            self.triggered = replace(self.triggered, waited=waited)
        elif seconds > 0.0:
            self._wait(seconds, self.place(tree))
        else:  # passed at once, as on the controller; yet the advance run stops
            self.stop(self.place(tree), f"WAIT SEC {seconds:g}")

    def _wait(self, seconds: float, place: SourcePlace) -> None:
        self.memory.arrived()
        self.commands.append(StandStill(seconds, place))
        self._signals.stood(seconds, place)

    def _wait_for(self, tree: SyntaxTree) -> None:
        """WAIT FOR: nobody sets inputs here, so the wait is taken as fulfilled, and a note says
        what is assumed of its time.
        """
        condition = tree.children[0]
        self._check_names(condition)
        for index, value in self._waited(condition, wanted=True):
            self._signals.expected[index] = value
        place = self.place(tree)
        if self.continuing:
            text = "WAIT FOR after CONTINUE: taken as fulfilled when it is reached"
            self.note_at(place, text, Effect.TIMES)
            return
        if self._is_blocked(condition, wanted=True):
            text = "this wait never ends by what the program itself sets: taken as ended"
            self.note_at(place, text, Effect.MOTIONS)
            self._settle(condition, wanted=True)
        if _names(condition) & {TIMER, TIMER_FLAG}:
            seconds = self._timed(condition)
            if seconds is not None and seconds > 0.0:
                text = f"{_text_of(condition)}: taken as a wait of {seconds:g} s from standstill"
                self.note_at(place, text, Effect.TIMES)
                self._wait(seconds, place)
                return
            if seconds is None:
                text = f"{_text_of(condition)}: nobody knows how long until then, taken as 0 s"
                self.note_at(place, text, Effect.TIMES)
        self.memory.arrived()
        self.commands.append(WaitForCondition(_text_of(condition), place))
        self._signals.moved()

    def _is_blocked(self, tree: SyntaxTree, *, wanted: bool) -> bool:
        """Whether flags and variables, which only the program sets, keep a condition from what a
        wait wants of it; inputs and the state of the controller may come to it.
        """
        match tree.data:
            case "negated":
                return self._is_blocked(tree.children[1], wanted=not wanted)
            case "joined" if str(tree.children[1]) in ("AND", "OR"):
                sides = [self._is_blocked(one, wanted=wanted) for one in tree.children[::2]]
                every = (str(tree.children[1]) == "AND") is wanted
                return any(sides) if every else all(sides)
            case "compared" if _is_truth_comparison(tree):
                same = _holds_with_left(tree)
                return self._is_blocked(tree.children[0], wanted=wanted is same)
        if not self._is_own(tree):
            return False
        before = self.memory.guesses
        values = [self.expressions.value(one) for one in _accesses(tree)]
        if any(isinstance(one, Unknown) for one in values):
            return False  # a note says so
        holds = self.expressions.truth(tree, "the condition of WAIT FOR")
        return holds is not wanted and self.memory.guesses == before

    def _is_own(self, tree: SyntaxTree) -> bool:
        """Whether an expression reads flags and variables alone."""
        signals = self.expressions.signals
        outside = (*signals.groups, *signals.aliases)
        return not _calls(tree) and all(
            name == FLAG or not (name.startswith("$") or name in outside) for name in _names(tree)
        )

    def _settle(self, tree: SyntaxTree, *, wanted: bool) -> None:
        """Flags and variables hold what a wait that was taken as ended leaves no choice."""
        match tree.data:
            case "negated":
                self._settle(tree.children[1], wanted=not wanted)
            case "joined" if str(tree.children[1]) == ("AND" if wanted else "OR"):
                self._settle(tree.children[0], wanted=wanted)
                self._settle(tree.children[2], wanted=wanted)
            case "compared" if _is_truth_comparison(tree):
                same = _holds_with_left(tree)
                self._settle(tree.children[0], wanted=wanted is same)
            case "access" if self._is_own(tree):
                self.memory.set(self.expressions.path(tree), wanted, self.place(tree))

    def _timed(self, condition: SyntaxTree) -> float | None:
        """Seconds until a timer that was set and started just before has passed a bound; None where
        the condition is another one, or time has passed since.
        """
        bound = 0.0
        if condition.data == "compared" and str(condition.children[1]) in (">", ">="):
            given = condition.children[2]
            if not _is_constant(given):
                return None
            bound = self.expressions.number(given, "the bound of a timer")
            condition = condition.children[0]
        if condition.data != "access":
            return None
        (name, index), *_ = self.expressions.path(condition)
        clock = self._timers.get(index[0]) if index is not None else None
        if name not in (TIMER, TIMER_FLAG) or clock is None or clock.set_at is None:
            return None
        if clock.runs_at is None:
            return None
        since = self.commands[max(clock.set_at, clock.runs_at) :]
        if any(isinstance(one, Motion | SplineBlock | WaitForCondition) for one in since):
            return None
        waited = sum(one.seconds for one in since if isinstance(one, StandStill))
        return (bound - clock.value) * _TICK - waited

    def _waited(self, tree: SyntaxTree, *, wanted: bool) -> list[tuple[int, bool]]:
        """Inputs that a condition which holds leaves no choice."""
        match tree.data:
            case "negated":
                return self._waited(tree.children[1], wanted=not wanted)
            case "joined" if str(tree.children[1]) == ("AND" if wanted else "OR"):
                left, _, right = tree.children
                return self._waited(left, wanted=wanted) + self._waited(right, wanted=wanted)
            case "joined" if str(tree.children[1]) == ("OR" if wanted else "AND"):
                return self._waited_one(tree.children[::2], wanted=wanted)
            case "compared":
                return self._waited_compared(tree, wanted=wanted)
            case "access":
                return self._waited_signal(tree, wanted=wanted)
        return []

    def _waited_signal(self, tree: SyntaxTree, *, wanted: bool) -> list[tuple[int, bool]]:
        """Inputs that a signal leaves no choice: itself, or those that a cyclical flag follows."""
        (name, index), *rest = self.expressions.path(tree)
        if name == INPUT and index is not None and not rest:
            return [(index[0], wanted)]
        if name == CYCLIC and index is not None and index[0] in self._flags:
            return self._waited(self._flags[index[0]], wanted=wanted)
        return []

    def _waited_compared(self, tree: SyntaxTree, *, wanted: bool) -> list[tuple[int, bool]]:
        """Inputs that a comparison leaves no choice: with TRUE or FALSE, or of a group of inputs
        with a number.
        """
        left, sign, right = tree.children
        if right.data in ("true", "false"):
            same = (str(sign) == "==") is (right.data == "true")
            return self._waited(left, wanted=wanted is same)
        if right.data != "number":
            return []
        group = self._signals.groups.get(str(left.children[0]) if left.data == "access" else "")
        equal = (str(sign) == "==") is wanted and str(sign) in ("==", "<>")
        number = self.expressions.number(right, "what a group is compared with")
        if group is None or group.kind != INPUT or not equal:
            return []
        if number != int(number) or not 0 <= number < 1 << len(group.numbers):
            return []
        return [(n, bool(int(number) >> k & 1)) for k, n in enumerate(group.numbers)]

    def _waited_one(self, sides: Sequence[SyntaxTree], *, wanted: bool) -> list[tuple[int, bool]]:
        """Inputs of that one of two conditions which ends a wait: of one that holds as they are
        given, else of the first that may.
        """
        given = self._signals.inputs
        choices = [self._waited(side, wanted=wanted) for side in sides]
        held = [one for one in choices if one and all(given.get(n) is on for n, on in one)]
        open_ = [one for one in choices if all(given.get(n, on) is on for n, on in one)]
        return next(iter([*held, *open_]), [])

    def _check_names(self, tree: Any) -> None:
        """Note a name in a condition that nothing is known of."""
        if isinstance(tree, SyntaxTree) and tree.data == "access":
            name = str(tree.children[0])
            signals = self.expressions.signals
            memory = self.memory
            declared = name in signals.aliases or name in signals.groups or memory.declared(name)
            if not declared and not name.startswith("$"):
                text = f"{name} isn't declared in the files: the wait is taken as one that ends"
                self.note(tree, text, Effect.TIMES)
        for child in tree.children if isinstance(tree, SyntaxTree) else ():
            self._check_names(child)


def _is_truth_comparison(compared: SyntaxTree) -> bool:
    """Whether a comparison is one with TRUE or FALSE."""
    return compared.children[2].data in ("true", "false")


def _holds_with_left(compared: SyntaxTree) -> bool:
    """Of a comparison with TRUE or FALSE: whether it holds where its left side does."""
    _, sign, right = compared.children
    return (str(sign) == "==") is (right.data == "true")


def _accesses(tree: SyntaxTree) -> list[SyntaxTree]:
    """What an expression reads."""
    if tree.data == "access":
        return [tree]
    return [
        found for one in tree.children if isinstance(one, SyntaxTree) for found in _accesses(one)
    ]


def _calls(tree: SyntaxTree) -> bool:
    """Whether an expression calls a function."""
    return tree.data == "call" or any(
        _calls(one) for one in tree.children if isinstance(one, SyntaxTree)
    )


def _names(tree: SyntaxTree) -> set[str]:
    """Names of what an expression reads."""
    own = {str(tree.children[0])} if tree.data == "access" else set()
    return own.union(*(_names(one) for one in tree.children if isinstance(one, SyntaxTree)))


def _text_of(tree: Any) -> str:
    """An expression as text, for people."""
    if not isinstance(tree, SyntaxTree):
        return "" if tree is None else str(tree)
    if tree.data in ("true", "false"):
        return tree.data.upper()
    parts = [_text_of(child) for child in tree.children]
    if tree.data == "index":
        return f"[{', '.join(parts)}]"
    if tree.data == "joined":
        return f"({' '.join(parts)})"
    return (" " if tree.data == "negated" else "").join(parts)


def _label_in(body: SyntaxTree, name: str) -> int | None:
    """The place of a label among the statements of a body."""
    labels = (k for k, one in enumerate(body.children) if one.data == "label")
    return next((k for k in labels if str(body.children[k].children[0]) == name), None)


def _is_constant(tree: SyntaxTree) -> bool:
    """Whether an expression names nothing: WHILE TRUE, WHILE 1==1."""
    if tree.data in ("access", "call"):
        return False
    return all(_is_constant(one) for one in tree.children if isinstance(one, SyntaxTree))


def _has_way_out(tree: SyntaxTree) -> bool:
    """Whether a jump, a return or an exit stands in a statement."""
    if tree.data in ("goto", "return_", "exit"):
        return True
    return any(_has_way_out(one) for one in tree.children if isinstance(one, SyntaxTree))


def _leaves(body: SyntaxTree) -> bool:
    """Whether a loop may be left from its body: by an EXIT that stands in no loop inside, by a jump
    or by a RETURN.
    """
    inner = ("loop", "for_", "while_", "repeat")
    return any(
        child.data in ("exit", "goto", "return_")
        or (_leaves(child) if child.data not in inner else _has_way_far_out(child))
        for child in body.children
        if isinstance(child, SyntaxTree)
    )


def _has_way_far_out(tree: SyntaxTree) -> bool:
    """Whether a jump or a return stands in a statement: an EXIT leaves the loop inside alone."""
    if tree.data in ("goto", "return_"):
        return True
    return any(_has_way_far_out(one) for one in tree.children if isinstance(one, SyntaxTree))
