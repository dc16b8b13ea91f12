"""Results of the demonstration by its recording: movements, checks, the report and the picture."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

from ir_cli.terminal import table
from ir_recorder import (
    Analysis,
    Finding,
    Tolerances,
    Verdict,
    analyse,
    findings,
    read_recording,
    summary,
)
from ir_recorder.analysis.checks import row_name
from ir_recorder.report import write_report
from ir_recorder.report.number_text import interval, number
from ir_recorder.report.picture import write_picture
from ir_recorder.report.tables import savings_lines

MODES_AT_REST = 4
"""Power modes that the tour visits with each load."""


@dataclass(frozen=True)
class Outcome:
    """The analysed recording and whether every check held."""

    analysis: Analysis
    checks: tuple[Finding, ...]

    @property
    def ok(self) -> bool:
        """Whether everything could be read, was checked, and holds."""
        return summary(self.checks)[0] is Verdict.HOLDS and not self.analysis.problems

    def text(self) -> str:
        """Tables for the terminal."""
        parts = [
            self._movements(),
            self._at_rest(),
            self._cycle(),
            self._saved(),
            *self.analysis.problems,
        ]
        parts += [_sentence(check) for check in self.checks if not check.ok]
        parts.append(f"checks: {summary(self.checks)[1]}")
        return "\n\n".join(part for part in parts if part)

    def _cycle(self) -> str:
        """Energy of the run, and of the cycle with its pauses at full length."""
        program = self.analysis.program
        if program is None:
            return "no program was executed"
        source = self.analysis.recording.origin
        lines = [f"this run ({source}): {_total(program.whole.energy, program.whole.seconds)}"]
        if program.unshortened is not None:
            full = program.unshortened
            cut = f"pauses of {full.full_pauses:.0f} s instead of {full.run_pauses:.0f} s"
            lines.append(f"with full pauses (computed): {_total(full.energy, full.seconds)}; {cut}")
        return "\n".join(lines)

    def _saved(self) -> str:
        """What the program saves by its plan, each figure with its baseline."""
        return "\n".join(savings_lines(self.analysis))

    def _movements(self) -> str:
        joules = ["J predicted", "90 %", f"J {self.analysis.recording.origin}"]
        header = ["step", "s", *joules, "cost W", "clearance mm", "tool deviation mm"]
        rows = []
        for result in self.analysis.steps:
            planned = result.step.movement.report
            clearance = result.clearance.least if result.clearance is not None else math.nan
            rows.append(
                [
                    f"{result.step.index + 1} {result.step.label}",
                    f"{result.seconds:.2f}",
                    f"{planned.energy:.0f}",
                    f"{planned.energy_low:.0f} to {planned.energy_high:.0f}",
                    f"{result.energy:.0f}",
                    f"{planned.movement_cost:.0f}",
                    f"{clearance * 1000.0:.1f}",
                    f"{result.tool_deviation * 1000.0:.2f}",
                ]
            )
        return table(header, [["-" if cell == "nan" else cell for cell in row] for row in rows])

    def _at_rest(self) -> str:
        rows = [
            [
                row_name(row),
                f"{row.expected:.0f}",
                f"{row.power:.1f}",
                f"{row.error * 100.0:+.2f} %",
                "-" if math.isnan(row.table_2) else f"{row.table_2:.0f}",
            ]
            for row in self.analysis.plateaus
        ]
        header = ["at rest, machine home", "W by data", "W net", "", "W Table II"]
        return table(header, rows) if rows else ""


def _total(energy: float, seconds: float) -> str:
    return f"{energy / 1000.0:.1f} kJ ({energy / 3600.0:.1f} Wh) in {seconds:.1f} s"


def _sentence(check: Finding) -> str:
    allowed = interval(check.low, check.high, check.unit)
    note = f" ({check.note})" if check.note else ""
    if check.verdict is Verdict.NOT_CHECKED:
        return f"NOT CHECKED  {check.name}{note}"
    return (
        f"FAILED  {check.name}: {number(check.measured, check.unit)}, allowed {allowed}: "
        f"{check.reason}{note}"
    )


def examine(recording: Path, report: Path, picture: Path, loads: int, failed: str = "") -> Outcome:
    """Analyse the recording, write report and picture; loads: how many the tour carried; failed:
    why the demonstration ended early.
    """
    analysis = analyse(read_recording(recording))
    if failed:
        analysis = replace(analysis, problems=(failed, *analysis.problems))
    checks = findings(analysis, Tolerances(resting_rows=MODES_AT_REST * loads))
    write_report(analysis, checks, report)
    write_picture(analysis, picture)
    return Outcome(analysis, checks)
