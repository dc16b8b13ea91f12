"""What do current and voltage, eq. (8), change against the torque envelope, and do lighter tools
shorten movements?
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from _paper_pairs import CELL, DRAWN, Pair, pairs
from _paper_result import Experiment, Row, Statement, geometric_mean, interval

from ir_planner import Planner
from ir_planner.scene import LinkVoltage, PlanningScene

PAIRS = 400  # per seed
QUICK_PAIRS = 8
NOMINAL = "at the nominal voltage"
LOW = "at 5 % less voltage"
VOLTAGES = {NOMINAL: 1.0, LOW: 0.95}
OBJECTIVES = {"least time": "time", "least J": "time_and_energy"}


def measure_voltage(seed: int, quick: bool) -> list[Row]:
    """A row per movement, bound and objective: seconds and joules of the straight movement."""
    planner = Planner(CELL)
    rows = []
    for pair in pairs(planner, QUICK_PAIRS if quick else PAIRS, seed + 40):
        volt = pair.scene.power.dc_link.voltage
        links = {name: LinkVoltage(volt, high * volt) for name, high in VOLTAGES.items()}
        for name, objective in OBJECTIVES.items():
            row: Row = {"number": pair.number, "load": pair.load, "objective": name}
            row |= _driven(pair, "envelope", objective)
            for bound, link in links.items():
                drives = replace(pair.scene.drives, voltage=link)
                bounded = replace(pair, scene=replace(pair.scene, drives=drives))
                row |= _driven(bounded, bound, objective)
            rows.append(row)
    return rows


def _driven(pair: Pair, name: str, objective: str) -> Row:
    found = pair.common(objective=objective)
    if found is None:
        return {}
    return {f"{name} s": found.duration, f"{name} J": pair.drive_energy(found)}


def judge_voltage(rows: Sequence[Row]) -> list[Statement]:
    """Seconds and joules over those with the envelope."""
    found = []
    for name in OBJECTIVES:
        for bound in VOLTAGES:
            for unit, what in (("s", "duration"), ("J", "E_drive")):
                both = [r for r in rows if r["objective"] == name and f"{bound} {unit}" in r]
                ratios = [r[f"{bound} {unit}"] / r[f"envelope {unit}"] for r in both
                          if min(r[f"envelope {unit}"], r[f"{bound} {unit}"]) > 0.0]  # fmt: skip
                mean = interval(geometric_mean, ratios)
                says = f"{name}, current and voltage {bound}"
                figure = f"{what} over that with the envelope, geometric mean"
                found.append(Statement(says, figure, *mean, len(ratios), "movements"))
    return found


def follows_voltage(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    values = [one.value for one in statements]
    fast = f"{100 * (values[0] - 1):+.1f} % time and {100 * (values[1] - 1):+.1f} % energy"
    low = f"{100 * (values[2] - 1):+.1f} % and {100 * (values[3] - 1):+.1f} %"
    best = f"{100 * (values[4] - 1):+.1f} % and {100 * (values[5] - 1):+.1f} %"
    return (
        "Both bounds begin and end alike (the inductance is chosen so) and differ in between: "
        "current and voltage leave the main axes less torque at middle speeds than the data's "
        f"envelope. That changes the fastest movements by {fast}, with 5 % less voltage by {low}, "
        f"and those of least J by {best}. The envelope stays the default: it is the "
        "maker's figure, k_t and inductance are estimates."
    )


MASSES = {"the tool": 1.0, "a tool of half the mass": 0.5, "a tool of a quarter": 0.25}
SHORTER = 0.99  # of the duration: less than that is hardly shorter


def measure_tools(seed: int, quick: bool) -> list[Row]:
    """A row per movement: seconds and joules of the fastest straight movement by mass of the
    tool.
    """
    planner = Planner(CELL)
    rows = []
    for pair in pairs(planner, 2 * (QUICK_PAIRS if quick else PAIRS), seed + 60):
        if not pair.scene.loads:
            continue
        row: Row = {"number": pair.number, "direction": pair.direction}
        for name, share in MASSES.items():
            row |= _driven(replace(pair, scene=_lighter(pair.scene, share)), name, "time")
        rows.append(row)
    return rows


def _lighter(scene: PlanningScene, share: float) -> PlanningScene:
    """The scene with loads of a share of their mass, alike in shape and watts."""
    loads = tuple(
        replace(load, mass=share * load.mass, inertia=share * load.inertia) for load in scene.loads
    )
    return replace(scene, loads=loads)


def judge_tools(rows: Sequence[Row]) -> list[Statement]:
    """Seconds and joules over those with the whole mass."""
    found = []
    first, *lighter = MASSES
    for name in lighter:
        for unit, what, bound in (("s", "duration", SHORTER), ("J", "E_drive", float("nan"))):
            ratios = [r[f"{name} {unit}"] / r[f"{first} {unit}"] for r in rows
                      if r[f"{first} {unit}"] > 0.0 and r[f"{name} {unit}"] > 0.0]  # fmt: skip
            mean = interval(geometric_mean, ratios)
            says = f"{name} shortens the cycle" if unit == "s" else f"{name}: energy"
            figure = f"{what} over that with the tool, geometric mean"
            found.append(Statement(says, figure, *mean, len(ratios), "movements", bound=bound,
                                   at_least=False))  # fmt: skip
    return found


def follows_tools(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    half, half_j, quarter, quarter_j = statements
    return (
        f"Half the mass of the 155 kg tool changes the duration of the fastest movements by "
        f"{100 * (half.value - 1):+.1f} % ({half.verdict}) and their energy by "
        f"{100 * (half_j.value - 1):+.0f} %, a quarter of it by {100 * (quarter.value - 1):+.1f} % "
        f"({quarter.verdict}) and {100 * (quarter_j.value - 1):+.0f} %: what torque bounds gets "
        "shorter, and a faster movement is not a cheaper one. What speed, acceleration and jerk "
        "bound stays, and so do a cycle's pauses and machines."
    )


EXPERIMENTS = (
    Experiment(
        "eq_8",
        "Eq. (8): current and voltage against the envelope",
        "Drive and arm are one system: the motors' current and the voltage of their supply bound "
        "what the arm can do.",
        f"{PAIRS} straight movements per seed in `{CELL}`, {DRAWN}: S-curve PTPs of least time and "
        "of least J, with the torque envelope of the data, and with `torque_limits: "
        "current_voltage` at the nominal voltage of the DC link and 5 % below.",
        measure_voltage,
        judge_voltage,
        follows_voltage,
    ),
    Experiment(
        "tool_mass",
        "Lighter tools and the cycle",
        "Lighter tools shorten production cycles.",
        f"{PAIRS} straight movements per seed in `{CELL}` with its 155 kg tool, and the same "
        "movements with a half and a quarter of its mass and inertia: the fastest S-curve PTPs. "
        f"Shorter: at most {SHORTER:g} of the duration.",
        measure_tools,
        judge_tools,
        follows_tools,
    ),
)
