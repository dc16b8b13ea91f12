"""The mains supply of the controller: base load by mode, the drives, and what the meter counts."""

from __future__ import annotations

import numpy as np

from ir_description import PowerData
from ir_kernels.dynamics import DynamicsModel
from ir_kernels.power import Regeneration
from ir_msgs_py.modes import DRIVES_ON, Mode
from ir_sim_driver.plant import Backend, BasePower, Carried, Plant, PowerMeter, standing_watts

_SETTLE_STEPS = 250  # at the latest: arrays of many steps cost what arrays of few do


class Mains:
    """Counts what the controller and `backend`, a robot of `plant`, take, step by step of dt [s].

    data: what the controller knows of it.
    """

    def __init__(
        self, plant: Plant, data: PowerData, backend: Backend, dt: float, regeneration: Regeneration
    ) -> None:
        self._backend = backend
        self.base = BasePower(plant.watts)
        self._known = BasePower(standing_watts(data))
        self.meter = PowerMeter(plant, dt, regeneration)
        self._unsettled = 0
        self._level = Mode.STAND_ON_MOTORS
        self._standing = True
        # at this level, which the meter has not counted
        self._steps = 0

    def set_load(self, load: Carried) -> None:
        """Count a load's own consumption from now on."""
        self._count()
        for base in (self.base, self._known):
            base.set_load(load.watts_always, load.watts_drive_bus, load.mass)

    def step(self, level: Mode, *, standing: bool) -> None:
        """Count one step at this level: STAND_ON_MOTORS or a rest, and whether the robot stands."""
        if level is not self._level or standing is not self._standing:
            self._count()
            self._level = level
            self._standing = standing
        self._steps += 1
        self._unsettled += 1
        if self._unsettled >= _SETTLE_STEPS:
            self.settle()

    def settle(self) -> None:
        """Bring the meter's reading up to the last step."""
        self._count()
        self._unsettled = 0
        self.meter.settle(self._backend.work())

    def _count(self) -> None:
        """Let the meter count the steps at the present level."""
        if self._steps:
            level = self._level
            whole = self.base.whole(level, self._backend.q) if self._standing else None
            base = self.base.of(level) if whole is None else whole
            self.meter.add(
                base,
                min(self.base.tool(level), base),
                level is Mode.STAND_ON_MOTORS,
                self._steps,
                whole=whole is not None,
                drive_bus=level in DRIVES_ON,
            )
            self._steps = 0

    def energy(self) -> float:
        """Energy [J] up to the last step."""
        self.settle()
        return self.meter.reading().energy

    def standing_power(self, level: Mode, dynamics: DynamicsModel) -> float:
        """Watts at the mains that the controller expects of a mode at the present posture."""
        q = self._backend.q[None]
        whole = self._known.whole(level, q[0])
        if whole is not None:
            return whole
        watts = self._known.of(level)
        if level is Mode.STAND_ON_MOTORS:
            still = np.zeros_like(q)
            hold = dynamics.inverse_dynamics(q, still, still)
            watts += float(dynamics.axis_power(still, hold).sum())
        return watts
