"""A placement: where everything stands, what a look at it said, and what its programs cost."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ir_studies.layout.freedom import Values, text_of
from ir_studies.layout.settings import Condition
from ir_studies.work import Job, Row

FIRST_SEED = 0


@dataclass(frozen=True)
class Placement:
    """Where things stand, by variable. What stands as given is left out: its jobs are those of the
    cell.
    """

    values: Values

    def __post_init__(self) -> None:
        moved = {name: value for name, value in sorted(self.values.items()) if value}
        object.__setattr__(self, "values", moved)

    @cached_property
    def key(self) -> str:
        """What it is known by."""
        return text_of(self.values)

    def look(self, conditions: Sequence[Condition]) -> Job:
        """The job of a look at it."""
        payloads = [dict(one) for one in payloads_of(conditions)]
        return Job(
            f"look|{self.key}|{payloads}",
            {"stage": "look", "values": self.values, "payloads": payloads},
        )

    def plan(self, condition: Condition, seed: int = FIRST_SEED, *, robots: bool = False) -> Job:
        """The job of its program in full; robots: with what the drawn robots add."""
        asked = {
            "values": self.values,
            "payload": dict(condition.payload),
            "seed": seed,
            "robots": robots,
        }
        words = {"stage": "plan", "cycle_time": condition.cycle_time, **asked}
        stage = "plan and robots" if robots else "plan"
        return Job(f"{stage}|{self.key}|{condition.text}|{seed}", words)


def payloads_of(conditions: Sequence[Condition]) -> list[tuple[tuple[str, float], ...]]:
    """The masses of parts, each once."""
    return list(dict.fromkeys(condition.payload for condition in conditions))


@dataclass(frozen=True)
class Known:
    """What is known of a placement.

    look: the row of the look; plans: those of its programs by condition, as far as they were made.
    """

    placement: Placement
    look: Row
    plans: Mapping[Condition, Row]
    conditions: tuple[Condition, ...]

    @property
    def coarse(self) -> float:
        """Mean cost of coarse movements over the conditions; inf where it is impossible."""
        if not self.look.get("solved"):
            return math.inf
        costs = dict(zip(payloads_of(self.conditions), self.look["coarse"], strict=True))
        return float(np.mean([costs[condition.payload] for condition in self.conditions]))

    @property
    def planned(self) -> bool:
        """Whether its programs were planned for all conditions."""
        return len(self.plans) == len(self.conditions)

    @property
    def cost(self) -> float:
        """Mean cost of its programs; inf where one is impossible, NaN where one isn't planned."""
        if not self.look.get("solved"):
            return math.inf
        if not self.planned:
            return math.nan
        return float(
            np.mean(
                [row["cost_j"] if row.get("solved") else math.inf for row in self.plans.values()]
            )
        )

    @property
    def reason(self) -> tuple[str, str]:
        """Kind and sentence of what makes it impossible, empty where nothing does."""
        for row in (self.look, *self.plans.values()):
            if not row.get("solved"):
                return str(row.get("kind", row.get("outcome", ""))), str(row.get("message", ""))
        return "", ""
