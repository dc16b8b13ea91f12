"""Layout study: where robot, machines, posture and tool stand for least energy."""

from ir_studies.layout.settings import (
    EXAMPLE,
    LayoutSettings,
    PlacementCondition,
    layout_settings,
    read_layout,
)
from ir_studies.layout.study import Layouts, run_layout

__all__ = [
    "EXAMPLE",
    "LayoutSettings",
    "Layouts",
    "PlacementCondition",
    "layout_settings",
    "read_layout",
    "run_layout",
]
