"""docs/reproduction.md, written from what the experiments on the claims of the paper have
stored.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from _paper_result import JUDGED, Experiment, Row, Statement

HEAD = """# The paper on trial

M. Bogdanovskyi, J. Cernohorsky, "Industrial Robots Trajectories Planning for Flexible Manufacturing Systems":
what it claims, what is measured here, and what follows. The statements are given in our words; how its
equations are read stands in [the paper map](paper_map.md). This page is written by
`python benchmarks/paper.py`; no figure in it is typed by hand. `--only NAME` repeats one claim, `--quick` all
of them with small samples; rows as JSON and CSV are in `out/paper`.

A statement **holds** where the whole 95 % interval (bootstrap over what was drawn independently; Wilson's for
shares that never vary) keeps its bound, it **does not hold** where none of the interval does, else it
**cannot be decided**. All of it is done with {seeds} that share nothing: where one seed alone says otherwise,
it cannot be decided either, and the row says so, and how much larger a sample would decide it if the figure
stays. `measured` claims nothing; `calibration` is no evidence, the data were made to fit. All energies are
predicted by the planner's model of robot and drives, no robot was measured; times are processor
times{machine}.

How large the samples are follows from pilots with seeds 0 to 5, whose draws are not used here (the bundled
cells themselves, which the drawn ones vary, are the same for every seed): where an interval was too wide to
decide, the sample grew with the square of its width over its distance to the bound, on whichever side of it
the figure was, as far as an hour of processor time for all claims allows. What is drawn independently are
cells and movements, not the searches in them. Every interval is one of 95 % by itself, and there are many:
that is why each seed must say the same alone, so that chance has to deceive twice for a wrong verdict. An
interval says what another draw would change, not what another machine would, or what else runs on it: the
ratio of two times of milliseconds can move further than that.
"""  # noqa: E501


@dataclass(frozen=True, eq=False)
class Chapter:
    """An experiment with what it found; picture: relative to the page, "" for none; seconds: of
    processor.
    """

    experiment: Experiment
    statements: list[Statement]
    rows: list[Row]
    picture: str
    seconds: float


def page(
    chapters: Sequence[Chapter],
    missing: Sequence[str],
    seeds: Sequence[int],
    machine: str,
    quick: bool,
) -> str:
    """The whole page."""
    named = f"{'seeds' if len(seeds) > 1 else 'seed'} {' and '.join(map(str, seeds))}"
    parts = [HEAD.format(seeds=named, machine=f" on {machine}" if machine else "")]
    if quick:
        parts.append("**Short version**: small samples; nothing here is to be quoted.\n")
    parts.append(_summary(chapters))
    if missing:
        parts.append(f"Not run: {', '.join(f'`{name}`' for name in missing)}.\n")
    parts += [_chapter(chapter) for chapter in chapters]
    total = sum(chapter.seconds for chapter in chapters)
    parts.append(f"All experiments together took {total / 60.0:.1f} minutes of processor time.\n")
    return "\n".join(parts)


def _summary(chapters: Sequence[Chapter]) -> str:
    rows: list[Row] = []
    for chapter in chapters:
        counted = Counter(one.verdict for one in chapter.statements)
        anchor = chapter.experiment.title.lower()
        anchor = "".join(c for c in anchor if c.isalnum() or c in " -_").replace(" ", "-")
        line: Row = {"claim": f"[{chapter.experiment.title}](#{anchor})"}
        line |= {verdict: counted[verdict] or "" for verdict in JUDGED}
        line |= {"no claim": sum(counted.values()) - sum(counted[v] for v in JUDGED) or ""}
        rows.append(line | {"processor time": f"{chapter.seconds:.0f} s"})
    return table(rows) + "\n"


def _chapter(chapter: Chapter) -> str:
    experiment = chapter.experiment
    rows = [
        {
            "statement": one.says,
            "figure": one.figure,
            "ours, 95 % interval": measured(one),
            "bound": bound(one),
            "verdict": f"**{one.verdict}**" + (f" ({one.note})" if one.note else ""),
        }
        for one in chapter.statements
    ]
    lines = [f"## {experiment.title}", "", f"**The paper.** {experiment.paper}", ""]
    lines += [f"**Experiment** (`{experiment.name}`). {experiment.asked}", "", table(rows), ""]
    for title, more in experiment.tables(chapter.rows).items():
        lines += [f"{title}:", "", table(more), ""]
    if chapter.picture:
        lines += [f"![{experiment.caption}]({chapter.picture})", "", f"*{experiment.caption}*", ""]
    lines += [f"**What follows.** {experiment.follows(chapter.statements)}", ""]
    return "\n".join(lines)


def measured(one: Statement) -> str:
    """The figure with interval and sample size; as many digits as set it apart from its ends."""
    unit = f" {one.unit}" if one.unit else ""
    shown = numbers(one.value, *(x for x in (one.low, one.high) if math.isfinite(x)))
    inside = f" [{', '.join(shown[1:])}]" if shown[1:] else ""
    count = f", {one.count} {one.what}" if one.count else ""
    return f"{shown[0]}{inside}{unit}{count}"


def numbers(*x: float) -> list[str]:
    """Three digits each, and as many more, up to six, as different numbers need to look
    different.
    """
    for digits in range(3, 7):
        shown = [number(one, digits) for one in x]
        if len(set(shown)) == len(set(x)):
            break
    return shown


def bound(one: Statement) -> str:
    """The bound as a person writes it."""
    if math.isnan(one.bound):
        return ""
    return f"{'≥' if one.at_least else '≤'} {one.bound:g}{f' {one.unit}' if one.unit else ''}"


def number(x: float, digits: int = 3) -> str:
    """So many digits, and all of those before the point."""
    if not math.isfinite(x):
        return "none"
    if abs(x) >= 10.0 ** (digits - 1):
        return f"{x:.0f}"
    return f"{x:.{digits}g}"


def table(rows: Sequence[Row]) -> str:
    """Rows as a Markdown table."""
    if not rows:
        return ""
    keys = list(rows[0])
    lines = [f"| {' | '.join(keys)} |", f"|{' --- |' * len(keys)}"]
    lines += [
        f"| {' | '.join(str(row.get(key, '')).replace('|', '/') for key in keys)} |" for row in rows
    ]
    return "\n".join(lines)


def write(page_text: str, file: Path) -> None:
    """Write it as it is."""
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(page_text.rstrip("\n") + "\n", "utf-8")
