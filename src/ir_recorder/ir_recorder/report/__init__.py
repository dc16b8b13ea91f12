"""A recording as one self-contained HTML page."""

from ir_recorder.report.page import report_html, write_report

__all__ = ["report_html", "write_report"]
