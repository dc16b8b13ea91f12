"""The arena: planners against each other over cells, tasks, seeds, payloads and timings."""

from ir_studies.arena.runs import FinishedArena, run_arena
from ir_studies.arena.settings import (
    EXAMPLE,
    PORTFOLIO,
    ArenaEntry,
    ArenaSettings,
    arena_settings,
    read_settings,
)

__all__ = [
    "EXAMPLE",
    "PORTFOLIO",
    "ArenaEntry",
    "ArenaSettings",
    "FinishedArena",
    "arena_settings",
    "read_settings",
    "run_arena",
]
