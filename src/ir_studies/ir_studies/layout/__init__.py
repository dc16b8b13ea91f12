"""Where robot, machines, posture and tool should stand for least energy, and what is impossible."""

from ir_studies.layout.example import EXAMPLE
from ir_studies.layout.settings import Condition, LayoutSettings, layout_settings, read_layout
from ir_studies.layout.study import Layouts, run_layout

__all__ = [
    "EXAMPLE",
    "Condition",
    "LayoutSettings",
    "Layouts",
    "layout_settings",
    "read_layout",
    "run_layout",
]
