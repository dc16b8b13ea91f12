"""Settings of the searches for regional movements."""

from dataclasses import dataclass

from ir_msgs_py.errors import ParameterError
from ir_msgs_py.settings import check_settings, setting

SAMPLES_MAX = 200


@dataclass(frozen=True)
class GeneticSettings:
    """The genetic correction of the stretch of a movement that collides."""

    shape: str = setting(
        "polyline",
        "What runs through the vias: spline (eq. 10) or polyline (straight steps).",
        choices=("spline", "polyline"),
    )
    vias: int = setting(2, "Via configurations that replace a stretch.", minimum=1, maximum=8)
    population: int = setting(48, "Individuals, all islands together.", minimum=4, maximum=1000)
    islands: int = setting(
        4,
        "Parts of the population that breed apart, perhaps in other homotopy classes.",
        minimum=1,
        maximum=64,
    )
    generations: int = setting(
        20, "Generations before a stretch is given up.", minimum=1, maximum=10_000
    )
    settle: int = setting(
        4, "Generations that follow the first free path.", minimum=0, maximum=10_000
    )
    first: int = setting(
        2,
        "Random individuals that are drawn for one in the first generation.",
        minimum=1,
        maximum=8,
    )
    samples: int = setting(
        24,
        "Configurations of an individual's path that are checked; more with every further attempt.",
        minimum=4,
        maximum=SAMPLES_MAX,
    )
    spread_least: float = setting(
        0.1, "Least deviation of first vias.", unit="rad", minimum=1e-3, maximum=3.0
    )
    spread_most: float = setting(
        1.2, "Largest deviation of first vias.", unit="rad", minimum=1e-3, maximum=3.0
    )
    mutation: float = setting(
        0.2, "Standard deviation of the first mutations.", unit="rad", minimum=1e-4, maximum=3.0
    )
    mutation_least: float = setting(
        0.01, "Least standard deviation.", unit="rad", minimum=0.0, maximum=3.0
    )
    adaptation: float = setting(
        0.4,
        "Standard deviation of the logarithm by which a child's deviation differs.",
        minimum=0.0,
        maximum=3.0,
    )
    mutated_share: float = setting(
        0.5, "Share of a child's joint values that mutate.", minimum=0.0, maximum=1.0
    )
    crossover: float = setting(0.6, "Share of children with two parents.", minimum=0.0, maximum=1.0)
    parting: float = setting(
        0.6, "Share of children pushed along the separating direction.", minimum=0.0, maximum=1.0
    )
    tournament: int = setting(
        3, "Individuals that compete to be a parent.", minimum=1, maximum=1000
    )
    elite: int = setting(2, "Individuals per island that stay unchanged.", minimum=1, maximum=1000)
    clearance_penalty: float = setting(
        60.0,
        "Cost, in W of the straight stretch, per metre of missing clearance.",
        unit="1/m",
        minimum=0.0,
        maximum=1e6,
    )
    limit_penalty: float = setting(
        10.0, "The same per radian beyond a joint limit.", unit="1/rad", minimum=0.0, maximum=1e6
    )
    margin: float = setting(
        0.6, "Share of the stretch's length added at both ends.", minimum=0.0, maximum=10.0
    )
    attempts: int = setting(6, "Times a stretch is tried, each time wider.", minimum=1, maximum=50)
    stretches: int = setting(
        6, "Stretches of one path that are corrected.", minimum=1, maximum=1000
    )
    paths: int = setting(
        3, "Different homotopy classes that are looked for.", minimum=1, maximum=64
    )

    difference: float = setting(
        0.3, "Paths that are nowhere farther apart are one.", unit="rad", minimum=0.0, maximum=10.0
    )

    def __post_init__(self) -> None:
        check_settings(self)
        if self.per_island <= self.elite:
            raise ParameterError(
                f"elite is {self.elite}: it must be less than population / islands, "
                f"which is {self.per_island}"
            )
        for less, more in (("spread_least", "spread_most"), ("mutation_least", "mutation")):
            if getattr(self, less) > getattr(self, more):
                raise ParameterError(
                    f"{less} is {getattr(self, less):g} rad: it must be at most {more}, "
                    f"which is {getattr(self, more):g} rad"
                )

    @property
    def per_island(self) -> int:
        """Individuals of an island."""
        return self.population // self.islands
