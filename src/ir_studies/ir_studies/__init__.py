"""Studies: many plans of many cells, and what follows from them.

    study = read_study("layout.yaml")
    answer = study.run("out/layout", Means(workers=2))
    print(answer.summary)

Each study is a room; they share the work (processes, results, settings) and the errors.
"""

from ir_studies.arena import run_arena
from ir_studies.errors import StoppedError
from ir_studies.layout import LayoutSettings, run_layout
from ir_studies.studies import read_study
from ir_studies.work import Means

__all__ = [
    "LayoutSettings",
    "Means",
    "StoppedError",
    "read_study",
    "run_arena",
    "run_layout",
]
