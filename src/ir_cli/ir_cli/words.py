"""The words after a name on the command line: a type that may be left out, and one YAML text."""

from __future__ import annotations

from .errors import CommandError


def type_and_text(values: list[str], kind: str) -> tuple[str, str]:
    """`[type] [yaml]`: the type may be left out, which ros2cli does not allow."""
    if len(values) > 2:
        raise CommandError(
            f"{len(values)} arguments after the {kind}: at most a type and one YAML text"
        )
    typed = values[0] if values and "/" in values[0].split("{")[0].split(":")[0] else ""
    text = values[-1] if len(values) > bool(typed) else ""
    return typed, text
