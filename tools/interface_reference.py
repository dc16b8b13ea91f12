"""Write docs/interface_reference.md: every message, service and action, as its file says it."""

from __future__ import annotations

import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INTERFACES = ROOT / "ros_ws" / "src" / "ir_msgs"
PAGE = ROOT / "docs" / "interface_reference.md"
KINDS = {"srv": "Services", "action": "Actions", "msg": "Messages"}
HEAD = """# Interface reference

Written by `make docs` from the files of `ros_ws/src/ir_msgs`; edit those. Units are SI, angles radians.
Which node has which service, topic and action: [interfaces.md](interfaces.md).
"""  # noqa: E501


def page() -> str:
    """Return the page as text: a list of links, then each file as it is."""
    parts = [HEAD]
    for folder, title in KINDS.items():
        files = sorted((INTERFACES / folder).glob(f"*.{folder}"))
        links = ", ".join(f"[{file.stem}](#{file.stem.lower()})" for file in files)
        parts.append(f"## {title}\n\n{links}\n")
        parts += [
            f"### {file.stem}\n\n```\n{file.read_text(encoding='utf-8').rstrip()}\n```\n"
            for file in files
        ]
    return "\n".join(parts)


def main() -> int:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")
    print(PAGE.relative_to(ROOT))
    return 0


if __name__ == "__main__":
    sys.exit(main())
