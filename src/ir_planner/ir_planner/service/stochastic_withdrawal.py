"""Withdrawal from a machine's work area by the modified genetic algorithm of eq. (7): the raw
paths.

A population of copies of the interaction configuration is perturbed, q_i <- q_i + W_i n_i with n_i
~ N(mu_i, sigma). What comes nearer than S_m is dropped, with its reason; the rest is ranked by the
total metric distance D to the machine. The mean grows with D and points where D grew and the tool
leaves; the spread shrinks with the gain of D, and is 1 rad around a configuration whose offspring
all collide, to get round what closes the zone. It goes on until configurations are outside whose D
is larger than at the start. Every step is a certified edge.
"""

from collections import Counter
from dataclasses import dataclass, field

import numpy as np

from ir_kernels import portable
from ir_kernels.collision import FREE
from ir_planner.request import Work
from ir_planner.service.exit import Exit, ExitsFound, WalkRecord
from ir_values.arrays import BoolArray, FloatArray, IntArray
from ir_values.settings import check_settings, setting


@dataclass(eq=False)
class ExitPopulation:
    """Configurations (N, n) with D (N,), spread (N,) rad, the step (N, n) that led here, index of
    their node; stuck (N,): all of their offspring collided.
    """

    q: FloatArray
    total: FloatArray
    sigma: FloatArray
    step: FloatArray
    node: IntArray
    stuck: BoolArray

    def of(self, rows: IntArray) -> "ExitPopulation":
        """Those of the `rows` (M,)."""
        return ExitPopulation(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    def __len__(self) -> int:
        return len(self.q)


def joined(a: ExitPopulation, b: ExitPopulation) -> ExitPopulation:
    """The configurations of both."""
    both = ((getattr(a, name), getattr(b, name)) for name in a.__dataclass_fields__)
    return ExitPopulation(*(np.concatenate(pair) for pair in both))


def counted(numbers: IntArray) -> list[tuple[int, int]]:
    """Every one of the numbers (N,), none negative, and how often it is there, in order."""
    counts = np.bincount(numbers)
    return [(z, int(counts[z])) for z in np.flatnonzero(counts).tolist()]


# Steps of the joints in the walk of eq. (7) are weighted by the mass from the tool to the joint,
# M_i = sum_{l>=i} m_l, the load with the last link. As printed W_i is proportional to M_i
# ("literal"); the option "inverse" lets the light joints, which move little of the arm, step more.


def accumulated_mass(link_mass: FloatArray, load_mass: float = 0.0) -> FloatArray:
    """M (n,) kg behind each joint; `link_mass` (n+1,) from the base on."""
    mass = np.array(link_mass[1:], dtype=float)
    mass[-1] += load_mass
    return np.ascontiguousarray(np.cumsum(mass[::-1])[::-1])


def step_weights(link_mass: FloatArray, load_mass: float, weighting: str) -> FloatArray:
    """W (n,) with mean 1: proportional to M, or to 1/M."""
    mass = accumulated_mass(link_mass, load_mass)
    weight = mass if weighting == "literal" else 1.0 / np.maximum(mass, 1e-9)
    return np.asarray(weight / weight.mean())


# m^2, of the least squares: near a singular wrist rates stay below 1 / (2 * damping)
_DAMPING = 0.02
# m/rad, lambda of eq. (2): how much a turn of the tool weighs against its travel
_ROTATION_LENGTH = 0.5
_WEIGHTED = np.array([1.0, 1.0, 1.0, *[_ROTATION_LENGTH] * 3])[:, None]
_DAMPED = (_DAMPING * _DAMPING) * np.eye(6)
# the spread shrinks at most to this share in one generation, so that one step can't end it
_SHARPEST = 0.25
_WIDEST = 1.3  # and grows at most so, where D was lost
# of the first step: mean steps grow with D between them
_MEAN_LEAST = 0.25
_MEAN_MOST = 4.0
GUIDED = "guided"
PRINTED = "printed"
_PER_PARENT = 3  # offspring of one configuration that may survive: several directions stay alive
_FEWEST_OFFSPRING = 4  # of one configuration, however large the population
_SMALLEST_D = 1e-3  # m: gains of D are relative to at least this


@dataclass(frozen=True)
class ModifiedGa:
    """Withdrawal from a machine by the modified genetic algorithm of eq. (7)."""

    weighting: str = setting(
        "literal",
        "W of eq. 7: literal (proportional to the mass from the tool to the joint) or inverse.",
        choices=("literal", "inverse"),
    )
    reading: str = setting(
        GUIDED,
        "How eq. 7 draws: guided (towards the exit, steps of several decades) or printed (q_i + "
        "W_i n_i, n_i ~ N(mu, sigma), mu proportional to D; after a collision N(0, 1 rad)).",
        choices=(GUIDED, PRINTED),
    )
    population: int = setting(16, "Configurations in the population.", minimum=2, maximum=1000)
    offspring: int = setting(6, "Perturbed copies of each configuration.", minimum=1, maximum=1000)
    generations: int = setting(
        60, "Generations before the search is given up.", minimum=1, maximum=10_000
    )
    step: float = setting(
        0.12,
        "Distance that the tool moves in the first mean step.",
        unit="m",
        minimum=0.001,
        maximum=2.0,
    )
    momentum: float = setting(
        0.8, "Largest share of the last step's direction in the mean.", minimum=0.0, maximum=1.0
    )
    spread: float = setting(
        0.15, "Standard deviation of the first steps.", unit="rad", minimum=1e-4, maximum=3.0
    )
    spread_least: float = setting(
        0.01, "Least standard deviation.", unit="rad", minimum=0.0, maximum=3.0
    )
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

    @property
    def title(self) -> str:
        """The name of its stage in answers."""
        return "modified GA"

    def find(
        self, problem: Exit, wanted: int, seed: np.random.SeedSequence, work: Work
    ) -> ExitsFound:
        """Perturb and rank until `wanted` paths have left the zone, generations or work end."""
        walk = withdraw(problem, self, np.random.default_rng(seed), wanted)
        note = (
            f"{len(walk.paths)} paths, {walk.generations} generations, {walk.candidates} candidates"
        )
        return ExitsFound(walk.paths, walk.best, note, walk.rejected, walk.record, walk.obstructed)


@dataclass(eq=False)
class Walk:
    """What a search found: paths (M_k, n) from the interaction configuration to outside, in the
    order they came.

    best: the configuration farthest out; rejected: dropped candidates by reason, of which
    obstructed: by pairs of bodies.
    """

    paths: list[FloatArray]
    best: FloatArray
    generations: int
    candidates: int
    rejected: Counter[str] = field(default_factory=Counter)
    record: WalkRecord | None = None
    obstructed: Counter[str] = field(default_factory=Counter)


def withdraw(problem: Exit, settings: ModifiedGa, rng: np.random.Generator, wanted: int) -> Walk:
    """Search from the interaction configuration until `wanted` paths end outside.

    Ends at the settings' generations or when the work is spent.
    """
    return _Walker(problem, settings, rng).run(wanted)


class _Walker:
    def __init__(self, problem: Exit, settings: ModifiedGa, rng: np.random.Generator) -> None:
        self.problem = problem
        self.area = problem.area
        self.inside = problem.inside
        self.settings = settings
        self.rng = rng
        self.scene = scene = problem.inside.scene
        loads = sum(load.mass for load in scene.loads)
        self.W = step_weights(scene.cell.robot.link_mass, loads, settings.weighting)
        first = problem.interaction
        self.nodes: list[FloatArray] = [first]
        self.parents: list[int] = [0]
        self.dropped: list[FloatArray] = [first[None][:0]]
        self.first_total = self.largest = max(
            float(self.area.total_distance(first[None])[0]), _SMALLEST_D
        )
        self.walk = Walk([], first, 0, 0)
        self.best_zone = float(self.area.zone_distance(first[None])[0])

    def run(self, wanted: int) -> Walk:
        """Generations of eq. (7) from the grasp, until so many paths lead outside, all copies are
        lost, or the work is used.
        """
        n = len(self.nodes[0])
        count = self.settings.population
        population = ExitPopulation(
            self.nodes[0][None],
            np.array([self.first_total]),
            np.array([self.settings.spread]),
            np.zeros((1, n)),
            np.zeros(1, dtype=np.int64),
            np.zeros(1, dtype=bool),
        )
        for _ in range(self.settings.generations):
            if len(population) == 0 or self.inside.work.exhausted or len(self.walk.paths) >= wanted:
                break
            self.walk.generations += 1
            population = self._next(
                population,
                max(self.settings.offspring * count // len(population), _FEWEST_OFFSPRING),
            )
        self.walk.record = self._record()
        return self.walk

    def _record(self) -> WalkRecord:
        kept = np.array(self.nodes)
        parents = np.array(self.parents, dtype=np.int64)
        counts = (self.walk.generations, self.walk.candidates)
        distance = (self.first_total, self.largest)
        return WalkRecord(kept, parents, np.concatenate(self.dropped), *counts, distance)

    def _next(self, parents: ExitPopulation, offspring: int) -> ExitPopulation:
        """One generation: perturb, drop, rank, certify, keep the best."""
        owner = np.repeat(np.arange(len(parents)), offspring)
        perturb = self._as_printed if self.settings.reading == PRINTED else self._guided
        q = perturb(parents, owner)
        self.walk.candidates += len(q)
        q, owner, collided = self._free(q, owner, len(parents))
        total = self.area.total_distance(q)
        order = np.argsort(-total, kind="stable")
        q = q[order]
        owner = owner[order]
        total = total[order]
        chosen = self._certified(parents, q, owner)
        children = self._children(parents, q[chosen], owner[chosen], total[chosen])
        survivors = len(children)
        children = self._finished(children)
        stuck = np.flatnonzero(collided if survivors else np.ones(len(parents), dtype=bool))
        if len(stuck):  # all of its offspring collide, or all steps do: look 1 rad around it
            stay = parents.of(stuck)
            wide = np.full(len(stuck), self.settings.collision_spread)
            again = ExitPopulation(
                stay.q, stay.total, wide, stay.step * 0.0, stay.node, np.ones_like(stuck, bool)
            )
            children = joined(children, again)
        return children

    def _as_printed(self, parents: ExitPopulation, owner: IntArray) -> FloatArray:
        """q_i + W_i n_i (M, n), n_i ~ N(mu, sigma): mu is proportional to D, the same for every
        joint and without a direction; after a collision it is 0 and sigma 1 rad, around q_i.
        """
        per_metre = self.settings.step / self.first_total
        mean = np.where(parents.stuck, 0.0, per_metre * parents.total)
        noise = self.rng.standard_normal((len(owner), parents.q.shape[1]))
        drawn = mean[owner][:, None] + parents.sigma[owner][:, None] * noise
        return parents.q[owner] + self.W * drawn

    def _guided(self, parents: ExitPopulation, owner: IntArray) -> FloatArray:
        """Offspring (M, n) with a mean that is not weighted, parts of it, and spreads of several
        decades: short steps survive where it is tight.
        """
        mean = self._mean(parents)
        spread = parents.sigma[owner] * portable.power(
            10.0, self.rng.uniform(-self.settings.spread_decades, 0.0, len(owner))
        )
        noise = spread[:, None] * self.rng.standard_normal((len(owner), parents.q.shape[1]))
        away = self.rng.random(len(owner))[:, None]
        return parents.q[owner] + mean[owner] * away + self.W * noise

    def _mean(self, parents: ExitPopulation) -> FloatArray:
        """Mean steps (N, n): where the last step went, and straight out along the tool; longer as D
        grows.
        """
        has_bodies = self.area.pairs > 0  # a zone without bodies has no D
        ratio = parents.total / self.first_total if has_bodies else np.ones(len(parents))
        grown = np.minimum(np.maximum(ratio, _MEAN_LEAST), _MEAN_MOST)
        out = self._straight_out(parents.q) * self.settings.step
        last = parents.step
        length, size = (np.sqrt((x * x).sum(axis=1, keepdims=True)) for x in (out, last))
        momentum = np.where(size > 1e-9, last / np.maximum(size, 1e-9) * length, out)
        share = self.rng.uniform(0.0, self.settings.momentum, (len(parents), 1))
        return np.asarray(grown[:, None] * ((1.0 - share) * out + share * momentum))

    def _straight_out(self, q: FloatArray) -> FloatArray:
        """Joint rates (N, n) per metre that the tool moves along its -x, by damped least
        squares.
        """
        J = self.scene.chain.jacobian(q)
        J = J * _WEIGHTED
        target = np.zeros((len(q), 6, 1))
        target[:, :3, 0] = -self.scene.chain.tcp_poses(q)[:, :3, 0]
        turned = J.transpose(0, 2, 1)
        rate: FloatArray = (
            portable.matmul(turned, portable.solve(portable.matmul(J, turned) + _DAMPED, target))
        )[:, :, 0]
        return rate

    def _free(
        self, q: FloatArray, owner: IntArray, count: int
    ) -> tuple[FloatArray, IntArray, BoolArray]:
        """Candidates within the limits and free; and which parents lost all of theirs to
        collisions.
        """
        low = self.inside.low
        high = self.inside.high
        beyond = (q < low) | (q > high)
        out = beyond.any(axis=1)
        if out.any():
            names = self.scene.cell.robot.joint_names
            for j, lost in counted(np.argmax(beyond[out], axis=1)):
                self.walk.rejected[f"{names[j]} beyond its limit"] += lost
            q = q[~out]
            owner = owner[~out]
        if len(q) == 0:
            return q, owner, np.ones(count, dtype=bool)
        cone = self.inside.cone
        if cone is not None:
            q = cone.brought_in(q, low, high, self.inside.scale)
        near = self.scene.collision.min_distance(q, self.inside.threshold)
        free = (near.pair < 0) | (near.distance > self.inside.threshold[near.pair])
        self._count_pairs(near.pair[~free], "too near")
        if cone is not None:
            held = cone.holds(q)
            self.walk.rejected["the tool leans too far"] += int((free & ~held).sum())
            free &= held
        self.dropped.append(q[~free])
        q = q[free]
        owner = owner[free]
        collided = np.ones(count, dtype=bool)
        collided[owner] = False
        return q, owner, collided

    def _certified(self, parents: ExitPopulation, q: FloatArray, owner: IntArray) -> IntArray:
        """The best candidates, in rank order, whose step from the parent is proved free."""
        population = self.settings.population
        most = max(_PER_PARENT, population // len(parents))
        taken = [0] * len(parents)
        ranked = []
        for k, parent in enumerate(owner.tolist()):
            if taken[parent] < most:
                taken[parent] += 1
                ranked.append(k)
                if len(ranked) == population:
                    break
        rows = np.array(ranked[: self.inside.work.left], dtype=np.int64)
        if len(rows) == 0:
            return rows
        self.walk.rejected["outranked: D smaller"] += len(q) - len(rows)
        found = self.inside.certificates(parents.q[owner[rows]], q[rows])
        free = found.verdict == FREE
        self._count_pairs(found.pair[~free], "in between too near")
        certified: IntArray = rows[free]
        cone = self.inside.cone
        if cone is not None and len(certified):
            held = cone.edges_held(parents.q[owner[certified]], q[certified])
            self.walk.rejected["the tool leans too far in between"] += int((~held).sum())
            certified = certified[held]
        return certified

    def _children(
        self, parents: ExitPopulation, q: FloatArray, owner: IntArray, total: FloatArray
    ) -> ExitPopulation:
        """Survivors with their spread: it shrinks in proportion to the gain of D."""
        gain = (total - parents.total[owner]) / np.maximum(parents.total[owner], _SMALLEST_D)
        shrink = np.minimum(np.maximum(1.0 - self.settings.shrink * gain, _SHARPEST), _WIDEST)
        sigma = np.maximum(parents.sigma[owner] * shrink, self.settings.spread_least)
        sigma = np.minimum(sigma, self.settings.collision_spread)
        self.largest = max(self.largest, float(total.max(initial=0.0)))
        node = np.arange(len(self.nodes), len(self.nodes) + len(q))
        self.nodes.extend(q)
        self.parents.extend(parents.node[owner].tolist())
        fresh = np.zeros(len(q), dtype=bool)
        return ExitPopulation(q, total, sigma, q - parents.q[owner], node, fresh)

    def _finished(self, children: ExitPopulation) -> ExitPopulation:
        """Take those out of the population that have left the zone; they count where D grew."""
        if len(children) == 0:
            return children
        zone = self.area.zone_distance(children.q)
        far = int(np.argmax(zone))
        if zone[far] > self.best_zone:
            self.best_zone = float(zone[far])
            self.walk.best = children.q[far]
        done = self.problem.is_out(children.q, zone)
        grown = (children.total > self.first_total) | (self.area.pairs == 0)
        if (done & ~grown).any():
            self.walk.rejected["outside, but D did not grow"] += int((done & ~grown).sum())
        for node in children.node[done & grown]:
            self.walk.paths.append(self._path(int(node)))
        return children.of(np.flatnonzero(~done))

    def _path(self, node: int) -> FloatArray:
        path = [node]
        while path[-1] != 0:
            path.append(self.parents[path[-1]])
        return np.array([self.nodes[k] for k in path[::-1]])

    def _count_pairs(self, pairs: IntArray, what: str) -> None:
        for z, count in counted(pairs[pairs >= 0]):
            pair = self.scene.collision.pairs[z]
            named = f"{pair.body_a} {what} {pair.body_b}"
            self.walk.rejected[named] += count
            self.walk.obstructed[named] += count
