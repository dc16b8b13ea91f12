"""How far above the best an answer can be: of its cost, what lies above a lower bound, in percent.

The bound is that of the chains (station_graph), less what carried charge could save: at most the
capacitor's energy per movement. Within a cycle time it is the Lagrangian one: no chain costs less
at a value of a second than the best one at that value, so none has less energy than that leaves of
any time spent moving.
"""

import numpy as np

from ir_planner.program.choice import Choice, Found, Steps
from ir_planner.program.movements import rates_of

_SHARES = 128  # of a cycle that may be spent moving, at which the bound is looked at


def free_gap(choice: Choice, found: Found, steps: Steps) -> float:
    """Gap [%] of a program without a cycle time."""
    context = choice.movements.context
    chain = choice.chain
    rates = rates_of(context)
    if rates.joule == 0.0 or context.options.objective == "movement_cost" or not found:
        return 100.0 * chain.gap
    alone = sum(movement.energy.total for movement in found.values())
    received = alone - sum(step.report.energy for step in steps if not step.is_pause)
    return _above(chain.cost - received, chain.bound - could_be_carried(choice, len(found)))


def cycle_gap(choice: Choice, count: int, energy: float, bound: float) -> float:
    """Gap [%] of a program of `count` movements within a cycle time: its energy at the mains
    without the pauses in it, and the `bound` of `cycle_bound` [J].
    """
    return _above(energy, bound - could_be_carried(choice, count))


def cycle_bound(choice: Choice, least: float, value: float, seconds: float) -> float:
    """Least energy [J] at the mains of movements and wait in a cycle of `seconds`, where no chain
    costs less than `least` at a value of a second [W].
    """
    base = choice.movements.context.scene.base_watts
    waits = np.linspace(0.0, seconds, _SHARES + 1)
    standing = np.array([choice.waiting(float(wait)) if wait > 0.0 else 0.0 for wait in waits])
    moving = seconds - waits
    return float((least + (base - value) * moving + standing).min())


def could_be_carried(choice: Choice, count: int) -> float:
    """What charge can save [J] at most over `count` movements."""
    bus = choice.movements.context.scene.dc_bus
    return bus.capacity_energy * max(count - 1, 0) if bus.regeneration != "none" else 0.0


def _above(cost: float, bound: float) -> float:
    return 100.0 * max(cost - max(bound, 0.0), 0.0) / cost if cost > 0.0 else 0.0
