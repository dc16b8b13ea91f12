"""Settings of the planner, one class per stage; ROS parameters and the documentation derive from them."""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting

_WEEK = 604_800.0


@dataclass(frozen=True)
class PlannerSettings:
    """Budgets, memory and what the drives' bus does with braking energy."""

    max_iterations: int = setting(
        400_000,
        "Certified edges a request may cost where it doesn't say (max_iterations 0).",
        minimum=1,
        maximum=100_000_000,
    )
    improvement_iterations: int = setting(
        12_000,
        "How many of them go into better movements once there is one, where the request doesn't say.",
        minimum=0,
        maximum=100_000_000,
    )
    regeneration: str = setting(
        "shared",
        "Braking energy: shared over the DC bus, none, or fed_back to the mains.",
        choices=("shared", "none", "fed_back"),
    )
    stored_trajectories: int = setting(
        500, "Trajectories remembered by id; the oldest go first.", minimum=1, maximum=100_000, read_only=True
    )
    stored_programs: int = setting(
        50, "Programs remembered by id; the oldest go first.", minimum=1, maximum=10_000, read_only=True
    )
    state_max_age: float = setting(
        1.0,
        "Age of the last joint_states from which it no longer tells where the robot is.",
        unit="s",
        minimum=0.05,
        maximum=3600.0,
    )
    cell: str = setting(
        "", "Cell file or bundled cell to start with; empty: wait for set_cell.", read_only=True
    )

    def __post_init__(self) -> None:
        check_settings(self)


@dataclass(frozen=True)
class PauseSettings:
    """Times of the ways into and out of the rests, and the shortest stay; as the driver has them."""

    stand_on_brakes_enter: float = setting(0.3, "Motors to brakes.", unit="s", minimum=0.0, maximum=_WEEK)
    stand_on_brakes_leave: float = setting(0.7, "Brakes to motors.", unit="s", minimum=0.0, maximum=_WEEK)
    stand_on_brakes_minimum_stay: float = setting(
        1.0, "Shortest stay on brakes.", unit="s", minimum=0.0, maximum=_WEEK
    )
    bus_power_off_enter: float = setting(3.0, "Into Bus Power Off.", unit="s", minimum=0.0, maximum=_WEEK)
    bus_power_off_leave: float = setting(
        20.0, "Bus Power Off to motors.", unit="s", minimum=0.0, maximum=_WEEK
    )
    bus_power_off_minimum_stay: float = setting(
        2.0, "Shortest Bus Power Off.", unit="s", minimum=0.0, maximum=_WEEK
    )
    hibernation_enter: float = setting(60.0, "Into hibernation.", unit="s", minimum=0.0, maximum=_WEEK)
    hibernation_leave: float = setting(120.0, "Hibernation to motors.", unit="s", minimum=0.0, maximum=_WEEK)
    hibernation_minimum_stay: float = setting(
        120.0, "Shortest hibernation.", unit="s", minimum=0.0, maximum=_WEEK
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def enter(self, mode: str) -> float:
        """Time [s] into a mode from standing on motors."""
        return self._of(mode, "enter")

    def leave(self, mode: str) -> float:
        """Time [s] from a mode to motors on."""
        return self._of(mode, "leave")

    def minimum_stay(self, mode: str) -> float:
        """Shortest stay [s] in a mode."""
        return self._of(mode, "minimum_stay")

    def _of(self, mode: str, what: str) -> float:
        return 0.0 if mode == "STAND_ON_MOTORS" else float(getattr(self, f"{mode.lower()}_{what}"))
