"""One picture of how cost grows: time and memory over each axis, with the exponent of each step."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from _scaling_rows import Row, exponents

mpl.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

AXES = {
    "bodies": "bodies in the cell",
    "stops": "stops of the program",
    "configurations": "free configurations per stop",
    "points": "points of the trajectory",
}


TICKS = (1, 2, 5, 10, 20, 50, 100, 1000, 10_000)


def _decades(panel: Axes) -> None:
    """At least two decades, so that noise stays small."""
    low, high = np.log10(panel.get_ylim())
    more = max(2.0 - (high - low), 0.0) / 2.0
    panel.set_ylim(10.0 ** (low - more), 10.0 ** (high + more))
    panel.yaxis.set_minor_formatter(NullFormatter())


def plot(rows: Sequence[Row], file: Path) -> None:
    """Times above, memory below, one column per axis."""
    axes_with_rows = [axis for axis in AXES if any(row.axis == axis for row in rows)]
    figure, panels = plt.subplots(
        2,
        len(axes_with_rows),
        figsize=(4.6 * len(axes_with_rows), 8.4),
        squeeze=False,
        sharex="col",
    )
    slopes = exponents(rows)
    sizes = {axis: [row.size for row in rows if row.axis == axis] for axis in axes_with_rows}
    for column, axis in enumerate(axes_with_rows):
        time, memory = panels[:, column]
        for name in dict.fromkeys(row.step for row in rows if row.axis == axis):
            mine = [row for row in rows if (row.axis, row.step) == (axis, name)]
            size = [row.size for row in mine]
            label = f"{name}: {slopes[axis, name]:.2f}"
            time.loglog(size, [row.seconds for row in mine], "o-", ms=3, lw=1.2, label=label)
            memory.loglog(size, [max(row.megabytes, 0.1) for row in mine], "o-", ms=3, lw=1.2)
        memory.set_xlabel(AXES[axis])
        handles, labels = time.get_legend_handles_labels()
        title = "step: exponent of its time"
        place = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2)}
        memory.legend(handles, labels, fontsize=8, title=title, title_fontsize=8, **place)
        ticks = [k for k in TICKS if min(sizes[axis]) <= k <= max(sizes[axis])]
        memory.set_xticks(ticks, [str(k) for k in ticks])
        memory.xaxis.set_minor_formatter(NullFormatter())
        for panel in (time, memory):
            panel.grid(which="both", alpha=0.25)
            _decades(panel)
    panels[0, 0].set_ylabel("processor time of one call [s]")
    panels[1, 0].set_ylabel("memory of one call [MB]")
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=100)
    plt.close(figure)
