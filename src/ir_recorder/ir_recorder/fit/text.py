"""A fit in words: what the data determined, what they did not, and how well it then agrees."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ir_description import PowerParameters, parameter_unit
from ir_recorder.fit.estimate import Fit, FittedMovement


def sentences(found: Fit) -> tuple[str, ...]:
    """The findings for people, one sentence each."""
    own = int(found.determined.sum())
    lines = [f"{own} of {len(found.determined)} parameters are determined by the data"]
    if found.kept:
        lines.append(
            f"kept at the prior, because the data say little of them: {', '.join(found.kept)}"
        )
    if not found.movements:
        lines.append(
            "nothing moves for 0.3 s or longer in these data: friction, masses and losses in "
            "motion were not "
            "determined, and movements are predicted as before; ir energy excite plans some"
        )
    else:
        lines.append(
            f"energy of {len(found.movements)} movements is off the meter by "
            f"{_share(found.movements, 'before')} before, by {_share(found.movements, 'after')} "
            "after (median and largest, in the fitted data)"
        )
    rest, moving = found.noise
    lines.append(
        f"power over 50 ms is off by {rest:.1f} W at rest and {moving:.1f} W in motion (rms)"
    )
    if found.inflation > 1.0:
        lines.append(
            f"noise counts {found.inflation:.1f} times: the model lacks something, and movements "
            f"that were not driven will meet it too"
        )
    return tuple(lines)


def _share(movements: Sequence[FittedMovement], field: str) -> str:
    shares = np.array([abs(getattr(each, field) / each.measured - 1.0) for each in movements])
    return f"{100.0 * np.median(shares):.1f} % and {100.0 * shares.max():.1f} %"


def parameter_rows(found: Fit, prior: PowerParameters) -> list[dict[str, object]]:
    """One row per parameter: before, after, deviations, whether determined."""
    names = found.parameters.names
    return [
        {
            "parameter": name,
            "unit": parameter_unit(name),
            "before": float(prior.mean[k]),
            "before_deviation": float(prior.deviation[k]),
            "value": float(found.parameters.mean[k]),
            "deviation": float(found.parameters.deviation[k]),
            "determined": bool(found.determined[k]),
        }
        for k, name in enumerate(names)
    ]
