"""Power modes at work: their state machine, how long each lasts, and PROFIenergy's choice for a
pause.
"""

from ir_sim_driver.power.power_modes import (
    NO_DEMAND,
    Demand,
    IdleTimes,
    PowerModes,
    Times,
    times_of,
)
from ir_sim_driver.power.profienergy import (
    PAUSE_MAX,
    Charging,
    best_mode,
    best_route,
    charging_of,
    energy_of,
    mode_table,
    uncharged,
)

__all__ = [
    "NO_DEMAND",
    "PAUSE_MAX",
    "Charging",
    "Demand",
    "IdleTimes",
    "PowerModes",
    "Times",
    "best_mode",
    "best_route",
    "charging_of",
    "energy_of",
    "mode_table",
    "times_of",
    "uncharged",
]
