"""Does the set-back of eq. (5) help at poses where some configurations collide and others are
free?
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from _paper_ccd import (
    DEFAULT,
    FREE,
    FREE_SWEPT,
    MANY_SWEEPS,
    QUICK_STARTS,
    READINGS,
    STARTS,
    SWEPT,
    chance_of,
    chances,
    colliding,
    gain,
    pays,
    share_free,
    tried,
)
from _paper_result import FAILS, HOLDS, Experiment, Row, Statement, percent, share
from _paper_stations import CELLS, Place, of_reading
from _regional_tasks import scene_of_cell
from _service_stations import S_M
from _variants import variant

from ir_description import load_cell
from ir_planner.scene import PlanningScene

# of each cell and seed
VARIANTS = 8
QUICK_VARIANTS = 1
POSES = 5  # of each
NEAR = 0.15  # m: the tool or the arm is within it of something
FEW = 8  # starts whose chance is compared: with more, hardly a pose is missed either way
_BATCH = 500
ASKED = (DEFAULT, FREE, SWEPT, FREE_SWEPT)


def blocked_places(scene: PlanningScene, count: int, rng: np.random.Generator) -> Iterator[Place]:
    """Poses of the tool at random free configurations near something, where the closed form has
    others that collide.
    """
    robot = scene.cell.robot
    kept = scene.thresholds(S_M)
    anywhere = replace(scene.cell.stations[0], name="", allowed_contacts=())
    while count:
        drawn = rng.uniform(robot.position_min, robot.position_max, (_BATCH, robot.n))
        distance = scene.collision.min_distance(drawn).distance
        for pose in scene.chain.tcp_poses(drawn[(distance > S_M) & (distance < NEAR)]):
            q = scene.inverse_kinematics.solve(pose[None]).q
            free = scene.collision.is_free(q, kept) if len(q) else np.zeros(0, dtype=bool)
            if free.any() and not free.all():
                yield Place(scene, replace(anywhere, pose=pose), S_M, q[free])
                count -= 1
                if not count:
                    return


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per pose and reading."""
    rows = []
    for name in CELLS[:2] if quick else CELLS:
        for k in range(QUICK_VARIANTS if quick else VARIANTS):
            scene = scene_of_cell(variant(load_cell(name), 100 + seed, k))
            there = blocked_places(scene, POSES, np.random.default_rng([seed, k, *name.encode()]))
            for number, place in enumerate(there):
                for reading in ASKED:
                    rng = np.random.default_rng([seed, k, number])
                    found = tried(place, READINGS[reading], rng, QUICK_STARTS if quick else STARTS)
                    rows.append(
                        {"cell": scene.cell.name, "station": "", "draw": number, "reading": reading}
                        | found
                    )
    return rows


def _ending(rows: Sequence[Row], reading: str) -> Statement:
    mine = [row for row in rows if row["reading"] == reading]
    found = percent(
        share(
            [row["colliding"] / row["starts"] for row in mine],
            [(row["seed"], row["cell"]) for row in mine],
        )
    )
    says = f"starts that arrive at a configuration that collides, {reading}"
    return Statement(says, "share of the starts", *found, len(mine), "poses", "%")


def judge(rows: Sequence[Row]) -> list[Statement]:
    """What the set-back changes."""
    default = list(of_reading(rows, DEFAULT).values())
    says = "the set-back of (5) lets more starts end free"
    succeed = "starts that succeed"
    several = f"{FEW} starts find more with the set-back"
    chance = "chance of a free configuration"
    return [
        gain(rows, says, succeed, DEFAULT, FREE, share_free, "poses"),
        gain(
            rows,
            "the same where no Newton finishes it",
            succeed,
            SWEPT,
            FREE_SWEPT,
            share_free,
            "poses",
        ),
        gain(rows, several, chance, DEFAULT, FREE, lambda row: chance_of(row, FEW), "poses"),
        pays(rows, "poses"),
        _ending(rows, DEFAULT),
        _ending(rows, FREE),
        colliding(default, "poses"),
    ]


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    back, alone, _, rate, ends, ends_free, parts = statements
    helps = {HOLDS: "lets more starts end free", FAILS: "is not worth 2 points of the starts"}
    worth = {HOLDS: "it pays for its time", FAILS: "it does not pay for its time"}
    return (
        f"Of the configurations {parts.value:.0f} % collide. Without the set-back "
        f"{ends_free.value:.1f} % of the starts arrive at one of those, with it {ends.value:.1f} "
        "%: Newton's finish moves through bodies. The set-back "
        f"{helps.get(back.verdict, 'may let a few more starts end free')} ({back.value:+.1f} "
        f"points; {alone.value:+.1f} where {MANY_SWEEPS} sweeps must arrive), and "
        f"{worth.get(rate.verdict, 'whether it pays for its time is open')}."
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Success by number of starts."""
    found = [
        {"reading": name, **chances([row for row in rows if row["reading"] == name])}
        for name in ASKED
    ]
    return {"Chance that so many starts find a free configuration, mean of the poses": found}


EXPERIMENT = Experiment(
    "ccd_blocked",
    "The set-back of eq. (5) where configurations collide",
    "A joint whose step ends in collision is set back, so that the configurations that are found "
    "are free.",
    f"In {VARIANTS} variants of {', '.join(CELLS)} per seed, {POSES} poses of the tool each, "
    f"drawn at random free configurations within {1e3 * NEAR:g} mm of something: only poses at "
    f"which the closed form has configurations that are free and others that collide. {STARTS} "
    "starts per pose and reading; no pilot chose these sizes.",
    measure,
    judge,
    follows,
    tables,
)
