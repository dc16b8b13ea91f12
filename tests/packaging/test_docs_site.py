"""`make docs` builds a site of all pages without a warning; no page needs another host."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

ROOT = Path(__file__).resolve().parents[2]
SITE = ROOT / "out" / "site"


def listed(entries: object) -> set[str]:
    """Pages that the navigation of mkdocs.yml names."""
    if isinstance(entries, str):
        return {entries}
    rows = entries.values() if isinstance(entries, dict) else entries
    assert rows is not None
    return {page for row in rows for page in listed(row)}  # type: ignore[attr-defined]


def test_every_page_is_in_the_navigation_and_on_the_first_page() -> None:
    settings = yaml.safe_load((ROOT / "mkdocs.yml").read_text("utf-8"))
    named = listed(settings["nav"])
    pages = {path.relative_to(ROOT).as_posix() for path in (ROOT / "docs").glob("*.md")}
    assert pages - named == set()
    missing = {name for name in named if not (ROOT / name).exists()}
    assert all(name.startswith("docs/reference/") for name in missing), missing
    index = (ROOT / "docs" / "index.md").read_text("utf-8")
    links = {f"docs/{link}" for link in re.findall(r"\]\(([a-z_0-9]+\.md)\)", index)}
    assert pages - {"docs/index.md"} == links


def test_every_decision_is_listed() -> None:
    folder = ROOT / "docs" / "decisions"
    text = (folder / "index.md").read_text("utf-8")
    for path in folder.glob("0*.md"):
        title = path.read_text("utf-8").splitlines()[0].removeprefix("# ")
        assert f"[{title}]({path.name})" in text


@pytest.mark.long
def test_it_is_built_without_a_warning_and_works_offline() -> None:
    built = subprocess.run(
        [sys.executable, str(ROOT / "tools" / "docs_site.py")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stdout + built.stderr
    page = (SITE / "docs" / "tutorial.html").read_text("utf-8")
    assert 'src="http' not in page
    assert 'rel="stylesheet" href="http' not in page
    assert "Planner" in (SITE / "docs" / "reference" / "ir_planner.html").read_text("utf-8")
