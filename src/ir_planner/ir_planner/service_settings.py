"""Settings of the service movements: stage one (eqs. 1 to 6) and stage two (eq. 7)."""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting


@dataclass(frozen=True)
class InteractionSettings:
    """The search of goal configurations by cyclic coordinate descent with metric distances."""

    distribution: str = setting(
        "truncated_normal",
        "Random starts of eq. 1: truncated_normal (mean mid-range, sigma a sixth of the range) or uniform.",
        choices=("truncated_normal", "uniform"),
    )
    set_back: str = setting(
        "secant",
        "How eq. 5 sets a joint back: secant (until the distance is S_m), or literal (by the gain in m).",
        choices=("secant", "literal"),
    )
    overshoot: float = setting(
        0.05, "eps of eq. 5: how much farther than the secant says.", minimum=0.0, maximum=1.0
    )
    repairs: int = setting(2, "Times a step is set back before it is taken back.", minimum=1, maximum=50)
    sweeps: int = setting(6, "Sweeps over the joints before a start is given up.", minimum=1, maximum=1000)
    finish_every: int = setting(
        2, "Sweeps between two tries to finish with Newton's steps.", minimum=1, maximum=1000
    )
    newton_steps: int = setting(
        30, "Newton's steps of a finish; 0: cyclic coordinate descent alone.", minimum=0, maximum=1000
    )
    xi: float = setting(
        1e-8, "A start has arrived when Psi is less (eq. 6).", unit="m^2", minimum=1e-16, maximum=1.0
    )

    def __post_init__(self) -> None:
        check_settings(self)


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
