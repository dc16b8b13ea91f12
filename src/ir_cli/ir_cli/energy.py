"""`ir energy`: direct against indirect measurement, parameters fitted to a meter, movements that
identify them, and a simulated plant that drives these.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from ir_cli.errors import InputError
from ir_cli.output import (
    Columns,
    Row,
    add_formats,
    add_renamed,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)
from ir_cli.planning import add_cell, planner_of, sentences
from ir_description import PowerParameters, load_cell
from ir_description.files import power_parameters_to_yaml
from ir_description.library import load_power_parameters
from ir_description.robot import DATA_SHEET, centre_deviations
from ir_recorder import analyse, read_recording
from ir_recorder.analysis.indirect import Agreement, MeasuredEnergies, agreement, agreement_of
from ir_recorder.fit import (
    BY,
    DataSource,
    Fit,
    doubts,
    fit_data,
    fit_sources,
    left_out,
    left_out_rows,
    open_prior,
    parameter_rows,
    recommendation,
    source_cell,
    write_fit_picture,
)
from ir_recorder.fit import sentences as fit_sentences
from ir_recorder.measure import PowerModel, movements
from ir_recorder.measure.arm import available, pinocchio_torques
from ir_recorder.report.files import write_output
from ir_recorder.traces import TraceMapping, read_mapping
from ir_recorder.traces.trace import TIME
from ir_values.files import ANYWHERE

COMPARED: Columns = {
    "movement": ("movement", text),
    "seconds": ("s", number(2)),
    "direct": ("meter J", number(0)),
    "indirect": ("from positions J", number(0)),
    "difference": ("difference %", number(1, 100.0)),
    "from_torques": ("from torques J", number(0)),
    "second_opinion": ("by Pinocchio J", number(0)),
}
FITTED: Columns = {
    "parameter": ("parameter", text),
    "before": ("before", number(4)),
    "before_deviation": ("±", number(4)),
    "value": ("fitted", number(4)),
    "deviation": ("±", number(4)),
    "unit": ("", text),
    "determined": ("determined", lambda own: "yes" if own else "no"),
}
LEFT_OUT: Columns = {
    "part": ("left out", text),
    "method": ("predicted by", text),
    "count": ("energies", number(0)),
    "rms": ("W rms", number(2)),
    "median": ("median %", number(2, 100.0)),
    "largest": ("largest %", number(2, 100.0)),
    "covered": ("in 90 %", lambda own: "" if own is None else str(own)),
}
PARAMETERS_START = b"format: ir_description/power_parameters/"


def _add_sources(parser: argparse.ArgumentParser, what: str) -> None:
    """Arguments that say what was recorded, by which robot."""
    parser.add_argument(
        "motion",
        type=Path,
        nargs="+",
        metavar="RECORDING",
        help=what,
    )
    parser.add_argument(
        "--meter",
        type=Path,
        action="append",
        metavar="FILE",
        help="CSV of a power meter beside each of them, in their order",
    )
    parser.add_argument(
        "--mapping", type=Path, metavar="FILE", help="what the columns of the joints mean"
    )
    parser.add_argument(
        "--rate",
        type=float,
        metavar="HZ",
        help="rows per second of logs of the joints without a column of time",
    )
    parser.add_argument(
        "--meter-mapping", type=Path, metavar="FILE", help="what those of the meter mean"
    )
    parser.add_argument("--cell", default="", help="of the robot, where the recording carries none")
    parser.add_argument("--load", default="", help='what is held all the time: "gripper+part"')
    prior = parser.add_argument(
        "--power-parameters", default="", metavar="FILE", help="to begin with (the data sheet)"
    )
    add_renamed(parser, "--prior", prior)


def add_compare(compare: argparse.ArgumentParser) -> None:
    """Arguments of `ir energy compare`."""
    _add_sources(compare, "recordings, or CSV of the joints")
    add_formats(compare)
    compare.set_defaults(run=run_compare)


def add_drive(drive: argparse.ArgumentParser) -> None:
    """Arguments of `ir energy drive`."""
    drive.add_argument("folder", type=Path, metavar="FOLDER", help="what ir energy excite wrote")
    drive.add_argument(
        "--plant", default="typical", help="nominal, typical:SEED or a file (typical)"
    )
    drive.add_argument(
        "-o", "--output", type=Path, metavar="CSV", help="file to write (FOLDER/run.csv)"
    )
    drive.set_defaults(run=run_drive)


def add_fit(fitted: argparse.ArgumentParser) -> None:
    """Arguments of `ir energy fit`."""
    _add_sources(fitted, "recordings, or CSV of the joints; one fit of all")
    fitted.add_argument(
        "--by",
        choices=BY,
        default="",
        help="what is explained: watts, the motors' torques or currents, both (watts if there are)",
    )
    fitted.add_argument(
        "--centres",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="find the links' centres of mass as well (as near to the data as their marks say)",
    )
    fitted.add_argument("--name", default="fit", help="of the parameters (fit)")
    fitted.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("out/power.yaml"),
        help="file to write (out/power.yaml)",
    )
    fitted.add_argument("--picture", type=Path, metavar="PNG", help="picture to write as well")
    add_formats(fitted, comma=False)
    fitted.set_defaults(run=run_fit)


def add_excite(excite: argparse.ArgumentParser) -> None:
    """Arguments of `ir energy excite`."""
    add_cell(excite)
    excite.add_argument(
        "--seconds", type=float, default=180.0, help="s of excursions, at most (180)"
    )
    excite.add_argument(
        "--postures", type=int, default=3, help="to start from, home among them (3)"
    )
    excite.add_argument("--hibernate", action="store_true", help="hibernate too; takes minutes")
    excite.add_argument(
        "--safety-distance", type=float, default=0.02, metavar="M", help="m to keep (0.02)"
    )
    prior = excite.add_argument(
        "--power-parameters", default="", metavar="FILE", help="known already (the data sheet)"
    )
    add_renamed(excite, "--prior", prior)
    excite.add_argument("--seed", type=int, default=0)
    excite.add_argument(
        "-o",
        "--output",
        type=Path,
        default=Path("out/excitation"),
        help="folder to write (out/excitation)",
    )
    add_formats(excite, comma=False)
    excite.set_defaults(run=run_excite)


def run_compare(arguments: argparse.Namespace) -> int:
    """Print both measurements of every movement; exit code 1 where there is nothing to compare."""
    first = arguments.motion[0]
    given = (arguments.meter, arguments.mapping, arguments.cell, arguments.power_parameters)
    if len(arguments.motion) == 1 and first.suffix.lower() == ".mcap" and not any(given):
        analysis = analyse(read_recording(first))
        both = agreement(analysis)
        source = analysis.recording.hardware
        notes: tuple[str, ...] = ()
    else:
        both, notes = _by_traces(arguments)
        source = ", ".join(path.name for path in arguments.motion)[:300]
    rows: list[Row] = [
        {
            "movement": row.label,
            "seconds": row.seconds,
            "direct": row.direct,
            "indirect": row.indirect,
            "difference": row.difference,
            "from_torques": row.from_torques,
            "second_opinion": row.second_opinion,
        }
        for row in both.movements
    ]
    if arguments.json:
        mean = both.difference
        interval = {"mean": mean.value, "low": mean.low, "high": mean.high, "spread": both.spread}
        print_json(
            {"source": source, "movements": rows, "difference": interval, "sentence": both.sentence}
        )
    elif arguments.csv:
        print_csv(rows)
    else:
        sys.stdout.write(f"{source or 'measured on an unknown robot'}\n")
        print_table(rows, COMPARED)
        sys.stdout.write("".join(f"{sentence}\n" for sentence in (*notes, both.sentence)))
    return 0 if rows else 1


def _by_traces(arguments: argparse.Namespace) -> tuple[Agreement, tuple[str, ...]]:
    """Both measurements of every movement in logs with a meter, and notes on how these were
    read.
    """
    sources, prior = _asked(arguments)
    data = fit_data(sources, prior, BY[0])
    model = data.model
    second = PowerModel(
        model.robot,
        model.robot.controller.dc_link,
        source_cell(sources[0]).base_pose,
        prior,
        pinocchio_torques,
    )
    rows: list[MeasuredEnergies] = []
    for name, samples in zip(data.names, data.recordings, strict=True):
        predicted = samples.metered(model.watts(prior.mean, model.prepare(samples)))
        other = np.full(len(samples), np.nan)
        if available():
            other = samples.metered(second.watts(prior.mean, second.prepare(samples)))
        joules = samples.step * np.column_stack([samples.watts, predicted, other])
        rows += [
            MeasuredEnergies(
                f"{name} {number}",
                samples.step * (behind - begin),
                direct=float(joules[begin:behind, 0].sum()),
                indirect=float(joules[begin:behind, 1].sum()),
                from_torques=np.nan,
                second_opinion=float(joules[begin:behind, 2].sum()),
            )
            for number, (begin, behind) in enumerate(movements(samples), start=1)
        ]
    return agreement_of(tuple(rows)), data.notes


def _asked(arguments: argparse.Namespace) -> tuple[list[DataSource], PowerParameters]:
    """What was recorded, and the parameters to begin with."""
    with sentences():
        cell = load_cell(arguments.cell) if arguments.cell else None
    motion = read_mapping(arguments.mapping) if arguments.mapping else None
    if arguments.rate is not None:
        motion = _at_rate(motion or TraceMapping(), arguments.rate)
    meter = arguments.meter_mapping
    meters = arguments.meter or [None] * len(arguments.motion)
    if len(meters) != len(arguments.motion):
        raise InputError(
            f"--meter is there {len(meters)} times, there are {len(arguments.motion)} recordings"
        )
    sources = [
        DataSource(
            path,
            beside,
            motion,
            read_mapping(meter) if meter else None,
            cell,
            arguments.load,
        )
        for path, beside in zip(arguments.motion, meters, strict=True)
    ]
    with sentences():
        robot = source_cell(sources[0]).robot
        return sources, load_power_parameters(arguments.power_parameters, robot)


_RATES = (1e-3, 1e5)  # Hz


def _at_rate(mapping: TraceMapping, rate: float) -> TraceMapping:
    """The mapping of logs with so many rows per second. InputError for what is no rate, or where
    the mapping has a time.
    """
    low, high = _RATES
    if not low <= rate <= high:
        raise InputError(f"--rate is {rate:.12g} Hz, must be {low:g} to {high:g} Hz")
    if TIME in mapping.columns or not np.isnan(mapping.step):
        raise InputError("--rate is for logs without time, the mapping (--mapping) has one")
    return replace(mapping, step=1.0 / rate)


def run_fit(arguments: argparse.Namespace) -> int:
    """Fit, write the file and the picture, print what was found."""
    sources, prior = _asked(arguments)
    if arguments.centres:
        prior = prior.with_centres(centre_deviations(source_cell(sources[0]).robot))
    data, estimate, found = fit_sources(sources, prior, arguments.by, arguments.name)
    unseen = left_out(estimate)
    named = ", ".join(path.name for path in arguments.motion)[:300]
    page = power_parameters_to_yaml(found.parameters, f"fit on {named}")
    arguments.output.parent.mkdir(parents=True, exist_ok=True)
    written = [write_output(arguments.output, page.encode(), PARAMETERS_START, ANYWHERE)]
    if arguments.picture:
        written.append(write_fit_picture(found, estimate.prior, arguments.picture))
    doubted = doubts(estimate, found)
    row_name = begun = prior.name
    if prior.name == DATA_SHEET:
        row_name = "data sheet"
        begun = "the data sheet"
    advised = recommendation(unseen, doubted=bool(doubted.sentences), begun=begun)
    said = (
        *data.notes,
        *fit_sentences(found, begun),
        *doubted.undecided,
        *doubted.sentences,
        advised,
    )
    rows = parameter_rows(found, estimate.prior)
    if arguments.json:
        listed = [asdict(each) for each in found.movements]
        print_json(
            {
                "parameters": rows,
                "movements": listed,
                "gains": _gains(data.model.layout.joints, found),
                "left_out": left_out_rows(unseen, row_name),
                "sentences": said,
                "files": [str(path) for path in written],
            }
        )
        return 0
    print_table(rows, FITTED)
    sys.stdout.write("\n")
    print_table(left_out_rows(unseen, row_name), LEFT_OUT)
    sys.stdout.write("".join(f"{sentence}\n" for sentence in said))
    sys.stdout.write("".join(f"{path}\n" for path in written))
    return 0


def _gains(joints: Sequence[str], found: Fit) -> list[dict[str, object]]:
    """Amperes per Nm of each motor with their deviations; none where none were recorded."""
    if not found.currents:
        return []
    return [
        {"joint": joint, "amperes_per_nm": scale, "deviation": deviation}
        for joint, scale, deviation in zip(
            joints, found.scales, found.scale_deviations, strict=True
        )
    ]


def run_excite(arguments: argparse.Namespace) -> int:
    """Plan the programme, write its folder, print what it identifies and what it does not."""
    if not 1 <= arguments.postures <= 20:
        raise InputError(f"--postures is {arguments.postures}, must be 1 to 20")
    if not 0.0 < arguments.seconds <= 3600.0:
        raise InputError(
            f"--seconds is {arguments.seconds:.12g} s, must be above 0 and at most 3600 s"
        )

    from ir_cli.excitation_programme import (
        ExcitationRequest,
        advice,
        plan_programme,
        write_programme,
    )

    with sentences():
        planner = planner_of(arguments.cell)
        robot = planner.cell.robot
        prior = load_power_parameters(arguments.power_parameters, robot)
        prior = open_prior(prior, robot.time_value)
        asked = ExcitationRequest(
            arguments.seconds,
            arguments.postures,
            arguments.safety_distance,
            arguments.hibernate,
            arguments.seed,
        )
        programme = plan_programme(planner, prior, asked)
    path = write_programme(programme, arguments.output, arguments.cell)
    known = programme.identified
    said = advice(programme.identified.missing)
    moved = sum(step.trajectory is not None for step in programme.steps)
    if arguments.json:
        figures = {"movements": moved, "seconds": programme.seconds, "file": str(path)}
        print_json({**figures, "identified": known.found, "missing": known.missing, "advice": said})
        return 0
    lines = [
        f"{moved} certified movements and {len(programme.steps) - moved} rests, "
        f"{programme.seconds:.0f} s",
        f"identified ({len(known.found)}): {', '.join(known.found)}",
        f"not identified ({len(known.missing)}): {', '.join(known.missing) or 'nothing'}",
        *(f"to add: {sentence}" for sentence in said),
        str(path),
    ]
    sys.stdout.write("\n".join(lines) + "\n")
    return 0


def run_drive(arguments: argparse.Namespace) -> int:
    """Drive a programme as fast as the plant can be stepped, write its readings, print where they
    are.
    """
    from ir_cli.excitation_programme import read_programme
    from ir_cli.traces import write_readings
    from ir_studies.simulated_run import driven

    cell, steps = read_programme(arguments.folder)
    trace = driven(cell, arguments.plant, steps)
    path = arguments.output or arguments.folder / "run.csv"
    write_readings(path, trace)
    joules = trace.columns["energy"][-1]
    sys.stdout.write(
        f"{len(steps)} steps in {trace.time[-1]:.0f} s, {joules / 1e3:.1f} kJ "
        f"({trace.source})\n{path}\n"
    )
    return 0
