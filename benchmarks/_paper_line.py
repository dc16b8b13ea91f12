"""Table I as a view of a whole line: what is the robot's share before and after?"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from _paper_result import FAILS, HOLDS, Experiment, Row, Statement, finished, interval, panels

from ir_description import load_power_data
from ir_msgs_py.options import PlanOptions
from ir_planner import Planner
from ir_recorder.analysis.production import Amount
from ir_recorder.report.prices import Costs
from ir_recorder.report.whole_line import WholeLine, of_whole_line

TOURS = {
    "open": 2,
    "table_columns": 2,
    "cnc_door": 2,
}  # random visits per cell and seed, beside the programs
STOPS = 5
ROBOT = "robot_drives"
NETWORK = "plc_and_profinet"
AROUND = "common programs' movements run around bodies"
PLANNING_S = 120.0


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per program: joules of the common one and of the planned one over the same seconds."""
    rows = [_row("demo", (), seed)]
    rng = np.random.default_rng([seed, 1])
    for cell, count in ({"open": 1} if quick else TOURS).items():
        names = [station.name for station in Planner(cell).cell.stations]
        for _ in range(count):
            stops = tuple(str(name) for name in rng.permutation(names)[:STOPS])
            rows.append(_row(cell, stops, seed))
    return [row for row in rows if row]


def _row(cell: str, stops: tuple[str, ...], seed: int) -> Row:
    planner = Planner(cell)
    asked = PlanOptions(seed=seed, planning_time=PLANNING_S)
    plan = planner.plan_program(
        stations=stops, options=asked, start=np.array(planner.cell.park), savings=True
    )
    found = plan.savings
    if not found.available:
        return {}
    base = planner.scene().base_watts
    always = base * found.movements.seconds
    return {
        "cell": cell,
        "stops": " ".join(stops) or "its program",
        "seconds": found.total.seconds,
        "common_J": found.total.common,
        "planned_J": found.total.planned,
        "mains": found.total.share,
        "drives": found.movements.saved / max(found.movements.common - always, 1e-9),
        "across": found.across,
        "around": found.around,
    }


def _shares() -> dict[str, float]:
    return {row.consumer: row.percent for row in load_power_data().table_1}


def of_line(saved: float) -> WholeLine:
    """What robots that take `saved` (0 to 1) less save of Table I's whole."""
    found = of_whole_line(Amount(saved, saved, saved), 1.0, Costs())
    assert found is not None  # robots take something
    return found


def after(saved: float) -> float:
    """The robots' share of the line [%] where they take `saved` (0 to 1) less and nothing else
    changes.
    """
    left = of_line(saved).after
    return 100.0 * left["robots"] / sum(left.values())


def judge(rows: Sequence[Row]) -> list[Statement]:
    """Saved energy of robots, of the line, and the robots' share afterwards."""
    robot = _shares()[ROBOT]
    network = _shares()[NETWORK]
    found = []
    for key, what in (
        ("drives", "of the drives, in their movements"),
        ("mains", "at the mains, pauses included"),
    ):
        saved = [row[key] for row in rows]
        programs = [(row["cell"], row["stops"]) for row in rows]
        count = len(set(programs)), "programs"
        share = interval(lambda x: 100.0 * float(np.mean(x)), saved, groups=programs)
        line = interval(lambda x: of_line(float(np.mean(x))).factory.value, saved, groups=programs)
        left = interval(lambda x: after(float(np.mean(x))), saved, groups=programs)
        found += [
            Statement(f"energy {what}: saved at equal cycle time", "mean", *share, *count, "%"),
            Statement(f"energy {what}: that is more than PLCs and network take",
                      "share of the factory's energy", *line, *count, "%", network),
            Statement(f"energy {what}: the robots' share afterwards", f"before {robot:g} %", *left,
                      *count, "%"),
        ]  # fmt: skip
    return [*found, _around(rows)]


def _around(rows: Sequence[Row]) -> Statement:
    """How many movements of the common programs have no free straight segment."""
    columns = ([row[key] for row in rows] for key in ("around", "across"))
    programs = [(row["cell"], row["stops"]) for row in rows]
    share = interval(
        lambda some, all_of: 100.0 * float(some.sum() / all_of.sum()), *columns, groups=programs
    )
    says = f"{AROUND}: their straight segment is not free"
    return Statement(
        says, "share of those from zone to zone", *share, len(set(programs)), "programs", "%"
    )


def follows(statements: Sequence[Statement]) -> str:
    """What the figures mean."""
    drives, line, left, mains, line_mains = statements[:5]
    around = "".join(
        f" {one.value:.0f} % of the {AROUND}, along the planner's path in straight steps: what "
        "they lose there is part of what is saved."
        for one in statements
        if AROUND in one.says
    )
    worth = {HOLDS: "more", FAILS: "not more"}.get(line.verdict, "not surely more")
    least, most = sorted((line.value, line_mains.value))
    return (
        f"Planned programs save {drives.value:.0f} % of the drives' energy and {mains.value:.0f} "
        f"% of the robot's at the mains. If Table I's {_shares()[ROBOT]:g} % are drives alone, a "
        f"factory saves {line.value:.1f} % ({worth} than PLCs and network take) and the robots' "
        f"share becomes {left.value:.1f} %; if they are whole robots, {line_mains.value:.1f} %. "
        f"So planning robots better is worth {least:.0f} to {most:.0f} % of a factory's energy, of "
        "which the hall takes half and line stand-by 4.5 %. That other consumers stay as they "
        f"are is assumed, not measured.{around}"
    )


def tables(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Every program."""
    found = []
    for row in rows:
        line = {"cell": row["cell"], "stations": row["stops"], "seconds": f"{row['seconds']:.1f}"}
        line |= {f"{key} saved [%]": f"{100.0 * row[key]:.1f}" for key in ("drives", "mains")}
        found.append(line | {"around bodies": f"{row['around']} of {row['across']}"})
    return {
        "Saved by every program, and how many movements of the common one run around bodies": found
    }


def draw(rows: Sequence[Row], file: Path) -> None:
    """The line before and after as two bars."""
    figure, (axes,) = panels(1, width=8.0, height=2.6)
    saved = float(np.mean([row["drives"] for row in rows]))
    for place, less in ((1, 0.0), (0, saved)):
        left = 0.0
        for k, (name, percent) in enumerate(_shares().items()):
            width = percent * (1.0 - less) if name == ROBOT else percent
            label = name.replace("_", " ") if place else None
            axes.barh(place, width, left=left, color=f"C{k}", label=label, height=0.6)
            left += width
        axes.text(left + 0.5, place, f"{left:.1f}", va="center", fontsize=8)
    axes.set_yticks([1, 0], ["Table I", "planned"])
    axes.set(xlabel="energy of the factory before = 100", xlim=(0, 108))
    axes.legend(fontsize=7, ncols=4, loc="upper center", bbox_to_anchor=(0.5, -0.3))
    finished(figure, file)


EXPERIMENT = Experiment(
    "line",
    "Table I: the robot's share of a line",
    "Robot drives take 25.5 % of the energy of a robotic production line, spot welding, gelation "
    "and gluing 18 %, PLCs and PROFINET 2 %, line stand-by 4.5 %, the factory's environment half "
    "(Table I).",
    f"The demonstration's program and random visits of {STOPS} stations of {', '.join(TOURS)}: "
    "the planned program against the common program (same stations, nearest configurations by "
    "W, S-curve PTPs, along the planner's path where they are not free, service lines and "
    "pauses as today) over the same seconds. What is saved is put into Table I, all else "
    "unchanged.",
    measure,
    judge,
    follows,
    tables,
    draw=draw,
    caption="Energy of the factory before and after, if Table I counts drives alone; the numbers "
    "are the sums.",
)
