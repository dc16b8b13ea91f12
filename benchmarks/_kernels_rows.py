"""Rows of `benchmarks/kernels.py`: a row, the clock, and the paper's load."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

REPETITIONS = 30


@dataclass(frozen=True)
class Row:
    """One measurement: what, beside what it stands, how long one item took."""

    kernel: str
    peer: str
    value: float
    unit: str


@dataclass(frozen=True)
class Tool:
    """The 155 kg of the paper's Table II."""

    name: str = "tool"
    mass: float = 155.0
    com: tuple[float, float, float] = (0.24, 0.0, 0.0)
    inertia: tuple[tuple[float, ...], ...] = ((5.0, 0.0, 0.0), (0.0, 4.0, 0.0), (0.0, 0.0, 6.0))


def best(function: Callable[[], Any], items: int, repetitions: int = REPETITIONS) -> float:
    """Seconds per item, the fastest of the repetitions."""
    fastest = np.inf
    for _ in range(repetitions):
        begin = time.perf_counter()
        function()
        fastest = min(fastest, time.perf_counter() - begin)
    return fastest / items
