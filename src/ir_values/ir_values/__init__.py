"""Values: arrays, settings, YAML with lines, files, and the errors of the house.

Everything else is above this package: it knows neither robots nor cells nor ROS.
"""

from ir_values.arrays import BoolArray, FloatArray, IntArray
from ir_values.errors import InvalidValueError, IrError, UnknownNameError
from ir_values.settings import Setting, check_settings, setting

__all__ = [
    "BoolArray",
    "FloatArray",
    "IntArray",
    "InvalidValueError",
    "IrError",
    "Setting",
    "UnknownNameError",
    "check_settings",
    "setting",
]
