"""A recording as one self-contained HTML page, and as one picture."""

from ir_recorder.report.page import CHARTS, Chart, report_html, write_report
from ir_recorder.report.picture import write_picture

__all__ = ["CHARTS", "Chart", "report_html", "write_picture", "write_report"]
