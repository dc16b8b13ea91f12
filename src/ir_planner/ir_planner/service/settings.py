"""Settings of the withdrawal from a machine, stage two of a service movement (eq. 7)."""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting


@dataclass(frozen=True)
class WithdrawalSettings:
    """The walk out of a machine by the modified genetic algorithm."""

    weighting: str = setting(
        "literal",
        "W of eq. 7: literal (proportional to the mass from the tool to the joint) or inverse.",
        choices=("literal", "inverse"),
    )
    population: int = setting(16, "Configurations in the population.", minimum=2, maximum=1000)
    offspring: int = setting(6, "Perturbed copies of each configuration.", minimum=1, maximum=1000)
    generations: int = setting(60, "Generations before the walk is given up.", minimum=1, maximum=10_000)
    step: float = setting(
        0.12, "Way of the tool in the mean step where the walk begins.", unit="m", minimum=0.001, maximum=2.0
    )
    momentum: float = setting(
        0.8, "Largest share of the last step's direction in the mean.", minimum=0.0, maximum=1.0
    )
    spread: float = setting(
        0.15, "Standard deviation of the first steps.", unit="rad", minimum=1e-4, maximum=3.0
    )
    spread_least: float = setting(0.01, "Least standard deviation.", unit="rad", minimum=0.0, maximum=3.0)
    spread_decades: float = setting(
        1.5, "Offspring step with 1 to 10^-this of the deviation.", minimum=0.0, maximum=6.0
    )
    collision_spread: float = setting(
        1.0, "Deviation where all offspring collide.", unit="rad", minimum=0.01, maximum=3.0
    )
    shrink: float = setting(
        2.0, "How much the deviation shrinks per relative gain of D.", minimum=0.0, maximum=100.0
    )

    def __post_init__(self) -> None:
        check_settings(self)
