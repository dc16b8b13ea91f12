"""Contents of the virtual environment .venv, and what is missing of it."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
VENV = ROOT / ".venv"
STAMPS = VENV / ".setup"
CONSTRAINTS = ROOT / "requirements" / "constraints.txt"


def site_packages(python_version: str) -> Path:
    """Return the folder in which the environment of this version keeps its packages."""
    return VENV / "lib" / f"python{python_version}" / "site-packages"


def said(missing: list[str]) -> str:
    """Return the first few of what is missing, as the end of a sentence."""
    more = f" and {len(missing) - 5} more" if len(missing) > 5 else ""
    return f" (missing: {', '.join(missing[:5])}{more})" if missing else ""


def canonical(name: str) -> str:
    """Return the name of a distribution as all its spellings have it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def installed(site: Path) -> dict[str, str]:
    """Return the versions of the distributions in a site-packages folder, by the names of their
    folders.
    """
    folders = (folder.name.removesuffix(".dist-info") for folder in site.glob("*.dist-info"))
    return {
        canonical(name): version
        for name, _, version in (folder.rpartition("-") for folder in folders)
    }


def pins() -> dict[str, str]:
    """Return the pinned version of every distribution that set-up may install."""
    lines = CONSTRAINTS.read_text().splitlines()
    pairs = (line.split("==") for line in lines if line[:1] not in ("", "#"))
    return {canonical(name): version for name, version in pairs}


def wanted(requirements: Path) -> set[str]:
    """Return what the requirements ask for, and what came with it when they were last installed.

    Not every pin is needed by every interpreter, so what came is known from that installation
    alone.
    """
    lines = requirements.read_text().splitlines()
    named = {
        canonical(re.split(r"[\[=<>~!; ]", line)[0])
        for line in lines
        if line[:1] not in ("", "#", "-")
    }
    came = came_with(requirements)
    return named | (set(came.read_text().split()) if came.exists() else set())


def came_with(requirements: Path) -> Path:
    """Return the file that names the distributions which these requirements brought."""
    return STAMPS / f"{requirements.stem}.installed"


def missing_wheels(site: Path, requirements: Path) -> list[str]:
    """Return the wanted distributions that aren't there in their pinned version."""
    there = installed(site)
    pinned = pins()
    return sorted(
        name for name in wanted(requirements) & set(pinned) if there.get(name) != pinned[name]
    )


def missing_editable(site: Path, folders: Iterable[Path]) -> list[str]:
    """Return the packages of src/ that aren't installed from where they lie."""

    def is_there(folder: Path) -> bool:
        urls = [
            file.read_text() for file in site.glob(f"{folder.name}-*.dist-info/direct_url.json")
        ]
        return any(json.loads(url).get("url") == folder.as_uri() for url in urls)

    return [folder.name for folder in folders if not is_there(folder)]


def note_what_came(site: Path, requirements: Path, before: dict[str, str]) -> None:
    """Write down which pinned distributions these requirements brought, beside those of
    `before`.
    """
    came = came_with(requirements)
    known = set(came.read_text().split()) if came.exists() else set()
    new = {name for name, version in installed(site).items() if before.get(name) != version}
    came.write_text("\n".join(sorted((known | new) & set(pins()))))
