"""The line of a cell file on which stands what a finding is about: a machine, a station, a step."""

from __future__ import annotations

import re
from collections.abc import Iterator

from ir_values.errors import CellFileError
from ir_values.yaml_tree import Node, Scalar, parse_yaml

_STEP = re.compile(r"step (\d+)$")
_KEYS = ("program", "base", "tcp", "home_deg", "home", "park_deg", "park")


def subject_line(text: str, subject: str) -> int:
    """The line (from 1) of the thing of that name, of "step 3", "program", "base", "tcp", "home" or
    "park";
    0: it is not there.
    """
    try:
        root = parse_yaml(text, "", CellFileError)
    except CellFileError:
        return 0
    if not isinstance(root.content, dict):
        return 0
    step = _STEP.match(subject)
    if step and "program" in root.content:
        steps = root.content["program"].node.content
        number = int(step.group(1)) - 1
        return steps[number].line if isinstance(steps, list) and number < len(steps) else 0
    for key in (subject, f"{subject}_deg"):
        if key in root.content and key in _KEYS:
            return root.content[key].line
    return next(_named(root, subject), 0)


def _named(node: Node, name: str) -> Iterator[int]:
    """Lines of the mappings of a name."""
    if isinstance(node.content, list):
        for entry in node.content:
            yield from _named(entry, name)
    elif isinstance(node.content, dict):
        own = node.content.get("name")
        if (
            own is not None
            and isinstance(own.node.content, Scalar)
            and own.node.content.text == name
        ):
            yield own.line
        for value in node.content.values():
            yield from _named(value.node, name)
