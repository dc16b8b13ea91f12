"""Savings of a program and points of its Pareto front, to and from messages."""

from __future__ import annotations

from ir_msgs.msg import ProgramPoint as ProgramPointMsg
from ir_msgs.msg import ProgramSavings as ProgramSavingsMsg
from ir_msgs.msg import Saving as SavingMsg
from ir_msgs_py.savings import ProgramPoint, ProgramSavings, Saving


def saving_to_msg(saving: Saving) -> SavingMsg:
    """Common and planned joules with their share."""
    return SavingMsg(
        common=saving.common,
        planned=saving.planned,
        seconds=saving.seconds,
        share=saving.share,
        saved_low=saving.saved_low,
        saved_high=saving.saved_high,
    )


def program_savings_to_msg(savings: ProgramSavings) -> ProgramSavingsMsg:
    """The three figures."""
    return ProgramSavingsMsg(
        available=savings.available,
        movements=saving_to_msg(savings.movements),
        pauses=saving_to_msg(savings.pauses),
        total=saving_to_msg(savings.total),
        across=savings.across,
        around=savings.around,
        program_id=savings.program_id,
        sentence=savings.sentence,
    )


def program_savings_from_msg(msg: ProgramSavingsMsg) -> ProgramSavings:
    """The three figures."""
    return ProgramSavings(
        available=msg.available,
        movements=_saving(msg.movements),
        pauses=_saving(msg.pauses),
        total_low=msg.total.saved_low,
        total_high=msg.total.saved_high,
        across=msg.across,
        around=msg.around,
        program_id=msg.program_id,
        sentence=msg.sentence,
    )


def program_point_to_msg(point: ProgramPoint) -> ProgramPointMsg:
    """A point of a front."""
    return ProgramPointMsg(
        cycle_time=point.cycle_time, energy=point.energy, program_id=point.program_id
    )


def program_point_from_msg(msg: ProgramPointMsg) -> ProgramPoint:
    """A point of a front."""
    return ProgramPoint(msg.cycle_time, msg.energy, msg.program_id)


def _saving(msg: SavingMsg) -> Saving:
    return Saving(msg.common, msg.planned, msg.seconds, msg.saved_low, msg.saved_high)
