"""A tree of YAML as text again, without its comments: reading it gives the same tree, but for its
lines.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator

from ir_description.files.yaml_tree import Node, Scalar

_PLAIN = re.compile(r"[-+.]?[0-9][-+.0-9A-Za-z]*|[A-Za-z][A-Za-z0-9_.\-/]*")


def yaml_text(node: Node) -> str:
    """The tree as the lines of a YAML document."""
    return "\n".join(_lines(node)) + "\n"


def _lines(node: Node) -> Iterator[str]:
    content = node.content
    if isinstance(content, dict) and not _small(node):
        for key, entry in content.items():
            if _small(entry.node):
                yield f"{key}: {_flow(entry.node)}"
            else:
                yield f"{key}:"
                yield from (f"  {line}" for line in _lines(entry.node))
    elif isinstance(content, list) and not _small(node):
        yield from (f"- {_flow(entry)}" for entry in content)
    else:
        yield _flow(node)


def _small(node: Node) -> bool:
    """Whether a value stands in one line: a figure, a word, a vector."""
    content = node.content
    if isinstance(content, dict):
        return "value" in content or not content
    return isinstance(content, Scalar) or not any(
        isinstance(each.content, dict) for each in content
    )


def _flow(node: Node) -> str:
    content = node.content
    if isinstance(content, Scalar):
        plain = content.plain and _PLAIN.fullmatch(content.text)
        return content.text if plain else json.dumps(content.text)
    if isinstance(content, list):
        return f"[{', '.join(map(_flow, content))}]"
    return f"{{{', '.join(f'{key}: {_flow(entry.node)}' for key, entry in content.items())}}}"
