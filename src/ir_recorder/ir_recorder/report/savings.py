"""What the program saves by its plan, in three figures, each with its baseline."""

from __future__ import annotations

from ir_msgs_py.savings import ProgramSavings, Saving
from ir_recorder.analysis import Analysis
from ir_recorder.format import contents
from ir_recorder.report.tables import table
from ir_recorder.report.words import joules, seconds, text

Row = tuple[str, Saving, str]


def savings_section(analysis: Analysis) -> str:
    """Section of the page; "" where the recording carries no savings."""
    savings = analysis.savings
    if savings is None:
        return ""
    cells = (
        (
            text(name),
            joules(saving.common),
            joules(saving.planned),
            f"<b>{_share(saving)}</b>{_within(saving)}",
            seconds(saving.seconds),
            text(baseline),
        )
        for name, saving, baseline in _rows(analysis, savings)
    )
    heads = ("", ">baseline", ">planned", ">saved", ">time", "held against")
    return (
        '<section id="savings"><h2>What the program saves</h2>'
        '<p class="hint">Predicted energies at the mains, over the same seconds, with the 90 % '
        "interval of "
        "what is saved; nothing here is simulated or measured. Losses that the data sheet puts "
        "at zero can "
        "only add; where the common program has more of them, the interval lies mostly above the "
        "value.</p>"
        f"{table(heads, cells, 'What the program saves')}"
        f"<details><summary>In words</summary><p>{text(savings.sentence)}; program "
        f"{text(savings.program_id)}.</p></details></section>"
    )


def savings_lines(analysis: Analysis) -> list[str]:
    """A sentence for each figure; none where the recording carries no savings."""
    savings = analysis.savings
    if savings is None:
        return []
    return [
        f"{name}: {_share(saving)} saved by plan (predicted), {joules(saving.planned)} instead of "
        f"{joules(saving.common)} in {seconds(saving.seconds)}{_sure(saving)}, against {baseline}"
        for name, saving, baseline in _rows(analysis, savings)
    ]


def _rows(analysis: Analysis, savings: ProgramSavings) -> list[Row]:
    """Name, figures and baseline; the row of pauses only where there are any."""
    common = (
        f"synchronous S-curve PTP at 100 % through the same stations ({savings.around} of "
        f"{savings.across} around bodies)"
    )
    shortened = (
        " (pauses shortened)" if analysis.recording.fact(contents.UNSHORTENED_PAUSES) else ""
    )
    rows = [("movements", savings.movements, common)]
    if savings.pauses.seconds > 0.0:
        rows.append(("pauses", savings.pauses, f"the controller's own timers{shortened}"))
    return [*rows, ("total", savings.total, f"both{shortened}")]


def _within(saving: Saving) -> str:
    words = _sure(saving).removeprefix(", ")
    return f"<small>{text(words)}</small>" if words else ""


def _sure(saving: Saving) -> str:
    """The interval of what is saved; "" where the recording has none."""
    if saving.saved_low == saving.saved_high:
        return ""
    within = f", 90 % interval {joules(saving.saved_low)} to {joules(saving.saved_high)}"
    return (
        within
        if saving.certain
        else f"{within}: zero lies in it, so it is open whether anything is saved"
    )


def _share(saving: Saving) -> str:
    return f"{100.0 * saving.share:.1f} %"
