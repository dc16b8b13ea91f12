"""The robot that is controlled: a port with its backends, plants, drives, the load, and the mains
meter.
"""

from ir_sim_driver.plant.backend import STANDING, Backend, MotorWork
from ir_sim_driver.plant.backends import BACKENDS, make_backend
from ir_sim_driver.plant.control import ControlSettings
from ir_sim_driver.plant.ideal_backend import IdealBackend
from ir_sim_driver.plant.loads import CUSTOM, Carried, carried, custom_load
from ir_sim_driver.plant.plant_parameters import NOMINAL, Plant, nominal_plant, standing_watts
from ir_sim_driver.plant.plants import (
    IDEAL,
    TYPICAL,
    ideal_plant,
    plant_from_yaml,
    plant_hash,
    plant_named,
    plant_to_yaml,
    read_plant,
    typical_plant,
)
from ir_sim_driver.plant.power_meter import BasePower, MeterReading, PowerMeter
from ir_sim_driver.plant.pybullet_backend import PyBulletBackend
from ir_values.errors import DescriptionFileError

__all__ = [
    "BACKENDS",
    "CUSTOM",
    "IDEAL",
    "NOMINAL",
    "STANDING",
    "TYPICAL",
    "Backend",
    "BasePower",
    "Carried",
    "ControlSettings",
    "DescriptionFileError",
    "IdealBackend",
    "MeterReading",
    "MotorWork",
    "Plant",
    "PowerMeter",
    "PyBulletBackend",
    "carried",
    "custom_load",
    "ideal_plant",
    "make_backend",
    "nominal_plant",
    "plant_from_yaml",
    "plant_hash",
    "plant_named",
    "plant_to_yaml",
    "read_plant",
    "standing_watts",
    "typical_plant",
]
