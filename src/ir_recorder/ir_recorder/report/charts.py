"""Charts and tables that the page shows of an analysis: a new one is a function, and a line here.

The page (assets/page.html) holds the place of each as {{name}}.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

from ir_recorder.analysis import Analysis
from ir_recorder.analysis.agreement import agreement
from ir_recorder.report.bars import joule_bars
from ir_recorder.report.methods import methods_section
from ir_recorder.report.sankey import sankey_section
from ir_recorder.report.savings import savings_section
from ir_recorder.report.tables import (
    fact_table,
    measurement_table,
    mode_table,
    problem_list,
    resting_table,
    station_table,
    step_table,
    warning_table,
)

Chart = Callable[[Analysis], str]
"""HTML or SVG of an analysis, whatever is missing in it; texts of the recording are escaped."""

CHARTS: Mapping[str, Chart] = {
    "problems": lambda analysis: problem_list(analysis.problems),
    "bars": lambda analysis: joule_bars(analysis.movements),
    "flows": sankey_section,
    "steps": step_table,
    "savings": savings_section,
    "methods": methods_section,
    "stations": station_table,
    "modes": mode_table,
    "resting": resting_table,
    "measurements": lambda analysis: measurement_table(agreement(analysis)),
    "warnings": warning_table,
    "facts": fact_table,
}
