"""The lists of the site: learn, do, look up, understand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from .links import Page


@dataclass(frozen=True)
class Section:
    """A list of pages: those named, then those of a folder."""

    title: str
    named: tuple[str, ...]
    folder: str = ""

    def sources(self, pages: Mapping[str, Page]) -> list[str]:
        """The sources of its pages, in order."""
        below = [source for source in pages if self.folder and source.startswith(f"{self.folder}/")]
        return [*(name for name in self.named if name in pages), *sorted(below)]


def _docs(*names: str) -> tuple[str, ...]:
    return tuple(f"docs/{name}.md" for name in names)


SECTIONS = (
    Section("Start", ("README.md", *_docs("tutorial"))),
    Section(
        "How to",
        _docs(
            "mistakes", "view", "cad", "robot_guide", "compare", "krl", "cartesian", "library", "studies",  # noqa: E501
            "arena", "measuring", "recording", "report", "network", "extending",
        ),
    ),
    Section(
        "Look up",
        _docs("cell_format", "robot_data", "interfaces", "interface_reference", "parameters", "notation"),  # noqa: E501
        "docs/reference",
    ),
    Section(
        "Understand",
        (
            *_docs(
                "planning", "energy", "driver", "plant", "architecture",
                "paper_map", "reproduction", "laws", "benchmarks",
            ),
            "CONTRIBUTING.md",
            "CHANGELOG.md",
        ),
    ),
    Section("Decisions", (), "docs/decisions"),
)  # fmt: skip


def titled(page: Page) -> str:
    """The title as a list shows it."""
    return page.title.split(": ")[0]
