"""Is a load noticed that is not the declared one, and never one that is?

Torques of drawn plants come from their own masses and gears, by formulas of this module, in batch;
what they are weighed with is the driver's check. Movements go from rest to rest, at random speeds.
The friction of axes
that stand is drawn too: whatever holds them, up to `_HOLDS` of their Coulomb friction. A few of the
movements are driven by the stepped driver (`_driven_loads`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from _driven_loads import Carrier
from _over_seeds import over_seeds
from _results import Claim, at_least, at_most
from _truth_section import Asked, Found

from ir_description import (
    Cell,
    Load,
    PowerParameters,
    data_sheet,
    load_cell,
    load_power_data,
    load_robot,
)
from ir_kernels.dynamics import DynamicsModel
from ir_sim_driver.load_check import Declared, LoadFinding, NotedMotion, Uncertainty, weighed
from ir_sim_driver.plant import Carried, Plant, nominal_plant, typical_plant
from ir_values.arrays import FloatArray

TITLE = "a load that is not the declared one"
PAYLOAD = 155.0
ERRORS = (0.05, 0.2, 0.5)
PAYLOADS = (25.0, 75.0, 155.0, 200.0)
INSTANTS = 24
THRESHOLD = 3.0
_REFERENCE = 40.0  # deg C to which the friction of the data belongs
# times the spread of estimates over drawn plants, beyond the threshold: what surely shows
_SURE = 3.0
_HOLDS = 0.8
_FIT = 0.2  # of the deviations of friction that a fit leaves
_KINDS = {"A1": [0], "A2": [1], "A3": [2], "A5": [4], "all axes": [0, 1, 2, 3, 4, 5]}


class Movement(NamedTuple):
    """Instants of a movement, each (N, n)."""

    q: FloatArray
    qd: FloatArray
    qdd: FloatArray


def measured(asked: Asked) -> Found:
    """Count alarms that are false and loads that are missed; the smallest masses that show."""
    cell = load_cell(asked.cells[0])
    generator = np.random.default_rng(20)
    many, few = (1000, 100) if asked.quick else (10_000, 1000)
    rows = [false_alarms(cell, generator, many)]
    plants = {
        "nominal": [nominal_plant(cell.robot, load_power_data())],
        "typical": [
            typical_plant(cell.robot, load_power_data(), seed) for seed in range(asked.seeds)
        ],
    }
    for name, drawn in plants.items():
        for fitted in (False, True):
            rows += [noticed(cell, generator, few, name, drawn, error, fitted) for error in ERRORS]
    rows += smallest(cell, generator, few // 4)
    stepped = [
        row
        for part in over_seeds(_stepped, range(-1, 2 if asked.quick else asked.seeds))
        for row in part
    ]
    rows += stepped
    asked_for = [row for row in rows if row["case"] == "wrong load" and row["error"] == 0.2]
    seen = [row["noticed"] for row in asked_for]
    missed = {
        name: max(row["missed_up_to"] for row in asked_for if row["plant"] == name)
        for name in plants
    }
    sure = THRESHOLD + _SURE * rows[0]["rms"]
    scale = 10_000 / many
    return Found(
        rows,
        [
            at_most("false alarms in 10,000 movements", rows[0]["alarms"] * scale, "", 1.0),
            *_stepped_claims(stepped),
            at_least(
                "20 % of 155 kg noticed on A2 and A3", 100.0 * min(seen), "% of movements", 100.0
            ),
            at_most(
                "largest 20 % that was missed, nominal plant",
                missed["nominal"],
                "deviations",
                THRESHOLD,
            ),
            at_most(
                "largest 20 % that was missed, drawn plants", missed["typical"], "deviations", sure
            ),
        ],
    )


def _stepped(seed: int) -> list[dict[str, Any]]:
    """What the stepped driver finds on movements of A2, A3 and all axes, as declared and with a
    fifth more; a seed below 0 is the nominal plant.
    """
    plant = "nominal" if seed < 0 else f"typical:{seed}"
    generator = np.random.default_rng(100 + seed)
    cell = load_cell("open")
    rows = []
    for error in (0.0, 0.2):
        carrier = Carrier(cell, plant, _payload(cell, PAYLOAD), error)
        for axes in (_KINDS["A2"], _KINDS["A3"], _KINDS["all axes"]):
            found = carrier.weigh(lambda axes=axes: _ends(_movement(cell, generator, axes)))
            row = {
                "case": "stepped",
                "plant": plant,
                "error": error,
                "axes": len(axes),
                "mass": found.mass,
            }
            rows.append(
                row | {"deviations": found.mass / found.mass_deviation, "noticed": found.noticed}
            )
    return rows


def _ends(movement: Movement) -> tuple[FloatArray, FloatArray]:
    return movement.q[0], movement.q[-1]


def _stepped_claims(rows: list[dict[str, Any]]) -> list[Claim]:
    as_declared = [row for row in rows if row["error"] == 0.0]
    wrong = [row for row in rows if row["error"] > 0.0 and row["axes"] == 1]
    share = 100.0 * sum(row["noticed"] for row in wrong) / len(wrong)
    return [
        at_most("stepped driver: false alarms", sum(row["noticed"] for row in as_declared), "", 0),
        at_least(
            "stepped driver: 20 % of 155 kg noticed on A2 and A3", share, "% of movements", 100.0
        ),
    ]


def false_alarms(cell: Cell, generator: np.random.Generator, count: int) -> dict[str, Any]:
    """Movements with the declared load, each on a plant of its own."""
    robot = _known(cell, data_sheet())
    data = load_power_data()
    load = _payload(cell, PAYLOAD)
    z = []
    for seed in range(count):
        movement = _movement(cell, generator, _KINDS["all axes"] if seed % 2 else _KINDS["A2"])
        plant = typical_plant(cell.robot, data, seed)
        found = _weighed(plant, movement, load.loads, load, robot, cell)
        z.append(found.mass / found.mass_deviation)
    alarms = int((np.abs(z) > THRESHOLD).sum())
    worst = float(np.abs(z).max())
    rms = float(np.sqrt(np.mean(np.square(z))))
    return {
        "case": "declared load",
        "movements": count,
        "alarms": alarms,
        "worst": worst,
        "rms": rms,
    }


def noticed(
    cell: Cell,
    generator: np.random.Generator,
    count: int,
    name: str,
    plants: Sequence[Plant],
    error: float,
    fitted: bool,
) -> dict[str, Any]:
    """Movements of A2 or A3 with more load than declared: the share noticed, and the largest mass
    that is not, in standard deviations on its movement.
    """
    declared = _payload(cell, PAYLOAD)
    carried = _payload(cell, PAYLOAD * (1.0 + error))
    hits = 0
    off = []
    missed = [0.0]
    for k in range(count):
        plant = plants[k % len(plants)]
        parameters = _as_a_fit_leaves_it(plant) if fitted else data_sheet()
        movement = _movement(cell, generator, _KINDS["A2" if k % 2 else "A3"])
        found = _weighed(plant, movement, carried.loads, declared, _known(cell, parameters), cell)
        shows = abs(found.mass) > THRESHOLD * found.mass_deviation
        hits += shows
        if not shows:
            missed.append(PAYLOAD * error / found.mass_deviation)
        off.append(found.mass - PAYLOAD * error)
    return {
        "case": "wrong load",
        "plant": name,
        "known as": "a fit leaves it" if fitted else "data sheet",
        "error": error,
        "noticed": hits / count,
        "missed_up_to": max(missed),
        "mass_error_kg": float(np.sqrt(np.mean(np.square(off)))),
    }


def smallest(cell: Cell, generator: np.random.Generator, count: int) -> list[dict[str, Any]]:
    """Three standard deviations of the mass: the smallest that shows, by movement and payload."""
    robot = _known(cell, data_sheet())
    plant = nominal_plant(cell.robot, load_power_data())
    rows = []
    for kind, axes in _KINDS.items():
        for payload in PAYLOADS:
            load = _payload(cell, payload)
            found = [
                _weighed(plant, _movement(cell, generator, axes), load.loads, load, robot, cell)
                for _ in range(count)
            ]
            masses = [THRESHOLD * each.mass_deviation for each in found]
            row = {"case": "smallest mass", "movement": kind, "payload_kg": payload}
            share = {"median_kg": 50.0, "p95_kg": 95.0}
            rows.append(row | {key: float(np.percentile(masses, q)) for key, q in share.items()})
    return rows


_ROBOTS: dict[tuple[str, str], Uncertainty] = {}


def _known(cell: Cell, parameters: PowerParameters) -> Uncertainty:
    key = cell.name, parameters.name
    if key not in _ROBOTS:
        _ROBOTS[key] = Uncertainty(cell.robot, parameters, load_robot().marks, cell.base_pose)
    return _ROBOTS[key]


def _payload(cell: Cell, mass: float) -> Carried:
    """A load of so many kg 0.24 m in front of the flange, 0.28 m in size."""
    axis = np.abs(np.array(cell.robot.joint_axis[-1]))
    load = Load("payload", "tool", mass, 0.24 * axis, 0.013 * mass * np.eye(3))
    return Carried("payload", (load,))


def _movement(cell: Cell, generator: np.random.Generator, axes: Sequence[int]) -> Movement:
    """From rest to rest, of these axes, between anywhere and anywhere, at up to full speed."""
    robot = cell.robot
    low = 0.9 * robot.position_min
    high = 0.9 * robot.position_max
    start = generator.uniform(low, high)
    delta = np.zeros(robot.n)
    for axis in axes:
        least = 0.15 * (high[axis] - low[axis])
        while abs(delta[axis]) < least:
            delta[axis] = generator.uniform(low[axis], high[axis]) - start[axis]
    size = np.abs(delta)
    T = max(
        (1.9 * size / robot.velocity_max).max(), np.sqrt(6.0 * size / robot.acceleration_max).max()
    )
    T *= generator.uniform(1.0, 4.0)
    s = ((np.arange(INSTANTS) + 0.5) / INSTANTS)[:, None]
    return Movement(
        start + (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5) * delta,
        (30.0 * s**2 - 60.0 * s**3 + 30.0 * s**4) * delta / T,
        (60.0 * s - 180.0 * s**2 + 120.0 * s**3) * delta / T**2,
    )


def _weighed(
    plant: Plant,
    movement: Movement,
    carried: Sequence[Load],
    declared: Carried,
    robot: Uncertainty,
    cell: Cell,
) -> LoadFinding:
    torque = _torque(plant, movement, carried, cell) + _holding(plant, movement)
    found = weighed(NotedMotion(*movement, torque), Declared(declared, robot), THRESHOLD)
    assert found is not None  # there is gravity
    return found


def _holding(plant: Plant, movement: Movement) -> FloatArray:
    """Friction (n,) [Nm] of the axes that stand, the same all along; drawn by where the movement
    begins.
    """
    draw = np.random.default_rng(np.abs(movement.q[0] * 1e6).astype(np.uint64)).uniform(
        -_HOLDS, _HOLDS, plant.robot.n
    )
    return np.where(np.ptp(movement.q, axis=0) > 0.0, 0.0, draw * plant.gears.coulomb)


def _viscous(plant: Plant) -> FloatArray:
    gears = plant.gears
    return np.asarray(
        gears.viscous * np.exp(-gears.viscous_per_kelvin * (gears.start - _REFERENCE))
    )


def _torque(plant: Plant, movement: Movement, loads: Sequence[Load], cell: Cell) -> FloatArray:
    """Motor torque (N, n) [Nm] of a plant: its masses, and the friction of its gears."""
    q, qd, qdd = movement
    none = np.zeros(plant.robot.n)
    smooth = replace(plant.robot, friction_viscous=none, friction_coulomb=none)
    drive = DynamicsModel(smooth, tuple(loads), cell.base_pose).inverse_dynamics(q, qd, qdd)
    through = drive - plant.robot.reflected_inertia * qdd
    gears = plant.gears
    share = np.where(through * qd >= 0.0, gears.load_driven, gears.load_back)
    near_rest = gears.stribeck * np.exp(-((qd / gears.stribeck_speed) ** 2))
    dry = (gears.coulomb + share * np.abs(through) + near_rest) * np.tanh(qd / 1e-3)
    return np.asarray(drive + _viscous(plant) * qd + dry)


def _as_a_fit_leaves_it(plant: Plant) -> PowerParameters:
    """The plant's own friction, a fifth as uncertain as before; the masses as the data have
    them.
    """
    known = data_sheet()
    mean = known.mean.copy()
    factor = np.ones(len(known.mean))
    for term, values in (("viscous", _viscous(plant)), ("coulomb", plant.gears.coulomb)):
        mean[known.places(term)] = values
        factor[known.places(term)] = _FIT
    covariance = known.covariance * np.outer(factor, factor)
    return replace(known, name=f"fit of {plant.name}", mean=mean, covariance=covariance)
