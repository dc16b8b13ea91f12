"""Which of the paper's claims hold?

    python benchmarks/paper.py [--only NAME]... [--workers N] [--seeds N] [--first-seed N] [--again]
                               [--write] [--out FOLDER] [--page FILE] [--quick] [--json FILE]

Every claim is an experiment of its own (`_paper_<claim>.py`). What one has found is stored as JSON
and CSV in
--out; the next run goes on with those that are missing, --only measures the named ones anew,
--again all.
Then the page is written from everything that is stored: docs/reproduction.md, or with --quick a
page of its own. Printed are the statements with their intervals, and those with a bound as claims.
"""

from __future__ import annotations

import argparse
import csv
import itertools
import json
import multiprocessing
import resource
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from pathlib import Path
from typing import Any

from _paper_claims import EXPERIMENTS
from _paper_page import Chapter, measured, page, write
from _paper_result import HOLDS, JUDGED, Experiment, Row, Statement, judged
from _results import Claim, add_ending, commit, machine, print_claims, write_json

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


def chapter(experiment: Experiment, found: dict[str, Any], images: Path, folder: Path) -> Chapter:
    """Judge what was stored, and draw it."""
    rows: list[Row] = found["rows"]
    picture = ""
    if experiment.draw is not None:
        file = images / f"paper_{experiment.name}.png"
        experiment.draw(rows, file)
        picture = file.relative_to(folder).as_posix()
    return Chapter(experiment, judged(experiment, rows), rows, picture, found["processor_s"])


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
    for name in EXPERIMENTS:
        if name not in asked:
            print(f"{name}: as it is stored", flush=True)
    run_all(asked, given)
    there = {
        name: found
        for name, one in EXPERIMENTS.items()
        if (found := stored(one, given)) is not None
    }
    folder = given.page.parent
    chapters = [
        chapter(EXPERIMENTS[name], found, folder / "images", folder)
        for name, found in there.items()
    ]
    left = [name for name in EXPERIMENTS if name not in there]
    machines = {found["machine"].split(", load")[0] for found in there.values()}
    text = page(chapters, left, seeds_of(given), ", ".join(sorted(machines)), given.quick)
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
