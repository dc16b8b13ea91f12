"""The cell: equipment with its stations, parts, the program, and what must hold between them."""

from ir_description.cell.cell import Cell, Task, check_posture
from ir_description.cell.checks import (
    BODIES_MAX,
    NameRegister,
    check_base_contact,
    check_contact,
    check_follows,
    check_part_mass,
    check_step,
    check_switch,
    shape_register,
)
from ir_description.cell.equipment import (
    APPROACH_MAX,
    SWITCH_MAX,
    ZONE_KINDS,
    ZONE_MAX,
    AllowedContact,
    Equipment,
    EquipmentState,
    StateSwitch,
    Station,
    Zone,
    station_at,
    zone_around,
)
from ir_description.cell.moving import cell_in, machine_in, sweep_speeds
from ir_description.cell.part import Part
from ir_description.cell.program import (
    AUTO,
    PAUSE_MAX,
    PAUSE_POWER_MODES,
    POSTURES,
    CellSignal,
    PartPlaces,
    ProgramStep,
)
from ir_description.cell.tool_path import CellPath

__all__ = [
    "APPROACH_MAX",
    "AUTO",
    "BODIES_MAX",
    "PAUSE_MAX",
    "PAUSE_POWER_MODES",
    "POSTURES",
    "SWITCH_MAX",
    "ZONE_KINDS",
    "ZONE_MAX",
    "AllowedContact",
    "Cell",
    "CellPath",
    "CellSignal",
    "Equipment",
    "EquipmentState",
    "NameRegister",
    "Part",
    "PartPlaces",
    "ProgramStep",
    "StateSwitch",
    "Station",
    "Task",
    "Zone",
    "cell_in",
    "check_base_contact",
    "check_contact",
    "check_follows",
    "check_part_mass",
    "check_posture",
    "check_step",
    "check_switch",
    "machine_in",
    "shape_register",
    "station_at",
    "sweep_speeds",
    "zone_around",
]
