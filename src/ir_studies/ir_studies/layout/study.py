"""A layout study from its settings to its files: search, error bars of the best, page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path

from ir_description import cell_to_yaml, load_cell
from ir_studies.layout.page import write_outputs
from ir_studies.layout.placement import Known
from ir_studies.layout.search import LayoutSearch
from ir_studies.layout.settings import LayoutSettings
from ir_studies.layout.summary import Final, final_jobs, finals, sentences
from ir_studies.work import Job, Means, Results, StudyJob


@dataclass(frozen=True)
class Layouts:
    """known: all placements that were looked at; finals: the given one and the best, by condition;
    files.
    """

    settings: LayoutSettings
    known: tuple[Known, ...]
    finals: list[tuple[Final, ...]]
    files: tuple[Path, ...]
    table: str
    remark: str = ""

    @property
    def summary(self) -> str:
        """What follows, in a few sentences."""
        said = sentences(self.known, self.finals, self.settings)
        return " ".join([*said, self.remark]).rstrip()


def run_layout(settings: LayoutSettings, folder: str | Path, means: Means | None = None) -> Layouts:
    """Make what the folder doesn't have yet; interrupted, it goes on where it ended. Raises
    StudyError.
    """
    means = means or Means()
    into = Path(folder)
    cell = load_cell(settings.cell)
    content = cell_to_yaml(cell)
    task = StudyJob("layout", {"cell_yaml": content, **settings.budget}, settings.hang_after)
    cells = {cell.name: sha256(content.encode()).hexdigest()}
    with Results(into, "layout", settings.budget, cells) as results:
        with means.makers(task) as makers:

            def made(jobs: Sequence[Job], phase: str, best: str) -> None:
                missing = [job for job in jobs if job.key not in results.rows]
                done = len(jobs) - len(missing)
                if missing:
                    means.progress(phase, done, len(jobs), best)
                for job, row in makers.rows(missing):
                    results.add(job, row)
                    done += 1
                    means.progress(phase, done, len(jobs), best)

            known = LayoutSearch(settings, results.rows, made).run()
            made(final_jobs(known, settings), "error bars of the best", "")
        best = finals(known, settings, results.rows)
        remark = results.remark
    files, table = write_outputs(known, best, settings, cell, into)
    return Layouts(settings, tuple(known), best, files, table, remark)
