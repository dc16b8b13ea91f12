"""One picture of the regional benchmark: J of the planner beside OMPL's, per task."""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np
from _regional_figures import OF_BEST, Figures

mpl.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.ticker import FixedLocator, NullLocator, ScalarFormatter


def plot(figures: list[Figures], file: Path) -> None:
    """Every movement as a mark, tasks from left to right: its J over the least J known for the
    task.
    """
    known = [f for f in figures if np.isfinite(f.best_known)]
    series = {
        "planner": [(x, cost.J / f.best_known) for x, f in enumerate(known) for cost in f.costs],
        "OMPL + TOPP-RA": [
            (x, peer.cost.J / f.best_known)
            for x, f in enumerate(known)
            for peer in f.peers
            if peer.cost is not None
        ],
    }
    figure, axes = plt.subplots(figsize=(max(6.0, 0.3 * len(known) + 2.0), 6.0))
    for (name, points), shift, marker in zip(series.items(), (-0.15, 0.15), "ox", strict=True):
        if points:
            x, ratio = np.array(points, dtype=np.float64).T
            axes.plot(x + shift, ratio, marker, ms=4, ls="", alpha=0.7, label=name)
    axes.axhline(OF_BEST, color="0.3", lw=1.0, label=f"{OF_BEST} times the best known")
    axes.set_xticks(range(len(known)), [f.task.label for f in known], rotation=90, fontsize=7)
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(FixedLocator([1.0, 1.1, 1.2, 1.5, 2.0, 3.0, 5.0, 10.0]))
    axes.yaxis.set_minor_locator(NullLocator())
    axes.yaxis.set_major_formatter(ScalarFormatter())
    axes.set_ylabel("J / best known J,  J = drive energy + 500 W · T")
    axes.margins(x=0.01)
    axes.grid(axis="y", alpha=0.3)
    axes.legend()
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=120)
    plt.close(figure)
