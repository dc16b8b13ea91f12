"""How far are the joules on real robots, fitted on a part of a recording and held against the rest?

    python benchmarks/measured.py [DIR] [--seeds N] [--quick] [--json FILE] [--page docs/energy.md]

DIR holds public recordings that a user has fetched (docs/energy.md names them; none is in the
repository). What is not there is left out, and said. Simulated plants as in `truth.py --only fit`
follow (not with DIR and --quick, none with --seeds 0), then robots that nobody has a file of
(`_measured_strangers`), by a meter of ten readings a second, how often intervals hold over
everything together, and what comes of recordings that are spoilt (`_measured_spoilt`) or in which
something changes half-way (`_measured_phases`).
--page writes the table of the recordings into the page's chapter "Measured".
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
from _measured_levels import repeated
from _measured_phases import CLEAN, outcomes
from _measured_robots import kr300_r2500, tx40, ur3e
from _measured_spoilt import AS_IT_IS, OUTCOMES, ROBOTS, verdicts
from _measured_strangers import recorded, stranger
from _results import Claim, at_least, at_most, command_line, finish, line_of
from _truth_section import Asked
from scipy.stats import binomtest

from ir_description import Load, PowerParameters, RobotModel, data_sheet_of, load_robot
from ir_description.robot import centre_deviations, interval_over
from ir_recorder.fit import (
    Estimate,
    LeftOut,
    doubts,
    left_out,
    median_error,
    plain_torques,
    recommendation,
    result,
    shaft_power_rms,
    shaft_work,
)
from ir_recorder.fit.fit_data import without_turns
from ir_recorder.measure import PowerModel, Samples, movements, samples_of
from ir_recorder.measure.arm import available
from ir_recorder.traces import Trace, read_traces
from ir_values.arrays import FloatArray

UR3E = "ur3e_rad.csv"
KR300 = "kr300_r2500_ultra_{}.csv"
RUNS = "ABC"
TX40 = ("pos_read_data.csv", "curr_data.csv", "tx40_mdh_modified.urdf")
UR10E = {
    "5 recordings": (
        "ur-20_02_10-30sec_12harm.csv",
        "ur-20_02_12-40sec_12harm.csv",
        "ur-20_02_19_14harm50sec.csv",
        "ur-20_02_19_15harm50sec.csv",
        "ur-20_01_17-ptp_10_points.csv",
    ),
    "6 others": (
        "ur-20_02_05-20sec_12harm.csv",
        "ur-20_02_05-20sec_8harm.csv",
        "ur-20_02_06-20sec_10harm.csv",
        "ur-20_02_06-20sec_5harm.csv",
        "ur-20_02_10-20sec_7harm.csv",
        "ur-20_02_12-50sec_12harm.csv",
    ),
}
TX40_STEP = 2e-4  # s
TX40_THINNED = 10  # rows averaged to one: 2 ms
PAYLOAD = 150.0  # kg: of the KR 300's recordings, not stated there
OPEN = 0.3  # deviation of a payload that nobody stated
STRANGERS = 6
PHASES = 6  # recordings of each robot and kind
QUICK = ("kr6_r900_2",)
NEAR = 0.2  # of the usual deviation from what is known: a good data sheet
DRAWS = 200
TWICE = ("TX40, without", "KR 300, payload fitted")  # data sets that stand there already
LAST = 3  # parts of the TX40's recording; the last one is predicted
START = "<!-- measured -->"
END = "<!-- end -->"


@dataclass(frozen=True)
class Row:
    """A data set: what was held against what, by the fit, the data sheet and a regression."""

    data: str
    figure: str
    fit: float
    sheet: float
    regression: float
    movements: int = 0  # of how many `fit` lie in their interval; 0: it is another figure

    def words(self) -> dict[str, Any]:
        """For a table."""
        return {
            "data": self.data,
            "figure": self.figure,
            "fit": self.fit,
            "data sheet": self.sheet,
            "regression": self.regression,
        }


def main() -> None:
    """Run what there is, and print it."""
    parser = command_line(__doc__, (), 20, "3 plants; with DIR the recordings alone")
    parser.add_argument("folder", nargs="?", type=Path, metavar="DIR")
    parser.add_argument("--page", type=Path, help="page whose chapter is written")
    asked = parser.parse_args()
    rows: list[dict[str, Any]] = []
    claims: list[Claim] = []
    held = 0
    count = 0
    if asked.folder is not None:
        table: list[Row] = []
        for own, found in _sets(asked.folder):
            table += own
            claims += found
        rows = [row.words() for row in table]
        claims += _nearer(table)
        held = sum(round(row.fit) for row in table if row.movements)
        count = sum(row.movements for row in table)
        if asked.page is not None:
            _write(asked.page, list(_in_short(table)))
    if asked.folder is None or not asked.quick:
        from _truth_fit import driven

        seeds = min(asked.seeds, 3) if asked.quick else asked.seeds
        if seeds > 0:
            plants, inside = driven(Asked(("demo",), seeds, asked.quick))
            rows += plants.rows
            claims += plants.claims
            held += sum(inside)
            count += len(inside)
        own, found, others = _strangers(2 if asked.quick else STRANGERS)
        rows += own
        claims += found
        held += sum(others)
        count += len(others)
        own, found = _matrix(quick=asked.quick)
        rows += own
        claims += found
        own, found = _phases(quick=asked.quick)
        rows += own
        claims += found
    if count:
        claims += _pooled(held, count)
    for row in rows:
        print(line_of(row))
    finish(asked.json, rows, claims)


def _pooled(held: int, count: int) -> list[Claim]:
    """The exact 95 % binomial interval of how often a 90 % interval holds has 90 % within."""
    ends = binomtest(held, count).proportion_ci(0.95, "exact")
    name = f"{held} of {count} movements of all data sets in their 90 % interval"
    return [
        at_most(f"{name}: lower end", 100.0 * float(ends.low), "%", 90.0),
        at_least(f"{name}: upper end", 100.0 * float(ends.high), "%", 90.0),
    ]


def _sets(folder: Path) -> Iterator[tuple[list[Row], list[Claim]]]:
    """Every data set that the folder has."""
    if (folder / UR3E).is_file():
        yield _ur3e(folder)
    else:
        print(f"left out: {UR3E} is not in {folder}")
    if all((folder / KR300.format(run)).is_file() for run in RUNS):
        yield _kr300(folder, "payload 150 kg", 0.01)
        yield _kr300(folder, "payload fitted", OPEN)
    else:
        print(f"left out: {KR300.format('*')} are not in {folder}")
    if all((folder / name).is_file() for name in TX40):
        yield _tx40(folder)
    else:
        print(f"left out: {', '.join(TX40)} are not in {folder}")
    for what, names in UR10E.items():
        if all((folder / name).is_file() for name in names):
            yield _ur10e(folder, what, names)
        else:
            print(f"left out: {', '.join(names)} are not in {folder}")


def _strangers(count: int) -> tuple[list[dict[str, Any]], list[Claim], list[bool]]:
    """Robots drawn at random: two runs, each predicted by a fit on the other; a third one, whose
    intervals hold or not (last). And robots that are near what is known of them, with runs too
    short for a fit: is what is recommended the nearer one on the third run?
    """
    if not available():
        print("left out: strangers, Pinocchio is not installed")
        return [], [], []
    usual = [_Stranger(seed, 1.0, (100.0, 80.0)) for seed in range(count)]
    near = [_Stranger(seed, NEAR, (25.0, 25.0)) for seed in range(count)]
    shares = [each.errors[0] / each.errors[2] for each in usual]
    alarms = sum(each.doubted for each in usual)
    misled = sum(each.misled for each in (*usual, *near))
    name = f"{count} strangers: error of what was left out beside the regression's"
    claims = [
        at_most(f"{name}, median", float(np.median(shares)), "", 0.8),
        at_most(f"{name}, worst", max(shares), "", 1.0),
        at_most(
            f"of {2 * count} strangers, {count} with good data sheets and short runs: fits that "
            "are recommended and worse than the data sheet on a third run",
            misled,
            "",
            0.0,
        ),
        at_most("strangers whose good recordings are doubted", alarms, "", 0.0),
    ]
    rows = [each.row() for each in (*usual, *near)]
    return rows, claims, [inside for each in usual for inside in each.inside]


class _Stranger:
    """A robot, the fit of its runs (of so many seconds each), and how a third run is predicted.

    errors: medians of fit, data sheet and regression of what was left out, shares; third: of fit
    and data sheet; inside: whether each movement of the third run lies in its interval.
    """

    def __init__(self, seed: int, far: float, seconds: Sequence[float]) -> None:
        robot = stranger(seed, far)
        model, prior = _model(robot.known)
        runs = [recorded(robot, each, run) for run, each in enumerate(seconds)]
        estimate = Estimate(runs, [f"run {k}" for k in range(len(runs))], model, prior)
        fit = result(estimate, "stranger")
        found = left_out(estimate)
        third = recorded(robot, 60.0, 2)
        level = float(np.mean(np.concatenate([_missing(model, prior, run) for run in runs])))
        known = _third(model, prior, third, level)
        self.doubted = bool(doubts(estimate, fit).sentences)
        self.errors = [median_error(found, method) for method in METHODS]
        self.third = [_third(model, fit.parameters, third, 0.0), known]
        self.inside = _inside(model, fit.parameters, third)
        said = recommendation(found, doubted=self.doubted)
        self.misled = "plan with the fit" in said and self.third[0] > self.third[1]
        self._name = f"stranger {seed}, {robot.carries:.0f} kg, {far:g} times as far as usual"

    def row(self) -> dict[str, Any]:
        """For a table."""
        return Row(
            self._name, "energy, median %", *(100.0 * each for each in self.errors)
        ).words() | {
            "third run, fit": 100.0 * self.third[0],
            "third run, data sheet": 100.0 * self.third[1],
            "inside": sum(self.inside),
            "of": len(self.inside),
        }


def _missing(model: PowerModel, parameters: PowerParameters, samples: Samples) -> FloatArray:
    """Watts (M,) by which samples are above what parameters predict."""
    return np.asarray(
        samples.watts - samples.metered(model.watts(parameters.mean, model.prepare(samples)))
    )


def _third(model: PowerModel, parameters: PowerParameters, samples: Samples, level: float) -> float:
    """Median error of the energy of movements, with so many W more than is predicted; a share."""
    missing = _missing(model, parameters, samples) - level
    return float(
        np.median(
            [
                abs(missing[first:behind].sum()) / samples.watts[first:behind].sum()
                for first, behind in movements(samples)
            ]
        )
    )


def _inside(model: PowerModel, parameters: PowerParameters, samples: Samples) -> list[bool]:
    """Whether the energy of each movement lies in its 90 % interval."""
    prepared = model.prepare(samples)
    watts = samples.metered(model.watts(parameters.mean, prepared))
    drawn = np.array(
        [samples.metered(model.watts(each, prepared)) for each in parameters.draws(DRAWS, 0)]
    )
    held = []
    for begin, behind in movements(samples):
        nominal = float(watts[begin:behind].sum())
        low, high = interval_over(nominal, drawn[:, begin:behind].sum(axis=1) - nominal)
        held.append(bool(low <= samples.watts[begin:behind].sum() <= high))
    return held


def _phases(*, quick: bool) -> tuple[list[dict[str, Any]], list[Claim]]:
    """What is said of recordings in which something changes half-way, and of others; quick: of one
    robot, once.
    """
    rows = list(outcomes(range(1), QUICK) if quick else outcomes(range(PHASES)))
    clean = [row["outcome"] == "silent" for row in rows if row["changed"] == CLEAN]
    others = [row["outcome"] for row in rows if row["changed"] != CLEAN]
    rightly = sum(each == "named rightly" for each in others)
    return rows, [
        at_most("changes named without need", clean.count(False) / len(clean), "share", 0.05),
        at_least("changes named rightly", rightly / len(others), "share", 0.6),
    ]


def _matrix(*, quick: bool) -> tuple[list[dict[str, Any]], list[Claim]]:
    """Recordings of three robots, each spoilt in every way: what came of them (quick: of one robot,
    every seventh way).
    """
    if not available():
        print("left out: spoilt recordings, Pinocchio is not installed")
        return [], []
    robots = ("kr6_r900_2",) if quick else tuple(ROBOTS)
    found = [each for robot in robots for each in verdicts(robot, 0, quick=quick)]
    rows = []
    for robot in robots:
        counts = Counter(each.outcome for each in found if each.robot == robot)
        rows.append({"spoilt": robot} | {outcome: counts[outcome] for outcome in OUTCOMES})
    wrong = [each for each in found if each.outcome == OUTCOMES[-1]]
    rows += [{"spoilt": each.robot, "kind": each.kind, "said": each.said} for each in wrong]
    name = f"{len(found)} spoilt recordings that are recommended wrongly without a word"
    alarms = sum(each.kind == AS_IT_IS and each.outcome != OUTCOMES[0] for each in found)
    return rows, [
        at_most(name, len(wrong), "", 0.0),
        at_most("recordings that are not spoilt and not read right", alarms, "", 0.0),
    ]


def _model(robot: RobotModel) -> tuple[PowerModel, PowerParameters]:
    prior = data_sheet_of(robot, robot.controller).with_centres(centre_deviations(robot))
    return PowerModel(robot, robot.controller.dc_link, np.eye(4), prior), prior


def _samples(
    trace: Trace, robot: RobotModel, prior: PowerParameters, loads: Sequence[Load], metered: bool
) -> Samples:
    trace, _ = without_turns(trace, robot)
    runs = [(-np.inf, np.inf, tuple(loads))]
    names = robot.joint_names
    return samples_of(trace, trace if metered else None, names, prior.modes, runs)


def _held(mass: float, ahead: float) -> Load:
    """A payload so far ahead of the last joint [m], in the direction of its axis."""
    return Load("payload", "part", mass, np.array([ahead, 0.0, 0.0]), 0.02 * mass * np.eye(3))


def _ur3e(folder: Path) -> tuple[list[Row], list[Claim]]:
    """Bus power of a UR3e, in four consecutive parts, each left out once."""
    robot = ur3e()
    model, prior = _model(robot)
    (trace,) = read_traces(folder / UR3E, None, robot.joint_names)
    part = Load("payload", "part", 1.07, np.array([0.0, 0.0, 0.05]), 0.002 * np.eye(3))
    samples = _samples(trace, robot, prior, [part], metered=True)
    estimate = Estimate([samples], ["UR3e"], model, prior)
    estimate.result("ur3e")
    found = left_out(estimate)
    median, largest, rms = (
        Row("UR3e, 14 movements", name, *(own(found, m) for m in METHODS))
        for name, own in (
            ("energy, median %", lambda rows, m: 100.0 * median_error(rows, m)),
            ("energy, largest %", _largest),
            ("power, W rms", _rms),
        )
    )
    own = [row for row in found if row.method == METHODS[0]]
    inside = sum(row.covered or 0 for row in own)
    count = sum(len(row.errors) for row in own)
    name = f"of {count} in the 90 % interval"
    covered = Row("UR3e, 14 movements", name, inside, np.nan, np.nan, count)
    claims = [
        at_most("UR3e: energy of a movement left out, median", median.fit, "%", 0.65),
        at_most("UR3e: energy of a movement left out, largest", largest.fit, "%", 4.7),
        at_most("UR3e: power left out, rms", rms.fit, "W", 1.58),
        at_most("UR3e: median beside the regression's", median.fit / median.regression, "", 1.0),
    ]
    return [median, largest, rms, covered], claims


METHODS = ("fit", "data sheet", "regression")


def _largest(rows: Sequence[LeftOut], method: str) -> float:
    return 100.0 * max(abs(e) for row in rows if row.method == method for e in row.errors)


def _rms(rows: Sequence[LeftOut], method: str) -> float:
    return float(np.sqrt(np.mean([row.rms**2 for row in rows if row.method == method])))


def _kr300(folder: Path, what: str, deviation: float) -> tuple[list[Row], list[Claim]]:
    """Work of a KR 300's motors, every split of its three runs into known and unknown ones."""
    robot = kr300_r2500()
    model, sheet = _model(robot)
    covariance = sheet.covariance.copy()
    covariance[sheet.index("load_mass"), sheet.index("load_mass")] = deviation**2
    prior = replace(sheet, covariance=covariance)
    load = _held(PAYLOAD, 0.34)
    runs = {}
    for run in RUNS:
        (trace,) = read_traces(folder / KR300.format(run), None, robot.joint_names)
        runs[run] = _samples(trace, robot, prior, [load], metered=False)
    rows = []
    for known in ("A", "B", "C", "AB", "AC", "BC"):
        estimate = Estimate([runs[r] for r in known], list(known), model, prior, motors=True)
        estimate.result("kr300")
        for run in (each for each in RUNS if each not in known):
            both = [*known, run]
            whole = Estimate([runs[r] for r in both], both, model, prior, motors=True)
            rows += _split(estimate, whole, f"KR 300, {what}", f"{known} to {run}")
    work = rows[::2]
    _print_levels(f"KR 300, {what}", Estimate(list(runs.values()), RUNS, model, prior, motors=True))
    worst = max(abs(row.fit) for row in work)
    better = max(abs(row.fit) - abs(row.sheet) for row in work)
    return rows, [
        at_most(f"KR 300, {what}: work of the motors of an unknown run, worst", worst, "%", 3.0),
        at_most(f"KR 300, {what}: beside the data sheet, worst", better, "%", 0.0),
    ]


def _print_levels(data: str, estimate: Estimate) -> None:
    """What work a predictor misses that has the shape of friction from all recordings, and its
    level from the others.
    """
    for bent in (False, True):
        found = repeated(estimate, bent=bent)
        print(
            line_of(
                {
                    "repeats": data,
                    "friction": "bent" if bent else "straight",
                    "median %": 100.0 * float(np.median(np.abs(found.errors))),
                    "largest %": 100.0 * float(np.abs(found.errors).max()),
                    "lowest level": float(found.levels.min()),
                    "highest level": float(found.levels.max()),
                    "spread of axis 1 %": 100.0 * float(found.levels[:, 0].std()),
                }
            )
        )


def _split(known: Estimate, whole: Estimate, data: str, name: str) -> tuple[Row, Row]:
    """The last recording of `whole` predicted by what `known` found, as work in % off and as power
    at the shafts in W rms.
    """
    motors = whole.motors
    assert motors is not None  # asked for
    assert known.motors is not None
    motors.turn(known.motors.travel)
    n = motors.n
    rows = len(motors.window) // n
    inside = motors.window[:rows] >= whole.runs[-1].first
    count = len(whole.prior.names)
    gains = motors.scales(whole.prior.mean, ~inside)
    extra = np.concatenate([np.zeros(n), gains])
    table = motors.measured.reshape(n, rows).T
    speed = motors.speed

    def off(predicted: FloatArray) -> float:
        own = shaft_work(predicted[inside], speed[inside])
        return 100.0 * (own / shaft_work(table[inside], speed[inside]) - 1.0)

    def rms(predicted: FloatArray) -> float:
        return shaft_power_rms((predicted - table)[inside], speed[inside])

    def at(x: FloatArray) -> FloatArray:
        return motors.predicted(x, 0.0)[0].reshape(n, rows).T

    plain = plain_torques(whole, inside)
    sheet = np.concatenate([whole.prior.mean[:count], extra])
    given = (at(known.found), at(sheet), plain)
    return (
        Row(data, f"work, {name}, %", *(off(each) for each in given)),
        Row(data, f"power, {name}, W rms", *(rms(each) for each in given)),
    )


def _tx40(folder: Path) -> tuple[list[Row], list[Claim]]:
    """Work of a TX40's motors: its last third by a fit on the rest, with the coupling of its wrist
    and without.
    """
    rows = []
    for what, robot in (("with the coupling", tx40(folder)), ("without", _uncoupled(tx40(folder)))):
        model, prior = _model(robot)
        trace = _tx40_trace(folder, robot)
        samples = _samples(trace, robot, prior, (), metered=False)
        ends = np.linspace(samples.time[0], samples.time[-1] + samples.step, LAST + 1)
        first = samples.part(ends[0], ends[-2])
        last = samples.part(ends[-2], ends[-1])
        known = Estimate([first], ["first"], model, prior, motors=True)
        known.result("tx40")
        whole = Estimate([first, last], ["first", "last"], model, prior, motors=True)
        rows += _split(known, whole, f"TX40, {what}", "two thirds to the last")
    name = "TX40: work of the motors in the last third"
    return rows, [at_most(name, abs(rows[0].fit), "%", 1.5)]


def _ur10e(folder: Path, what: str, names: Sequence[str]) -> tuple[list[Row], list[Claim]]:
    """Work of a UR10e's motors by their currents: each recording by a fit on the others."""
    robot = load_robot("ur10e")
    model, prior = _model(robot)
    runs = []
    for name in names:
        table = np.loadtxt(folder / name, delimiter=",")
        columns = {}
        for k, joint in enumerate(robot.joint_names):
            columns[joint] = table[:, 1 + k].copy()
            columns[f"{joint}_velocity"] = table[:, 7 + k].copy()
            columns[f"{joint}_current"] = table[:, 13 + k].copy()
        rising = np.concatenate([[True], np.diff(table[:, 0]) > 0.0])
        kept = {key: each[rising] for key, each in columns.items()}
        trace = Trace(name, table[rising, 0].copy(), kept)
        runs.append(_samples(trace, robot, prior, (), metered=False))
    estimate = Estimate(runs, list(names), model, prior, motors=True)
    estimate.result("ur10e")
    found = left_out(estimate)
    median, largest, rms = (
        Row(f"UR10e, {what}", name, *(own(found, m) for m in METHODS))
        for name, own in (
            ("work, median %", lambda rows, m: 100.0 * median_error(rows, m)),
            ("work, largest %", _largest),
            ("power, W rms", _rms),
        )
    )
    _print_levels(f"UR10e, {what}", estimate)
    name = f"UR10e, {what}: work of the motors of a recording left out, median"
    return [median, largest, rms], [
        at_most(f"{name}, beside the data sheet", median.fit / median.sheet, "", 1.0),
    ]


def _uncoupled(robot: RobotModel) -> RobotModel:
    return replace(robot, motor_turns=np.eye(robot.n))


def _tx40_trace(folder: Path, robot: RobotModel) -> Trace:
    """Joint positions and torques of the motors, as seen at their own joints."""
    motors, torques = (np.loadtxt(folder / name, delimiter=",", skiprows=1) for name in TX40[:2])
    signs = np.array([1.0, 1.0, 1.0, -1.0, 1.0, 1.0])
    ratio = robot.gear_ratio * signs
    turns = np.eye(6)
    turns[5, 4] = 1.0  # whatever the model is told: this is how the arm stands
    q = (motors / ratio) @ np.linalg.inv(turns).T
    q += np.array([0.0, -np.pi / 2, np.pi / 2, 0.0, 0.0, 0.0])
    effort = torques * ratio
    if not robot.coupled:
        effort = effort @ turns
    thinned = len(q) // TX40_THINNED * TX40_THINNED
    q, effort = (each[:thinned].reshape(-1, TX40_THINNED, 6).mean(axis=1) for each in (q, effort))
    time = (np.arange(len(q)) + 0.5) * TX40_STEP * TX40_THINNED
    columns = {}
    for k, name in enumerate(robot.joint_names):
        columns[name] = q[:, k].copy()
        columns[f"{name}_effort"] = effort[:, k].copy()
    return Trace("TX40", time, columns)


def _in_short(table: Sequence[Row]) -> Iterator[Row]:
    """For the page: splits of one data set as median and largest of their sizes."""
    for data, group in groupby(table, key=lambda row: row.data):
        rows = list(group)
        for kind, unit in (("energy", "%"), ("work", "%"), ("power", "W rms"), ("of ", "")):
            splits = [row for row in rows if " to " in row.figure and row.figure.startswith(kind)]
            if len(splits) < 2:
                yield from (row for row in rows if row.figure.startswith(kind))
                continue
            sizes = np.abs([[row.fit, row.sheet, row.regression] for row in splits])
            named = (("median", np.median(sizes, axis=0)), ("largest", sizes.max(axis=0)))
            for name, values in named:
                figure = f"{kind}, {name} of {len(splits)} splits, {unit}"
                yield Row(data, figure, *(float(value) for value in values))


def _nearer(table: Sequence[Row]) -> list[Claim]:
    """Errors of the fit beside those of the regression, in the median of the data sets."""
    short = [row for row in _in_short(table) if row.data not in TWICE]
    claims = []
    for name, kinds in (("energy or work", ("energy", "work")), ("power", ("power",))):
        shares = {}
        for row in short:
            if row.figure.startswith(kinds) and "largest" not in row.figure:
                shares[row.data] = abs(row.fit / row.regression)
        if shares:
            what = f"{len(shares)} data sets: error of {name} beside the regression's, median"
            claims.append(at_most(what, float(np.median(list(shares.values()))), "", 0.8))
    return claims


def _write(page: Path, table: Sequence[Row]) -> None:
    """Put the table between the marks of a page."""
    heads = ("recording", "figure", "fit", "data sheet", "regression")
    lines = [f"| {' | '.join(heads)} |", f"|{' --- |' * len(heads)}"]
    lines += [
        f"| {row.data} | {row.figure} | {_figure(row.fit)} | {_figure(row.sheet)} | "
        f"{_figure(row.regression)} |"
        for row in table
    ]
    text = page.read_text(encoding="utf-8")
    before, _, rest = text.partition(START)
    _, _, after = rest.partition(END)
    page.write_text("\n".join([before + START, *lines, END]) + after, encoding="utf-8")


def _figure(value: float) -> str:
    return "–" if np.isnan(value) else f"{value:.3g}" if value != int(value) else f"{value:.0f}"


if __name__ == "__main__":
    main()
