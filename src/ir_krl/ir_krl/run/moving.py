"""Motions and spline blocks as statements, with what triggers do meanwhile and what stands after
WITH.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from functools import partial
from typing import TypeVar

from ir_krl.errors import KrlRunError
from ir_krl.language import Tree
from ir_krl.run.assigning import Assigning
from ir_krl.run.commands import Motion, SetOutput, SplineBlock, TimeBlock
from ir_krl.run.motions import Motions
from ir_krl.run.values import copied

_Built = TypeVar("_Built", Motion, SplineBlock)


class Moving(Assigning):
    """Runs motions; what they are is built by `_motions`."""

    _motions: Motions
    _triggers: list[tuple[float, Tree]]

    def _trigger(self, tree: Tree) -> None:
        when, where, delay, action = tree.children[0], *tree.children[1:4]
        at = self.expressions.number(where, str(when))
        if str(when) not in ("DISTANCE", "PATH") or self.expressions.number(delay, "DELAY") != 0.0:
            self.note(
                tree, "a TRIGGER acts at an end of its motion: path and delay aren't modelled"
            )
        self._triggers.append((at if str(when) == "DISTANCE" else 1.0, action))

    def _ptp(self, tree: Tree) -> None:
        due = self._triggers
        self._triggers = []
        self._act(action for at, action in due if at == 0.0)
        self.commands.append(self._with_settings(tree, lambda: self._motions.motion(tree)))
        self._act(action for at, action in due if at != 0.0)

    def _act(self, actions: Iterable[Tree]) -> None:
        """What triggers do while the robot moves."""
        for action in actions:
            self.continuing = True
            getattr(self, f"_{action.data}")(action)
        self.continuing = False

    _lin = _circ = _ptp

    def _spline_block(self, tree: Tree) -> None:
        """A block with its triggers: what they switch on first counts from its start, the rest from
        its end, so that no part of a process is taken for positioning.
        """
        due = self._triggers
        self._triggers = []
        block = self._with_settings(tree, lambda: self._block(tree))
        inside = self._triggers
        self._triggers = []
        self._act(action for at, action in due if at == 0.0)
        before = len(self.commands)
        self._act(action for _, action in inside)
        made = self.commands[before:]
        self.commands[before:] = []
        first = {one.number: one for one in reversed(made) if isinstance(one, SetOutput)}
        early = [one for one in first.values() if one.value]
        late = [one for one in made if one not in early]
        self.commands += [*reversed(early), block, *late]
        self._act(action for at, action in due if at != 0.0)

    def _with_settings(self, tree: Tree, build: Callable[[], _Built]) -> _Built:
        """Build with what stands after WITH; it holds for this motion only."""
        settings = next(
            child for child in tree.children if isinstance(child, Tree) and child.data == "settings"
        )
        assignments = [one for one in settings.children if one is not None]
        if not assignments:
            return build()
        shared = self.memory.shared
        before = {name: copied(value) for name, value in shared.items() if name.startswith("$")}
        for assignment in assignments:
            self._assignment(assignment)
        built = build()
        for name in [name for name in shared if name.startswith("$") and name not in before]:
            del shared[name]
        shared.update(before)
        return built

    def _block(self, tree: Tree) -> SplineBlock:
        word, _, *parts, approximation = tree.children
        motions: list[Motion] = []
        times: list[TimeBlock] = []
        start: int | None = None
        marks: list[tuple[int, float]] = []
        for part in parts:
            match part.data:
                case "time_start":
                    start = len(motions)
                    marks = []
                case "time_part":
                    marks.append(
                        (len(motions), self.expressions.number(part.children[0], "TIME_BLOCK PART"))
                    )
                case "time_end":
                    seconds = self.expressions.number(part.children[0], "TIME_BLOCK END")
                    if start is None or seconds <= 0.0 or start == len(motions):
                        raise KrlRunError(
                            "TIME_BLOCK END needs a START, motions and a time above 0 s",
                            self.place(part),
                        )
                    times.append(
                        TimeBlock(start, len(motions), tuple(marks), seconds, self.place(part))
                    )
                    start = None
                case "assignment" | "trigger" | "const_vel" | "stop_when":
                    getattr(self, f"_{part.data}")(part)
                case _:
                    motions.append(self._with_settings(part, partial(self._motions.motion, part)))
        if not motions:
            raise KrlRunError("a spline block without motions", self.place(tree))
        axis = str(word) == "PTP_SPLINE"
        blend = self._motions.blend(approximation)
        return SplineBlock(axis, tuple(motions), tuple(times), self.place(tree), blend)
