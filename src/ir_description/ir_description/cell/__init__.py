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
    shape_register,
)
from ir_description.cell.equipment import (
    APPROACH_MAX,
    ZONE_KINDS,
    ZONE_MAX,
    AllowedContact,
    Equipment,
    EquipmentState,
    Station,
    Zone,
    station_at,
    zone_around,
)
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

__all__ = [
    "APPROACH_MAX",
    "AUTO",
    "BODIES_MAX",
    "PAUSE_MAX",
    "PAUSE_POWER_MODES",
    "POSTURES",
    "ZONE_KINDS",
    "ZONE_MAX",
    "AllowedContact",
    "Cell",
    "CellSignal",
    "Equipment",
    "EquipmentState",
    "NameRegister",
    "Part",
    "PartPlaces",
    "ProgramStep",
    "Station",
    "Task",
    "Zone",
    "check_base_contact",
    "check_contact",
    "check_follows",
    "check_part_mass",
    "check_posture",
    "check_step",
    "shape_register",
    "station_at",
    "zone_around",
]
