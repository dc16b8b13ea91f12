"""One picture of the regional benchmark: J of the planner beside OMPL's, per task."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from _regional_figures import Figures

mpl.use("Agg")

from matplotlib import pyplot as plt


def plot(figures: list[Figures], file: Path) -> None:
    """Every run as a mark, tasks from left to right, the best known J as a line; J in kJ."""
    figure, axes = plt.subplots(figsize=(max(6.0, 0.32 * len(figures) + 2.0), 5.5))
    for x, f in enumerate(figures):
        axes.hlines(
            1e-3 * f.best_known, x - 0.4, x + 0.4, color="0.3", lw=1.0, label="best known" if x == 0 else ""
        )
    series = {
        "planner": [(x, cost.J) for x, f in enumerate(figures) for cost in f.costs],
        "OMPL + TOPP-RA": [
            (x, peer.cost.J) for x, f in enumerate(figures) for peer in f.peers if peer.cost is not None
        ],
    }
    for (name, points), shift, marker in zip(series.items(), (-0.15, 0.15), "ox", strict=True):
        if points:
            x, J = np.array(points, dtype=np.float64).T
            axes.plot(x + shift, 1e-3 * J, marker, ms=4, ls="", alpha=0.7, label=name)
    axes.set_xticks(range(len(figures)), [f.task.label for f in figures], rotation=90, fontsize=7)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel("J = drive energy + 500 W · T  [kJ]")
    axes.grid(axis="y", alpha=0.3)
    axes.legend()
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=120)
    plt.close(figure)
