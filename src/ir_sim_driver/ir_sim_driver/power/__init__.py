"""Power modes at work: their state machine, how long each lasts, and PROFIenergy's choice for a
pause.
"""

from ir_sim_driver.power.power_modes import Demand, IdleTimes, PowerModes
from ir_sim_driver.power.profienergy import (
    PAUSE_MAX,
    Charging,
    best_route,
    charging_of,
    mode_table,
    uncharged,
)

__all__ = [
    "PAUSE_MAX",
    "Charging",
    "Demand",
    "IdleTimes",
    "PowerModes",
    "best_route",
    "charging_of",
    "mode_table",
    "uncharged",
]
