"""Studies: many plans of many cells, and what follows from them.

    settings = read_settings("arena.yaml")
    finished = run_arena(settings, "out/arena")

Each study is a room; they share nothing but the errors.
"""

from ir_studies.arena import ArenaSettings, read_settings, run_arena
from ir_studies.errors import FolderError, SettingsError, StudyError, WorkerError

__all__ = [
    "ArenaSettings",
    "FolderError",
    "SettingsError",
    "StudyError",
    "WorkerError",
    "read_settings",
    "run_arena",
]
