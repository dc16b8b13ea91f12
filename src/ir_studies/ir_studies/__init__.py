"""Studies: many plans of many cells, and what follows from them.

    study = read_study("layout.yaml")
    answer = study.run("out/layout", Means(workers=2))
    print(answer.summary)

Each study is a room; they share the work (processes, results, settings) and the errors.
"""

from ir_studies.arena import read_settings, run_arena
from ir_studies.errors import FolderError, SettingsError, StoppedError, WorkerError
from ir_studies.layout import LayoutSettings, read_layout, run_layout
from ir_studies.studies import KINDS, read_study, study_of
from ir_studies.work import Means

__all__ = [
    "KINDS",
    "FolderError",
    "LayoutSettings",
    "Means",
    "SettingsError",
    "StoppedError",
    "WorkerError",
    "read_layout",
    "read_settings",
    "read_study",
    "run_arena",
    "run_layout",
    "study_of",
]
