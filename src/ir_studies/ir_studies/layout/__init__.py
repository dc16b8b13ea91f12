"""Layout study: where robot, machines, posture and tool stand for least energy."""

from ir_studies.layout.settings import EXAMPLE, LayoutSettings, layout_settings
from ir_studies.layout.study import Layouts, run_layout

__all__ = [
    "EXAMPLE",
    "LayoutSettings",
    "Layouts",
    "layout_settings",
    "run_layout",
]
