"""Watts that a robot draws whatever its drives do: controller by mode, drives that are switched on,
tool.
"""

from __future__ import annotations

from ir_msgs_py.modes import Mode
from ir_sim_driver.plant.plant_parameters import StandingWatts


class BasePower:
    """Base load of a plant with these watts."""

    def __init__(self, watts: StandingWatts) -> None:
        self._figures = watts
        self._controller = dict(watts.controller)
        self._controller[Mode.STAND_ON_MOTORS] += watts.drives
        self.set_tool(0.0, 0.0)

    def set_tool(self, always: float, drive_bus: float) -> None:
        """Take the tool's watts as declared: always, and more while the drive bus is up."""
        factor = self._figures.tool
        self._tool = dict.fromkeys(self._controller, factor * always)
        for level in (Mode.STAND_ON_MOTORS, Mode.STAND_ON_BRAKES):
            self._tool[level] += factor * drive_bus
        self._watts = {
            level: watts + self._tool[level] for level, watts in self._controller.items()
        }

    def of(self, level: Mode) -> float:
        """Watts in STAND_ON_MOTORS or a rest, without holding torque."""
        return self._watts[level]

    def tool(self, level: Mode) -> float:
        """Watts of the tool, a part of `of`."""
        return self._tool[level]
