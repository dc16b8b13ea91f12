"""Data of a fit: a recording, or traces of joints and of a power meter, checked for sense."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ir_description import Cell, DescriptionError, Load, PowerParameters, RobotModel, cell_from_yaml
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_recorder.analysis.loads import LoadTimeline, carried, load_timeline, normal
from ir_recorder.errors import RecorderError
from ir_recorder.measure import PowerModel, Samples, samples_of
from ir_recorder.measure.samples import LoadRuns
from ir_recorder.reading.reader import read_recording
from ir_recorder.reading.recording import Recording
from ir_recorder.traces import Trace, TraceMapping, clock_offset, read_traces
from ir_recorder.traces.reader import recorded_traces
from ir_recorder.traces.trace import LOAD
from ir_values.arrays import BoolArray, FloatArray
from ir_values.errors import InvalidValueError

# The cell of a recording: its robot, its mounting and what may be held.


def attached_cell(recording: Recording | None) -> Cell:
    """The cell that a recording carries; RecorderError where there is none."""
    if recording is None:
        raise RecorderError("the file carries no cell: name one with --cell")
    if not recording.cell_yaml:
        raise RecorderError(f"{recording.path}: no cell is attached: name one with --cell")
    try:
        return cell_from_yaml(recording.cell_yaml, "the attached cell")
    except (DescriptionError, InvalidValueError, RecursionError) as error:
        raise RecorderError(
            f"{recording.path}: the attached cell can't be read: {error}"
        ) from error


# Data that no parameters explain are refused: units that are not what they are taken for, another
# robot.

MOST_UNEXPLAINED = 0.5  # of the mean power: plants that are fitted leave a tenth at most
_BEYOND = 0.2  # rad outside a joint's range: referencing and a worn stop are less
_FEWEST = 20  # windows
_SELDOM = 0.25  # s: within it an axis is accelerated and braked again


def check_explained(measured: FloatArray, fitted: FloatArray, moving: BoolArray) -> None:
    """RecorderError where the fitted power (W,) [W] stays so far from the measured that the data
    can't be those of the model.
    """
    for rows, what in ((~moving, "at rest"), (moving, "in motion")):
        if np.count_nonzero(rows) < _FEWEST:
            continue
        mean = float(measured[rows].mean())
        off = float(np.sqrt(np.mean((measured - fitted)[rows] ** 2)))
        if off > MOST_UNEXPLAINED * max(mean, 0.0):
            raise RecorderError(
                f"no parameters explain the meter: {what} it shows {mean:.0f} W in the mean, the "
                f"fit is off by {off:.0f} W (rms). Are the units of power and energy those of "
                "the headings, modes and loads those that were driven, and is it this robot?"
            )


def check_determined(determined: BoolArray, moving: BoolArray, window: float) -> None:
    """RecorderError where the data determine no parameter (P,); moving (W,): in which windows of
    `window` s.
    """
    if determined.any():
        return
    seconds = window * len(moving)
    moved = window * np.count_nonzero(moving)
    raise RecorderError(
        f"the data determine none of the {len(determined)} power parameters, so there is nothing "
        f"to write: the robot moves in {moved:.1f} of {seconds:.1f} s with watts. Drive several "
        "axes at several speeds and stay in the power modes; ir energy excite plans such "
        "movements"
    )


def check_readings(meter: Trace) -> None:
    """RecorderError where a meter reads so seldom that movements vanish between its readings."""
    if meter.period > _SELDOM:
        raise RecorderError(
            f"{meter.source}: a reading of power every {meter.period:.3g} s, a fit needs one every "
            f"{_SELDOM:g} s at least, better every 0.1 s or less"
        )


def check_range(source: str, robot: RobotModel, q: FloatArray) -> None:
    """RecorderError where positions (N, n) [rad] lie beyond what the robot can reach."""
    beyond = np.fmax(robot.position_min - q, q - robot.position_max)
    worst = np.nanmax(beyond, axis=0, initial=-np.inf)
    j = int(worst.argmax())
    if worst[j] > _BEYOND:
        value = float(q[np.nanargmax(beyond[:, j]), j])
        raise RecorderError(
            f"{source}: {robot.joint_names[j]} is {value:.3g} rad, {robot.name} reaches "
            f"{robot.position_min[j]:.3g} to {robot.position_max[j]:.3g} rad. Degrees need a "
            f"heading that says so: {robot.joint_names[j]}_deg; or is it another robot?"
        )


# What a fit is made from: a recording, or traces of joints and of a power meter with its own
# clock.


@dataclass(frozen=True, eq=False)
class FitData:
    """Samples with watts, the model of their robot, and sentences on how they were laid
    together.
    """

    samples: Samples
    model: PowerModel
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Source:
    """A file of the robot's motion; a file of the meter (None: the same), with the mapping of each;
    a cell for what no file says of it, and what is held all the time ("" where the recording
    knows).
    """

    motion: Path
    meter: Path | None = None
    motion_mapping: TraceMapping | None = None
    meter_mapping: TraceMapping | None = None
    cell: Cell | None = None
    load: str = ""

    @cached_property
    def recording(self) -> Recording | None:
        """The recording that the motion is from, read once; None for other files."""
        return read_recording(self.motion) if self.motion.suffix.lower() == ".mcap" else None


def source_cell(source: Source) -> Cell:
    """The cell that is given, else the one that the recording carries; RecorderError where there
    is none.
    """
    return source.cell or attached_cell(source.recording)


def fit_data(source: Source, prior: PowerParameters) -> FitData:
    """Read all of a source and lay it on one grid; ReadError, RecorderError or RecorderError as a
    sentence.
    """
    recording = source.recording
    cell = source_cell(source)
    _check_load(cell, source.load)
    if recording is not None:
        traces = recorded_traces(recording)
        runs = _recorded_loads(cell, load_timeline(recording).certain(recording.duration))
    else:
        traces = read_traces(source.motion, source.motion_mapping, cell.robot.joint_names)
        runs = _written_loads(cell, _with(traces, cell.robot.joint_names))
    if source.load or not runs:
        runs = [(-np.inf, np.inf, carried(cell, source.load))]
    joints = _with(traces, cell.robot.joint_names)
    positions = joints.joints(cell.robot.joint_names)
    assert positions is not None  # the trace was chosen for them
    check_range(joints.source, cell.robot, positions)
    meter = _metered(traces)
    model = PowerModel(cell.robot, cell.robot.controller.dc_link, cell.base_pose, prior)
    notes = [problem for trace in traces for problem in trace.problems]
    if source.meter is not None:
        mapping = source.meter_mapping or TraceMapping()
        outer = _metered(read_traces(source.meter, mapping, cell.robot.joint_names))
        if outer is None:
            raise RecorderError(f"{source.meter}: there is neither a column power nor energy")
        if np.isnan(mapping.clock_offset):
            outer, note = _aligned(joints, meter, outer, prior, model, runs)
            notes.append(note)
        meter = outer
    if meter is None:
        raise RecorderError(
            f"{source.motion}: there is neither a column power nor energy; name the meter's file"
        )
    check_readings(meter)
    names = cell.robot.joint_names
    modes = prior.modes
    return FitData(samples_of(joints, meter, names, modes, runs), model, tuple(notes))


def _written_loads(cell: Cell, trace: Trace) -> list[tuple[float, float, tuple[Load, ...]]]:
    """Runs of the words of a column `load`; none where there is no such column. RecorderError for
    what the cell does not have.
    """
    words = trace.texts.get(LOAD, ())
    for word in dict.fromkeys(words):
        _check_load(cell, word, f"{trace.source}: ")
    times = zip(trace.time.tolist(), map(normal, words), strict=False)
    return _recorded_loads(cell, LoadTimeline(tuple(times)).certain(float(trace.time[-1])))


def _check_load(cell: Cell, text: str, where: str = "") -> None:
    """Refuse a load text that names what is neither the cell's tool nor one of its parts."""
    known = {NO_LOAD, *(load.name for load in cell.loads("")), *(part.name for part in cell.parts)}
    if strange := set(normal(text).split(LOAD_SEPARATOR)) - known:
        raise RecorderError(
            f"{where}load {min(strange)[:40]!r} is unknown, known are {', '.join(sorted(known))}"
        )


def _recorded_loads(
    cell: Cell, known: Iterable[tuple[float, float, str]]
) -> list[tuple[float, float, tuple[Load, ...]]]:
    """Runs of loads of the cell by what the recording says; one tuple for each different text."""
    held: dict[str, tuple[Load, ...]] = {}
    runs = []
    for start, end, text in known:
        held.setdefault(text, carried(cell, text))
        runs.append((start, end, held[text]))
    return runs


def _with(traces: Sequence[Trace], names: Sequence[str]) -> Trace:
    for trace in traces:
        if trace.joints(names) is not None:
            return trace
    known = ", ".join(traces[0].columns)[:200]
    raise RecorderError(f"{traces[0].source}: there is no column {names[0]}, there is: {known}")


def _metered(traces: Sequence[Trace]) -> Trace | None:
    return next((trace for trace in traces if trace.joules() is not None), None)


def _aligned(
    joints: Trace,
    meter: Trace | None,
    outer: Trace,
    prior: PowerParameters,
    model: PowerModel,
    runs: LoadRuns,
) -> tuple[Trace, str]:
    """The outer meter on the robot's clock: its power against the recorded one, else the predicted
    one.
    """
    if meter is not None:
        time = meter.time
        watts = _watts(meter)
        what = "the recorded power"
    else:
        samples = samples_of(joints, None, prior.joints, prior.modes, runs)
        time = samples.time
        watts = model.watts(prior.mean, model.prepare(samples))
        what = "the power that the data sheet predicts"
    offset = clock_offset(time, watts, outer.time, _watts(outer))
    note = (
        f"{outer.source}: {offset.seconds:+.3f} s on its clock agrees with {what} by "
        f"{offset.correlation:.2f}"
    )
    return outer.shifted(offset.seconds), note


def _watts(meter: Trace) -> FloatArray:
    """Mean watts (N,) by the meter's count, the first as the second."""
    joules = meter.joules()
    assert joules is not None  # only metered traces come here
    means = np.diff(joules) / np.diff(meter.time)
    return np.concatenate([means[:1], means])
