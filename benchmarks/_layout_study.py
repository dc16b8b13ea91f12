"""Layout studies for studies.py: bounds against an exhaustive grid, the demonstration, programs a
second.
"""

from __future__ import annotations

import math
import os
import tempfile
import time
from collections.abc import Callable, Collection
from dataclasses import replace
from pathlib import Path

from _layout_variants import grid_claims
from _results import Claim, at_least, at_most, line_of

from ir_studies import LayoutSettings, Means, run_layout
from ir_studies.layout import Layouts
from ir_studies.layout.summary import ends

LAYOUT_PARTS = ("grid", "timed_grid", "grids", "demonstration", "speed")
QUICK_STEPS = 5  # more placements than the search plans before it has a bound
EVERYTHING = 1000.0  # a margin that excludes nothing
STATIONS = (
    "infeed_pick",
    "gauge_measure",
    "outfeed_place",
)  # without the pauses of the program, which dwarf the movements
SHARE = 0.2  # of the given placement's cycle when it is free: a cycle time has so much more
SMALL = LayoutSettings(
    cell="demo",
    base={"x": (-0.4, 0.4), "y": (-0.4, 0.4)},
    method="grid",
    steps=7,
    keep=1,
    seeds=3,
    margin=0.0,
)
DEMONSTRATION = LayoutSettings(
    cell="demo",
    base={"x": (-0.5, 0.5), "y": (-0.5, 0.5), "z": (0.0, 0.4), "turn_deg": (-30.0, 30.0)},
    equipment={
        "infeed": {"x": (-0.4, 0.4), "y": (-0.3, 0.5)},
        "gauge": {"x": (-0.6, 0.4), "y": (-0.6, 0.6), "turn_deg": (-45.0, 45.0)},
        "outfeed": {"x": (-0.4, 0.5), "y": (-0.5, 0.4)},
    },
    park={"a1_deg": (-60.0, 60.0), "a2_deg": (-10.0, 60.0)},
    placements=1100,
    rounds=4,
    margin=0.003,
)


def layout_claims(
    cell: str, parts: Collection[str], out: Path | None, *, quick: bool
) -> list[Claim]:
    """Claims of the named parts about layout studies, kept in `out` where it is given; quick:
    without the demonstration's, smaller grids and fewer programs.
    """
    small = replace(SMALL, cell=cell, steps=QUICK_STEPS if quick else SMALL.steps)
    timed = replace(small, stations=STATIONS)
    asked: dict[str, Callable[[Path], list[Claim]]] = {
        "grid": lambda folder: bounded_against_exhaustive(small, "free", folder),
        "timed_grid": lambda folder: bounded_against_exhaustive(
            in_cycle(timed, folder), "cycle time", folder
        ),
        "grids": lambda folder: grid_claims(folder / "grids", quick=quick),
        "demonstration": lambda folder: [] if quick else demonstration(folder),
        "speed": lambda folder: speed(small, folder, 6 if quick else 24),
    }
    with tempfile.TemporaryDirectory() as place:
        return [
            claim
            for name in LAYOUT_PARTS
            if name in parts
            for claim in asked[name](out or Path(place))
        ]


def in_cycle(settings: LayoutSettings, folder: Path) -> LayoutSettings:
    """The same study in a cycle time: what the given placement takes when it is free, and SHARE
    more.
    """
    planned = run_layout(replace(settings, plans=1, seeds=1), folder / "cycle")
    given = planned.finals[0][0].mean("duration_s")
    return replace(settings, cycle_times=(float(math.ceil((1.0 + SHARE) * given)),))


def bounded_against_exhaustive(settings: LayoutSettings, name: str, folder: Path) -> list[Claim]:
    """What bounds lose of the best of a grid, and how many they plan; the spread is that over
    seeds.
    """
    bounded = run_layout(
        settings, folder / name
    )  # rows are the same whoever asks: they are made once
    whole = run_layout(replace(settings, margin=EVERYTHING), folder / name)
    lost = 100.0 * (least(bounded) / least(whole) - 1.0)
    spread = max(one.spread("cost_j") / one.mean("cost_j") for own in whole.finals for one in own)
    plans = [sum(math.isfinite(one.cost) for one in found.known) for found in (bounded, whole)]
    row = {"layout": name, "best_j": least(bounded), "grid_j": least(whole), "lost_percent": lost}
    row |= {"placements": len(whole.known), "plans": plans[0], "grid_plans": plans[1]}
    print(line_of({**row, "spread_percent": 100.0 * spread}), flush=True)
    bound = 1.0 + 100.0 * spread
    return [
        at_most(f"layout, {name}: best above an exhaustive grid's", lost, "%", bound),
        at_most(f"layout, {name}: share planned of the grid", plans[0] / plans[1], "", 0.95),
    ]


def least(found: Layouts) -> float:
    """Cost of the best placement."""
    return min(one.cost for one in found.known if math.isfinite(one.cost))


def demonstration(folder: Path) -> list[Claim]:
    """The layout of the demonstration."""
    begun = time.monotonic()
    found = run_layout(DEMONSTRATION, folder / "demonstration")
    print(found.summary)
    given, best = ends(found.finals)
    assert given is not None  # the bundled cell has its program
    assert best is not None
    saved, within = best[0].saving(given[0])
    print(f"{time.monotonic() - begun:.0f} s; spread over seeds {best[0].spread():.0f} J")
    return [
        at_least("layout of the demonstration: placements", len(found.known), "", 1000.0),
        at_least("layout of the demonstration: joules saved per cycle", saved, "J", 0.0),
        at_least(
            "layout of the demonstration: low end of their 90 % interval", within.low, "J", 0.0
        ),
    ]


def speed(settings: LayoutSettings, folder: Path, programs: int) -> list[Claim]:
    """Programs per second: one process on one core, two and four on two. Wall clock."""
    cores = sorted(os.sched_getaffinity(0))
    asked = replace(settings, margin=EVERYTHING, plans=programs, seeds=1)
    rate = {}
    for workers, used in ((1, cores[:1]), (2, cores[:2]), (4, cores[:2])):
        os.sched_setaffinity(0, used)
        rate[workers] = programs_per_second(asked, folder / f"{workers} workers", workers)
        os.sched_setaffinity(0, cores)
    print(line_of({f"programs_per_s_{workers}_workers": one for workers, one in rate.items()}))
    return [
        at_least("programs per second and core", rate[1], "1/s", 1.0),
        at_least("scaling from one worker on one core to two on two", rate[2] / rate[1], "x", 1.8),
        at_most(
            "overhead of four workers on two cores", 100.0 * (rate[2] / rate[4] - 1.0), "%", 15.0
        ),
    ]


def programs_per_second(settings: LayoutSettings, folder: Path, workers: int) -> float:
    """Of a study's plans in full; the time until workers have started doesn't count."""
    instants: list[float] = []

    def note(phase: str, done: int, of: int, best: str) -> None:
        if "plans" in phase and done:
            instants.append(time.monotonic())

    run_layout(settings, folder, Means(workers, progress=note))
    return (len(instants) - 1) / (instants[-1] - instants[0])
