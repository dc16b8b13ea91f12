"""Data of a fit: a recording, or traces of joints and of a power meter, checked for sense."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from ir_description import Cell, DescriptionError, Load, PowerParameters, RobotModel, cell_from_yaml
from ir_description.robot import DATA_SHEET
from ir_msgs_py.names import LOAD_SEPARATOR, NO_LOAD
from ir_recorder.analysis.loads import LoadTimeline, carried, load_timeline, normal
from ir_recorder.errors import RecorderError
from ir_recorder.measure import PowerModel, Samples, samples_of
from ir_recorder.measure.samples import MOVING, STEP, LoadRuns
from ir_recorder.reading.reader import read_recording
from ir_recorder.reading.recording import Recording
from ir_recorder.traces import ClockOffset, Trace, TraceMapping, clock_offset, read_traces
from ir_recorder.traces.reader import is_own, recorded_traces
from ir_recorder.traces.trace import CURRENT, EFFORT, LOAD, VELOCITY
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
_FEWEST = 20  # windows, or rows
_SELDOM = 0.25  # s: within it an axis is accelerated and braked again


def check_explained(measured: FloatArray, fitted: FloatArray, moving: BoolArray) -> None:
    """RecorderError where the fitted power (W,) [W] stays so far from the measured that the data
    can't be those of the model.
    """
    for rows, what in ((~moving, "at rest"), (moving, "in motion")):
        if np.count_nonzero(rows) < _FEWEST:
            continue
        mean = float(measured[rows].mean())
        if mean <= 0.0:
            raise RecorderError(
                f"no parameters explain the meter: it shows {mean:.0f} W in the mean {what}, a "
                "robot takes power; is a sign or a clamp turned round?"
            )
        off = float(np.sqrt(np.mean((measured - fitted)[rows] ** 2)))
        if off > MOST_UNEXPLAINED * mean:
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


_LEAST_WATTS = 5.0  # in the median: with its drives on, the lightest arm takes more
_MOST_POWER = 3.0  # of peak torque times full speed, all axes together: in the mean


def check_unit(watts: FloatArray, robot: RobotModel, source: str) -> None:
    """RecorderError where watts (M,) can't be those of a robot: kW read as W, or the other way."""
    known = watts[np.isfinite(watts)]
    if not len(known):
        return
    median = float(np.median(known))
    most = _MOST_POWER * float(robot.envelope_torque[:, 0] @ robot.velocity_max)
    remedy = "is the heading's unit right (power_W, power_kW, or unit: kW in a mapping)?"
    if 0.0 <= median < _LEAST_WATTS and float(known.max()) < 20.0 * _LEAST_WATTS:
        raise RecorderError(
            f"{source}: no parameters explain the meter: it shows {median:.3g} W in the median and "
            f"{float(known.max()):.3g} W at most, a robot takes more than {_LEAST_WATTS:g} W: "
            f"{remedy}"
        )
    if median > most:
        raise RecorderError(
            f"{source}: no parameters explain the meter: it shows {median:.3g} W in the median, "
            f"all axes of {robot.name} at peak torque and full speed give {most / _MOST_POWER:.3g} "
            f"W: {remedy}"
        )


def check_readings(meter: Trace) -> None:
    """RecorderError where a meter reads so seldom that movements vanish between its readings."""
    if meter.period > _SELDOM:
        raise RecorderError(
            f"{meter.source}: a reading of power every {meter.period:.3g} s, a fit needs one every "
            f"{_SELDOM:g} s at least, better every 0.1 s or less"
        )


_TURN = 2.0 * np.pi
_NO_END = 0.05  # rad less than a turn: a joint of such a range has no end


def without_turns(joints: Trace, robot: RobotModel) -> tuple[Trace, list[str]]:
    """The trace with joints that have no end followed through their jumps of a turn, and brought
    back by whole turns to what the robot file calls their range; a sentence for each.
    """
    columns = dict(joints.columns)
    said = []
    for name, low, high in zip(
        robot.joint_names, robot.position_min, robot.position_max, strict=True
    ):
        if high - low < _TURN - _NO_END:
            continue
        q = columns[name]
        known = np.isfinite(q)
        if not known.any():
            continue
        followed = q.copy()
        followed[known] = np.unwrap(q[known])
        lowest = float(np.nanmin(followed))
        highest = float(np.nanmax(followed))
        turns = 0
        if not low - _BEYOND <= lowest <= highest <= high + _BEYOND:
            turns = round((0.5 * (lowest + highest) - 0.5 * (low + high)) / _TURN)
        columns[name] = followed - turns * _TURN
        jumps = int(np.count_nonzero(np.abs(np.diff(q[known])) > np.pi))
        if turns or jumps:
            said.append(
                f"{joints.source}: {name} brought back by {turns} turns, {jumps} jumps of a turn "
                "followed"
            )
    return replace(joints, columns=columns) if said else joints, said


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


_FASTER = 1.2  # times full speed: controllers let axes overshoot a little
_SELDOM_FASTER = 0.001  # share of the samples: spikes of differentiated positions


def check_speed(source: str, robot: RobotModel, qd: FloatArray) -> None:
    """RecorderError where speeds (M, n) [rad/s] are beyond what the robot's axes can reach."""
    known = qd[np.isfinite(qd).all(axis=1)]
    if not len(known):
        return
    fastest = np.quantile(np.abs(known), 1.0 - _SELDOM_FASTER, axis=0)
    j = int((fastest / robot.velocity_max).argmax())
    if fastest[j] > _FASTER * robot.velocity_max[j]:
        raise RecorderError(
            f"{source}: {robot.joint_names[j]} moves at {fastest[j]:.3g} rad/s, {robot.name} "
            f"reaches {robot.velocity_max[j]:.3g} rad/s. Are the units of time and position right "
            "(ms or s, degrees or rad), is it the column of this joint, and is it this robot?"
        )


_ALIKE = 0.8  # correlation of recorded speeds with those of the positions: they are of one motion
_OTHER = 1.3  # times the recorded speed, or one in so many: of another unit or clock


def check_clock(joints: Trace, names: Sequence[str]) -> None:
    """RecorderError where positions change by a multiple of what the recorded speeds say."""
    positions = joints.joints(names)
    speeds = joints.joints(names, VELOCITY)
    if positions is None or speeds is None:
        return
    steps = joints.time[2:] - joints.time[:-2]
    moved = (positions[2:] - positions[:-2]) / steps[:, None]
    for name, own, said in zip(names, moved.T, speeds[1:-1].T, strict=True):
        times = _times_as_fast(own, said)
        if not 1.0 / _OTHER < times < _OTHER:
            raise RecorderError(
                f"{joints.source}: positions of {name} change {times:.3g} times as fast as its "
                "recorded speed says: is the time right (a row's number is none), are the units "
                "of positions and speeds, and are both of this joint?"
            )


_TURNED = 0.05  # rad: a joint that moves


def check_efforts(joints: Trace, names: Sequence[str]) -> None:
    """RecorderError where the effort of a joint that moves is 0 all the time, as drivers write it
    that measure none.
    """
    positions = joints.joints(names)
    kind = EFFORT if joints.joints(names, EFFORT) is not None else CURRENT
    efforts = joints.joints(names, kind)
    if positions is None or efforts is None:
        return
    moves = np.nanmax(positions, axis=0) - np.nanmin(positions, axis=0) > _TURNED
    silent = moves & ~np.nan_to_num(efforts).any(axis=0)
    if silent.any():
        name = names[int(silent.argmax())]
        raise RecorderError(
            f"{joints.source}: {name}{kind} is 0 all the time, though {name} moves: was it "
            "measured? Name the meter's file, or leave such a column out"
        )


def _times_as_fast(moved: FloatArray, said: FloatArray) -> float:
    """How many times as fast a joint moves, by its positions (N,), as its recorded speed (N,) says;
    1 where the two are not of one motion, or of none.
    """
    known = np.isfinite(moved) & np.isfinite(said)
    moved = moved[known]
    said = said[known]
    if len(said) < _FEWEST or np.abs(said).max() < MOVING:
        return 1.0
    product = float(moved @ said)
    power = float(said @ said)
    if abs(product) < _ALIKE * np.sqrt(float(moved @ moved) * power):
        return 1.0
    return product / power


# What a fit is made from: a recording, or traces of joints and of a power meter with its own
# clock.


@dataclass(frozen=True, eq=False)
class FitData:
    """Recordings, by name, the model of their robot, and sentences on how they were laid
    together. motors: whether the fit has to rest on what the controllers say of their motors.
    offsets [s]: added to the clock of each recording's meter so that its power agrees with the one
    that the prior predicts; NaN where nothing was to be found so.
    """

    recordings: tuple[Samples, ...]
    names: tuple[str, ...]
    model: PowerModel
    notes: tuple[str, ...]
    motors: bool
    offsets: tuple[float, ...]


@dataclass(frozen=True)
class DataSource:
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
        """The recording that the motion is from, read once; None for other files, and for bags of
        others.
        """
        if self.motion.suffix.lower() != ".mcap":
            return None
        recording = read_recording(self.motion)
        return recording if is_own(recording) else None

    def on_clock(self, seconds: float) -> DataSource:
        """The source with so many seconds added to the meter's clock."""
        mapping = self.meter_mapping or TraceMapping()
        return replace(self, meter_mapping=replace(mapping, clock_offset=seconds))


def source_cell(source: DataSource) -> Cell:
    """The cell that is given, else the one that the recording carries; RecorderError where there
    is none.
    """
    return source.cell or attached_cell(source.recording)


BY = ("meter", "motors", "both")
"""What a fit explains: watts, torques or currents of the motors, or both."""


def fit_data(
    sources: DataSource | Sequence[DataSource], prior: PowerParameters, by: str = ""
) -> FitData:
    """Read all sources and lay each on a grid; ReadError or RecorderError as a sentence. by: one of
    BY; "": the meter, and the motors where there is no meter.
    """
    given = (sources,) if isinstance(sources, DataSource) else tuple(sources)
    cells = [source_cell(each) for each in given]
    for cell in cells:
        if cell.robot.name != prior.robot:
            raise RecorderError(
                f"one fit is of one robot, there is {cell.robot.name} beside {prior.robot}"
            )
    cell = cells[0]
    model = PowerModel(cell.robot, cell.robot.controller.dc_link, cell.base_pose, prior)
    recordings: tuple[Samples, ...] = ()
    notes: tuple[str, ...] = ()
    offsets: tuple[float, ...] = ()
    for source in given:
        samples, own_notes, offset = _run(source, prior, model, by)
        recordings = (*recordings, samples)
        notes = (*notes, *own_notes)
        offsets = (*offsets, offset)
    motors = by in BY[1:]
    if not by:
        motors = not any(np.isfinite(samples.watts).any() for samples in recordings)
    if by == BY[1]:  # by the motors alone
        recordings = tuple(
            replace(samples, watts=np.full(len(samples), np.nan)) for samples in recordings
        )
    if motors and len({samples.currents for samples in recordings}) > 1:
        raise RecorderError("some recordings have torques, others currents: fit them one by one")
    names = tuple(each.motion.stem for each in given)
    return FitData(recordings, names, model, notes, motors, offsets)


def _run(
    source: DataSource, prior: PowerParameters, model: PowerModel, by: str
) -> tuple[Samples, list[str], float]:
    """A source on one grid, sentences on how it was laid there, and what was added to the clock of
    its meter so that its power agrees with the predicted one [s]; else NaN.
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
    joints, turned = without_turns(joints, cell.robot)
    positions = joints.joints(cell.robot.joint_names)
    assert positions is not None  # the trace was chosen for them
    check_range(joints.source, cell.robot, positions)
    check_clock(joints, cell.robot.joint_names)
    meter = _metered(traces)
    added = np.nan
    notes = [*_said(traces), *turned]
    if source.meter is not None:
        mapping = source.meter_mapping or TraceMapping()
        meters = read_traces(source.meter, mapping, cell.robot.joint_names)
        if source.meter != source.motion:
            notes += _said(meters)
        outer = _metered(meters)
        if outer is None:
            raise RecorderError(
                f"{source.meter}: there is neither a column power nor energy: head it power_W, "
                "power_kW or energy_Wh, or say in a mapping (--meter-mapping) which column it is"
            )
        if np.isnan(mapping.clock_offset):
            offset, what = _offset(joints, meter, outer, prior, model, runs)
            notes.append(
                f"{outer.source}: {offset.seconds:+.3f} s on its clock agrees with {what} by "
                f"{offset.correlation:.2f}"
            )
            outer = outer.shifted(offset.seconds)
            added = offset.seconds if meter is None else np.nan
        meter = outer
    names = cell.robot.joint_names
    if by in BY[1:] or meter is None:
        _check_motors(source, joints, names, by)
    if meter is not None and by != BY[1]:
        check_readings(meter)
    notes += _gaps(joints)
    samples = samples_of(joints, meter, names, prior.modes, runs)
    check_speed(joints.source, cell.robot, samples.qd)
    if meter is not None and by != BY[1]:
        check_unit(samples.watts, cell.robot, meter.source)
    return samples, notes, added


def _check_motors(source: DataSource, joints: Trace, names: Sequence[str], by: str) -> None:
    """RecorderError where a fit by the motors has neither torques nor currents, or such as nobody
    measured.
    """
    if joints.joints(names, EFFORT) is None and joints.joints(names, CURRENT) is None:
        what = "" if by in BY[1:] else "neither a column power nor energy, and "
        raise RecorderError(
            f"{source.motion}: there is {what}no column {names[0]}{EFFORT} nor "
            f"{names[0]}{CURRENT}; name the meter's file"
        )
    check_efforts(joints, names)


def _said(traces: Sequence[Trace]) -> list[str]:
    """What reading said of each trace."""
    return [f"{trace.source}: {problem}" for trace in traces for problem in trace.problems]


def _gaps(joints: Trace) -> list[str]:
    """What is lost of a recording, and how it is laid on the grid."""
    gaps = joints.gaps()
    lost = sum(length for _, length in gaps)
    said = [f"{joints.source}: a row every {joints.period:.3g} s, laid on a grid of {STEP:g} s"]
    if gaps:
        said.append(f"{joints.source}: {len(gaps)} gaps, {lost:.2f} s in all, are not used")
    return said


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


def _offset(
    joints: Trace,
    meter: Trace | None,
    outer: Trace,
    prior: PowerParameters,
    model: PowerModel,
    runs: LoadRuns,
) -> tuple[ClockOffset, str]:
    """What lays the outer meter on the robot's clock, its power against the recorded one, else the
    predicted one; and which of them.
    """
    if meter is not None:
        time, watts = _watts(meter)
        what = "the recorded power"
    else:
        samples = samples_of(joints, None, prior.joints, prior.modes, runs)
        time = samples.time
        watts = model.watts(prior.mean, model.prepare(samples))
        begun = "the data sheet" if prior.name == DATA_SHEET else prior.name
        what = f"the power that {begun} predicts"
    return clock_offset(time, watts, *_watts(outer)), what


def _watts(meter: Trace) -> tuple[FloatArray, FloatArray]:
    """Middles (N - 1,) s between readings, and the mean watts (N - 1,) there."""
    joules = meter.joules()
    assert joules is not None  # only metered traces come here
    middles = 0.5 * (meter.time[1:] + meter.time[:-1])
    return middles, np.diff(joules) / np.diff(meter.time)
