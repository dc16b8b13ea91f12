"""`make docs` builds a site without a warning, every link of which leads to a file in it."""

from __future__ import annotations

import importlib.util
import sys
from html.parser import HTMLParser
from pathlib import Path
from types import ModuleType
from urllib.parse import unquote

import pytest

ROOT = Path(__file__).resolve().parents[2]


class _Reader(HTMLParser):
    """Links and anchors of a page."""

    def __init__(self) -> None:
        super().__init__()
        self.links: list[str] = []
        self.anchors: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = dict(attrs)
        self.links += [str(given[key]) for key in ("href", "src") if given.get(key)]
        self.anchors |= {str(given["id"])} if given.get("id") else set()


def loaded() -> ModuleType:
    """The tool."""
    spec = importlib.util.spec_from_file_location("docs_site", ROOT / "tools" / "docs_site.py")
    assert spec is not None
    assert spec.loader is not None
    tool = importlib.util.module_from_spec(spec)
    sys.modules["docs_site"] = tool
    spec.loader.exec_module(tool)
    return tool


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[str]]:
    tool = loaded()
    out = tmp_path_factory.mktemp("site")
    return out, tool.build(out).warnings


def test_every_page_is_in_a_list() -> None:
    tool = loaded()
    named = {source for section in tool.SECTIONS for source in section.named}
    pages = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").glob("*.md")}
    assert pages - named == set()
    assert {name for name in named if not (ROOT / name).exists()} == set()


@pytest.mark.long
def test_it_is_built_without_a_warning(site: tuple[Path, list[str]]) -> None:
    assert site[1] == []


@pytest.mark.long
def test_every_link_leads_to_a_file_of_the_site_and_to_its_anchor(
    site: tuple[Path, list[str]],
) -> None:
    read: dict[Path, _Reader] = {}
    for path in site[0].rglob("*.html"):
        read[path] = _Reader()
        read[path].feed(path.read_text("utf-8"))
    assert len(read) > 45
    broken = []
    for path, page in read.items():
        for link in page.links:
            if link.startswith(("http:", "https:", "mailto:")):
                continue
            name, _, anchor = unquote(link).partition("#")
            target = (path.parent / name).resolve() if name else path
            there = target.is_file() and (
                not anchor or target not in read or anchor in read[target].anchors
            )
            broken += [] if there else [f"{path.name}: {link}"]
    assert broken == []


@pytest.mark.long
def test_a_page_asks_nobody_else_for_anything(site: tuple[Path, list[str]]) -> None:
    text = (site[0] / "tutorial.html").read_text("utf-8")
    assert 'src="http' not in text
    assert 'rel="stylesheet" href="http' not in text
