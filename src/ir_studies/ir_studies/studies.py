"""All kinds of studies under one face, for the command `ir study` and the node.

study = read_study("layout.yaml")           # its format says which kind it is
answer = study.run("out/layout", Means(workers=2))
print(answer.summary)
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ir_studies import arena, layout, statistics
from ir_studies.arena.settings import arena_settings
from ir_studies.errors import SettingsError
from ir_studies.work import Means, Placed, beside, read_text
from ir_studies.work.settings_file import kind_of
from ir_values.errors import unknown_name


@dataclass(frozen=True)
class StudyAnswer:
    """summary: what follows from a study, in a few sentences; files that were written; table: CSV
    with a header, its best or summed up rows.
    """

    summary: str
    files: tuple[Path, ...]
    table: str


@dataclass(frozen=True)
class Kind:
    """A kind of study: what it answers, a settings file with all its keys, how settings are read
    from a text, and how it is run in a folder.
    """

    about: str
    example: str
    read: Callable[[str, Placed], Any]
    run: Callable[[Any, Path, Means], StudyAnswer]


@dataclass(frozen=True)
class Study:
    """Settings that were read, of a kind."""

    kind: str
    settings: Any

    def run(self, folder: str | Path, means: Means | None = None) -> StudyAnswer:
        """Make what the folder doesn't have yet. Raises StudyError."""
        return KINDS[self.kind].run(self.settings, Path(folder), means or Means())


def _run_arena(settings: arena.ArenaSettings, folder: Path, means: Means) -> StudyAnswer:
    finished = arena.run_arena(settings, folder, means)
    return StudyAnswer(finished.summary, finished.files, finished.summed_up)


def _run_layout(settings: layout.LayoutSettings, folder: Path, means: Means) -> StudyAnswer:
    found = layout.run_layout(settings, folder, means)
    return StudyAnswer(found.summary, found.files, found.table)


def _run_statistics(
    settings: statistics.StatisticsSettings, folder: Path, means: Means
) -> StudyAnswer:
    finished = statistics.run_statistics(settings, folder, means)
    return StudyAnswer(finished.summary, finished.files, finished.summed_up)


KINDS = {
    "layout": Kind(
        "where robot, machines, posture and tool should stand for least energy",
        layout.EXAMPLE,
        layout.layout_settings,
        _run_layout,
    ),
    "arena": Kind("planners against each other", arena.EXAMPLE, arena_settings, _run_arena),
    "statistics": Kind(
        "time and energy over random movements, synchronous and asynchronous, predicted and "
        "measured",
        statistics.EXAMPLE,
        statistics.statistics_settings,
        _run_statistics,
    ),
}


def read_study(path: str | Path) -> Study:
    """The study that a YAML file asks for; cell files count from its folder. SettingsError names
    the key.
    """
    content = read_text(path)
    try:
        return study_of(content, placed=beside(path))
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}") from error


def study_of(content: str, kind: str = "", placed: Placed = str) -> Study:
    """The study that a text asks for. kind: which it must be, "": what its format says. Raises
    SettingsError for another kind.
    """
    kind = kind or kind_of(content)
    if kind not in KINDS:
        raise SettingsError(unknown_name("kind", kind, KINDS))
    return Study(kind, KINDS[kind].read(content, placed))
