"""From the texts of a program to its routines and its data.

KRL doesn't distinguish upper and lower case, and one statement is one line: the text is brought
into upper case outside of strings, comments and header lines are blanked, and lines and columns
stay as they were.
"""

from __future__ import annotations

import re
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from typing import Any

from lark import Lark, Token
from lark import Tree as ParseTree
from lark.exceptions import UnexpectedCharacters, UnexpectedInput

from ir_krl.errors import KrlError, SourcePlace

TEXT_MAX = 4_000_000
"""Characters of one file that are read: a program of this size has some 100,000 lines."""

_COMMENT = re.compile(r"\"[^\"\n]*\"|;[^\n]*|^&[^\n]*", re.MULTILINE)
_STAMP = re.compile(
    r"%[RV] *(\d+)\.(\d+)[.\d]* *, *%MKUKATPBASIS|IlfProvider=kukaroboter\.basistech",
    re.IGNORECASE,
)
"""What inline forms say of the version that wrote them; those with a provider are of KSS 8.5."""
_PROVIDER = (8, 5)
_SPELLED = {  # what a user calls the parser's terminals
    "_NL": "the end of the line",
    "NAME": "a name",
    "NUMBER": "a number",
    "STRING": "a text",
    "ENUM_VALUE": "a value such as #BASE",
    "APPROXIMATE": "C_PTP, C_DIS, C_VEL, C_ORI or C_SPL",
    "COMPARED": "a comparison",
    "$END": "the end of the file",
    "EQUAL": "=",
    "LPAR": "(",
    "RPAR": ")",
    "LSQB": "[",
    "RSQB": "]",
    "LBRACE": "{",
    "RBRACE": "}",
    "COMMA": ",",
    "COLON": ":",
    "DOT": ".",
}
_UNITS = frozenset(("DEF", "DEFFCT", "DEFDAT", "GLOBAL", "_NL"))
_CLOSING = ("ENDIF", "ENDFOR", "ENDWHILE", "ENDLOOP", "UNTIL", "ENDSWITCH", "ENDSPLINE")
_PLAIN_REMEDY = "mend the line, or put ; before it to leave it out"
_SPEED = "a motion takes no speed: set $VEL.CP [m/s] or $VEL_AXIS[1] to [6] [%] before it"
_REMEDIES = {  # by the word that stands where none is expected
    "VEL": _SPEED,
    "ACC": _SPEED,
    "DO": "WHILE and FOR have no DO: leave it out",
    ",": "one line is one statement: begin a new line",
    ":": "a parameter is NAME:IN or NAME:OUT; its type is declared in the routine, that of a "
    "function stands before its name",
}
_EXPECTED_MAX = 6  # alternatives that a sentence names
# constructs of KRL that aren't read: named, so that nobody looks for a typing error
_KNOWN_ELSEWHERE = {
    "STOP": "a condition stops motions of a spline only, put it into SPLINE … ENDSPLINE",
    "ELSEIF": "KRL has none, write ELSE with an IF of its own inside",
    "ELSIF": "KRL has none, write ELSE with an IF of its own inside",
}


@dataclass(frozen=True, eq=False)
class SyntaxTree:
    """A piece of the program: the grammar's rule, and its children: trees, words, None for what
    lacks.
    """

    data: str
    children: tuple[Any, ...]
    line: int
    column: int


class Word(str):
    """A word of the program with its place."""

    line: int
    column: int

    def __new__(cls, text: str, line: int, column: int) -> Word:
        """The text itself."""
        word = super().__new__(cls, text)
        word.line = line
        word.column = column
        return word


@dataclass(frozen=True)
class Parameter:
    """One parameter of a routine: its name, whether its value goes back to the caller (OUT, and
    where nothing is said), and whether that is said.
    """

    name: str
    out: bool
    directed: bool = True


@dataclass(frozen=True, eq=False)
class Routine:
    """A DEF or DEFFCT: result is the type of its value, "" for a DEF; body is a tree `body`;
    everywhere: it is GLOBAL, so that other files may call it.
    """

    name: str
    parameters: tuple[Parameter, ...]
    body: SyntaxTree
    result: str
    file: str
    everywhere: bool = False


@dataclass(frozen=True, eq=False)
class SourceFile:
    """One file: its routines in their order, the bodies of its data lists, and the versions of the
    system software that wrote its inline forms.
    """

    file: str
    routines: tuple[Routine, ...]
    data: tuple[SyntaxTree, ...]
    versions: frozenset[tuple[int, int]] = frozenset()


def parse(text: str, file: str) -> SourceFile:
    """Read the text of a .src or .dat file; `file` is the name that complaints carry.

    Raises KrlError with line and column.
    """
    if len(text) > TEXT_MAX:
        raise KrlError(f"{len(text)} characters: at most {TEXT_MAX} are read", SourcePlace(file))
    # as editors leave them
    text = text.removeprefix("\ufeff").replace("\r\n", "\n").replace("\r", "\n")
    try:
        units = _tree(_parser().parse(_prepared(text) + "\n")).children
    except RecursionError:
        raise KrlError(
            "brackets, signs or blocks are nested too deeply", SourcePlace(file)
        ) from None
    except UnexpectedInput as error:
        sentence, column = _complaint(error, text)
        raise KrlError(sentence, SourcePlace(file, error.line, column)) from None
    routines = [_routine(unit, file) for unit in units if unit.data in ("routine", "function")]
    data = tuple(unit.children[-1] for unit in units if unit.data == "data_list")
    versions = frozenset(
        (int(found[1]), int(found[2])) if found[1] else _PROVIDER for found in _STAMP.finditer(text)
    )
    return SourceFile(file, tuple(routines), data, versions)


def place_of(node: SyntaxTree | Word, file: str) -> SourcePlace:
    """Where a tree or a word begins."""
    return SourcePlace(file, node.line, node.column)


def _tree(node: Any) -> Any:
    """The parser's tree as this package's own."""
    if isinstance(node, ParseTree):
        meta = node.meta
        children = tuple(_tree(child) for child in node.children)
        return SyntaxTree(
            str(node.data), children, getattr(meta, "line", 0), getattr(meta, "column", 0)
        )
    return Word(str(node), node.line or 0, node.column or 0) if isinstance(node, Token) else node


def _prepared(text: str) -> str:
    def blanked(found: re.Match[str]) -> str:
        return found[0] if found[0].startswith('"') else " " * len(found[0])

    parts = []
    end = 0
    for found in _COMMENT.finditer(text):
        parts += [text[end : found.start()].upper(), blanked(found)]
        end = found.end()
    return "".join([*parts, text[end:].upper()])


@cache
def _parser() -> Lark:
    grammar = files(__package__).joinpath("krl.lark").read_text(encoding="utf-8")
    return Lark(grammar, parser="lalr", propagate_positions=True, maybe_placeholders=True)


def _routine(unit: SyntaxTree, file: str) -> Routine:
    everywhere, *head, parameters, body = (one for one in unit.children if not _is_sizes(one))
    result, name = ("", *head) if unit.data == "routine" else head
    found = [_parameter(one) for one in parameters.children if one is not None]
    return Routine(str(name), tuple(found), body, str(result), file, everywhere is not None)


def _is_sizes(node: Any) -> bool:
    """Whether a node is the size of an array: [16] of a type or of a parameter."""
    return isinstance(node, SyntaxTree) and node.data == "sizes"


def _parameter(tree: SyntaxTree) -> Parameter:
    name, *direction = (str(one) for one in tree.children if one and not _is_sizes(one))
    return Parameter(name, direction != ["IN"], bool(direction))


def _complaint(error: Any, text: str) -> tuple[str, int]:
    """What is wrong, and in which column, of the parser's untyped exceptions."""
    lines = text.splitlines()
    line = lines[error.line - 1] if 0 < error.line <= len(lines) else ""
    if isinstance(error, UnexpectedCharacters):
        character = line[error.column - 1 : error.column] or "?"
        return f"{character!r} is no part of KRL here: {_PLAIN_REMEDY}", error.column
    first = line.split()[0].upper() if line.split() else ""
    if first in _KNOWN_ELSEWHERE:
        sentence = f"{first} isn't read here: {_KNOWN_ELSEWHERE[first]}"
        return sentence, line.upper().index(first) + 1
    if {"LPAR", "EQUAL"} <= set(error.expected) and not line[: error.column - 1].split()[1:]:
        name = first[:40]
        return (
            f"{name} is no statement of KRL: a call has brackets, an assignment =; {_PLAIN_REMEDY}",
            line.upper().index(name) + 1,
        )
    word = str(error.token).strip()
    found = f"{word[:40]!r}" if word else "the line ends, or the file"
    expected = sorted(_spelled(name) for name in error.expected)
    wanted = " or ".join(expected) if len(expected) <= _EXPECTED_MAX else "something else"
    return f"{found} where {wanted} is expected: {_remedy(word, error.expected)}", error.column


def _remedy(word: str, expected: Collection[str]) -> str:
    """What helps where `word` stands and one of `expected` should."""
    closing = next((one for one in _CLOSING if one in expected), "")
    if closing and word in ("END", "ENDFCT", "ENDDAT", *_CLOSING):
        return f"a block isn't closed before, {closing} ends it"
    if "DEF" in expected and _UNITS.issuperset(expected):
        return "lines stand between DEF and END, or DEFDAT and ENDDAT: put them there"
    return _REMEDIES.get(word, _PLAIN_REMEDY)


def _spelled(terminal: str) -> str:
    return _SPELLED.get(terminal, terminal)
