"""`ir ask evaluate` and `ir ask optimize`: a trace held against the limits, and made cheaper."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ir_cli.output import ProgressLine, add_formats, add_renamed, print_json
from ir_cli.planning import (
    FAILED,
    add_cell,
    add_margin,
    add_options,
    add_parameters,
    add_tilt,
    failed,
    figures_of,
    options_of,
    planner_of,
    sentence_of,
    sentences,
    tilt_of,
)
from ir_cli.trace_programs import stretches_of
from ir_cli.traces import add_measured, measured_figures, motion_of, write_trace


def add_evaluate(evaluate: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask evaluate`."""
    add_cell(evaluate)
    evaluate.add_argument(
        "trace",
        type=Path,
        metavar="TRACE",
        help="CSV with time and joints, Parquet, or a recording",
    )
    add_measured(evaluate)
    evaluate.add_argument("--station", default="", help="whose allowed contacts hold in its zone")
    add_margin(evaluate)
    add_tilt(evaluate)
    add_parameters(evaluate)
    add_formats(evaluate, comma=False)
    evaluate.set_defaults(run=run_evaluate)


def run_evaluate(arguments: argparse.Namespace) -> int:
    """Evaluate and print; exit code 1 where a limit or the clearance is violated."""
    with sentences(), ProgressLine() as line:
        planner = planner_of(arguments.cell, arguments.power_parameters)
        margin = arguments.safety_distance
        load = arguments.load
        station = arguments.station
        known, trajectory = motion_of(arguments, planner, line.show)
        line.show("evaluate", 0, 1, 0.0)
        tilt = tilt_of(arguments)
        found = planner.evaluate(
            trajectory, safety_distance=margin, load=load, station=station, **tilt
        )
    verification = found.verification
    if arguments.json:
        violations = [v for v in (verification.violation, *verification.others) if v is not None]
        listed = [{"what": v.what, "seconds": v.time, "sentence": v.sentence} for v in violations]
        print_json({**figures_of(found.report), **measured_figures(known), "violations": listed})
    else:
        sys.stdout.write(sentence_of(found.report, planner) + "\n")
        if known is not None:
            sys.stdout.write("\n".join(known.sentences) + "\n")
        if verification.violation is not None:
            sys.stdout.write(f"violated: {verification.status.message}\n")
    return 0 if verification.certified else FAILED


def add_optimize(optimize: argparse.ArgumentParser) -> None:
    """Arguments of `ir ask optimize`."""
    add_cell(optimize)
    optimize.add_argument(
        "trace",
        type=Path,
        metavar="TRACE",
        help="CSV with time and joints, Parquet, or a recording",
    )
    optimize.add_argument(
        "--duration", type=float, default=0.0, metavar="S", help="s it takes; 0: the best (0)"
    )
    output = optimize.add_argument(
        "-o", "--output", type=Path, metavar="FILE", help="write its points as CSV"
    )
    add_renamed(optimize, "--trajectory", output)
    add_measured(optimize)
    add_options(optimize)
    add_parameters(optimize)
    add_formats(optimize, comma=False)
    optimize.set_defaults(run=run_optimize)


def run_optimize(arguments: argparse.Namespace) -> int:
    """Optimise and print; exit code 1 where nothing is found."""
    with sentences(), ProgressLine() as line:
        planner = planner_of(arguments.cell, arguments.power_parameters)
        known, motion = motion_of(arguments, planner, line.show)
        moving = [one.trajectory for one in stretches_of(motion)[0] if one.trajectory is not None]
        if known is not None and len(moving) == 1:
            motion = moving[0]  # standstills around a measured movement are no part of it
        line.show("optimise", 0, 1, 0.0)
        found = planner.optimize_trajectory(
            motion, options=options_of(arguments, arguments.duration)
        )
    if known is not None and len(moving) > 1:
        sys.stderr.write(
            f"ir: {len(moving)} movements with stops between them are made one: ir compare keeps "
            "the stops\n"
        )
    if found.trajectory is None:
        return failed(found.status.message)
    if arguments.output:
        write_trace(arguments.output, found.trajectory)
    if arguments.json:
        before = {**figures_of(found.before), **measured_figures(known)}
        print_json({"before": before, "after": figures_of(found.after)})
        return 0
    said = [f"before: {sentence_of(found.before, planner)}"]
    said += known.sentences if known is not None else ()
    sys.stdout.write("\n".join([*said, f"after: {sentence_of(found.after, planner)}"]) + "\n")
    return 0
