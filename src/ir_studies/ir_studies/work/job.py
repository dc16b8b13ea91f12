"""Jobs: the smallest pieces of a study, each made in one process; its row is the result."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeAlias

Row: TypeAlias = "dict[str, Any]"
"""What JSON can hold: texts, numbers (NaN is one), booleans, lists and mappings of them."""
REFUSED = "refused"
"""Key of the sentence with which a worker says, before its first job, why it can make none."""


@dataclass(frozen=True)
class StudyJob:
    """What every job of a study has in common.

    kind: which module of MAKERS (worker.py) makes the jobs; settings: what it is given before the
    first, as JSON; limit: seconds after which a job is cut.
    """

    kind: str
    settings: Mapping[str, Any]
    limit: float


@dataclass(frozen=True)
class Job:
    """key: what its row is known by in the results; words: what the worker is given, as JSON."""

    key: str
    words: Mapping[str, Any] = field(default_factory=dict)
