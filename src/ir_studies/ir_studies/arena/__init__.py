"""The arena: planners against each other over cells, tasks, seeds, payloads and timings."""

from ir_studies.arena.runs import run_arena
from ir_studies.arena.settings import (
    EXAMPLE,
    PORTFOLIO,
    ArenaSettings,
    arena_settings,
    read_settings,
)

__all__ = [
    "EXAMPLE",
    "PORTFOLIO",
    "ArenaSettings",
    "arena_settings",
    "read_settings",
    "run_arena",
]
