"""Pictures of the claims of the paper: small PNG files in one style."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")

from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.figure import Figure

DPI = 100


def panels(
    count: int, *, width: float = 4.6, height: float = 4.0
) -> tuple[Figure, tuple[Axes, ...]]:
    """A figure with so many panels side by side, `width` x `height` inch each."""
    figure, axes = plt.subplots(1, count, figsize=(width * count, height), squeeze=False)
    for panel in axes[0]:
        panel.grid(alpha=0.3)
    return figure, tuple(axes[0])


def finished(figure: Figure, file: Path) -> None:
    """Write the figure."""
    figure.tight_layout()
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file, dpi=DPI)
    plt.close(figure)


def bars(axes: Axes, values: dict[str, tuple[float, float, float]], **style: Any) -> None:
    """Horizontal bars with their intervals: value, low, high by label."""
    labels = list(values)
    middle = [values[name][0] for name in labels]
    lower = [max(values[name][0] - values[name][1], 0.0) for name in labels]
    upper = [max(values[name][2] - values[name][0], 0.0) for name in labels]
    axes.barh(range(len(labels)), middle, xerr=[lower, upper], capsize=3, **style)
    axes.set_yticks(range(len(labels)), labels)
    axes.invert_yaxis()
