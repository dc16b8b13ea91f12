"""Studies at the command line: `ir study layout`, `statistics`, `arena` and `cells`."""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, replace
from typing import TypeVar

from ir_cli.errors import InputError
from ir_cli.output import ProgressLine, print_json, table
from ir_studies import Means, read_study, run_arena
from ir_studies.arena import EXAMPLE, ArenaSettings, arena_settings, read_settings
from ir_studies.cells import CellAnswer, hurried, read_instances, solve_cell
from ir_studies.studies import KINDS
from ir_studies.work import MOST_WORKERS

# Options and progress of all studies.

Made = TypeVar("Made")


class TimeLeft:
    """How long the rest of a phase takes when it goes on as since its first job of this run."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._phase = ""
        self._of = 0
        self._first = 0
        self._done = 0
        self._begun = clock()

    def words(self, phase: str, done: int, of: int) -> str:
        """The time left, or nothing where it isn't known yet."""
        now = self._clock()
        if (phase, of) != (self._phase, self._of) or done < self._done:
            self._phase = phase
            self._of = of
            self._first = done
            self._begun = now
        self._done = done
        if done in (self._first, of):
            return ""
        return (
            f", about {_duration_words((now - self._begun) * (of - done) / (done - self._first))} "
            "for the others"
        )


def _duration_words(seconds: float) -> str:
    """A duration as people say it."""
    for unit, name in ((3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * unit:
            return f"{seconds / unit:.0f} {name}"
    return f"{max(seconds, 1.0):.0f} s"


class _Progress:
    """The line that says how far a study is."""

    def __init__(self) -> None:
        self.line = ProgressLine()
        self._left = TimeLeft()
        self._done = 0
        self._of = 0

    def show(self, phase: str, done: int, of: int, best: str) -> None:
        """So many of the jobs of a phase are done; best: the best result so far."""
        self._done = done
        self._of = of
        text = f"{best}; {phase}" if best else phase
        self.line.show(text, done, of, 0.0, self._left.words(phase, done, of))

    @property
    def reached(self) -> str:
        """How many jobs were done, nothing before the first."""
        return f" after {self._done} of {self._of}" if self._of else ""


def add_study(parser: argparse.ArgumentParser, folder: str) -> None:
    """SETTINGS.yaml, -o, --workers, --scheduler and --example."""
    parser.add_argument("settings", nargs="?", metavar="SETTINGS.yaml", help="what is asked")
    parser.add_argument(
        "-o", "--output", default=folder, metavar="FOLDER", help=f"results ({folder})"
    )
    parser.add_argument(
        "--workers",
        type=int,
        default=0,
        metavar="N",
        help=f"processes, 1 to {MOST_WORKERS} (as many as cores)",
    )
    parser.add_argument(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="of a Dask cluster that makes the jobs instead, as tcp://127.0.0.1:8786",
    )
    parser.add_argument(
        "--example", action="store_true", help="print a settings file with all keys, and end"
    )


def settings_of(arguments: argparse.Namespace, command: str) -> str:
    """The settings file. InputError where none is named."""
    if arguments.settings is None:
        raise InputError(f"SETTINGS.yaml is missing: {command} --example prints one")
    return str(arguments.settings)


def studied(arguments: argparse.Namespace, make: Callable[[Means], Made]) -> Made:
    """What `make` returns, with a line that says how far it is."""
    if not 0 <= arguments.workers <= MOST_WORKERS:
        raise InputError(f"--workers is {arguments.workers}: it must be in 1 .. {MOST_WORKERS}")
    progress = _Progress()
    try:
        with progress.line:
            return make(Means(arguments.workers, arguments.scheduler, progress.show))
    except KeyboardInterrupt:
        with suppress(BrokenPipeError):
            sys.stderr.write(f"stopped{progress.reached}: the same command goes on from there\n")
        raise


# One command per kind.


def add_layout(layout: argparse.ArgumentParser) -> None:
    """Arguments of `ir study layout`."""
    _add_kind(layout, "layout")


def add_statistics(statistics: argparse.ArgumentParser) -> None:
    """Arguments of `ir study statistics`."""
    _add_kind(statistics, "statistics")


def _add_kind(parser: argparse.ArgumentParser, kind: str) -> None:
    add_study(parser, f"out/{kind}")
    parser.add_argument(
        "--json", action="store_true", help="print summary, files and table as JSON"
    )
    parser.set_defaults(run=run_study, kind=kind)


def run_study(arguments: argparse.Namespace) -> int:
    """Run, and print what follows and which files were written."""
    kind = str(arguments.kind)
    if arguments.example:
        sys.stdout.write(KINDS[kind].example)
        return 0
    study = read_study(settings_of(arguments, f"ir study {kind}"))
    if study.kind != kind:
        raise InputError(f"these are settings of {study.kind}, not of {kind}")
    answer = studied(arguments, lambda means: study.run(arguments.output, means))
    if arguments.json:
        files = [str(path) for path in answer.files]
        print_json({"summary": answer.summary, "files": files, "table": answer.table})
        return 0
    sys.stdout.write(f"{answer.summary}\n")
    sys.stdout.writelines(f"{path}\n" for path in answer.files)
    return 0


_FOLDER = "out/arena"
_QUICK_FOLDER = "out/arena_quick"
_QUICK_S = 0.2  # of processor per run: 550 runs of the example take two minutes on two cores


def add_arena(arena: argparse.ArgumentParser) -> None:
    """Arguments of `ir study arena`."""
    add_study(arena, _FOLDER)
    arena.add_argument(
        "--quick",
        action="store_true",
        help=f"one seed and {_QUICK_S:g} s per run, in {_QUICK_FOLDER}; without SETTINGS.yaml "
        "those of --example",
    )
    arena.add_argument("--parquet", action="store_true", help="also table.parquet; needs pyarrow")
    arena.set_defaults(run=run_arena_command)


def run_arena_command(arguments: argparse.Namespace) -> int:
    """Run, and print which files were written."""
    if arguments.example:
        sys.stdout.write(EXAMPLE)
        return 0
    settings, folder = asked(arguments)
    finished = studied(
        arguments, lambda means: run_arena(settings, folder, means, parquet=arguments.parquet)
    )
    sys.stdout.write(f"{finished.summary}\n")
    sys.stdout.writelines(f"{path}\n" for path in finished.files)
    return 0


def asked(arguments: argparse.Namespace) -> tuple[ArenaSettings, str]:
    """The settings, and the folder of the results."""
    if not arguments.quick:
        return read_settings(settings_of(arguments, "ir study arena")), str(arguments.output)
    named = arguments.settings is not None
    settings = read_settings(arguments.settings) if named else arena_settings(EXAMPLE, str)
    folder = _QUICK_FOLDER if arguments.output == _FOLDER else str(arguments.output)
    return replace(settings, seeds=1, seconds=_QUICK_S), folder


# Robotic cells of the public benchmark.

_CELL_S = 120.0  # of processor time per instance
_HURRIED_S = 20.0  # the same for what it is compared with
_HURRIED_GAP = 1e-3


def add_cells(cells: argparse.ArgumentParser) -> None:
    """Arguments of `ir study cells`."""
    cells.add_argument("file", metavar="FILE.xml", help="instances of the public benchmark")
    cells.add_argument(
        "--seconds",
        type=float,
        default=_CELL_S,
        metavar="S",
        help=f"of processor time per instance, at most ({_CELL_S:g})",
    )
    cells.add_argument("--json", action="store_true", help="print the schedules as JSON")
    cells.set_defaults(run=run_cells)


def run_cells(arguments: argparse.Namespace) -> int:
    """Solve every instance; exit code 1 where one has no schedule."""
    if not arguments.seconds > 0.0:
        raise InputError(f"--seconds is {arguments.seconds:g}, must be positive")
    answers = []
    compared = []
    instances = read_instances(arguments.file)
    with ProgressLine() as line:
        for k, instance in enumerate(instances):
            line.show(instance.name, k, len(instances), 0.0)
            answers.append(solve_cell(instance, arguments.seconds))
            compared.append(solve_cell(hurried(instance), _HURRIED_S, _HURRIED_GAP))
    if arguments.json:
        print_json(
            {"instances": [_cell_values(*each) for each in zip(answers, compared, strict=True)]}
        )
    else:
        rows = [_cell_row(*each) for each in zip(answers, compared, strict=True)]
        header = ("instance", "robots", "cycle s", "energy J", "gap %", "saving %", "processor s")
        sys.stdout.write(f"{table(header, rows)}\n")
    return int(any(answer.schedule is None for answer in answers))


def _saving(answer: CellAnswer, fastest: CellAnswer) -> float:
    """How much less [%] than all movements fastest and motors on in every wait; nan: unknown."""
    if answer.schedule is None or fastest.schedule is None:
        return math.nan
    return 100.0 * (1.0 - answer.energy / fastest.energy)


def _cell_row(answer: CellAnswer, fastest: CellAnswer) -> tuple[str, ...]:
    instance = answer.instance
    begin = (instance.name, str(len(instance.robots)), f"{instance.cycle:.2f}")
    if answer.schedule is None:
        why = "impossible" if answer.is_impossible else "none found"
        return (*begin, why, "-", "-", f"{answer.seconds:.1f}")
    saving = _saving(answer, fastest)
    shown = "-" if math.isnan(saving) else f"{saving:.1f}"
    seconds = f"{answer.seconds:.1f}"
    return (*begin, f"{answer.energy:.3f}", f"{100.0 * answer.gap:.3f}", shown, seconds)


def _cell_values(answer: CellAnswer, fastest: CellAnswer) -> dict[str, object]:
    robots = answer.schedule.robots if answer.schedule else ()
    return {
        "name": answer.instance.name,
        "cycle_s": answer.instance.cycle,
        "energy_j": answer.energy,
        "bound_j": answer.bound,
        "gap_percent": 100.0 * answer.gap,
        "fastest_j": fastest.energy,
        "saving_percent": _saving(answer, fastest),
        "processor_s": answer.seconds,
        "robots": [[asdict(done) for done in robot] for robot in robots],
    }
