"""`ir krl`: what a KUKA program costs in a cell, and planned programs as KRL."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from ir_cli.errors import InputError
from ir_cli.output import (
    Columns,
    ProgressLine,
    Row,
    add_formats,
    number,
    print_csv,
    print_json,
    print_table,
    text,
)
from ir_cli.planning import (
    FAILED,
    add_blend,
    add_cell,
    add_margin,
    add_options,
    add_parameters,
    add_start,
    failed,
    options_of,
    planned_program,
    planner_of,
    sentences,
)
from ir_krl import Followed, parse, read_project
from ir_krl.language import SourceFile
from ir_krl.project import ARCHIVES, BYTES_MAX, text_of
from ir_krl.run import Note, worst_first
from ir_krl.settings import settings_of, stubs
from ir_krl.write import (
    PLC_PAUSE,
    STYLES,
    URSCRIPT,
    FrameNumbers,
    PlcPause,
    frame_numbers,
    plc_input,
    read_plc_table,
)
from ir_planner import Planner
from ir_planner.krl import (
    EvaluatedProgram,
    EvaluatedStep,
    Switched,
    evaluate_krl,
    export_krl,
    follow_krl,
    follow_ur,
)
from ir_values.errors import FileRefusedError
from ir_values.files import ANYWHERE
from ir_values.output_files import write_file

UR = ".script"
"""Ending of a UR's programs."""
COLUMNS: Columns = {
    "lines": ("line", text),
    "from": ("from", text),
    "to": ("to", text),
    "seconds": ("s", number(2)),
    "joules": ("J", number(0)),
    "joules_low": ("from", number(0)),
    "joules_high": ("to", number(0)),
    "clearance": ("clearance mm", number(1, 1e3)),
    "note": ("", text),
}


def add_import(read: argparse.ArgumentParser) -> None:
    """Arguments of `ir krl import`."""
    read.add_argument(
        "files",
        nargs="+",
        type=Path,
        metavar="FILE",
        help=".src first, then .dat and subprograms; or a folder or .zip of programs",
    )
    read.add_argument("--cell", default="demo", help="name of a bundled cell, or a file (demo)")
    add_followed(read)
    read.add_argument(
        "--compare", action="store_true", help="plan the same stations and show the difference"
    )
    add_margin(read)
    add_parameters(read)
    add_formats(read)
    read.set_defaults(run=run_import)


def add_followed(parser: argparse.ArgumentParser) -> None:
    """What decides how a KRL program is followed."""
    parser.add_argument(
        "--routine", default="", metavar="NAME", help="of KRL: the first of the first file"
    )
    parser.add_argument(
        "--input",
        action="append",
        default=[],
        metavar="N=VALUE",
        help="of KRL: what $IN[N] reads: 3=true; repeatable",
    )
    parser.add_argument(
        "--plc",
        type=Path,
        metavar="FILE.csv",
        help="of KRL: table of the pauses that the PLC spends in power modes",
    )
    parser.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="NAME=VALUE",
        help="of KRL: what a variable holds, '$MODE_OP=#EX'; or a file of such lines; repeatable",
    )
    parser.add_argument(
        "--stub",
        type=Path,
        metavar="FILE.src",
        help="of KRL: write routines that the program calls and nobody gave, to fill in",
    )
    passes = "of KRL: of a loop that nothing known ends (1)"
    parser.add_argument("--loop-passes", type=int, default=1, metavar="N", help=passes)


def followed(files: Sequence[Path], planner: Planner, arguments: argparse.Namespace) -> Followed:
    """The commands of the program in these files, as the options of `add_followed` say."""
    if arguments.loop_passes < 1:
        raise InputError(f"--loop-passes {arguments.loop_passes}: a loop is followed once at least")
    if files[0].suffix.lower() == UR:
        if len(files) > 1:
            raise InputError(f"{files[1]}: a script of a UR is one file")
        return follow_ur(planner, _text(files[0]), files[0].name)
    sources, left_out = _sources(files, arguments.routine)
    inputs = {**plc_input(sources, there=arguments.plc is not None), **_inputs(arguments.input)}
    found = follow_krl(
        planner,
        sources,
        routine=arguments.routine,
        inputs=inputs,
        loop_passes=arguments.loop_passes,
        settings=[_setting(one) for one in arguments.set],
    )
    if arguments.stub is not None:
        write_file(arguments.stub, stubs(found.unknown), new=True)
    if found.unknown:
        found = replace(found, notes=worst_first([*found.notes, *left_out]))
    return found


def _sources(files: Sequence[Path], routine: str) -> tuple[Sequence[SourceFile], Sequence[Note]]:
    """What the files hold: a project, or modules, each .src with the .dat that lies beside it."""
    if len(files) == 1 and is_project(files[0]):
        project = read_project(files[0])
        return project.sources(project.main(routine))
    beside = [data_beside(path) for path in files if path.suffix.lower() == ".src"]
    extra = [path for path in beside if path is not None and path not in files]
    return [parse(_text(path), path.name) for path in (*files, *extra)], ()


def is_project(path: Path) -> bool:
    """Whether a path is a folder or an archive of programs."""
    return path.is_dir() or path.suffix.lower() in ARCHIVES


def data_beside(source: Path) -> Path | None:
    """The .dat of the module whose .src this is; None without one."""
    if not source.parent.is_dir():
        return None
    stem = source.stem.upper()  # as on the controller, whose names have no case
    found = (one for one in source.parent.iterdir() if one.stem.upper() == stem)
    return next((one for one in found if one.suffix.lower() == ".dat" and one.is_file()), None)


def _setting(text: str) -> SourceFile:
    if "=" in text:
        return settings_of([text])
    return settings_of(_text(Path(text)).splitlines(), text)


def plc_pauses(program: Followed, arguments: argparse.Namespace) -> dict[int, PlcPause]:
    """The table that `--plc` names. Raises InputError for one that the program doesn't ask for."""
    if arguments.plc is None:
        return {}
    if PLC_PAUSE not in program.signals:
        raise InputError(
            f"--plc {arguments.plc}: {program.name} asks for no pause, it declares no {PLC_PAUSE}"
        )
    return read_plc_table(_text(arguments.plc), arguments.plc.name)


def add_export(write: argparse.ArgumentParser) -> None:
    """Arguments of `ir krl export`."""
    add_cell(write)
    write.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="FILE.src",
        help="the .dat is beside it",
    )
    write.add_argument(
        "--stations", nargs="+", default=[], metavar="NAME", help="visit these instead"
    )
    write.add_argument(
        "--cycle-time", type=float, default=0.0, metavar="S", help="for the cycle; 0: free (0)"
    )
    add_blend(write)
    write.add_argument(
        "--style",
        choices=STYLES,
        default="spline",
        help="spline keeps the plan; kss8, krc2: inline forms to touch up (spline)",
    )
    write.add_argument(
        "--tool",
        action="append",
        default=[],
        metavar="N[=PART]",
        help="of inline forms: number of TOOL_DATA of the tool, or of it with a part; repeatable",
    )
    write.add_argument(
        "--base",
        action="append",
        default=[],
        metavar="N=MACHINE",
        help="of inline forms: number of BASE_DATA of a machine; repeatable",
    )
    write.add_argument(
        "--numbers-from",
        type=Path,
        metavar="FILE.dat",
        help="the plant's $config.dat: take its own numbers of the same tools and bases, or free "
        "ones",
    )
    add_start(write)
    add_options(write)
    add_parameters(write)
    write.set_defaults(run=run_export)


def run_import(arguments: argparse.Namespace) -> int:
    """Print what the program costs; exit code 1 where it violates a limit or the clearance."""
    with sentences():
        planner = planner_of(arguments.cell, arguments.power_parameters)
        program = followed(arguments.files, planner, arguments)
        pauses = plc_pauses(program, arguments)
        found = evaluate_krl(
            planner, program, arguments.safety_distance, arguments.load, plc=pauses
        )
    rows = rows_of(found)
    compared = _compared(planner, found) if arguments.compare else {}
    if arguments.json:
        print_json(
            {
                **totals_of(found),
                **compared,
                "steps": rows,
                "notes": [str(note) for note in found.notes],
            }
        )
    elif arguments.csv:
        print_csv(rows)
    else:
        print_table(rows, COLUMNS)
        sys.stdout.write("\n".join([*_sentences(found), *_comparison(compared)]) + "\n")
    return 0 if found.certified else FAILED


def run_export(arguments: argparse.Namespace) -> int:
    """Plan, write both files, say what it costs as the controller would drive it."""
    source = arguments.output
    if source.suffix.lower() not in (".src", UR):
        raise InputError(f"{source.name} must end in .src, or in {UR} for a UR")
    style = URSCRIPT if source.suffix.lower() == UR else arguments.style
    data = source.with_suffix(".dat")
    table = source.with_suffix(".plc.csv")
    text = source.with_suffix(".plc.st")
    for path in (source, data, table, text):
        if path.exists():
            raise InputError(f"{path} is there already")
    with sentences(), ProgressLine() as line:
        asked = _frame_numbers(arguments)
        planner = planner_of(arguments.cell, arguments.power_parameters)
        options = options_of(arguments)
        plan = planned_program(arguments, planner, options, line.show)
        if not plan.status.ok:
            return failed(plan.status.message)
        written = export_krl(planner, plan.movements, source.stem, options, style, asked)
    if written.data:
        write_file(data, written.data, new=True)
    if written.plc_table:
        write_file(table, written.plc_table, new=True)
        write_file(text, written.plc_text, new=True)
    write_file(source, written.source, new=True)
    planned = written.planned
    driven = written.exported
    sys.stdout.write(
        f"{source}{f' and {data.name}' if written.data else ''}: {driven.duration:.2f} s, "
        f"{driven.energy:.0f} J moving, at least "
        f"{1e3 * driven.min_clearance:.1f} mm clear as the controller drives it, certified\n"
        f"planned: {planned.duration:.2f} s, {planned.energy:.0f} J; "
        f"joints at most {written.deviation:.2g} rad apart\n"
        f"with its pauses: {written.seconds:.2f} s, {written.joules:.0f} J\n"
    )
    for said in filter(None, (plan.status.message, written.remark)):
        sys.stdout.write(f"note: {said}\n")
    if written.plc_table:
        sys.stdout.write(
            f"{table.name} and {text.name}: the PLC's part, it spends pauses in power modes in "
            f"EXT; read back with --plc {table}\n"
        )
    return 0


def _frame_numbers(arguments: argparse.Namespace) -> FrameNumbers:
    """What the options say of numbers of tools and bases. Raises KrlError."""
    plant = arguments.numbers_from
    given = None if plant is None else parse(_text(plant), plant.name)
    return frame_numbers(arguments.tool, arguments.base, given)


def rows_of(found: EvaluatedProgram) -> list[Row]:
    """One row per step, SI units."""
    return [
        {
            "lines": f"{one.step.places[0].line}"
            + (f"-{one.step.places[-1].line}" if len(one.step.places) > 1 else ""),
            "from": one.from_station,
            "to": one.to_station if one.step.moves else "",
            "seconds": one.report.duration,
            "joules": one.report.energy,
            "joules_low": one.report.energy_low if one.step.moves else None,
            "joules_high": one.report.energy_high if one.step.moves else None,
            "clearance": one.report.min_clearance if one.step.moves else None,
            "certified": one.found.verification.certified if one.step.moves else None,
            "note": "; ".join(
                filter(
                    None,
                    (
                        one.found.verification.status.message,
                        one.power_mode or _waiting(one.step.waits_for),
                        _handled(one.step.handled),
                        _under_way(one),
                    ),
                )
            ),
            "outputs": "; ".join(_spoken(output) for output in one.step.outputs),
        }
        for one in found.steps
    ]


def totals_of(found: EvaluatedProgram) -> Row:
    """Figures of the whole program."""
    return {
        "name": found.name,
        "seconds": found.report.duration,
        "joules": found.report.energy,
        "clearance": found.report.min_clearance,
        "certified": found.certified if found.moves else None,
        "stations": list(found.stations),
    }


def _waiting(condition: str) -> str:
    return f"waits for {condition}" if condition else ""


def _spoken(output: Switched) -> str:
    level = "on" if output.value else "off"
    return f"$OUT[{output.number}] {level} at {output.seconds:.3f} s"


def _under_way(one: EvaluatedStep) -> str:
    """Outputs that a movement sets before it ends."""
    end = one.step.trajectory.duration
    moving = [each for each in one.step.outputs if one.step.moves and each.seconds < end]
    return ", ".join(_spoken(each) for each in moving)


def _handled(part: str) -> str:
    """What the gripper does with a part, from its name after "+" or "-"."""
    return f"{'takes' if part[0] == '+' else 'leaves'} {part[1:]}" if part else ""


def _sentences(found: EvaluatedProgram) -> list[str]:
    judged = "free of violations" if found.certified else "NOT certified: see above"
    if not found.moves:
        judged = "it has no movement, so nothing was judged (its first one says where it starts)"
    return [
        f"{found.name}: {found.report.duration:.2f} s, {found.report.energy:.0f} J predicted, "
        f"{judged}",
        f"stations: {', '.join(found.stations) or 'none recognised'}",
        *(f"note: {note}" for note in found.notes),
    ]


def _compared(planner: Planner, found: EvaluatedProgram) -> Row:
    """The stations of the program as the planner visits them: free, and in the program's time."""
    if any(step.step.process for step in found.steps):
        raise InputError(
            "the program works along paths of the tool, between an output's on and off, that a "
            "visit of its stations would leave out: compare with `ir compare`"
        )
    if len(set(found.stations)) < 2:
        known = found.stations[0] if found.stations else "none"
        raise InputError(
            f"stations recognised: {known}; --compare plans between at least two: `ir compare` "
            "makes stations of the other stops"
        )
    start = found.steps[0].step.trajectory.positions[0]
    answer: dict[str, object] = {}
    for name, cycle_time in (("planned", 0.0), ("planned_in_time", found.report.duration)):
        plan = planner.plan_program(stations=found.stations, cycle_time=cycle_time, start=start)
        answer[name] = (
            {"seconds": plan.report.duration, "joules": plan.report.energy}
            if plan.status.ok
            else {"status": plan.status.message}
        )
    return answer


def _comparison(compared: Row) -> list[str]:
    names = {"planned": "planned freely", "planned_in_time": "planned in its time"}
    return [
        f"{names[name]}: {figures['seconds']:.2f} s, {figures['joules']:.0f} J"
        if "seconds" in figures
        else f"{names[name]}: {figures['status']}"
        for name, figures in compared.items()
    ]


def _text(path: Path) -> str:
    try:
        with ANYWHERE.open_to_read(path) as file:
            content = file.read(BYTES_MAX + 1)
    except FileRefusedError as error:
        raise InputError(str(error)) from error
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}") from error
    return text_of(content, str(path))


def _inputs(texts: list[str]) -> dict[int, bool]:
    found = {}
    for given in texts:
        index, _, value = given.partition("=")
        if not index.isdigit() or value.lower() not in ("true", "false", "1", "0"):
            raise InputError(f"--input {given[:40]}: it is N=true or N=false")
        found[int(index)] = value.lower() in ("true", "1")
    return found
