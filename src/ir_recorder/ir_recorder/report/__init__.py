"""Recordings, plans and fleets as pages that open offline in any browser, and as one picture.

The pages, each a module:

- `page`: the report of one recording or plan. Its sections: `headline`, `cycle_costs`, `nights`,
  `whole_line`, `sankey` (flows), `tending`, `methods`, `tables`; its charts and the cell in 3D:
  `charts`, `series`, `gantt`, `motion_scene`, `data` (what its scripts read).
- `side_by_side`: several recordings against the first of them.
- `before_after`: today's program against the planner's, what `ir compare` writes.
- `fleet`: many robots and shifts; `fleet_members` (which files), `fleet_figures` (sums), and
  `fleet_tables`.
- `robots`: the robots of one recording together.
- `picture`: power and motion as a PNG.

What they share:

- money: `prices` (price, shifts, what a page is counted with), `program_names`, `quarter_hour`
  (peak demand), `money_text`; the top of each page: `answer`, `paid` (a year before and after),
  `bars`.
- looks: `shell` (head and frame), `number_text`, `tables`, `assets` (styles and scripts).
- drawings: `cell_scene`, `cell_outline`, `shapes`.
- files: `files`, `step_table` (CSV, XLSX, Parquet).
"""

from ir_recorder.report.page import CHARTS, Chart, report_html, write_report
from ir_recorder.report.picture import write_picture

__all__ = ["CHARTS", "Chart", "report_html", "write_picture", "write_report"]
