"""When nobody works: what the robot draws outside of the shifts, by power mode, and what its
deepest one saves of a year.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ir_description import Cell
from ir_recorder.analysis import Analysis
from ir_recorder.analysis.production import (
    HIBERNATION,
    LEFT_ALONE,
    Amount,
    idle_watts,
    production_of,
    rest_basis,
    rest_measured,
    rest_saving,
)
from ir_recorder.report.money_text import (
    NOTHING,
    money,
    yearly_money,
)
from ir_recorder.report.number_text import (
    kilograms,
    kilowatt_hours,
    significant,
    text,
    watts,
)
from ir_recorder.report.prices import J_PER_KWH, Costs
from ir_recorder.report.quarter_hour import quarter_sentence
from ir_recorder.report.tables import COMPACT, table


def clock_section(analysis: Analysis, costs: Costs) -> str:
    """Section of the page; "" where no whole cycle is known."""
    cycle = production_of(analysis)
    if cycle is None:
        return ""
    return (
        '<section id="around"><h2>When nobody works</h2>'
        f"{_idle(analysis, costs)}"
        f'<p class="hint">{quarter_sentence(analysis, cycle, costs)}</p></section>'
    )


def _idle(analysis: Analysis, costs: Costs) -> str:
    """What the robot draws while nobody works, by power mode."""
    found = idle_watts(analysis)
    if analysis.cell is not None and not analysis.cell.robot.controller.counted:
        return (
            '<p class="hint">What the robot takes when nobody works isn\'t known: its controller '
            "has no figures.</p>"
        )
    if not found or costs.idle_hours <= 0.0:
        return ""
    saving = recorded_idle_saving(analysis, costs)
    seconds_idle = costs.idle_hours * 3600.0
    rows = [
        (
            text(mode.replace("_", " ").lower()) + (_TODAY if mode == LEFT_ALONE else ""),
            watts(power),
            f"<b>{text(idle_money(power * seconds_idle, costs))}</b>"
            f"<small>{kilowatt_hours(power * seconds_idle)}</small>",
        )
        for mode, power in found.items()
    ]
    heads = ("when nobody works", ">power", ">a year")
    return (
        f"{table(heads, rows, 'When nobody works', COMPACT)}"
        f'<p class="hint">{significant(costs.idle_hours, 6)} hours a year lie outside of the '
        f"shifts, at machine home. {text(idle_sentence(saving, costs))} "
        f"{text(how_to_hibernate(analysis.cell))}</p>"
    )


_TODAY = "<small>today: what the controller does if left alone</small>"


def idle_money(energy: float, costs: Costs) -> str:
    """Price of so many joules outside of the shifts."""
    return money(energy / J_PER_KWH * costs.idle_price, costs.currency)


@dataclass(frozen=True)
class IdleSaving:
    """Money of a year outside of the shifts: the controller left alone, and in its deepest mode;
    and the power of both [W], through so many hours, each at a price. saves [W]: the difference
    with its interval. measured: whether both powers were.
    """

    mode: str
    watts_left_alone: float
    watts_deepest: float
    saves: Amount
    hours: float
    price: float
    measured: bool = False

    @property
    def energy(self) -> Amount:
        """What the deepest mode saves [J]."""
        return self.saves.times(self.hours * 3600.0)

    @property
    def money(self) -> Amount:
        """What the deepest mode saves."""
        return self.saves.of(self._money)

    @property
    def left_alone(self) -> float:
        """Money of the controller left alone."""
        return self._money(self.watts_left_alone)

    @property
    def deepest(self) -> float:
        """Money in the deepest mode."""
        return self._money(self.watts_deepest)

    def _money(self, watts: float) -> float:
        return watts * self.hours / 1000.0 * self.price

    @property
    def basis(self) -> str:
        """What the powers rest on, in words."""
        return rest_basis(measured=self.measured)

    @property
    def saved(self) -> float:
        """What the deepest mode saves, in money."""
        return self.money.value


@dataclass(frozen=True)
class SavedYear:
    """What is saved of a year in shifts and outside of them: money, and energy [J]."""

    money: Amount
    energy: Amount

    def with_energy(self, costs: Costs) -> str:
        """Energy and CO2 in words; "" where they go the other way than the money."""
        word, energy = self.energy.gain()
        if word != self.money.gain()[0]:
            return ""
        return f"{kilowatt_hours(energy.value)}, {kilograms(costs.co2(energy.value))} CO2"


def saved_year(saved: Amount, idle: IdleSaving | None, costs: Costs) -> SavedYear:
    """The saving in shifts [J] with that outside of them."""
    shifts = saved.of(costs.money)
    if idle is None:
        return SavedYear(shifts, saved)
    return SavedYear(shifts.plus(idle.money), saved.plus(idle.energy))


def idle_saving(
    watts_at_rest: Mapping[str, float],
    saves: Amount | None,
    costs: Costs,
    *,
    measured: bool = False,
) -> IdleSaving | None:
    """What hibernation saves outside of the shifts; None where a power of rest [W] is not known, or
    it saves nothing. saves [W]: over closed brakes. measured: whether the powers were.
    """
    known = {LEFT_ALONE, HIBERNATION} <= set(watts_at_rest)
    if not known or saves is None or costs.idle_hours <= 0.0:
        return None
    rests = watts_at_rest[LEFT_ALONE], watts_at_rest[HIBERNATION]
    found = IdleSaving(
        HIBERNATION.lower(), *rests, saves, costs.idle_hours, costs.idle_price, measured
    )
    return found if found.saved >= NOTHING else None


def recorded_idle_saving(analysis: Analysis, costs: Costs) -> IdleSaving | None:
    """The same of the robot of a recording, by its data."""
    measured = rest_measured(analysis)
    return idle_saving(idle_watts(analysis), rest_saving(analysis), costs, measured=measured)


def idle_sentence(found: IdleSaving | None, costs: Costs) -> str:
    """The same in words; "" without it."""
    if found is None:
        return ""
    return (
        f"Outside of shifts: {found.mode} instead of closing the brakes saves "
        f"{yearly_money(found.saved, costs.currency)} a year, {found.basis}."
    )


def how_to_hibernate(cell: Cell | None) -> str:
    """Who puts the robot into hibernation, how long that takes and what to look after; "" where the
    controller has no such input.
    """
    controller = None if cell is None else cell.robot.controller
    if controller is None or _HIB not in (bit.name for bit in controller.plc_inputs):
        return ""
    mode = controller.mode(HIBERNATION)
    return (
        f"How: the PLC sets the input {_HIB} of the controller when work ends "
        f"({mode.time_to_pause:g} s), and wakes it over the network "
        f"{mode.regular_time_to_operate:g} s before the next begins; meanwhile the controller "
        "isn't on the network, and one that isn't woken in time delays the first cycle."
    )


_HIB = "HIB"
