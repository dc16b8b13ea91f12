"""Functions of texts (CHAR arrays), as every controller has them: StrLen, StrComp, StrFind,
StrCopy, StrAdd, StrClear.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.language import SyntaxTree
from ir_krl.run.expressions import Expressions
from ir_krl.run.values import Symbol, Unknown, Value, integer, kind_of, text_of

_ARGUMENTS = {
    "STRLEN": 1,
    "STRCOMP": 3,
    "STRFIND": 4,
    "STRCOPY": 2,
    "STRADD": 2,
    "STRCLEAR": 1,
}
TEXT_FUNCTIONS = frozenset(_ARGUMENTS)
_LETTERS_MAX = 10_000


def text_value(
    name: str, trees: Sequence[Any], expressions: Expressions, place: SourcePlace
) -> Value:
    """What a function of texts returns; StrCopy, StrAdd and StrClear also set their first argument.

    Raises KrlRunError for arguments that it doesn't take.
    """
    trees = [one for one in trees if one is not None]
    if len(trees) != _ARGUMENTS[name]:
        raise KrlRunError(
            f"{name} takes {_ARGUMENTS[name]} arguments, {len(trees)} are given", place
        )
    if name == "STRFIND":
        start = integer(expressions.value(trees[0]), "the first argument of STRFIND", place)
        text, part = _alike(trees[1:], expressions, place)
        return text.find(part, max(start - 1, 0)) + 1
    if name == "STRCOMP":
        first, second = _alike(trees, expressions, place)
        return first == second
    if name == "STRLEN":
        return len(_text(trees[0], expressions, place))
    if name == "STRCLEAR":
        _put(trees[0], "", expressions, place)
        return True
    added = _text(trees[1], expressions, place)
    before = _text(trees[0], expressions, place) if name == "STRADD" else ""
    _put(trees[0], before + added, expressions, place)
    return len(before + added) if name == "STRADD" else True


def _alike(
    trees: Sequence[SyntaxTree], expressions: Expressions, place: SourcePlace
) -> tuple[str, str]:
    """Two texts as the third argument (#CASE_SENS, #NOT_CASE_SENS) compares them."""
    one, other = (_text(tree, expressions, place) for tree in trees[:2])
    how = expressions.value(trees[2])
    if how == Symbol("NOT_CASE_SENS"):
        return one.upper(), other.upper()
    if how != Symbol("CASE_SENS"):
        raise KrlRunError(f"{kind_of(how)}: it is #CASE_SENS or #NOT_CASE_SENS", place)
    return one, other


def _text(tree: SyntaxTree, expressions: Expressions, place: SourcePlace) -> str:
    value = expressions.value(tree)
    if isinstance(value, Unknown):
        value = expressions.memory.guess(value, "", place)
    return text_of(value)


def _put(tree: SyntaxTree, text: str, expressions: Expressions, place: SourcePlace) -> None:
    if tree.data != "access":
        raise KrlRunError("the first argument is a variable: that gets the text", place)
    if len(text) > _LETTERS_MAX:
        raise KrlRunError(
            f"the text has {len(text)} letters: at most {_LETTERS_MAX} are followed", place
        )
    expressions.memory.set(expressions.path(tree), text, place)
