"""Settings of the planner, one class per stage; ROS parameters and the documentation derive from them."""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting


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
        8_000,
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
