"""Builds the documentation as a site that works offline: out/site/index.html.

Pages are README.md and docs/; the reference of the packages is written from their docstrings, that
of the commands from their help, that of the interfaces from the message files
(docs/interface_reference.md). A link that leads nowhere, a page that no list holds and a name
without a docstring are warnings, and warnings fail.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import sys
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent))

from docs_site_parts.links import Links, Page
from docs_site_parts.markdown import rendered
from docs_site_parts.nav import SECTIONS, titled
from docs_site_parts.reference import command_page, package_page

ROOT = Path(__file__).resolve().parent.parent
OUT = ROOT / "out" / "site"
PARTS = Path(__file__).resolve().parent / "docs_site_parts"
PACKAGES = ("ir_planner", "ir_description", "ir_msgs_py", "ir_kernels", "ir_krl", "ir_recorder")


@dataclass
class Site:
    """All pages by the path of their source, and what is wrong with them."""

    out: Path
    pages: dict[str, Page] = field(default_factory=dict)
    warnings: list[str] = field(default_factory=list)

    def read(self) -> None:
        """Take in every page."""
        sources = [*ROOT.glob("*.md"), *sorted((ROOT / "docs").rglob("*.md"))]
        for path in sources:
            self._take(path.relative_to(ROOT).as_posix(), path.read_text("utf-8"))
        for name in PACKAGES:
            text, missing = package_page(name)
            self._take(f"docs/reference/{name}.md", text)
            self.warnings += [f"{each} has no docstring" for each in missing]
        self._take("docs/reference/commands.md", command_page())

    def _take(self, source: str, text: str) -> None:
        self.pages[source] = Page(source, text)

    def write(self) -> None:
        """Render and write every page, and the files that they name."""
        shutil.rmtree(self.out, ignore_errors=True)
        self.out.mkdir(parents=True)
        listed = {source for section in SECTIONS for source in section.sources(self.pages)}
        self.warnings += [
            f"{source} is in no list" for source in self.pages if source not in listed
        ]
        links = Links(ROOT, self.out, self.pages)
        index = []
        for page in self.pages.values():
            body = rendered(page, links)
            target = self.out / page.target
            target.parent.mkdir(parents=True, exist_ok=True)
            target.write_text(self._html(page, body), "utf-8")
            text = re.sub(r"<[^>]+>|\s+", " ", body)
            index.append({"t": page.title, "u": page.target, "x": text.lower()})
        self.warnings += links.warnings
        shutil.copy(PARTS / "site.css", self.out / "site.css")
        search = f"var PAGES = {json.dumps(index)};\n" + (PARTS / "site.js").read_text("utf-8")
        (self.out / "site.js").write_text(search, "utf-8")

    def _html(self, page: Page, body: str) -> str:
        up = "../" * page.target.count("/")
        entries = []
        for section in SECTIONS:
            entries.append(f"<h2>{section.title}</h2><ul>")
            for source in section.sources(self.pages):
                other = self.pages[source]
                here = ' class="here"' if other is page else ""
                entries.append(
                    f'<li><a{here} href="{up}{other.target}">{escape(titled(other))}</a></li>'
                )
            entries.append("</ul>")
        return (
            "<!doctype html>\n"
            f'<html lang="en"><head><meta charset="utf-8"><title>{escape(page.title)}</title>'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f'<link rel="stylesheet" href="{up}site.css"></head><body data-up="{up}">'
            f'<nav><input id="search" type="search" placeholder="Search" aria-label="Search">'
            f'<ol id="found"></ol>{"".join(entries)}</nav><main>{body}</main>'
            f'<script src="{up}site.js"></script></body></html>\n'
        )


def build(out: Path) -> Site:
    """Write the site to a folder; its warnings say what is wrong."""
    site = Site(out)
    site.read()
    site.write()
    return site


def main() -> int:
    """Build, print, exit code 1 with warnings."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path, default=OUT)
    site = build(parser.parse_args().out)
    for warning in site.warnings:
        print(f"warning: {warning}", file=sys.stderr)
    print(f"{site.out / 'index.html'}: {len(site.pages)} pages, {len(site.warnings)} warnings")
    return 1 if site.warnings else 0


if __name__ == "__main__":
    sys.exit(main())
