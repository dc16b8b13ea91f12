"""An arena whose workers plan nothing."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from ir_studies import Means
from ir_studies.arena import ArenaSettings, run_arena
from ir_studies.arena.runs import FinishedArena
from ir_studies.work.means import Progress, nobody

sys.path.append(
    str(Path(__file__).parents[2] / "benchmarks")
)  # scripts, imported from their folder

WORKER = Path(__file__).with_name("fake_worker.py")
Fought = Callable[..., FinishedArena]


@pytest.fixture
def command(tmp_path: Path) -> tuple[str, ...]:
    marks = tmp_path / "marks"
    marks.mkdir()
    return sys.executable, "-S", str(WORKER), str(marks)


@pytest.fixture
def fought(tmp_path: Path, command: tuple[str, ...]) -> Fought:
    """Runs an arena of these planners in a folder."""

    def run(
        *planners: str,
        folder: str = "out",
        seeds: int = 2,
        progress: Progress = nobody,
        hang_after: float = 60.0,
        parquet: bool = False,
    ) -> FinishedArena:
        settings = ArenaSettings(
            cells=("open",),
            planners=planners,
            tasks=("home->p1",),
            seeds=seeds,
            seconds=0.01,
            hang_after=hang_after,
        )
        means = Means(2, progress=progress, command=command)
        return run_arena(settings, tmp_path / folder, means, parquet=parquet)

    return run
