"""The page of today's program beside the planner's: figures with error bars, changes, both motions
in 3D.
"""

from ir_recorder.report.before_after.page import before_after_html, write_before_after
from ir_recorder.report.before_after.table import before_after_columns, write_before_after_table

__all__ = [
    "before_after_columns",
    "before_after_html",
    "write_before_after",
    "write_before_after_table",
]
