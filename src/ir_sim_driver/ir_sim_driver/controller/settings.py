"""Settings of the simulated controller, stage by stage."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import cast

from ir_kernels.power import REGENERATIONS, Regeneration
from ir_msgs_py.modes import REST_MODES, Mode, TransitionTimes
from ir_msgs_py.plc import OperatingMode
from ir_sim_driver.controller.supervision import SupervisionSettings
from ir_sim_driver.load_check import LoadCheckSettings
from ir_sim_driver.motion import ExecutionSettings
from ir_sim_driver.plant import ControlSettings
from ir_sim_driver.plc import PlcSettings
from ir_sim_driver.power import IdleTimes
from ir_values.settings import check_settings, setting

DT = 0.001
"""Step of plant and controller [s]."""


@dataclass(frozen=True)
class ControllerSettings:
    """How the controller starts and what it knows of its surroundings."""

    start_mode: str = setting(
        "STAND_ON_MOTORS", "Power mode at the start.", choices=REST_MODES, read_only=True
    )
    operating_mode: str = setting(
        "EXT",
        "Position of the mode switch at the start.",
        choices=("T1", "T2", "AUT", "EXT"),
        read_only=True,
    )
    enabling_switch: bool = setting(
        False,
        "Somebody holds the enabling switch: programs may run in T1 (at 250 mm/s) and T2.",
        read_only=True,
    )
    regeneration: str = setting(
        "shared",
        "What becomes of braking energy at the DC link.",
        choices=REGENERATIONS,
        read_only=True,
    )

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def rest_at_start(self) -> Mode:
        """Power mode at the start."""
        return Mode[self.start_mode]

    @property
    def mode_switch(self) -> OperatingMode:
        """Position of the mode switch at the start."""
        return OperatingMode[self.operating_mode]

    @property
    def regeneration_mode(self) -> Regeneration:
        """What becomes of braking energy."""
        return cast(Regeneration, self.regeneration)


@dataclass(frozen=True)
class SimulationSettings:
    """All stages of the simulation; dt [s]: step of plant and controller. before_first_stop: number
    of stops before the first one (`ir_msgs_py.stop_numbers`).
    """

    dt: float = DT
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    control: ControlSettings = field(default_factory=ControlSettings)
    execution: ExecutionSettings = field(default_factory=ExecutionSettings)
    transitions: TransitionTimes = field(default_factory=TransitionTimes)
    supervision: SupervisionSettings = field(default_factory=SupervisionSettings)
    idle: IdleTimes = field(default_factory=IdleTimes)
    plc: PlcSettings = field(default_factory=PlcSettings)
    load_check: LoadCheckSettings = field(default_factory=LoadCheckSettings)
    before_first_stop: int = 0
