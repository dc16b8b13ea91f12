"""Results of the demonstration by its recording: movements, checks, the report and the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

from ir_cli.terminal import table
from ir_recorder import Analysis, Finding, Tolerances, analyse, findings, read_recording
from ir_recorder.report import write_report
from ir_recorder.report.picture import write_picture

TABLE_2_ROWS = 4
"""Power modes of the paper's Table II; once without, once with the tool."""


@dataclass(frozen=True)
class Outcome:
    """The analysed recording and whether every check held."""

    analysis: Analysis
    checks: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Whether there is something to show, and all of it held."""
        return bool(self.checks) and all(check.ok for check in self.checks) and not self.analysis.problems

    def text(self) -> str:
        """Tables for the terminal."""
        parts = [self._movements(), self._table_2(), *self.analysis.problems]
        failed = [check for check in self.checks if not check.ok]
        parts += [f"FAILED  {_sentence(check)}" for check in failed]
        held = len(self.checks) - len(failed)
        parts.append(f"{held} of {len(self.checks)} checks held")
        return "\n\n".join(part for part in parts if part)

    def _movements(self) -> str:
        header = ["step", "s", "J planned", "J measured", "W (eq. 9)", "clearance mm", "tool off mm"]
        rows = []
        for result in self.analysis.steps:
            planned = result.step.movement.report
            clearance = result.clearance.least if result.clearance is not None else math.nan
            rows.append(
                [
                    f"{result.step.index + 1} {result.step.label}",
                    f"{result.seconds:.2f}",
                    f"{planned.energy:.0f}",
                    f"{result.energy:.0f}",
                    f"{planned.movement_cost:.0f}",
                    f"{clearance * 1000.0:.1f}",
                    f"{result.tool_deviation * 1000.0:.2f}",
                ]
            )
        return table(header, [["-" if cell == "nan" else cell for cell in row] for row in rows])

    def _table_2(self) -> str:
        rows = [
            [
                f"{row.mode.lower().replace('_', ' ')}, {row.payload:g} kg",
                f"{row.expected:.0f}",
                f"{row.power:.1f}",
                f"{(row.power / row.expected - 1.0) * 100.0:+.2f} %",
            ]
            for row in self.analysis.plateaus
        ]
        return table(["Table II at machine home", "W paper", "W measured", ""], rows) if rows else ""


def _sentence(check: Finding) -> str:
    note = f" ({check.note})" if check.note else ""
    return (
        f"{check.name}: {check.measured:.6g} {check.unit}, expected {check.expected:.6g} "
        f"within {check.bound:.3g} {check.unit}{note}"
    )


def examine(recording: Path, report: Path, picture: Path, loads: int) -> Outcome:
    """Analyse the recording, write report and picture; loads: how many the tour carried."""
    analysis = analyse(read_recording(recording))
    checks = findings(analysis, Tolerances(table_2_rows=TABLE_2_ROWS * loads))
    write_report(analysis, checks, report)
    write_picture(analysis, picture)
    return Outcome(analysis, checks)
