"""Builds the documentation as a site that works offline: out/site/index.html.

Pages are README.md and docs/, staged beside the files that they link to. The reference of the
packages is made from their docstrings by mkdocstrings, that of the commands from their help here.
mkdocs.yml lists the pages and names the site; a link or a heading that is missing ends the build.
"""

from __future__ import annotations

import argparse
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

from ir_cli.commands import COMMANDS, GROUPS

ROOT = Path(__file__).resolve().parent.parent
STAGE = ROOT / "out" / "site_source"
WORKER = Path(__file__).with_name("iframe-worker.js")  # instead of one from the network
PACKAGES = (
    "ir_planner",
    "ir_description",
    "ir_msgs_py",
    "ir_kernels",
    "ir_krl",
    "ir_recorder",
    "ir_values",
)
_LINK = re.compile(r"\]\(([^)\s#]+)")
_CODE = re.compile(r"^```.*?^```|`[^`\n]*`", re.DOTALL | re.MULTILINE)


def stage(folder: Path) -> None:
    """Lay all pages, and the files that they link to, into a folder as in the repository."""
    shutil.rmtree(folder, ignore_errors=True)
    pages = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]
    for page in pages:
        for file in [page, *_linked(page)]:
            target = folder / file.relative_to(ROOT)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(file, target)
    reference = folder / "docs" / "reference"
    reference.mkdir(parents=True, exist_ok=True)
    for name in PACKAGES:
        (reference / f"{name}.md").write_text(f"# {name}\n\n::: {name}\n", "utf-8")
    (reference / "commands.md").write_text(command_page(), "utf-8")
    shutil.copy(WORKER, folder / WORKER.name)


def _linked(page: Path) -> Iterator[Path]:
    """Files of the repository that a page links to, other pages apart."""
    for link in _LINK.findall(_CODE.sub("", page.read_text("utf-8"))):
        path = (page.parent / link).resolve()
        if path.is_file() and path.suffix != ".md" and ROOT in path.parents:
            yield path


def command_page() -> str:
    """The help of every command and its verbs."""
    lines = ["# Commands", "", "Written from the help of the commands.", ""]
    for command in sorted(COMMANDS, key=lambda each: [*("", *GROUPS)].index(each.group)):
        parser = command.parser()
        lines += [f"## ir {command.path}", "", "```text", parser.format_help().rstrip(), "```", ""]
    return "\n".join(lines)


def main() -> int:
    """Stage and build; the exit code is that of the generator, 1 with a warning."""
    argparse.ArgumentParser(description=__doc__).parse_args()
    stage(STAGE)
    zensical = Path(sys.executable).with_name("zensical")
    command = [str(zensical), "build", "--strict", "-f", str(ROOT / "mkdocs.yml")]
    return subprocess.run(command, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
