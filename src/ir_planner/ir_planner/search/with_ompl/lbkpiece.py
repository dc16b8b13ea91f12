"""Two trees of KPIECE whose motions are checked when they join both (LBKPIECE).

OMPL's BKPIECE with the lazy checks of SBL.
"""

from dataclasses import dataclass
from typing import ClassVar

from ir_planner.search.with_ompl.ompl_search import OverCells


@dataclass(frozen=True)
class Lbkpiece(OverCells):
    """Two trees of KPIECE whose motions are checked when they join both (LBKPIECE)."""

    planner_id: ClassVar[str] = "lbkpiece"
    planner: ClassVar[str] = "LBKPIECE1"
