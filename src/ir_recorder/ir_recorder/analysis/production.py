"""A program in production: what one cycle of it takes, and what could be saved of it.

Every page, table and command that shows a cycle, a year or a saving of a recording reads it here. A
recording may hold several cycles, and its pauses may be shortened: a cycle is their mean, with its
pauses at full length, computed.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ir_description import Cell, PowerData, data_sheet_of
from ir_description.robot import interval_over
from ir_msgs_py.modes import REST_MODES
from ir_msgs_py.names import NO_LOAD
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.savings import ProgramSavings, Saving, largest_quarter
from ir_recorder.analysis.flows import EnergyFlows, energy_flows
from ir_recorder.analysis.loads import carried
from ir_recorder.analysis.meter import Meter
from ir_recorder.analysis.predicted_power import (
    BRAKES,
    Predictor,
    recorded_power_data,
    resting_watts,
)
from ir_recorder.analysis.results import (
    Analysis,
    FullPause,
    ProgramTotals,
    Share,
    Unshortened,
    mode_name,
)
from ir_recorder.analysis.steps import step_label
from ir_recorder.analysis.tending import Span, Tending
from ir_recorder.format import contents
from ir_recorder.reading.recording import Recording

ENDED = "ended"  # outcome of a step
PREDICTED = "predicted"
PLANNED_MOVING = "MOVING"
NO_MODE = "STAND_ON_MOTORS"
WAITING = "waiting between steps"
SLOWER = "slower, in the common program's time"
FULL_PAUSES = "pauses at full length"
HIBERNATION = "HIBERNATION"
LEFT_ALONE = "STAND_ON_BRAKES"
"""The mode that a controller goes into by itself while nobody works."""
OPEN = "zero lies in it: it is open whether anything is saved"
DRIVES_ONLY = "drives only, controller not counted"


@dataclass(frozen=True)
class Amount:
    """A value with the ends of its 90 % interval."""

    value: float
    low: float
    high: float

    def of(self, unit: Callable[[float], float]) -> Amount:
        """The amount in another unit."""
        return Amount(unit(self.value), unit(self.low), unit(self.high))

    def times(self, count: float) -> Amount:
        """So many of it."""
        return self.of(lambda value: value * count)

    def plus(self, other: Amount) -> Amount:
        """Both, ends added: what is unsure is so in both alike."""
        return Amount(self.value + other.value, self.low + other.low, self.high + other.high)

    @property
    def doubt(self) -> str:
        """OPEN where zero lies inside the interval of a saving; "" where it does not, or there is
        no interval.
        """
        return OPEN if self.low < self.high and self.low <= 0.0 <= self.high else ""

    @staticmethod
    def of_value(value: float) -> Amount:
        """One without an interval."""
        return Amount(value, value, value)

    def gain(self) -> tuple[str, Amount]:
        """A saving as people say it: "saved", or "more" where it is negative, and how much."""
        if self.value >= 0.0:
            return "saved", self
        return "more", Amount(-self.value, -self.high, -self.low)


def saved_amount(saving: Saving) -> Amount:
    """What is saved [J]; without an interval its ends are the value."""
    if saving.saved_low == saving.saved_high:
        return Amount(saving.saved, saving.saved, saving.saved)
    return Amount(saving.saved, saving.saved_low, saving.saved_high)


def sum_of(amounts: Sequence[Amount]) -> Amount:
    """Values and ends add up: what is unsure is so in all alike."""
    return Amount(
        sum(amount.value for amount in amounts),
        sum(amount.low for amount in amounts),
        sum(amount.high for amount in amounts),
    )


def mean_of(amounts: Sequence[Amount]) -> Amount:
    """The mean of amounts that are as unsure alike."""
    return sum_of(amounts).times(1.0 / len(amounts))


@dataclass(frozen=True)
class Production:
    """One cycle of a program: seconds [s] and energy [J] at the mains.

    name: which cycle that is; origin: "measured", "simulated", "recorded" or "predicted". low, high
    [J]: 90 % interval of the energy, alike where there is none. cycles: how many the recording
    holds. modes, steps: shares by power mode and by movement or pause; the sum of either is the
    cycle's energy. savings: what the plan saves of the common program, pauses at full length; None
    where it is not known. notes: sentences that limit the figures. drives_only: joules are those of
    drives and tool, as nobody knows what the controller draws. computed: what nobody drove of a
    cycle that was driven, the rest of its shortened pauses; None where all was driven. basis: what
    powers at rest are from. own: the planned program as its steps are, where the cycle is that of
    the same stops in the common program's time; None elsewhere.
    """

    name: str
    origin: str
    seconds: float
    energy: float
    low: float
    high: float
    cycles: float = 1.0
    modes: Mapping[str, Share] = field(default_factory=dict)
    steps: Mapping[str, Share] = field(default_factory=dict)
    savings: ProgramSavings | None = None
    notes: tuple[str, ...] = ()
    drives_only: bool = False
    computed: Share | None = None
    basis: str = ""
    own: Share | None = None

    @property
    def pace(self) -> float:
        """Seconds from one cycle of a year to the next: those of the program that it is held
        against, as both make as many, but not less than its own.
        """
        if self.savings is None:
            return self.seconds
        return max(self.savings.total.seconds, self.seconds)

    @property
    def supply(self) -> str:
        """DRIVES_ONLY, or "" where the energy is that of the mains."""
        return DRIVES_ONLY if self.drives_only else ""


def production_of(analysis: Analysis) -> Production | None:
    """The cycle of what was driven, else of what was planned; None without a whole cycle of known
    energy (`without_production` says why).
    """
    cycle = _cycle_of(analysis)
    if cycle is None or not drives_only(analysis):
        return cycle
    note = f"{DRIVES_ONLY}: the mains give more, and what the controller draws at rest isn't known"
    return replace(
        cycle,
        name=f"{cycle.name}, {DRIVES_ONLY}",
        notes=(*cycle.notes, note),
        drives_only=True,
    )


def drives_only(analysis: Analysis) -> bool:
    """Whether the joules are computed for a robot whose controller has no figures."""
    cell = analysis.cell
    computed = analysis.program is None or analysis.recording.origin == "simulated"
    return cell is not None and not cell.robot.controller.counted and computed


def _cycle_of(analysis: Analysis) -> Production | None:
    """The driven program's, else the planned one's; None where there is neither."""
    if analysis.program is not None:
        return _driven_cycle(analysis, analysis.program)
    planned = analysis.recording.planned
    if planned_share(planned) is not None:
        return _predicted_production(analysis, planned)
    savings = analysis.savings
    if savings is None or savings.total.seconds <= 0.0:
        return None
    total = savings.total
    parts = {"movements": savings.movements, "pauses": savings.pauses}
    return Production(
        "planned in the common program's time, predicted",
        PREDICTED,
        total.seconds,
        total.planned,
        total.planned,
        total.planned,
        steps={name: Share(name, s.seconds, s.planned) for name, s in parts.items() if s.seconds},
        savings=savings,
    )


def without_production(analysis: Analysis) -> str:
    """Why a recording has no cycle in production."""
    if analysis.program is None:
        return "it holds neither a program that was driven nor a plan with its savings"
    if not math.isfinite(analysis.program.whole.energy):
        return "the energy of its program was not recorded"
    return f"its program was not driven to the end: {_ended(analysis)}"


def _ended(analysis: Analysis) -> str:
    total = max(analysis.steps[0].step.total, 1)
    ended = sum(result.step.outcome == ENDED for result in analysis.steps)
    return f"{ended % total or total} of {total} steps ended"


def _driven_cycle(analysis: Analysis, program: ProgramTotals) -> Production | None:
    """The mean cycle of what was driven; of a route that of a part, the line full."""
    steps = analysis.steps
    ended = sum(result.step.outcome == ENDED for result in steps)
    programs = ended / max(steps[0].step.total, 1)
    cycles = programs * _cycles_of_program(analysis.recording)
    whole = program.whole
    if programs < 1.0 or not math.isfinite(whole.energy) or whole.seconds <= 0.0:
        return None
    notes = []
    if programs != round(programs):
        notes.append(
            f"its last cycle was not driven to the end ({_ended(analysis)}): it counts as "
            f"{cycles % 1.0:.2f} of one"
        )
    if analysis.tending is not None:
        return _tended(analysis, analysis.tending, whole, notes)
    name = "this run" if cycles == 1.0 else f"mean of {cycles:.3g} cycles of this run"
    full = program.unshortened
    if full is not None and math.isnan(full.energy):
        notes.append("the pauses of the run are shortened: its year is one of such cycles")
        name = f"{name}, its pauses shortened"
        full = None
    elif full is not None:
        name = "cycle with full pauses, computed from this run and the data"
    savings = _full_savings(analysis.savings, full)
    energy = (full.energy if full is not None else whole.energy) / cycles
    seconds = (full.seconds if full is not None else whole.seconds) / cycles
    computed = None
    if full is not None:
        computed = Share(
            FULL_PAUSES,
            sum(pause.seconds for pause in full.added) / cycles,
            sum(pause.energy for pause in full.added) / cycles,
        )
    mean = _Mean(analysis, full, seconds, energy, cycles, _all_of(analysis))
    return Production(
        name,
        analysis.recording.origin,
        seconds,
        energy,
        energy,
        energy,
        cycles,
        _modes(mean),
        _steps(mean),
        savings.of_part(cycles / programs) if savings is not None else None,
        tuple(notes),
        computed=computed,
        basis=rest_basis(measured=rest_measured(analysis)) if computed is not None else "",
    )


def _cycles_of_program(recording: Recording) -> int:
    """Whole cycles that a program of several is made of; 1 where the recording doesn't say it."""
    said = recording.fact(contents.CYCLES)
    return int(said) if said.isdecimal() and int(said) > 0 else 1


def _tended(analysis: Analysis, tending: Tending, whole: Share, notes: Sequence[str]) -> Production:
    """The mean part while the line was full; of all parts where it never was."""
    parts = tending.steady or tending.parts
    count = len(parts)
    seconds = sum(part.span.seconds for part in parts) / count
    energy = sum(part.joules for part in parts) / count
    cycle = _Mean(analysis, None, seconds, energy, count, _counted(analysis))
    filled = "with the line full" if tending.steady else "while the line was filled"
    mean = "the part" if count == 1 else f"mean of {count} parts"
    return Production(
        f"{mean} {filled}",
        analysis.recording.origin,
        seconds,
        energy,
        energy,
        energy,
        whole.seconds / seconds,
        _modes(cycle),
        _steps(cycle),
        _of_parts(analysis.savings, tending),
        tuple(notes),
    )


def _of_parts(savings: ProgramSavings | None, tending: Tending) -> ProgramSavings | None:
    """Savings of a part; None where they are of another program than the parts of a full line."""
    if savings is None or not tending.steady:
        return None
    planned = sum(part.planned_seconds for part in tending.steady) / len(tending.steady)
    return savings if abs(savings.total.seconds - planned) < _OF_A_PART * planned else None


_OF_A_PART = 0.1  # of a part's time


def _all_of(analysis: Analysis) -> Span:
    """The time of the program."""
    return Span(analysis.steps[0].step.start, analysis.steps[-1].step.end)


def _counted(analysis: Analysis) -> Span:
    """The time of the cycles that the mean cycle is of: of a route while the line was full."""
    if analysis.tending is None:
        return _all_of(analysis)
    parts = analysis.tending.steady or analysis.tending.parts
    return Span(parts[0].span.begin, parts[-1].span.end)


@dataclass(frozen=True)
class _Mean:
    """A mean cycle: seconds and energy [J] of one, and how many of them a time of the recording
    holds, with what full lengths of shortened pauses add to it.
    """

    analysis: Analysis
    full: Unshortened | None
    seconds: float
    energy: float
    cycles: float
    time: Span


def _modes(mean: _Mean) -> dict[str, Share]:
    """Shares of the modes in a time; readings at its ends count by their part."""
    power = mean.analysis.recording.power
    if power is None or len(power.time) < 2:
        return {}
    since = np.concatenate((power.time[:1], power.time[:-1]))
    inside = np.minimum(power.time, mean.time.end) - np.maximum(since, mean.time.begin)
    known = (inside > 0.0) & np.isfinite(power.power)
    rows = []
    for number in np.unique(power.mode[known]).tolist():
        own = known & (power.mode == number)
        joules_of = float((power.power[own] * inside[own]).sum())
        rows.append((mode_name(int(number)), float(inside[own].sum()), joules_of))
    if mean.full is not None:
        rows += [(pause.mode, pause.seconds, pause.energy) for pause in mean.full.added]
    found = _summed(rows, mean.cycles)
    # the sums are those of the cycle, whatever the meter's counter rounds
    times = mean.seconds / (sum(share.seconds for share in found.values()) or 1.0)
    joules = mean.energy / (sum(share.energy for share in found.values()) or 1.0)
    return {
        name: Share(name, share.seconds * times, share.energy * joules)
        for name, share in found.items()
    }


def _added(program: ProgramTotals | None) -> tuple[FullPause, ...]:
    """What the full lengths of shortened pauses add to a run."""
    full = program.unshortened if program is not None else None
    return full.added if full is not None else ()


def _steps(mean: _Mean) -> dict[str, Share]:
    """Shares of the movements and pauses in a time, and of the waiting between them."""
    rows = [
        (result.step.label, result.seconds, result.energy)
        for result in mean.analysis.steps
        if mean.time.begin <= result.step.start <= mean.time.end
    ]
    if mean.full is not None:
        rows += [
            (mean.analysis.steps[pause.step].step.label, pause.seconds, pause.energy)
            for pause in mean.full.added
        ]
    found = _summed(rows, mean.cycles)
    if all(math.isfinite(joules) for _, _, joules in rows):
        between = mean.seconds - sum(share.seconds for share in found.values())
        joules = mean.energy - sum(share.energy for share in found.values())
        if between > _STAMP:
            found[WAITING] = Share(WAITING, between, joules)
    return found


_STAMP = 1e-6  # s: stamps of messages are no finer


def _summed(rows: Iterable[tuple[str, float, float]], cycles: float = 1.0) -> dict[str, Share]:
    found: dict[str, Share] = {}
    for name, time, energy in rows:
        before = found.get(name, Share(name, 0.0, 0.0))
        joules = energy if math.isfinite(energy) else 0.0
        found[name] = Share(name, before.seconds + time / cycles, before.energy + joules / cycles)
    return found


def _full_savings(
    savings: ProgramSavings | None, full: Unshortened | None
) -> ProgramSavings | None:
    """The savings with pauses at full length, predicted: the interval of the pauses is over the
    robots that the planner's are over.
    """
    if savings is None or full is None or not full.added:
        return savings
    rested = savings.pauses
    pauses = Saving(
        rested.common + sum(pause.common_energy for pause in full.added),
        rested.planned + sum(pause.predicted_energy for pause in full.added),
        rested.seconds + sum(pause.planned_seconds for pause in full.added),
    )
    added = np.sum([pause.saved_added for pause in full.added], axis=0)
    low, high = interval_over(pauses.saved, np.asarray(added))
    return replace(savings, pauses=replace(pauses, saved_low=low, saved_high=high))


# Beside the cycle: the largest quarter of an hour, and rest while nobody works.


def driven_and_predicted(analysis: Analysis) -> tuple[float, float]:
    """Joules of all that was driven, waiting included, and what was predicted of it; NaN where one
    is not known.
    """
    program = analysis.program
    if program is None:
        return math.nan, math.nan
    planned = program.planned_movements.energy + program.planned_pauses.energy
    return program.whole.energy, planned if planned > 0.0 else math.nan


def deviation(driven: float, predicted: float) -> float:
    """How much more was driven than predicted [J], as a share of what was predicted; NaN where one
    is not known. Every page has it of the runs as they were driven, waits between steps included.
    """
    return driven / predicted - 1.0 if predicted > 0.0 else math.nan


def demand_watts(analysis: Analysis, cycle: Production) -> float:
    """The largest mean power [W] of a quarter of an hour of cycles, one after the other.

    The steps and the waits between them draw their mean power, in their order. They are those that
    the cycle is the mean of, so no cycle takes more on average; one that fits a quarter of an hour
    often has little more than its mean.
    """
    rows = stretches(analysis)
    seconds = np.array([time for time, _ in rows])
    joules = np.array([energy for _, energy in rows])
    if not len(rows) or seconds.sum() <= 0.0 or not np.isfinite(joules).all():
        return cycle.energy / cycle.seconds
    return largest_quarter(seconds, joules)


def stretches(analysis: Analysis) -> list[tuple[float, float]]:
    """Seconds and joules of the steps of all cycles that production counts, and of the waits
    between them, in their order; pauses at full length.
    """
    power = analysis.recording.power
    if analysis.program is None:
        planned = [(step.duration, step.report.energy) for step in analysis.recording.planned]
        return [*planned, *_beyond_steps(production_of(analysis))]
    if power is None or len(power.time) < 2:
        return []
    span = _counted(analysis)
    meter = Meter(power)
    added = _added(analysis.program) if analysis.tending is None else ()
    longer = {pause.step: pause for pause in added}
    rows = []
    turn = span.begin
    for place, result in enumerate(analysis.steps):
        start = max(result.step.start, turn)
        end = min(result.step.end, span.end)
        if end <= start:
            continue
        rows.append((start - turn, meter.energy(turn, start)))
        pause = longer.get(place)
        more = (pause.seconds, pause.energy) if pause is not None else (0.0, 0.0)
        rows.append((end - start + more[0], meter.energy(start, end) + more[1]))
        turn = end
    rows.append((span.end - turn, meter.energy(turn, span.end)))
    return [row for row in rows if row[0] > 0.0]


def _beyond_steps(cycle: Production | None) -> list[tuple[float, float]]:
    """Seconds and joules of a plan's cycle beyond its steps: none but in another program's time."""
    if cycle is None or cycle.own is None:
        return []
    return [(cycle.seconds - cycle.own.seconds, cycle.energy - cycle.own.energy)]


def idle_watts(analysis: Analysis) -> dict[str, float]:
    """W at rest at machine home in each power mode that the controller has, with what the program
    holds at its end, by the data; empty where the recording has no cell, or its controller has no
    figures.
    """
    cell = analysis.cell
    if cell is None or not cell.robot.controller.counted:
        return {}
    data, _ = recorded_power_data(analysis.recording, cell)
    return home_watts(cell, _ends_with(analysis), data)


def _ends_with(analysis: Analysis) -> str:
    """The load that the program ends with."""
    ends = [step.load for step in analysis.recording.planned[-1:]]
    ends += [result.step.movement.load for result in analysis.steps[-1:]]
    return ends[-1] if ends else NO_LOAD


def rest_saving(analysis: Analysis) -> Amount | None:
    """W that hibernation saves over closed brakes at machine home, of the robot of a recording;
    None where its rest isn't known.
    """
    cell = analysis.cell
    rests = idle_watts(analysis)
    if cell is None or not rests:
        return None
    data, _ = recorded_power_data(analysis.recording, cell)
    return saved_at_rest(cell, _ends_with(analysis), data)


def saved_at_rest(cell: Cell, load: str, data: PowerData) -> Amount:
    """W that hibernation saves over closed brakes at machine home with a load. Its 90 % interval is
    over robots drawn from the data sheet; where both were measured there is none.
    """
    rests = home_watts(cell, load, data)
    saved = rests[BRAKES] - rests[HIBERNATION]
    if all_rests_measured(data):
        return Amount.of_value(saved)
    robots = Predictor(cell.robot, data.dc_link, cell.base_pose, data_sheet_of(cell.robot, data))
    brakes, deepest = (
        robots.added_at_rest(mode, cell.machine_home, carried(cell, load))
        for mode in (BRAKES, HIBERNATION)
    )
    return Amount(saved, *interval_over(saved, brakes - deepest))


def rest_basis(*, measured: bool) -> str:
    """What powers at rest are from, in words."""
    return "from measured powers" if measured else "from the data sheet, not measured"


def rest_measured(analysis: Analysis) -> bool:
    """Whether the powers of rest in the recording's data were measured."""
    return all_rests_measured(recorded_power_data(analysis.recording, analysis.cell)[0])


def all_rests_measured(data: PowerData) -> bool:
    """Whether a table of measured rests knows each mode that the controller rests in."""
    return all(data.measured_rest(mode) is not None for mode in REST_MODES)


def home_watts(cell: Cell, load: str, data: PowerData) -> dict[str, float]:
    """W at rest at machine home with a load, in each power mode that the controller has."""
    loads = carried(cell, load)
    return {
        mode: resting_watts(mode, cell.robot.machine_home, cell, loads, data) for mode in REST_MODES
    }


# A plan that was not driven.

_PARTS = {"whole": (True, False), "movements": (False,), "pauses": (True,)}


def planned_share(steps: Sequence[PlannedMovement], part: str = "whole") -> Share | None:
    """Time and energy of the whole program, its movements or its pauses; None for no plan or
    another part.
    """
    if not steps or part not in _PARTS:
        return None
    own = [step for step in steps if step.is_pause in _PARTS[part]]
    return Share(part, sum(step.duration for step in own), sum(step.report.energy for step in own))


def planned_interval(recording: Recording) -> tuple[float, float] | None:
    """90 % interval of the whole energy [J] of what was planned, as the planner said it; without
    its word that of the steps' ends added up; None where the plan has none.
    """
    if recording.planned_interval is not None:
        return recording.planned_interval
    steps = recording.planned
    low, high = (
        sum(getattr(step.report, name) for step in steps) for name in ("energy_low", "energy_high")
    )
    return (low, high) if high > low else None


def planned_clearance(steps: Sequence[PlannedMovement]) -> float:
    """The least clearance of the movements [m], NaN without any."""
    return min((step.report.min_clearance for step in steps if not step.is_pause), default=math.nan)


def _predicted_production(
    analysis: Analysis, planned: Sequence[PlannedMovement]
) -> Production | None:
    """The year of a program that was planned, None where it has no joules."""
    whole = planned_share(planned)
    if whole is None or whole.seconds <= 0.0 or not math.isfinite(whole.energy):
        return None
    modes = _summed(
        (
            (step.power_mode or NO_MODE) if step.is_pause else PLANNED_MOVING,
            step.duration,
            step.report.energy,
        )
        for step in planned
    )
    steps = _summed((step_label(step), step.duration, step.report.energy) for step in planned)
    low, high = planned_interval(analysis.recording) or (whole.energy, whole.energy)
    found = Production(
        "planned program, predicted",
        PREDICTED,
        whole.seconds,
        whole.energy,
        low,
        high,
        modes=modes,
        steps=steps,
        savings=analysis.savings,
    )
    held = analysis.savings
    return found if held is None or held.common_seconds > 0.0 else _paced(found, held.total)


def _paced(plan: Production, total: Saving) -> Production:
    """A plan in the seconds of the program that it is held against: what it takes then, slower or
    with a wait at its end, counts as movement.
    """
    seconds = total.seconds - plan.seconds
    energy = total.planned - plan.energy
    if total.seconds <= 0.0:
        return plan
    rows = [(share.name, share.seconds, share.energy) for share in plan.modes.values()]
    steps = {**plan.steps, SLOWER: Share(SLOWER, seconds, energy)}
    return replace(
        plan,
        name="planned program, in the time of the common one, predicted",
        seconds=total.seconds,
        energy=total.planned,
        low=plan.low + energy,
        high=plan.high + energy,
        modes=_summed([*rows, (PLANNED_MOVING, seconds, energy)]),
        steps=steps,
        own=Share("planned program, as fast as pays", plan.seconds, plan.energy),
    )


# What could be saved at most, and by what: the levers of a cycle, the biggest first.
#
# Each is an upper bound by itself from figures of the run; together they count some joules twice.

_STANDING = ("", "STAND_ON_MOTORS")
FASTER = 0.1  # share of the moving time that a shorter layout or a quicker program might save


@dataclass(frozen=True)
class Lever:
    """Up to so many joules of a cycle; means: what would save them; basis: how they are
    computed.
    """

    name: str
    joules: float
    means: str
    basis: str


def levers(analysis: Analysis, most: int = 5) -> tuple[Lever, ...]:
    """The biggest levers of a cycle that was driven; none where energies are missing."""
    flows = energy_flows(analysis)
    cycle = production_of(analysis)
    if flows is None or not flows.known or analysis.program is None or cycle is None:
        return ()
    found = [
        replace(lever, joules=lever.joules / cycle.cycles)
        for lever in [*_drive_levers(flows), *_time_levers(analysis)]
    ]
    real = [lever for lever in found if math.isfinite(lever.joules) and lever.joules >= 1.0]
    return tuple(sorted(real, key=lambda lever: -lever.joules)[:most])


def _drive_levers(flows: EnergyFlows) -> list[Lever]:
    """What smaller losses of the drives could save."""
    return [
        Lever(
            "heat in the brake resistor",
            flows.resistor,
            "brake one axis while another accelerates, a larger capacitor, or a supply that "
            "feeds back",
            "all of it",
        ),
        Lever(
            "friction of gears and bearings",
            flows.friction * (1.0 - (1.0 - FASTER) ** 2) if flows.split else math.nan,
            "shorter paths and lower speeds",
            "a tenth less speed, friction in proportion to its square",
        ),
        Lever(
            "losses of motors and inverters",
            flows.motors * (1.0 - (1.0 - FASTER) ** 2) if flows.split else math.nan,
            "gentler acceleration, postures that hold less torque",
            "a tenth less torque, losses in proportion to its square",
        ),
    ]


def _time_levers(analysis: Analysis) -> list[Lever]:
    """What less time in movements and in pauses could save."""
    least = min(idle_watts(analysis).values(), default=0.0)
    moving = sum(result.base_energy for result in analysis.movements)
    pauses = [result for result in analysis.steps if result.step.movement.is_pause]
    standing = sum(r.energy for r in pauses if r.step.movement.power_mode in _STANDING)
    resting = sum(
        max(r.energy - least * r.seconds, 0.0)
        for r in pauses
        if r.step.movement.power_mode not in _STANDING
    )
    program = analysis.program
    waiting = program.waiting.energy if program is not None else math.nan
    for pause in _added(program):
        own = analysis.steps[pause.step].step.movement.power_mode
        standing += pause.energy if own in _STANDING else 0.0
        resting += 0.0 if own in _STANDING else max(pause.energy - least * pause.seconds, 0.0)
    return [
        Lever(
            "controller, drives and tool while the robot moves",
            FASTER * float(np.nan_to_num(moving)),
            "a shorter cycle: fewer or shorter movements",
            "a tenth less time in movements",
        ),
        Lever(
            "stops with the motors on",
            standing,
            "shorter stops; brakes closed earlier by the controller's timer",
            "all of it",
        ),
        Lever(
            "pauses in a power mode",
            resting,
            "deeper modes, earlier, woken later; a tool that can be switched off",
            "what they take above the deepest mode at machine home",
        ),
        Lever(WAITING, waiting, "machines and nodes that answer sooner", "all of it"),
    ]
