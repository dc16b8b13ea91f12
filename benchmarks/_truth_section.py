"""Sections of `truth.py`: modules `_truth_NAME.py` with one question each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from _results import Claim


@dataclass(frozen=True)
class Asked:
    """Cells by name or file, how many seeds, and whether the section has a quarter of two minutes
    only.
    """

    cells: Sequence[str]
    seeds: int
    quick: bool


@dataclass(frozen=True)
class Found:
    """Rows of a section, printed as they are, and its claims."""

    rows: list[dict[str, Any]] = field(default_factory=list)
    claims: list[Claim] = field(default_factory=list)
