"""How far measured may be from planned, with the reason of each bound."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ir_msgs_py.settings import check_settings, setting

MODEL_PLANTS = ("", "nominal", "ideal")
"""Plants whose figures are those that the planner's model has; "" for recordings that name none."""


@dataclass(frozen=True)
class Tolerances:
    """Bounds of the checks. The energy a movement may differ by is the larger of the relative and
    the absolute one; what the capacitors held at its start, as the bus voltage shows, may be
    missing besides.
    """

    energy_relative: float = setting(
        0.01,
        "Energy against plan: the nominal plant agrees within this share.",
        minimum=0.0,
        maximum=1.0,
    )
    energy_absolute: float = setting(
        10.0,
        "Energy against plan: two readings of the meter at 500 W, whose ends straddle the step.",
        unit="J",
        minimum=0.0,
    )
    duration: float = setting(
        0.05,
        "Duration of a movement: its ends are extrapolated from states at 50 Hz.",
        unit="s",
        minimum=0.0,
    )
    pause_duration: float = setting(
        0.5,
        "Duration of a pause, and how long it may rest less deep than planned: wake margin 0.2 s "
        "and three answers of 0.1 s.",
        unit="s",
        minimum=0.0,
    )
    tool_deviation: float = setting(
        0.005,
        "Tool off its commanded point: beyond it the planned clearance is no proof.",
        unit="m",
        minimum=0.0,
    )
    safety_distance: float = setting(
        0.02, "S_m where the recording carries none: the default of requests.", unit="m"
    )
    slack: float = setting(
        1e-4, "Clearance: resolution of the exact distances and of the states.", unit="m"
    )
    resting_relative: float = setting(
        0.01, "Power at rest against the data of controller and tool.", minimum=0.0, maximum=1.0
    )
    resting_rows: int = setting(
        0, "How many modes with a load the recording has to show at machine home.", minimum=0
    )
    indirect_relative: float = setting(
        0.01, "Energy from joint states against the meter.", minimum=0.0, maximum=1.0
    )

    plant_relative: float = setting(
        0.2,
        "Energy and power of a plant that is not the model, where the plan has no interval: two "
        "standard deviations of figures of medium confidence.",
        minimum=0.0,
        maximum=1.0,
    )

    within_interval: bool = setting(
        False, "Energy of a movement against twice the plan's 90 % interval, where it has one."
    )

    def __post_init__(self) -> None:
        check_settings(self)

    def of_plant(self, plant: str) -> Tolerances:
        """The bounds for a plant of this name: only those of its own data agree closely with the
        model.
        """
        if plant in MODEL_PLANTS:
            return self
        wide = self.plant_relative
        return replace(
            self,
            energy_relative=wide,
            indirect_relative=wide,
            resting_relative=wide,
            within_interval=True,
        )
