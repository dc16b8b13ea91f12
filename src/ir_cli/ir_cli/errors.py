"""Errors of the command line, and sentences for unknown names.

::

    CommandError
    └── InputError  what was typed makes no sense: exit code 2
"""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches


class CommandError(Exception):
    """A sentence for the person at the terminal; the command ends with `exit_code`."""

    exit_code = 1


class InputError(CommandError):
    """What was typed, or the file that was named, makes no sense."""

    exit_code = 2


SHOWN_NAMES = 8
"""Names that are listed where none is near; a cell alone has 55 services."""
_NEAR = 3
_TYPO = 0.85  # likeness of two names that differ by a letter or two
_SIMILAR = 0.6  # of names that share most of their letters, as difflib proposes


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Known names that the person may have meant, the nearest first; also those with the same last
    part.
    """
    names = sorted(known)
    last = name.rsplit("/", 1)[-1]
    same = [each for each in names if last and each.rsplit("/", 1)[-1] == last]
    for likeness in (_TYPO, _SIMILAR):
        close = get_close_matches(name, names, _NEAR, likeness)
        if close or same:
            return list(dict.fromkeys([*close, *same]))[:_NEAR]
    return []


def unknown_name(kind: str, name: str, known: Iterable[str], listing: str) -> str:
    """A sentence for a name that is not there; `listing`: the command that shows all."""
    names = sorted(known)
    near = nearest(name, names)
    if near:
        return f"no {kind} {name}: did you mean {' or '.join(near)}?"
    more = len(names) - SHOWN_NAMES
    rest = f" and {more} more ({listing} shows all)" if more > 0 else ""
    return f"no {kind} {name}; there is: {', '.join(names[:SHOWN_NAMES])}{rest}"
