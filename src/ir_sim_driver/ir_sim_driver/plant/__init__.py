"""The robot that is controlled: a port with its backends, the drives, the load, and the mains meter."""

from ir_sim_driver.plant.backend import STANDING, Backend, Work
from ir_sim_driver.plant.backends import BACKENDS, make_backend
from ir_sim_driver.plant.control import ControlSettings
from ir_sim_driver.plant.ideal_backend import IdealBackend
from ir_sim_driver.plant.loads import CUSTOM, Carried, carried, custom_load
from ir_sim_driver.plant.power_meter import BasePower, MeterReading, PowerMeter
from ir_sim_driver.plant.pybullet_backend import PyBulletBackend

__all__ = [
    "BACKENDS",
    "CUSTOM",
    "STANDING",
    "Backend",
    "BasePower",
    "Carried",
    "ControlSettings",
    "IdealBackend",
    "MeterReading",
    "PowerMeter",
    "PyBulletBackend",
    "Work",
    "carried",
    "custom_load",
    "make_backend",
]
