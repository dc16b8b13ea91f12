"""A fit as sentences, as a table and as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

from ir_description import PowerParameters
from ir_description.robot import parameter_unit
from ir_recorder.errors import RecorderError
from ir_recorder.fit.left_out import METHODS, LeftOut
from ir_recorder.fit.power_estimate import Fit, FittedMovement
from ir_recorder.report.files import write_output
from ir_recorder.report.picture import PICTURE_START
from ir_values.files import ANYWHERE

# A fit in words: what the data determined, what they did not, and how well it then agrees.


def sentences(found: Fit, begun: str = "the data sheet") -> tuple[str, ...]:
    """The findings for people, one sentence each; begun: the name of what the fit began with."""
    own = int(found.determined.sum())
    lines = [f"{own} of {len(found.determined)} parameters are determined by the data"]
    metered = bool(len(found.measured))
    if found.kept:
        lines.append(
            f"the data say little of these, which stay near what was known: {', '.join(found.kept)}"
        )
    if found.friction_scale > 1.0:
        lines.append(
            f"friction may lie {found.friction_scale:g} times farther from {begun} than its "
            "marks say: so what is left out is predicted best"
            if metered
            else "friction is open: torques show it axis by axis"
        )
    if not metered:
        noise = ", ".join(f"{each:.3g}" for each in found.torque_noise)
        unit = "A" if found.currents else "Nm"
        return (
            *lines,
            f"motors over 50 ms are off by {noise} {unit} (rms, by axis)",
            *_gains(found),
            *_turning(found),
            "there are no watts in these data: losses of drives and controller stay as before",
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
    return (*lines, *_gains(found))


def _gains(found: Fit) -> tuple[str, ...]:
    """What an ampere is worth, with standard deviations, where currents were recorded."""
    if not found.currents:
        return ()
    each = (
        f"{1.0 / scale:.3g} ({100.0 * deviation / abs(scale):.0f} %)"
        for scale, deviation in zip(found.scales, found.scale_deviations, strict=True)
        if scale != 0.0
    )
    return (
        f"an ampere of the motors is {', '.join(each)} Nm at the joints (by axis, with its "
        "standard deviation)" + ("" if len(found.measured) else "; friction is no surer"),
    )


def _turning(found: Fit) -> tuple[str, ...]:
    """How dry friction turns, where it does not at once."""
    if not any(found.travel):
        return ()
    travel = ", ".join(f"{1e3 * each:g}" for each in found.travel)
    return (
        f"after a reversal dry friction turns over {travel} mrad (by axis; 0: at once): gears give "
        "way before they slide",
    )


def _share(movements: Sequence[FittedMovement], field: str) -> str:
    shares = np.array([abs(getattr(each, field) / each.measured - 1.0) for each in movements])
    return f"{100.0 * np.median(shares):.1f} % and {100.0 * shares.max():.1f} %"


def left_out_rows(found: Sequence[LeftOut], begun: str = METHODS[1]) -> list[dict[str, object]]:
    """One row per part and method: what was left out, and how it is predicted; begun: the name of
    what the fit began with.
    """
    rows: list[dict[str, object]] = []
    for each in found:
        sizes = np.abs(each.errors) if each.errors else np.array([np.nan])
        rows.append(
            {
                "part": each.part,
                "method": begun if each.method == METHODS[1] else each.method,
                "count": len(each.errors),
                "rms": each.rms,
                "median": float(np.median(sizes)),
                "largest": float(sizes.max()),
                "covered": each.covered,
            }
        )
    return rows


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


# A fit as one picture: powers over time, residuals by movement, and parameters against their
# prior.

_MOST_SECONDS = 60.0  # of powers that are shown: a few movements, not an hour
_MEASURED = "#39434f"
_BEFORE = "#e8590c"
_AFTER = "#5b8def"


def write_fit_picture(found: Fit, prior: PowerParameters, path: Path) -> Path:
    """Write the picture as PNG and return its absolute path; RecorderError where matplotlib isn't
    installed. prior: as the fit took it (`Estimate.prior`); without a meter its parameters alone
    are shown.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise RecorderError("a picture needs matplotlib: pip install matplotlib") from error
    metered = bool(len(found.measured))
    size = (10.0, 9.5 if metered else 4.5)
    figure = Figure(figsize=size, dpi=110, layout="constrained", facecolor="white")
    if metered:
        powers, residuals, parameters = figure.subplots(3, 1, height_ratios=(1.0, 0.8, 1.2))
        _powers(powers, found)
        _residuals(residuals, found)
    else:
        parameters = figure.subplots()
    _parameters(parameters, found, prior)
    for axes in figure.axes:
        axes.grid(color="#dde3ea", linewidth=0.6)
        axes.set_axisbelow(True)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    picture = BytesIO()
    figure.savefig(picture, format="png")
    return write_output(path, picture.getvalue(), PICTURE_START, ANYWHERE)


def _powers(axes: Any, found: Fit) -> None:
    begin = found.movements[0].start - 1.0 if found.movements else found.time[0]
    rows = (found.time >= begin) & (found.time <= begin + _MOST_SECONDS)
    for values, colour, label in (
        (found.measured, _MEASURED, "meter"),
        (found.before, _BEFORE, "before the fit"),
        (found.after, _AFTER, "after the fit"),
    ):
        axes.plot(found.time[rows], values[rows] / 1e3, color=colour, linewidth=0.9, label=label)
    axes.set(xlabel="time [s]", ylabel="power at the mains [kW]")
    axes.legend(frameon=False, fontsize=8.5)


def _residuals(axes: Any, found: Fit) -> None:
    number = np.arange(1, len(found.movements) + 1)
    for values, colour, label in (
        ([each.before for each in found.movements], _BEFORE, "before the fit"),
        ([each.after for each in found.movements], _AFTER, "after the fit"),
    ):
        shares = [
            100.0 * (v / m.measured - 1.0) for v, m in zip(values, found.movements, strict=True)
        ]
        axes.plot(number, shares, "o", color=colour, markersize=4, label=label)
    axes.axhline(0.0, color=_MEASURED, linewidth=0.8)
    axes.set(xlabel="movement", ylabel="energy off the meter [%]")
    axes.legend(frameon=False, fontsize=8.5)


def _parameters(axes: Any, found: Fit, prior: PowerParameters) -> None:
    """Each parameter in deviations of its prior: where it went, and what uncertainty is left."""
    scale = np.where(prior.deviation > 0.0, prior.deviation, 1.0)
    moved = (found.parameters.mean - prior.mean) / scale
    left = found.parameters.deviation / scale
    place = np.arange(len(moved))
    for rows, colour, label in (
        (found.determined, _AFTER, "determined by the data"),
        (~found.determined, "#adb5bd", "kept at the prior"),
    ):
        axes.errorbar(
            place[rows],
            moved[rows],
            yerr=left[rows],
            fmt="o",
            markersize=3.5,
            color=colour,
            label=label,
        )
    axes.axhspan(-1.0, 1.0, color="#f1f3f5", zorder=0)
    axes.set_xticks(place, found.parameters.names, rotation=90, fontsize=6.5)
    axes.set_ylabel("deviations of the prior")
    axes.legend(frameon=False, fontsize=8.5)
