"""Power modes: their table, the state machine, how long transitions take, and PROFIenergy's choice."""
from ir_msgs_py.modes import DRIVES_ON, MODES, ModeRow, OFF_THE_NETWORK, READY, RESTS, REST_OF_BIT, ROW

from ir_sim_driver.power.power_modes import NO_DEMAND, Demand, PowerModes
from ir_sim_driver.power.profienergy import PAUSE_MAX, best_mode, energy_of, mode_table
from ir_sim_driver.power.transitions import Times, TransitionSettings, times_of

__all__ = [
    "DRIVES_ON",
    "MODES",
    "NO_DEMAND",
    "OFF_THE_NETWORK",
    "PAUSE_MAX",
    "READY",
    "RESTS",
    "REST_OF_BIT",
    "ROW",
    "Demand",
    "ModeRow",
    "PowerModes",
    "Times",
    "TransitionSettings",
    "best_mode",
    "energy_of",
    "mode_table",
    "times_of",
]
