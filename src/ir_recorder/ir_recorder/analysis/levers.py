"""What could be saved at most, and by what: the levers of a program, the biggest first.

Each is an upper bound by itself from figures of the run; together they count some joules twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ir_recorder.analysis.flows import EnergyFlows, energy_flows
from ir_recorder.analysis.results import Analysis

_STANDING = ("", "STAND_ON_MOTORS")
FASTER = 0.1  # share of the moving time that a shorter layout or a quicker program might save


@dataclass(frozen=True)
class Lever:
    """Up to so many joules of the run; means: what would save them; basis: how they are
    computed.
    """

    name: str
    joules: float
    means: str
    basis: str


def levers(analysis: Analysis, most: int = 5) -> tuple[Lever, ...]:
    """The biggest levers of an executed program; none where energies are missing."""
    flows = energy_flows(analysis)
    if flows is None or not flows.known or analysis.program is None:
        return ()
    found = [*_drive_levers(flows), *_time_levers(analysis)]
    real = [lever for lever in found if math.isfinite(lever.joules) and lever.joules >= 1.0]
    return tuple(sorted(real, key=lambda lever: -lever.joules)[:most])


def _drive_levers(flows: EnergyFlows) -> list[Lever]:
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
    moving = sum(result.base_energy for result in analysis.movements)
    pauses = [result for result in analysis.steps if result.step.movement.is_pause]
    standing = sum(r.energy for r in pauses if r.step.movement.power_mode in _STANDING)
    resting = sum(r.energy for r in pauses if r.step.movement.power_mode not in _STANDING)
    program = analysis.program
    waiting = program.waiting.energy if program is not None else math.nan
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
            "all of it",
        ),
        Lever(
            "waiting between steps", waiting, "machines and nodes that answer sooner", "all of it"
        ),
    ]
