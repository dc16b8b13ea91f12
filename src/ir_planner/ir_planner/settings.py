"""Settings of the planner as one tree; ROS parameters and the documentation derive from it."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import cast

from ir_description import RobotModel
from ir_description.library import power_parameters_of, read_power_parameters
from ir_description.robot import DATA_SHEET
from ir_kernels.power import Regeneration
from ir_msgs_py.modes import TransitionTimes
from ir_planner.configurations import InteractionSettings
from ir_planner.scene import Drives, LinkVoltage
from ir_planner.search import Search, registered
from ir_planner.service import ModifiedGa
from ir_values.files import FileRoots
from ir_values.settings import check_settings, setting, stage

_FILES = 64  # of power parameters that are remembered


@dataclass(frozen=True)
class PlannerSettings:
    """Work, memory and what the drives' bus does with braking energy; the settings of the stages,
    and every registered search by its name.
    """

    max_iterations: int = setting(
        400_000,
        "Certified edges a request may cost where it doesn't say (max_iterations 0).",
        minimum=1,
        maximum=100_000_000,
    )
    improvement_iterations: int = setting(
        2_500,
        "How many of them go into better movements once there is one, where the request doesn't "
        "say.",
        minimum=0,
        maximum=100_000_000,
    )
    regeneration: str = setting(
        "shared",
        "Braking energy: shared over the DC link, none, or fed_back to the mains.",
        choices=("shared", "none", "fed_back"),
    )
    torque_reserve: float = setting(
        0.1,
        "Share of the torque envelope that plans leave to the feedback: a robot is never quite "
        "as its data.",
        minimum=0.0,
        maximum=0.5,
    )
    torque_limits: str = setting(
        "envelope",
        "What bounds the torque: the envelope of the data, or current_voltage, eq. (8) with the "
        "current of the drive and the voltage of the DC link.",
        choices=("envelope", "current_voltage"),
    )
    dc_voltage: float = setting(
        0.0,
        "Voltage of the DC link for current_voltage; 0: that of the controller's data.",
        unit="V",
        minimum=0.0,
        maximum=2000.0,
    )
    power_parameters: str = setting(
        "",
        "Power parameters that joules and torques follow from: path of a .yaml file; empty: the "
        "data sheet.",
        read_only=True,
    )
    stored_trajectories: int = setting(
        500,
        "Trajectories remembered by id; the oldest go first.",
        minimum=1,
        maximum=100_000,
        read_only=True,
    )
    stored_programs: int = setting(
        120,
        "Programs remembered by id; the oldest go first.",
        minimum=1,
        maximum=10_000,
        read_only=True,
    )
    stored_megabytes: int = setting(
        200,
        "Memory of the trajectories remembered, and of those of programs; the oldest go first.",
        unit="MB",
        minimum=1,
        maximum=100_000,
        read_only=True,
    )
    state_max_age: float = setting(
        1.0,
        "Age from which the last joint_states no longer count as the robot's state.",
        unit="s",
        minimum=0.05,
        maximum=3600.0,
    )
    cell: str = setting(
        "", "Cell file or bundled cell to start with; empty: wait for set_cell.", read_only=True
    )

    roots: tuple[str, ...] = setting(
        ("",),
        "Folders below which set_cell reads files; empty: IR_FILE_ROOTS, else the working folder.",
        read_only=True,
    )
    transitions: TransitionTimes = stage(TransitionTimes)
    interaction: InteractionSettings = stage(InteractionSettings)
    withdrawal: ModifiedGa = stage(ModifiedGa)
    searches: Mapping[str, Search] = stage(registered)

    def __post_init__(self) -> None:
        check_settings(self)

    @property
    def file_roots(self) -> FileRoots:
        """The folders below which set_cell reads files."""
        return FileRoots.of(self.roots)

    def drives(self, robot: RobotModel) -> Drives:
        """What is assumed of a robot's drives. Raises DescriptionError for parameters that can't be
        read, or are those of a robot that is neither this one nor bundled.
        """
        parameters = None
        if self.power_parameters not in ("", DATA_SHEET):
            text = power_parameters_text(self.power_parameters)
            parameters = _parameters(text, self.power_parameters, robot)
        bounds = None
        if self.torque_limits == "current_voltage":
            nominal = robot.controller.dc_link.voltage
            bounds = LinkVoltage(nominal, self.dc_voltage or nominal)
        regeneration = cast(Regeneration, self.regeneration)
        return Drives(regeneration, self.torque_reserve, parameters, bounds)

    def read(self) -> None:
        """Read the file of power parameters, which is needed no more from now on."""
        if self.power_parameters not in ("", DATA_SHEET):
            power_parameters_text(self.power_parameters)


power_parameters_text = lru_cache(_FILES)(read_power_parameters)  # a file is read once
_parameters = lru_cache(_FILES)(power_parameters_of)
