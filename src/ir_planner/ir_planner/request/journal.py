"""How an answer came about: stages with their seconds, what was rejected and why."""

from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import PlanningInfo, PlanningStage, Rejection
from ir_msgs_py.search_log import ConfigurationLog, SearchLog, stage_of
from ir_planner.request.work import Work


@dataclass
class Journal:
    """Kept by one request; the clock is its budget's."""

    work: Work
    seed: int
    begin: float = 0.0
    planner_id: str = ""
    timing: str = ""  # which the answer is
    stages: list[PlanningStage] = field(default_factory=list)
    rejected: Counter[str] = field(default_factory=Counter)
    logs: list[SearchLog] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.begin = self.work.clock()

    @contextmanager
    def stage(self, name: str) -> Iterator[list[str]]:
        """Time a stage; what is appended to the list becomes its note."""
        notes: list[str] = []
        begin = self.work.clock()
        try:
            yield notes
        finally:
            self.stages.append(PlanningStage(name, self.work.clock() - begin, "; ".join(notes)))

    def note(self, name: str, text: str) -> None:
        """A remark without duration."""
        if text:
            self.stages.append(PlanningStage(name, 0.0, text))

    def reject(self, reason: str, count: int = 1) -> None:
        """Count candidates dropped for one reason."""
        if count:
            self.rejected[reason] += count

    def keep(self, log: SearchLog) -> None:
        """Let a log of a search travel with the answer; of searches at one station the first."""
        known = [other.station for other in self.logs if isinstance(other, ConfigurationLog)]
        if not (isinstance(log, ConfigurationLog) and log.station in known):
            self.logs.append(log)

    def info(self, start: FloatArray | None, joint_names: tuple[str, ...]) -> PlanningInfo:
        """The record of a request from start (n,), as it goes into the answer."""
        return PlanningInfo(
            planner_id=self.planner_id,
            seed=self.seed,
            start=np.zeros(0) if start is None else start,
            start_names=() if start is None else joint_names,
            iterations=self.work.iterations,
            truncated=self.work.truncated,
            planning_time=self.work.clock() - self.begin,
            stages=(*self.stages, *map(stage_of, self.logs)),
            rejected=tuple(
                Rejection(reason, count) for reason, count in sorted(self.rejected.items())
            ),
            timing=self.timing,
        )


def noted(info: PlanningInfo, note: str, about: str = "options") -> PlanningInfo:
    """The record with a remark on the options, or about something else ("": none)."""
    return replace(info, stages=(*info.stages, PlanningStage(about, 0.0, note))) if note else info
