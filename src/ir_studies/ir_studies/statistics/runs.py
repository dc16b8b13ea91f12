"""The statistics from their settings to their files; interrupted, they go on where they ended."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

from ir_msgs_py.options import TIMINGS
from ir_studies.statistics.findings import Findings, findings_of, solved
from ir_studies.statistics.movements import read_by
from ir_studies.statistics.outputs import summary_of, summed_up, write_outputs
from ir_studies.statistics.settings import StatisticsSettings
from ir_studies.work import Job, Means, Results, Row, StudyJob


@dataclass(frozen=True)
class FinishedStatistics:
    """Rows of all pairs in their order, what they say together, and the files that were written."""

    settings: StatisticsSettings
    rows: tuple[Row, ...]
    findings: Findings
    files: tuple[Path, ...]
    remark: str = ""

    @property
    def summary(self) -> str:
        """Counts, the table of comparisons with intervals, and notes, as text."""
        said = summary_of(self.findings, self.settings)
        return f"{said}\n{self.remark}" if self.remark else said

    @property
    def summed_up(self) -> str:
        """A row of CSV per comparison."""
        return summed_up(self.findings)


def run_statistics(
    settings: StatisticsSettings, folder: str | Path, means: Means | None = None
) -> FinishedStatistics:
    """Make the pairs that the folder has no row of; interrupted, it goes on where it ended.
    StudyError.
    """
    means = means or Means()
    jobs = {str(number): Job(str(number), {"number": number}) for number in range(settings.pairs)}
    read = read_by(settings)
    task = StudyJob("statistics", {**asdict(settings), "read": read}, settings.hang_after)
    with Results(Path(folder), "statistics", settings.budget, read) as results:
        missing = [job for key, job in jobs.items() if key not in results.rows]
        done = len(jobs) - len(missing)
        with means.makers(task) as makers:
            for job, row in makers.rows(missing):
                results.add(job, row)
                done += 1
                means.progress(_words(row), done, len(jobs), "")
        rows = tuple(results.rows[key] for key in jobs)
        remark = results.remark
    found = findings_of(rows)
    files = write_outputs(rows, found, settings, Path(folder))
    return FinishedStatistics(settings, rows, found, files, remark)


def _words(row: Row) -> str:
    if "start" not in row:
        return str(row.get("message", "no answer"))
    moved = any(solved(row, timing) for timing in TIMINGS)
    return f"{row['start']} to {row['goal']}: {'planned and driven' if moved else 'no movement'}"
