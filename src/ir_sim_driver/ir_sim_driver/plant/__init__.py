"""The robot that is controlled: a port with its backends, plants, drives, the load, and the mains
meter.
"""

from ir_sim_driver.plant.backend import Backend, MotorWork
from ir_sim_driver.plant.backends import BACKENDS, make_backend
from ir_sim_driver.plant.loads import CUSTOM, Carried, carried, custom_load
from ir_sim_driver.plant.plant_parameters import NOMINAL, Plant, nominal_plant, standing_watts
from ir_sim_driver.plant.plants import (
    IDEAL,
    TYPICAL,
    ideal_plant,
    plant_hash,
    plant_named,
    plant_to_yaml,
    typical_plant,
)
from ir_sim_driver.plant.power_meter import BasePower, PowerMeter
from ir_sim_driver.plant.pybullet_backend import PyBulletBackend
from ir_sim_driver.plant.servo_control import ControlSettings

__all__ = [
    "BACKENDS",
    "CUSTOM",
    "IDEAL",
    "NOMINAL",
    "TYPICAL",
    "Backend",
    "BasePower",
    "Carried",
    "ControlSettings",
    "MotorWork",
    "Plant",
    "PowerMeter",
    "PyBulletBackend",
    "carried",
    "custom_load",
    "ideal_plant",
    "make_backend",
    "nominal_plant",
    "plant_hash",
    "plant_named",
    "plant_to_yaml",
    "standing_watts",
    "typical_plant",
]
