"""How sure the figures of a robot or power file are: the confidence mark of each, by its place."""

from __future__ import annotations

from collections.abc import Iterator

from ir_description.errors import RobotFileError
from ir_description.files.yaml_tree import Node, Scalar, parse_yaml


def confidence_marks(text: str, source: str = "<text>") -> dict[str, str]:
    """Return H, M or L by place: "drives.friction_viscous_nms_rad", "links.link_2.mass_kg",
    "modes.HIBERNATION.controller_w". Entries of lists go by their name.
    """
    return marks_of(parse_yaml(text, source, RobotFileError))


def marks_of(node: Node) -> dict[str, str]:
    """The same of a tree."""
    return dict(_marks(node, ""))


def _marks(node: Node, place: str) -> Iterator[tuple[str, str]]:
    content = node.content
    if isinstance(content, list):
        for i, element in enumerate(content):
            yield from _marks(element, f"{place}.{_text(element, 'name') or i}")
    elif isinstance(content, dict):
        mark = _text(node, "confidence")
        if mark and "value" in content:
            yield place, mark
            return
        for key, entry in content.items():
            yield from _marks(entry.node, f"{place}.{key}" if place else key)


def _text(node: Node, key: str) -> str:
    """The text under a key of a mapping, "" where there is none."""
    content = node.content
    if not isinstance(content, dict) or key not in content:
        return ""
    value = content[key].node.content
    return value.text if isinstance(value, Scalar) else ""
