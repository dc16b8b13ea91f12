"""Recordings as they are spoilt in practice, read by the documented way: is each read right,
noticed, or refused, or is a wrong fit recommended without a word?

A robot is driven by the plant of `_measured_strangers`; its log and its meter are written as files
with headings, one thing is made wrong in them, and `fit_sources` reads them as `ir energy fit`
does.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from _measured_robots import ur3e
from _measured_strangers import Stranger, logged, recorded, standing_for

from ir_description import (
    Cell,
    PowerParameters,
    RobotModel,
    data_sheet_of,
    load_cell,
    load_robot,
)
from ir_description.robot import centre_deviations, without_table
from ir_recorder.errors import RecorderError
from ir_recorder.fit import doubts, fit_sources, left_out, recommendation
from ir_recorder.fit.fit_data import DataSource
from ir_recorder.measure import PowerModel, movements
from ir_recorder.traces import TraceMapping
from ir_values.arrays import FloatArray


def _kr210() -> RobotModel:
    """Without its gas spring, which the plant has not, at a controller that nobody knows."""
    return replace(load_robot("kr210_r2700_extra"), counterbalance=None, controller=without_table())


ROBOTS: Mapping[str, tuple[Callable[[], RobotModel], float]] = {
    "ur3e": (ur3e, 3.0),
    "kr6_r900_2": (lambda: load_robot("kr6_r900_2"), 6.0),
    "kr210_r2700_extra": (_kr210, 210.0),
}
SECONDS = 60.0
WRONG_ZERO = 0.9  # rad
AS_GOOD = 1.5  # times the error of the unspoilt fit on other movements, and
BESIDE = 0.02  # of what they take beyond rest: what a fit that was read right may be off
AS_IT_IS = "as it is"
OUTCOMES = ("read right", "undecided", "noticed", "refused", "wrong without a word")


@dataclass(frozen=True)
class Recording:
    """A log: time (N,) s, joints (N, n) rad, headings of these; a meter: time (M,) s, watts (M,),
    heading; seconds to add to its clock (NaN: to be found).
    """

    time: FloatArray
    joints: FloatArray
    names: tuple[str, ...]
    meter_time: FloatArray
    watts: FloatArray
    heading: str = "power_W"
    offset: float = 0.0


@dataclass(frozen=True)
class Spoilt:
    """A recording with one thing wrong; reading: how `doubts` names this reading of the columns."""

    kind: str
    recording: Recording
    reading: str = ""


def spoilt(good: Recording) -> Iterator[Spoilt]:
    """Every way to spoil a recording."""
    n = len(good.names)
    for a, b in combinations(range(n), 2):
        order = list(range(n))
        order[a], order[b] = b, a
        reading = f"the columns of {good.names[a]} and {good.names[b]} swapped"
        exchanged = _joints(good, good.joints[:, order])
        yield Spoilt(f"columns {a + 1} and {b + 1} swapped", exchanged, reading)
    for j in range(n):
        sign = np.where(np.arange(n) == j, -1.0, 1.0)
        turned = _joints(good, good.joints * sign)
        yield Spoilt(f"sign of column {j + 1}", turned, f"the sign of {good.names[j]} changed")
    for j in (1, 2, 4):
        zero = np.where(np.arange(n) == j, WRONG_ZERO, 0.0)
        yield Spoilt(f"zero of column {j + 1} elsewhere", _joints(good, good.joints + zero))
    for j in range(n):
        still = good.joints.copy()
        still[:, j] = still[0, j]
        yield Spoilt(f"column {j + 1} constant", _joints(good, still))
    one, two = (replace(good, watts=good.watts * share / 3.0) for share in (1.0, 2.0))
    yield Spoilt("one phase of three", one, "only a third")
    yield Spoilt("two phases of three", two, "two thirds")
    yield Spoilt("kW under W", replace(good, watts=good.watts / 1e3))
    yield Spoilt("W under kW", replace(good, heading="power_kW"))
    yield Spoilt("degrees under rad", _joints(good, np.degrees(good.joints)))
    degrees = tuple(f"{name} [deg]" for name in good.names)
    yield Spoilt("rad under degrees", replace(good, names=degrees))
    for late in (0.05, 0.3, 2.0):
        other = replace(good, meter_time=good.meter_time + late)
        yield Spoilt(f"clock {late:g} s late, called equal", other)
        found = replace(other, offset=np.nan)
        yield Spoilt(f"clock {late:g} s late, to be found", found)
    rng = np.random.default_rng(0)
    kept = np.sort(rng.choice(len(good.time), len(good.time) * 9 // 10, replace=False))
    yield Spoilt("a tenth of the rows missing", _rows(good, kept))
    whole = np.arange(len(good.time))
    third = len(whole) // 3
    gap = np.concatenate([whole[:third], whole[third + 400 :]])
    yield Spoilt("3.2 s of rows missing", _rows(good, gap))
    meter = np.delete(np.arange(len(good.meter_time)), slice(200, 230))
    lost = replace(good, meter_time=good.meter_time[meter], watts=good.watts[meter])
    yield Spoilt("3 s of the meter missing", lost)
    twice = np.sort(np.concatenate([whole, whole[::10]]))
    yield Spoilt("every tenth row twice", _rows(good, twice))
    again = np.concatenate([whole[: 2 * third], whole[third:]])
    yield Spoilt("a third of the rows again", _rows(good, again))


def _joints(good: Recording, joints: FloatArray) -> Recording:
    return replace(good, joints=joints)


def _rows(good: Recording, rows: Any) -> Recording:
    return replace(good, time=good.time[rows], joints=good.joints[rows])


@dataclass(frozen=True)
class Verdict:
    """What came of a recording: one of OUTCOMES, with the sentence that tells. Read right is what
    predicts other movements as a fit of the unspoilt recording does, whatever was spoilt.
    """

    robot: str
    kind: str
    outcome: str
    said: str


def verdicts(name: str, seed: int, *, quick: bool = False) -> Iterator[Verdict]:
    """The recording as it is, and every way to spoil it, of one robot of ROBOTS; quick: every
    seventh of them.
    """
    make, payload = ROBOTS[name]
    robot = standing_for(make(), payload, np.random.default_rng(seed))
    known = robot.known
    prior = data_sheet_of(known, known.controller).with_centres(centre_deviations(known))
    joints, meter = logged(robot, SECONDS, 0)
    positions = np.column_stack([joints.columns[each] for each in known.joint_names])
    good = Recording(joints.time, positions, known.joint_names, meter.time, meter.columns["power"])
    judge = _Judge(robot, _cell(known), prior, _unseen(robot, prior, good, _cell(known)))
    yield judge.verdict(Spoilt(AS_IT_IS, good))
    for each in list(spoilt(good))[:: 7 if quick else 1]:
        yield judge.verdict(each)


@dataclass(frozen=True)
class _Judge:
    """A robot, what is known of it, and how far a fit of the unspoilt recording is off on other
    movements, a share.
    """

    robot: Stranger
    cell: Cell
    prior: PowerParameters
    least: float

    def verdict(self, each: Spoilt) -> Verdict:
        """What comes of a recording."""
        name = self.robot.known.name
        try:
            read = _read(each.recording, self.cell, self.prior)
        except RecorderError as error:
            return Verdict(name, each.kind, "refused", str(error))
        if read.against:
            return Verdict(name, each.kind, "noticed", read.against)
        off = _off(self.robot, self.prior, read.parameters)
        said = f"{100 * off:.2f} % off, unspoilt {100 * self.least:.2f} %"
        if off <= AS_GOOD * self.least + BESIDE:
            return Verdict(name, each.kind, "read right", said)
        named = each.reading and each.reading in read.undecided
        return Verdict(name, each.kind, "undecided" if named else OUTCOMES[-1], said)


@dataclass(frozen=True)
class _Read:
    """Parameters as `ir energy fit` finds them, what it says against planning with them, and which
    readings it says the watts do not tell apart.
    """

    parameters: PowerParameters
    against: str
    undecided: str


def _read(recording: Recording, cell: Cell, prior: PowerParameters) -> _Read:
    """The recording through files."""
    with TemporaryDirectory() as folder:
        log = Path(folder) / "log.csv"
        meter = Path(folder) / "meter.csv"
        table = np.column_stack([recording.time, recording.joints])
        _write(log, ("time [s]", *recording.names), table)
        table = np.column_stack([recording.meter_time, recording.watts])
        _write(meter, ("time [s]", recording.heading), table)
        clock = TraceMapping(clock_offset=recording.offset)
        source = DataSource(log, meter, None, clock, cell, load="none")
        _, estimate, fit = fit_sources([source], prior, "", "spoilt")
    found = doubts(estimate, fit)
    advised = recommendation(left_out(estimate), doubted=bool(found.sentences))
    against = list(found.sentences)
    if not advised.endswith("plan with the fit"):
        against.append(advised)
    return _Read(fit.parameters, "; ".join(against), "; ".join(found.undecided))


def _write(path: Path, headings: tuple[str, ...], table: FloatArray) -> None:
    lines = [",".join(headings)]
    lines += [",".join(f"{value:.9g}" for value in row) for row in table.tolist()]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def _unseen(robot: Stranger, prior: PowerParameters, good: Recording, cell: Cell) -> float:
    """How far a fit of a recording is off on other movements."""
    return _off(robot, prior, _read(good, cell, prior).parameters)


def _off(robot: Stranger, prior: PowerParameters, parameters: PowerParameters) -> float:
    """Errors of the energies of other movements, as a share of what these take beyond rest."""
    known = robot.known
    model = PowerModel(known, known.controller.dc_link, np.eye(4), prior)
    samples = recorded(robot, 60.0, 1)
    missing = samples.metered(model.watts(parameters.mean, model.prepare(samples))) - samples.watts
    moving = samples.watts - robot.standing
    spans = movements(samples)
    errors = sum(abs(missing[first:behind].sum()) for first, behind in spans)
    return float(errors / sum(moving[first:behind].sum() for first, behind in spans))


def _cell(robot: RobotModel) -> Cell:
    """A cell with nothing but the robot."""
    return replace(
        load_cell("open"),
        robot=robot,
        base_pose=np.eye(4),
        tool=None,
        parts=(),
        equipment=(),
        stations=(),
        signals=(),
        program=(),
        tasks=(),
        paths=(),
        park=robot.machine_home,
        machine_home=robot.machine_home,
        base_contacts=(),
        whole_loads=(),
        route=None,
    )
