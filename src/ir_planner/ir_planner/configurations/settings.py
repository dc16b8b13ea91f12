"""Settings of the search for goal configurations, stage one of a service movement (eqs. 1 to 6)."""

from dataclasses import dataclass

from ir_msgs_py.settings import check_settings, setting


@dataclass(frozen=True)
class InteractionSettings:
    """The search of goal configurations by cyclic coordinate descent with metric distances."""

    distribution: str = setting(
        "truncated_normal",
        "Random starts of eq. 1: truncated_normal (mean mid-range, sigma a sixth of the range) "
        "or uniform.",
        choices=("truncated_normal", "uniform"),
    )
    set_back: str = setting(
        "secant",
        "How eq. 5 sets a joint back: secant (until the distance is S_m), literal (by the gain "
        "in m), or none: collisions are sorted out at the pose.",
        choices=("secant", "literal", "none"),
    )
    overshoot: float = setting(
        0.05, "eps of eq. 5: how much farther than the secant says.", minimum=0.0, maximum=1.0
    )
    repairs: int = setting(
        2, "Times a step is set back before it is taken back.", minimum=1, maximum=50
    )
    sweeps: int = setting(
        6, "Sweeps over the joints before a start is given up.", minimum=1, maximum=1000
    )
    finish_every: int = setting(
        2, "Sweeps between two tries to finish with Newton's steps.", minimum=1, maximum=1000
    )
    newton_steps: int = setting(
        30,
        "Newton's steps of a finish; 0: cyclic coordinate descent alone.",
        minimum=0,
        maximum=1000,
    )
    xi: float = setting(
        1e-8,
        "A start has arrived when Psi is less (eq. 6).",
        unit="m^2",
        minimum=1e-16,
        maximum=1.0,
    )

    def __post_init__(self) -> None:
        check_settings(self)


INTERACTION = InteractionSettings()
"""The default settings."""
