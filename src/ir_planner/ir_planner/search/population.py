"""The genetic algorithm that leads round what is in the path: vias in place of a stretch that
collides.

An individual is a few via configurations between the two free ends of the stretch. What runs
through them is the cubic joint spline of eq. (10) (or straight steps), sampled: its fitness is the
cost W of eq. (9) plus penalties for missing clearance and exceeded limits. Penetration counts with
its depth, so the fitness has a slope in collision too. A whole generation is evaluated in one
batch. The population breeds in islands, which keep different homotopy classes apart. Sampling
decides the selection only: what leaves is a path of certified steps.
"""

from dataclasses import dataclass

import numpy as np

from ir_kernels import portable
from ir_kernels.collision import FREE, Certificates
from ir_planner.checks import FreeSpace
from ir_planner.curves import spline_through, to_ppoly, virtual_knots
from ir_planner.scene import movement_cost, path_cost
from ir_values.arrays import FloatArray, IntArray
from ir_values.errors import InvalidValueError
from ir_values.settings import check_settings, setting

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
            raise InvalidValueError(
                f"elite is {self.elite}: it must be less than population / islands, "
                f"which is {self.per_island}"
            )
        for less, more in (("spread_least", "spread_most"), ("mutation_least", "mutation")):
            if getattr(self, less) > getattr(self, more):
                raise InvalidValueError(
                    f"{less} is {getattr(self, less):g} rad: it must be at most {more}, "
                    f"which is {getattr(self, more):g} rad"
                )

    @property
    def per_island(self) -> int:
        """Individuals of an island."""
        return self.population // self.islands


_SAMPLES_PER_EDGE = 40  # configurations that cost as much as one certified edge
_BEYOND = 0.25  # crossover reaches this share beyond both parents
_OWN = 0.5  # vias of one individual mutate together, and by this share on their own
_LARGEST = 3.0  # rad: no deviation grows beyond
_FINE = 400  # places on a spline between which its progress is interpolated


@dataclass(frozen=True, eq=False)
class Evolution:
    """What a population found: certified paths (M_k, n) from a to b, cheapest by W first.

    Where there is none: the individual that came nearest lacks `shortfall` m at `pair` in
    configuration `q`. fitness: of the best individual of every generation; the straight stretch's
    cost counts 1.
    """

    paths: list[FloatArray]
    shortfall: float
    pair: int
    q: FloatArray
    generations: int
    fitness: tuple[float, ...] = ()


@dataclass(eq=False)
class _Individuals:
    """vias (N, V, n); spread (N,) rad of their mutations; fitness (N,); the clearance that lacks at
    worst, shortfall (N,) m (negative: free), with sample and pair (N,); excess (N,) rad beyond
    joint limits.
    """

    vias: FloatArray
    spread: FloatArray
    fitness: FloatArray
    shortfall: FloatArray
    excess: FloatArray
    sample: IntArray
    pair: IntArray

    def of(self, rows: IntArray) -> "_Individuals":
        return _Individuals(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @staticmethod
    def joined(a: "_Individuals", b: "_Individuals") -> "_Individuals":
        return _Individuals(
            *(
                np.concatenate([getattr(a, name), getattr(b, name)])
                for name in a.__dataclass_fields__
            )
        )


def evolve(
    a: FloatArray,
    b: FloatArray,
    space: FreeSpace,
    settings: GeneticSettings,
    rng: np.random.Generator,
) -> Evolution:
    """Paths around between the free configurations a and b (n,) within the limits.

    Ends at the settings' generations or with the budget. Raises CancelledError when asked to stop.
    """
    return _Breeder(a, b, space, settings, rng).run()


def batch_work(configurations: int) -> int:
    """What checking so many configurations counts in certified edges."""
    return -(-configurations // _SAMPLES_PER_EDGE)


def path_matrix(shape: str, vias: int, samples: int) -> FloatArray:
    """(samples, vias + 2): configurations of a path from its start, vias and end, even in progress.

    The first row is the start, the last one the end.
    """
    times = np.linspace(0.0, 1.0, vias + 2)
    even = np.linspace(0.0, 1.0, samples)
    if shape == "polyline":
        hats = [np.interp(even, times, row) for row in np.eye(vias + 2)]
        return np.ascontiguousarray(np.array(hats).T)
    spline = to_ppoly(spline_through(np.eye(vias + 2), times, virtual_knots(times)))
    u = np.linspace(0.0, 1.0, _FINE)
    # of points that lie evenly on a line
    progress = np.maximum.accumulate(portable.matmul(spline(u), times))
    return np.ascontiguousarray(spline(np.interp(even, progress, u)))


class _Breeder:
    def __init__(
        self,
        a: FloatArray,
        b: FloatArray,
        space: FreeSpace,
        settings: GeneticSettings,
        rng: np.random.Generator,
    ) -> None:
        self.a = a
        self.b = b
        self.space = space
        self.settings = settings
        self.rng = rng
        self.weights = space.scene.weights
        self.straight = max(float(movement_cost(self.weights, a, b)), 1e-9)
        matrix = path_matrix(settings.shape, settings.vias, settings.samples)
        self.blend = np.ascontiguousarray(matrix[:, 1:-1])  # (S, V)
        self.fixed = matrix[:, :1] * a + matrix[:, -1:] * b  # (S, n)
        self.along = np.arange(1, settings.vias + 1)[:, None] / (settings.vias + 1)
        self.per_island = settings.per_island
        self.elite = settings.elite
        self.found: list[FloatArray] = []
        self.tried: set[bytes] = set()

    def run(self) -> Evolution:
        """Breed until the free paths have settled; no generation begins that the work left can't
        pay.
        """
        s = self.settings
        work = self.space.work
        children = s.islands * (self.per_island - self.elite)
        if self._price(s.islands * self.per_island * s.first) > work.left:
            return Evolution([], np.inf, -1, self.a, 0)
        people = self._first()
        generations = 1
        since = 0
        fitness: list[float] = []
        while True:
            fitness.append(float(people.fitness.min()))
            self._collect(people)
            since += bool(self.found)
            settled = since > s.settle or generations >= s.generations
            if settled or work.exhausted or self._price(children) > work.left:
                break
            people = self._next(people)
            generations += 1
        # free, but no better than others
        lack = np.where(people.shortfall < 0.0, np.inf, people.shortfall)
        best = int(np.argmin(lack))
        paths = sorted(self.found, key=lambda path: path_cost(self.weights, path))
        q = self.samples(people.vias[best : best + 1])[people.sample[best], 0]
        return Evolution(
            paths, float(lack[best]), int(people.pair[best]), q, generations, tuple(fitness)
        )

    def _price(self, individuals: int) -> int:
        """Work that so many new ones take."""
        return batch_work(individuals * (self.settings.samples - 2))

    def samples(self, vias: FloatArray) -> FloatArray:
        """(S, N, n): the paths of individuals."""
        count, v, n = vias.shape
        mixed = portable.matmul(self.blend, vias.transpose(1, 0, 2).reshape(v, count * n))
        paths: FloatArray = mixed.reshape(-1, count, n) + self.fixed[:, None, :]
        return paths

    def evaluated(self, vias: FloatArray, spread: FloatArray) -> _Individuals:
        """The individuals with their fitness, all in one batch."""
        q = self.samples(vias)
        count, n = q.shape[1:]
        inner = q[1:-1].reshape(-1, n)
        self.space.work.spend(batch_work(len(inner)))
        near = self.space.scene.collision.min_distance(inner, self.space.threshold)
        lack = np.where(near.pair >= 0, self.space.threshold[near.pair] - near.distance, -np.inf)
        lack = lack.reshape(-1, count)
        low = self.space.low
        high = self.space.high
        excess = np.maximum(np.maximum(low - q, q - high), 0.0).sum(axis=(0, 2))
        cost = (portable.matmul(np.abs(np.diff(q, axis=0)), self.weights)).sum(
            axis=0
        ) / self.straight
        worst = np.argmax(lack, axis=0)
        columns = np.arange(count)
        fitness = (
            cost
            + self.settings.clearance_penalty * np.maximum(lack, 0.0).mean(axis=0)
            + self.settings.limit_penalty * excess
        )
        fitness += (lack[worst, columns] >= 0.0) | (excess > 0.0)
        return _Individuals(
            vias,
            spread,
            fitness,
            lack[worst, columns],
            excess,
            worst + 1,
            near.pair.reshape(-1, count)[worst, columns],
        )

    def _first(self) -> _Individuals:
        """Random individuals around the straight stretch, the best of each island's."""
        s = self.settings
        rng = self.rng
        n = len(self.a)
        count = s.islands * self.per_island * s.first
        spread = portable.exp(
            rng.uniform(portable.log(s.spread_least), portable.log(s.spread_most), (count, 1, 1))
        )
        line = self.a + self.along * (self.b - self.a)
        noise = rng.standard_normal((count, 1, n)) + _OWN * rng.standard_normal((count, s.vias, n))
        vias = np.clip(line + spread * noise, self.space.low, self.space.high)
        drawn = self.evaluated(vias, np.full(count, s.mutation))
        return self._ranked(drawn, s.first * self.per_island)

    def _ranked(self, people: _Individuals, per_island: int) -> _Individuals:
        """The best of each island, islands one after the other, each sorted by fitness."""
        order = np.argsort(people.fitness.reshape(-1, per_island), axis=1, kind="stable")
        rows = order[:, : self.per_island] + per_island * np.arange(len(order))[:, None]
        return people.of(rows.ravel())

    def _next(self, people: _Individuals) -> _Individuals:
        """One generation: the elite stays, the rest are children of tournament winners.

        `people` are sorted by island, and within it by fitness; so is the answer.
        """
        s = self.settings
        rng = self.rng
        n = len(self.a)
        per = self.per_island
        children = self.per_island - self.elite
        first_of_island = per * np.arange(s.islands)[:, None]

        # the lowest of some random places, which is the fittest, wins a tournament
        drawn = rng.integers(0, per, (2, s.islands, children, s.tournament))
        won = drawn.min(axis=3) + first_of_island
        mother, father = won.reshape(2, -1)
        count = len(mother)

        # crossover: joint by joint a place on the line through both parents
        vias = people.vias[mother]
        crossed = rng.random(count) < s.crossover
        share = rng.uniform(-_BEYOND, 1.0 + _BEYOND, (count, 1, n)) * crossed[:, None, None]
        child = vias + share * (people.vias[father] - vias)
        away = self._parting(people, mother)
        child += away * (rng.random(count) < s.parting)[:, None, None]

        # mutation, whose deviation is inherited and mutates itself
        spread = people.spread[mother] * portable.exp(s.adaptation * rng.standard_normal(count))
        spread = np.clip(spread, s.mutation_least, _LARGEST)
        together = rng.standard_normal((count, 1, n))
        noise = together + _OWN * rng.standard_normal(vias.shape)
        mutated = rng.random((count, 1, n)) < s.mutated_share
        child += spread[:, None, None] * noise * mutated
        child = np.clip(child, self.space.low, self.space.high)

        stay = (first_of_island + np.arange(self.elite)).ravel()
        both = _Individuals.joined(people.of(stay), self.evaluated(child, spread))
        island = np.concatenate([stay // per, np.arange(count) // children])
        return self._ranked(both.of(np.argsort(island, kind="stable")), per)

    def _parting(self, people: _Individuals, rows: IntArray) -> FloatArray:
        """Steps (N, V, n) that part the pair which lacks most, to first order by one to two
        times.
        """
        vias = people.vias[rows]
        sample = people.sample[rows]
        pair = np.maximum(people.pair[rows], 0)
        blend = self.blend[sample]  # (N, V)
        q = self.fixed[sample] + (portable.matmul(blend[:, None, :], vias))[:, 0]
        gradient = self.space.scene.collision.gradients(q, pair)
        size = np.maximum((gradient * gradient).sum(axis=1) * (blend * blend).sum(axis=1), 1e-3)
        lack = np.clip(people.shortfall[rows], 0.0, 1.0) * self.rng.uniform(1.0, 2.0, len(rows))
        step: FloatArray = (lack / size)[:, None, None] * blend[:, :, None] * gradient[:, None, :]
        return np.clip(step, -1.0, 1.0)

    def _collect(self, people: _Individuals) -> None:
        """Certify the best of each island that samples call free."""
        free = (people.shortfall < 0.0) & (people.excess <= 0.0)
        for island in range(self.settings.islands):
            here = np.flatnonzero(free[island * self.per_island : (island + 1) * self.per_island])
            if len(here) == 0:
                continue
            row = island * self.per_island + int(here[0])
            vias = people.vias[row]
            key = vias.tobytes()
            if key in self.tried:
                continue
            self.tried.add(key)
            path = self._path(vias)
            if len(path) - 1 > self.space.work.left:
                return
            proof = self.space.certificates(path[:-1], path[1:])
            if (proof.verdict == FREE).all():
                self.found.append(path)
            else:
                self._correct(people, row, path, proof)

    def _correct(
        self, people: _Individuals, row: int, path: FloatArray, proof: Certificates
    ) -> None:
        """An individual that collides between samples is one that collides."""
        step = int(np.argmax(proof.verdict != FREE))
        share = float(proof.t1[step])
        pair = int(proof.pair[step])
        q = path[step] + share * (path[step + 1] - path[step])
        distance = self.space.scene.collision.witnesses(q[None], np.array([pair])).distance[0]
        lack = max(float(self.space.threshold[pair] - distance), 0.0)
        last = self.settings.samples - 1
        people.sample[row] = np.clip(round((step + share) / (len(path) - 1) * last), 1, last - 1)
        people.pair[row] = pair
        people.shortfall[row] = lack
        people.fitness[row] += 1.0 + self.settings.clearance_penalty * lack

    def _path(self, vias: FloatArray) -> FloatArray:
        if self.settings.shape == "polyline":
            return np.concatenate([self.a[None], vias, self.b[None]])
        return np.ascontiguousarray(self.samples(vias[None])[:, 0])
