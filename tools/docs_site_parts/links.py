"""Where links lead: to pages of the site, to headings, to files of the repository that are copied
into it.
"""

from __future__ import annotations

import posixpath
import re
import shutil
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

_FENCE = re.compile(r"^```.*?^```", re.DOTALL | re.MULTILINE)
_HEADING = re.compile(r"^#+ (.+)$", re.MULTILINE)


def slug(heading: str) -> str:
    """The anchor of a heading, as code hosts make it."""
    return re.sub(r"[^\w\- ]", "", heading.lower()).strip().replace(" ", "-")


@dataclass(frozen=True)
class Page:
    """A page: the path of its source below the root, and its Markdown."""

    source: str
    text: str

    @property
    def target(self) -> str:
        """Its path in the site."""
        if self.source == "README.md":
            return "index.html"
        return self.source.removeprefix("docs/").removesuffix(".md") + ".html"

    @cached_property
    def headings(self) -> list[str]:
        """Its headings, the title first."""
        return _HEADING.findall(_FENCE.sub("", self.text))

    @property
    def title(self) -> str:
        """Its first heading."""
        return re.sub(r"[`*]", "", self.headings[0]) if self.headings else self.source

    @cached_property
    def anchors(self) -> set[str]:
        """Anchors of its headings."""
        return {slug(heading) for heading in self.headings}


@dataclass
class Links:
    """Resolves the links of all pages; `warnings`: those that lead nowhere."""

    root: Path
    out: Path
    pages: Mapping[str, Page]
    warnings: list[str] = field(default_factory=list)

    def resolved(self, page: Page, link: str) -> str:
        """A link of a page as it is in the site."""
        if re.match(r"\w+:", link):
            return link
        path, _, anchor = link.partition("#")
        source = (
            posixpath.normpath(posixpath.join(posixpath.dirname(page.source), path))
            if path
            else page.source
        )
        other = self.pages.get(source)
        if other is not None:
            if anchor and anchor not in other.anchors:
                self.warnings.append(f"{page.source}: {link} leads to no heading")
            target = other.target
        else:
            target = self._file(page, source, link)
        relative = posixpath.relpath(target, posixpath.dirname(page.target) or ".")
        return f"{relative}#{anchor}" if anchor else relative

    def _file(self, page: Page, source: str, link: str) -> str:
        """A file or a folder of the repository, copied into the site."""
        path = self.root / source
        target = f"files/{source}"
        if path.is_dir():
            return self._folder(path, target)
        if not path.is_file():
            self.warnings.append(f"{page.source}: {link} leads to no file")
            return target
        (self.out / target).parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(path, self.out / target)
        return target

    def _folder(self, path: Path, target: str) -> str:
        """A page that lists a folder's files, which are copied."""
        folder = self.out / target
        folder.mkdir(parents=True, exist_ok=True)
        files = sorted(each for each in path.iterdir() if each.is_file())
        for each in files:
            shutil.copy(each, folder / each.name)
        rows = "".join(f'<li><a href="{each.name}">{each.name}</a></li>' for each in files)
        head = f'<html lang="en"><meta charset="utf-8"><title>{path.name}</title>'
        (folder / "index.html").write_text(f"<!doctype html>{head}<ul>{rows}</ul></html>", "utf-8")
        return f"{target}/index.html"
