"""Which of the paper's claims hold?

    python benchmarks/paper.py [--only NAME]... [--workers N] [--seeds N] [--first-seed N] [--again]
                               [--write] [--out FOLDER] [--page FILE] [--quick] [--json FILE]

Every claim is an experiment of its own (`_paper_<claim>.py`). What one has found is stored as JSON
and CSV in
--out; the next run goes on with those that are missing, --only measures the named ones anew,
--again all.
Then the page is written from everything that is stored: docs/reproduction.md, or with --quick a
page of its own. A chapter that is not stored stays as the page has it, where it is of the same
seeds. Printed are the statements with their intervals, and those with a bound as claims.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import json
import math
import multiprocessing
import re
import resource
import time
from collections import Counter
from collections.abc import Container, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import _paper_blocked
import _paper_ccd
import _paper_cell
import _paper_cost
import _paper_drives
import _paper_genetic
import _paper_line
import _paper_modes
import _paper_prm
import _paper_ranks
import _paper_rivals
import _paper_savings
import _paper_spline
import _paper_unmodified
import _paper_withdrawal
from _paper_result import HOLDS, JUDGED, Experiment, Row, Statement, judged
from _results import Claim, add_ending, commit, machine, print_claims, write_json

# docs/reproduction.md, written from what the experiments on the claims of the paper have
# stored.

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
times{machine} where a chapter names no other machine.

How large the samples are follows from pilots with seeds 0 to 5, whose draws are not used here (the bundled
cells themselves, which the drawn ones vary, are the same for every seed): where an interval was too wide to
decide, the sample grew with the square of its width over its distance to the bound, on whichever side of it
the figure was, as far as about an hour of processor time for all claims allows. What is drawn independently are
cells and movements, not the searches in them. Every interval is one of 95 % by itself, and there are many:
that is why each seed must say the same alone, so that chance has to deceive twice for a wrong verdict. An
interval says what another draw would change, not what another machine would, or what else runs on it: the
ratio of two times of milliseconds can move further than that.
"""  # noqa: E501


@dataclass(frozen=True, eq=False)
class Chapter:
    """An experiment with what it found; picture: relative to the page, "" for none; seconds: of
    processor; machine: where it was measured, "" where the page's head says it.
    """

    experiment: Experiment
    statements: list[Statement]
    rows: list[Row]
    picture: str
    seconds: float
    machine: str = ""


@dataclass(frozen=True)
class Kept:
    """A chapter as a page has it: its line of the summary, its text, seconds of processor."""

    summary: str
    text: str
    seconds: float


def kept_chapters(file: Path, seeds: Sequence[int]) -> dict[str, Kept]:
    """The chapters of a page by their titles; none where it is not of these seeds."""
    text = file.read_text("utf-8") if file.exists() else ""
    if f"with {_named(seeds)} that" not in text:
        return {}
    summaries = {
        found[1]: found[0] for found in re.finditer(r"^\| \[(.*?)\]\(#.*\|$", text, re.MULTILINE)
    }
    found = {}
    for part in re.split(r"^## ", text, flags=re.MULTILINE)[1:]:
        title = part.partition("\n")[0]
        body = re.sub(r"\nAll experiments together took .*", "", part).rstrip("\n")
        line = summaries.get(title, "")
        seconds = re.search(r"\| (\d+) s \|$", line)
        if seconds is not None:
            found[title] = Kept(line, f"## {body}\n", float(seconds[1]))
    return found


def kept_machine(file: Path) -> str:
    """Where the chapters of a page that name no machine were measured; "" where it doesn't say."""
    text = file.read_text("utf-8") if file.exists() else ""
    found = re.search(r"^times on (.*) where a chapter", text, re.MULTILINE)
    return found[1] if found else ""


def _named(seeds: Sequence[int]) -> str:
    return f"{'seeds' if len(seeds) > 1 else 'seed'} {' and '.join(map(str, seeds))}"


def page(
    chapters: Sequence[Chapter | Kept],
    missing: Sequence[str],
    seeds: Sequence[int],
    machine: str,
    quick: bool,
) -> str:
    """The whole page."""
    named = _named(seeds)
    parts = [HEAD.format(seeds=named, machine=f" on {machine}" if machine else "")]
    if quick:
        parts.append("**Short version**: small samples; nothing here is to be quoted.\n")
    parts.append(_summary(chapters))
    if missing:
        parts.append(f"Not run: {', '.join(f'`{name}`' for name in missing)}.\n")
    parts += [one.text if isinstance(one, Kept) else _chapter(one) for one in chapters]
    total = sum(chapter.seconds for chapter in chapters)
    parts.append(f"All experiments together took {total / 60.0:.1f} minutes of processor time.\n")
    return "\n".join(parts)


def _summary(chapters: Sequence[Chapter | Kept]) -> str:
    """A line for each chapter, those that are kept as they were."""
    rows: list[Row] = []
    for chapter in chapters:
        if isinstance(chapter, Kept):
            cells = [cell.strip() for cell in chapter.summary.strip("|").split("|")]
            rows.append(
                dict(zip(("claim", *JUDGED, "no claim", "processor time"), cells, strict=True))
            )
            continue
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
    asked = experiment.asked
    if chapter.machine:
        asked += f" Processor times are those of {chapter.machine}."
    lines = [f"## {experiment.title}", "", f"**The paper.** {experiment.paper}", ""]
    lines += [f"**Experiment** (`{experiment.name}`). {asked}", "", table(rows), ""]
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


# All experiments on claims of the paper, in the order of the page.

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        *_paper_rivals.EXPERIMENTS,
        _paper_prm.EXPERIMENT,
        _paper_ranks.EXPERIMENT,
        _paper_ccd.EXPERIMENT,
        _paper_blocked.EXPERIMENT,
        _paper_withdrawal.EXPERIMENT,
        _paper_genetic.EXPERIMENT,
        *_paper_unmodified.EXPERIMENTS,
        _paper_cost.EXPERIMENT,
        _paper_spline.EXPERIMENT,
        _paper_savings.EXPERIMENT,
        *_paper_drives.EXPERIMENTS,
        _paper_line.EXPERIMENT,
        _paper_modes.EXPERIMENT,
        _paper_cell.PICTURES,
        _paper_cell.EXPERIMENT,
    )
}

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "reproduction.md"
# seeds 0 to 5 are those of the pilots that the sizes of the samples come from
SEEDS = 2
FIRST = 6


def arguments() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    names = ", ".join(EXPERIMENTS)
    parser.add_argument(
        "--only", action="append", choices=list(EXPERIMENTS), metavar="NAME", help=names
    )
    parser.add_argument(
        "--workers", type=int, default=1, help="claims that are measured side by side"
    )
    parser.add_argument(
        "--seeds", type=int, default=SEEDS, help=f"independent repetitions; default: {SEEDS}"
    )
    parser.add_argument(
        "--first-seed", type=int, default=FIRST, help=f"the first of them; default: {FIRST}"
    )
    parser.add_argument("--again", action="store_true", help="measure also what is stored")
    parser.add_argument(
        "--write", action="store_true", help="measure nothing: the page from what is stored"
    )
    parser.add_argument(
        "--out", type=Path, default=ROOT / "out" / "paper", help="where rows are stored"
    )
    parser.add_argument(
        "--page", type=Path, help="default: docs/reproduction.md; --quick: in --out"
    )
    add_ending(parser, "small samples, one seed, a page of its own")
    given = parser.parse_args()
    if given.quick:
        given.seeds = 1
        given.out = given.out / "quick"
    given.page = given.page or (given.out / "reproduction.md" if given.quick else PAGE)
    return given


def seeds_of(given: argparse.Namespace) -> list[int]:
    """Of the independent repetitions."""
    return list(range(given.first_seed, given.first_seed + given.seeds))


def processor_seconds() -> float:
    """Of this process and of those that it has waited for."""
    mine, others = (
        resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)
    )
    return mine.ru_utime + mine.ru_stime + others.ru_utime + others.ru_stime


def run_all(names: Sequence[str], given: argparse.Namespace) -> None:
    """Measure claims, each in a process of its own where several are measured side by side."""
    if given.workers < 2:
        for name in names:
            run(name, given)
        return
    spawned = multiprocessing.get_context(
        "spawn"
    )  # a claim's processor time has no part of another's
    with ProcessPoolExecutor(given.workers, spawned, max_tasks_per_child=1) as pool:
        for _ in pool.map(run, names, itertools.repeat(given)):
            pass


def run(name: str, given: argparse.Namespace) -> None:
    """Measure a claim and store its rows."""
    experiment = EXPERIMENTS[name]
    print(f"{name}: measured", flush=True)
    begin = processor_seconds()
    wall = time.perf_counter()
    rows = [
        {"seed": seed, **row}
        for seed in seeds_of(given)[: None if experiment.seeded else 1]
        for row in experiment.measure(seed, given.quick)
    ]
    stored = {
        "name": experiment.name,
        "seeds": seeds_of(given),
        "commit": commit(),
        "machine": machine(),
    }
    stored |= {
        "processor_s": processor_seconds() - begin,
        "wall_s": time.perf_counter() - wall,
        "rows": rows,
    }
    given.out.mkdir(parents=True, exist_ok=True)
    part = given.out / f"{experiment.name}.part"
    part.write_text(json.dumps(stored, indent=1))
    part.replace(given.out / f"{experiment.name}.json")
    with (given.out / f"{experiment.name}.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, list(dict.fromkeys(key for row in rows for key in row)))
        writer.writeheader()
        writer.writerows(rows)


def stored(experiment: Experiment, given: argparse.Namespace) -> dict[str, Any] | None:
    """What was stored with the same seeds, None where nothing was."""
    file = given.out / f"{experiment.name}.json"
    found: dict[str, Any] | None = json.loads(file.read_text()) if file.exists() else None
    return found if found is not None and found["seeds"] == seeds_of(given) else None


def is_asked(name: str, given: argparse.Namespace) -> bool:
    """Whether a claim is measured: the named ones are, else those that are missing."""
    if given.only:
        return name in given.only
    return given.again or stored(EXPERIMENTS[name], given) is None


def origin(experiment: Experiment, given: argparse.Namespace, kept: Container[str]) -> str:
    """Where the chapter of a claim that is not measured comes from."""
    if stored(experiment, given) is not None:
        return "as it is stored"
    return "as the page has it" if experiment.title in kept else "not run"


def chapter(
    experiment: Experiment, found: dict[str, Any], images: Path, folder: Path, others: str
) -> Chapter:
    """Judge what was stored, and draw it; others: the machine that the page's head names."""
    rows: list[Row] = found["rows"]
    picture = ""
    if experiment.draw is not None:
        file = images / f"paper_{experiment.name}.png"
        experiment.draw(rows, file)
        picture = file.relative_to(folder).as_posix()
    own = machine_of(found)
    where = "" if own == others else own
    return Chapter(experiment, judged(experiment, rows), rows, picture, found["processor_s"], where)


def machine_of(found: dict[str, Any]) -> str:
    """Where it was measured, without the load of that moment."""
    return str(found["machine"].split(", load")[0])


def claims_of(statements: Sequence[Statement]) -> list[Claim]:
    """Statements with a bound."""
    return [
        Claim(f"{one.says} ({one.verdict})", one.value, one.unit, one.bound, one.verdict == HOLDS)
        for one in statements
        if one.verdict in JUDGED
    ]


def main() -> None:
    """Measure what is missing, write the page, print the claims."""
    given = arguments()
    asked = [] if given.write else [name for name in EXPERIMENTS if is_asked(name, given)]
    kept = kept_chapters(given.page, seeds_of(given))
    for name, one in EXPERIMENTS.items():
        if name not in asked:
            print(f"{name}: {origin(one, given, kept)}", flush=True)
    run_all(asked, given)
    folder = given.page.parent
    there = {name: stored(one, given) for name, one in EXPERIMENTS.items()}
    usual = kept_machine(given.page) if kept else ""
    usual = usual or ", ".join(sorted({machine_of(one) for one in there.values() if one}))
    shown: list[Chapter | Kept] = []
    left = []
    for name, one in EXPERIMENTS.items():
        found = there[name]
        if found is not None:
            shown.append(chapter(one, found, folder / "images", folder, usual))
        elif one.title in kept:
            shown.append(kept[one.title])
        else:
            left.append(name)
    chapters = [one for one in shown if isinstance(one, Chapter)]
    text = page(shown, left, seeds_of(given), usual, given.quick)
    write(text, given.page)
    claims = []
    rows = []
    for one in chapters:
        claims += claims_of(one.statements)
        rows += [asdict(statement) | {"claim": one.experiment.name} for statement in one.statements]
        print(f"\n{one.experiment.title}, {one.seconds:.0f} s of processor time")
        for statement in one.statements:
            print(f"  {statement.verdict:18s} {statement.says}: {measured(statement)}")
    print_claims(claims)
    write_json(given.json, rows, claims)
    print(f"\n{given.page}")


if __name__ == "__main__":
    main()
