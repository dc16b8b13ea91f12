"""The whole statistics: what is not yet in the folder is planned and driven, then summed up."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path

from ir_studies.statistics.figures import Findings, findings_of
from ir_studies.statistics.outputs import write_outputs
from ir_studies.statistics.places import read_by
from ir_studies.statistics.settings import StatisticsSettings
from ir_studies.statistics.verdict import sentences
from ir_studies.work import Job, Means, Results, Row, Task


@dataclass(frozen=True)
class Finished:
    """Rows of all pairs in their order, what they say together, and the files that were written."""

    rows: tuple[Row, ...]
    findings: Findings
    files: tuple[Path, ...]

    @property
    def summary(self) -> str:
        """What follows, and what does not."""
        return " ".join(sentences(self.findings))

    @property
    def summed_up(self) -> str:
        """A row of CSV per comparison."""
        head = "comparison,pairs,mean_percent,low_percent,high_percent,median_percent,effect,less_share"
        lines = [
            f"{each.name},{each.count},{each.mean.value},{each.mean.low},{each.mean.high},{each.median},"
            f"{each.effect},{each.less}"
            for each in self.findings.comparisons
        ]
        return "\n".join([head, *lines]) + "\n"


def run_statistics(settings: StatisticsSettings, folder: str | Path, means: Means | None = None) -> Finished:
    """Make the pairs that the folder has no row of; interrupted, it goes on where it ended. StudyError."""
    means = means or Means()
    jobs = {str(number): Job(str(number), {"number": number}) for number in range(settings.pairs)}
    read = read_by(settings)
    task = Task("statistics", {**asdict(settings), "read": read}, settings.hang_after)
    with Results(Path(folder), "statistics", settings.budget, read) as results:
        missing = [job for key, job in jobs.items() if key not in results.rows]
        done = len(jobs) - len(missing)
        with means.makers(task) as makers:
            for job, row in makers.rows(missing):
                results.add(job, row)
                done += 1
                means.progress(_words(row), done, len(jobs), "")
        rows = tuple(results.rows[key] for key in jobs)
    found = findings_of(rows)
    return Finished(rows, found, write_outputs(rows, found, settings, Path(folder)))


def _words(row: Mapping[str, object]) -> str:
    return f"{row.get('start', '?')} to {row.get('goal', '?')}: planned and driven"
