"""Figures of a task of the regional benchmark, as a row of table and JSON, and the claims of all
tasks.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from _regional_ours import Run
from _regional_tasks import Cost, Task
from _results import Claim, at_least, at_most

FIRST_MS = {"open": 1.0, "table_columns": 2.0, "cnc_door": 10.0, "deep_box": 30.0}
FINAL_MS = {"open": 50.0, "table_columns": 50.0, "cnc_door": 200.0, "deep_box": 200.0}
OF_BEST = 1.05
SPREAD = 0.05  # (max - min) / min of J over the seeds of a task


@dataclass(frozen=True)
class PeerRun:
    """One search of OMPL, ms; cost None where nothing was found."""

    planner: str
    first_ms: float
    final_ms: float
    cost: Cost | None
    how: str


@dataclass(frozen=True, eq=False)
class Figures:
    """All runs of one task; left [m] by Coal over `asked` configurations; share of the limits."""

    task: Task
    runs: tuple[Run, ...]
    peers: tuple[PeerRun, ...]
    best_by: str
    best_known: float
    left: float
    asked: int
    share: float
    trajectories: int

    @property
    def costs(self) -> list[Cost]:
        """Of the planner's answers."""
        return [run.cost for run in self.runs if run.cost is not None]

    @property
    def peer(self) -> PeerRun | None:
        """OMPL's cheapest movement."""
        found = [peer for peer in self.peers if peer.cost is not None]
        return min(found, key=lambda peer: peer.cost.J) if found else None  # type: ignore[union-attr]

    @property
    def spread(self) -> float:
        """(max - min) / min of J over the seeds; nan where nothing was found."""
        J = [cost.J for cost in self.costs]
        return (max(J) - min(J)) / min(J) if J else float("nan")

    def near_best(self, runs: tuple[Run, ...]) -> int:
        """How many of these runs have J at most 1.05 times the best known."""
        costs = [run.cost for run in runs if run.cost is not None]
        return sum(cost.J / self.best_known <= OF_BEST for cost in costs)

    def row(self) -> dict[str, Any]:
        """As it goes into the table and the JSON."""
        costs = self.costs
        row: dict[str, Any] = {
            "task": self.task.label,
            "S_m_mm": round(1e3 * self.task.margin, 1),
            "solved": f"{len(costs)}/{len(self.runs)}",
            "truncated": sum(run.truncated for run in self.runs),
            "first_ms": _median([run.first_ms for run in self.runs if run.solved], 2),
            "final_ms": _median([run.final_ms for run in self.runs], 1),
            "J": _median([cost.J for cost in costs], 0),
            "T": _median([cost.duration for cost in costs], 3),
            "E": _median([cost.energy for cost in costs], 0),
            "clearance_mm": _least([1e3 * run.clearance for run in self.runs if run.solved], 1),
        }
        for planner in dict.fromkeys(peer.planner for peer in self.peers):
            mine = [peer for peer in self.peers if peer.planner == planner]
            found = [peer for peer in mine if peer.cost is not None]
            row[f"{planner}_solved"] = f"{len(found)}/{len(mine)}"
            row[f"{planner}_first_ms"] = _median([peer.first_ms for peer in found], 2)
            row[f"{planner}_final_ms"] = _median([peer.final_ms for peer in found], 0)
            row[f"{planner}_J"] = _median([peer.cost.J for peer in found if peer.cost], 0)
        if self.peer is not None and self.peer.cost is not None:
            best = self.peer.cost
            row |= {
                "ompl_J": round(best.J),
                "ompl_T": round(best.duration, 3),
                "ompl_E": round(best.energy),
            }
            row["ompl_by"] = f"{self.peer.planner} {self.peer.how}"
        if np.isfinite(self.best_known):
            row |= {"best_J": round(self.best_known, 1), "best_by": self.best_by}
            row["near_best"] = f"{self.near_best(self.runs)}/{len(self.runs)}"
        return row


def _median(values: list[float], digits: int) -> float | None:
    return round(float(np.median(values)), digits) if values else None


def _least(values: list[float], digits: int) -> float | None:
    return round(min(values), digits) if values else None


def claims_of(figures: list[Figures]) -> list[Claim]:
    """What the tasks say."""
    runs = [run for f in figures for run in f.runs]
    solved = sum(run.solved for run in runs)
    claims = [at_least("success, certified", 100.0 * solved / len(runs), "%", 99.9)]
    cells = dict.fromkeys(f.task.cell for f in figures)
    for what, bounds in (("first feasible", FIRST_MS), ("final", FINAL_MS)):
        for cell in cells:
            here = [run for f in figures if f.task.cell == cell for run in f.runs if run.solved]
            values = [run.first_ms if what == "first feasible" else run.final_ms for run in here]
            if values and cell in bounds:
                claims.append(
                    at_most(f"{what}, {cell}, median", float(np.median(values)), "ms", bounds[cell])
                )
    near = 100.0 * sum(f.near_best(f.runs) for f in figures) / len(runs)
    name = f"runs with the default budget: J at most {OF_BEST} times the best known"
    claims.append(at_least(name, near, "%", 95.0))
    spreads = [f.spread for f in figures if len(f.costs) > 1]
    if spreads:
        narrow = 100.0 * float(np.mean(np.array(spreads) <= SPREAD))
        name = f"tasks whose J spreads at most {100.0 * SPREAD:g} % over the seeds"
        claims.append(at_least(name, narrow, "%", 95.0))
    return claims + _against_ompl(figures) + _violations(figures)


def _against_ompl(figures: list[Figures]) -> list[Claim]:
    """Tasks and runs beside OMPL's movements."""
    beside = [f for f in figures if f.peers]
    if not beside:
        return []
    below = {"best": 0, "median": 0}
    worse = 0
    for f in beside:
        theirs = [peer.cost for peer in f.peers if peer.cost is not None]
        if not theirs:
            below = {name: count + bool(f.costs) for name, count in below.items()}
            continue
        least = min(theirs, key=lambda cost: cost.J)
        ours = float(np.median([cost.J for cost in f.costs])) if f.costs else np.inf
        below["best"] += ours < least.J
        below["median"] += ours < float(np.median([cost.J for cost in theirs]))
        worse += sum(
            cost.duration > least.duration and cost.energy > least.energy for cost in f.costs
        )
    count = len(beside)
    return [
        at_least(
            f"tasks with median J below OMPL's {name}", 100.0 * below[name] / count, "%", 100.0
        )
        for name in ("median", "best")
    ] + [at_most("runs with both duration and energy above OMPL's best", worse, "runs", 0)]


def _violations(figures: list[Figures]) -> list[Claim]:
    """What Coal and Pinocchio say."""
    checked = [f for f in figures if f.trajectories]
    if not checked:
        return []
    claims = []
    if any(f.asked for f in checked):
        name = f"least distance beyond S_m by Coal, {sum(f.asked for f in checked)} configurations"
        claims.append(at_least(name, min(f.left for f in checked if f.asked), "m", -1e-6))
    name = f"largest share of a limit at 10 kHz, {sum(f.trajectories for f in checked)} movements"
    claims.append(at_most(name, max(f.share for f in checked), "1", 1.0 + 1e-6))
    return claims
