"""Figures 1 and 2 as pictures of the demonstration: cell and zones, service and regional
movements.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _paper_result import MEASURED, Experiment, Row, Statement, finished, panels
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from ir_description import Cell, load_cell
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind
from ir_planner import Planner
from ir_planner.checks import StateCheck
from ir_planner.trajectories import Reference
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_values.arrays import FloatArray

CELL = "demo"
STATION = "lathe_work"
DISTANCE = 0.02  # m: 20 units of the paper's figure, read as millimetres
INSIDE = 0.35  # of the way out of the machine
FARTHEST = 0.9  # rad that the first joint turns at most
OFFSETS = ((0, 0, 0, 0, 0, 0), (0.5, 0.2, -0.3, 0, 0.3, 0), (1.0, 0, 0.1, 0.4, 0, 0.5),
           (1.5, 0.3, -0.3, 0, 0.2, 0))  # fmt: skip  # rad from park
COLOURS = {"OPEN": "tab:green", "SEMI_CLOSED": "tab:orange", "CLOSED": "tab:red"}
_SAMPLES = 80
ABOVE = np.eye(3)[:2]  # projections (2, 3) of the world
_AZIMUTH = np.radians(-60.0)
_ELEVATION = np.radians(32.0)
CORNER = np.array(
    [
        [-np.sin(_AZIMUTH), np.cos(_AZIMUTH), 0.0],
        [
            -np.cos(_AZIMUTH) * np.sin(_ELEVATION),
            -np.sin(_AZIMUTH) * np.sin(_ELEVATION),
            np.cos(_ELEVATION),
        ],
    ]
)


def measure(seed: int, quick: bool) -> list[Row]:
    """A row per movement of the planned program: the tool's path, and what kind it is."""
    planner = Planner(CELL)
    plan = planner.plan_program(
        options=PlanOptions(planning_time=60.0), start=np.array(planner.cell.park)
    )
    chain = planner.scene().chain
    rows = []
    for step in plan.movements:
        if step.trajectory is None:
            continue
        times = np.linspace(0.0, step.trajectory.duration, _SAMPLES)
        path = chain.tcp_poses(step.trajectory.sample(times).q)[:, :3, 3]
        row: Row = {
            "kind": MovementKind(step.kind).value,
            "from": step.from_station,
            "to": step.to_station,
        }
        row |= {"seconds": step.trajectory.duration, "joules": step.report.energy}
        rows.append(row | {"path": np.round(path, 3).tolist()})
    return rows


def judge(rows: Sequence[Row]) -> list[Statement]:
    """How much of the program is which kind of movement."""
    nan = float("nan")
    found = []
    whole = sum(row["seconds"] for row in rows)
    for kinds, name in (((MovementKind.REGIONAL,), "regional"),
                        ((MovementKind.SERVICE_ENTRY, MovementKind.SERVICE_EXIT), "service")):  # fmt: skip  # noqa: E501
        some = [row for row in rows if row["kind"] in [kind.value for kind in kinds]]
        share = 100.0 * sum(row["seconds"] for row in some) / whole
        says = f"{name} movements of the demonstration"
        moved = len(some), "movements", "%"
        found.append(Statement(says, "share of the time that it moves", share, nan, nan, *moved,
                               verdict=MEASURED))  # fmt: skip
    return found


def follows(statements: Sequence[Statement]) -> str:
    """What the pictures show."""
    regional, service = statements
    return (
        f"{regional.count} regional and {service.count} service movements, {service.value:.0f} % "
        "of the moving time inside the zones. These are pictures of this project's cell, drawn "
        "from its data; they reproduce the arrangement that the paper describes, not its "
        "drawings."
    )


def measure_pictures(seed: int, quick: bool) -> list[Row]:
    """What the services answer for the figures: states in a semi-closed zone with their metric
    distance, verdict, kind and parts; and a trajectory through four points.
    """
    planner = Planner(CELL)
    plan = planner.plan_service(STATION, direction="exit", options=PlanOptions(seed=1))
    out = plan.candidates[0].trajectory
    inside = out.sample(np.array([INSIDE * out.duration])).q[0]
    rows = [
        _state(planner, name, inside, asked)
        for name, asked in (("at 20 units", DISTANCE), ("in collision", -DISTANCE))
    ]
    park = np.array(planner.cell.park)
    points = np.array([park + np.array(offset) for offset in OFFSETS])
    found = planner.plan_trajectory(Reference(points), options=PlanOptions(seed=1))
    assert found.trajectory is not None, found.status.message
    chain = planner.scene().chain
    times = np.linspace(0.0, found.trajectory.duration, _SAMPLES)
    path = chain.tcp_poses(found.trajectory.sample(times).q)[:, :3, 3]
    row: Row = {"kind": "trajectory", "verdict": found.report.certified}
    row |= {"seconds": found.report.duration, "joules": found.report.energy}
    row |= {"points": np.round(chain.tcp_poses(points)[:, :3, 3], 4).tolist()}
    return [*rows, row | {"path": np.round(path, 4).tolist()}]


def _state(planner: Planner, name: str, inside: FloatArray, distance: float) -> Row:
    """The state at which the metric distance to the machine is `distance` [m], found by turning the
    first joint from `inside` (n,) and asking for each state.
    """
    turned = np.zeros(len(inside))
    turned[0] = 1.0

    def asked(angle: float) -> StateCheck:
        return planner.check_state(inside + angle * turned, safety_distance=0.0)

    low = 0.0
    high = FARTHEST
    for _ in range(50):
        middle = 0.5 * (low + high)
        nearer = asked(middle).min_distance > distance
        low = middle if nearer else low
        high = high if nearer else middle
    found = planner.check_state(inside + low * turned)
    pair = found.pairs[0]
    row: Row = {"kind": "state", "name": name, "q": (inside + low * turned).tolist()}
    row |= {"distance_mm": 1e3 * found.min_distance, "verdict": found.valid}
    row |= {"collision": pair.kind, "parts": [pair.body_a, pair.body_b]}
    return row | {"points": [pair.point_a.tolist(), pair.point_b.tolist()]}


def judge_pictures(rows: Sequence[Row]) -> list[Statement]:
    """The answers as they came."""
    nan = float("nan")
    found = []
    for row in rows:
        if row["kind"] == "state":
            says = f"{row['name']}: {_answer(row)}"
            found.append(Statement(says, "metric distance", row["distance_mm"], nan, nan, 1,
                                   "state", "mm", verdict=MEASURED))  # fmt: skip
        else:
            says = f"trajectory through four points, {row['joules']:.0f} J"
            found.append(Statement(says, "duration", row["seconds"], nan, nan, 1, "trajectory", "s",
                                   verdict=MEASURED))  # fmt: skip
    return found


def _answer(row: Row) -> str:
    """Verdict, type of collision and parts of a state, as the service has them."""
    verdict = "free" if row["verdict"] else "not free"
    return f"{verdict}, {row['collision']}, {' and '.join(row['parts'])}"


def follows_pictures(statements: Sequence[Statement]) -> str:
    """What the pictures show."""
    free, hit, moved = statements
    return (
        f"Left, `check_state` in the semi-closed zone of the lathe: {free.says} at "
        f"{free.value:.1f} mm of metric distance, {hit.says} at {hit.value:.1f} mm (negative: "
        f"penetration). Right, `plan_trajectory`: {moved.says} in {moved.value:.2f} s. A unit of "
        "the paper's drawing is read as a millimetre."
    )


def draw_pictures(rows: Sequence[Row], file: Path) -> None:
    """Both states from above with their closest points, and the tool's path through the points."""
    figure, panels_of = panels(3, width=4.2, height=4.6)
    cell = load_cell(CELL)
    states = [row for row in rows if row["kind"] == "state"]
    for panel, row in zip(panels_of, states, strict=False):
        panel.grid(visible=False)
        _machines(panel, cell, ABOVE)
        _robot(panel, cell, ABOVE, np.array(row["q"]))
        ends = np.array(row["points"]) @ ABOVE.T
        colour = "tab:green" if row["verdict"] else "tab:red"
        panel.plot(*ends.T, "o-", color=colour, ms=5, lw=2.5, zorder=9)
        middle = ends.mean(axis=0)
        panel.set(xlim=middle[0] + np.array([-0.9, 0.9]), ylim=middle[1] + np.array([-0.9, 0.9]))
        words = f"{row['distance_mm']:.1f} mm: {'free' if row['verdict'] else 'not free'}"
        panel.set_title(f"figure 1, {words}", fontsize=10)
        panel.set_xlabel(f"{row['collision']}: {row['parts'][0]} and {row['parts'][1]}", fontsize=8)
        panel.set_aspect("equal")
    (moved,) = (row for row in rows if row["kind"] == "trajectory")
    panel = panels_of[2]
    panel.grid(visible=False)
    _machines(panel, cell, CORNER)
    _robot(panel, cell, CORNER, np.array(cell.park))
    panel.plot(*(np.array(moved["path"]) @ CORNER.T).T, color="tab:blue", lw=1.8, zorder=8)
    for k, point in enumerate(np.array(moved["points"]) @ CORNER.T, start=1):
        panel.plot(*point, "o", color="tab:red", ms=6, zorder=9)
        panel.annotate(str(k), point, xytext=(5, 5), textcoords="offset points", zorder=10)
    panel.set_title(f"figure 2: four points, {moved['seconds']:.2f} s", fontsize=10)
    panel.set(xticks=[], yticks=[])
    panel.set_aspect("equal")
    finished(figure, file)


def draw(rows: Sequence[Row], file: Path) -> None:
    """The cell from above with its zones, and from a corner with the tool's paths."""
    figure, (above, corner) = panels(2, width=4.8, height=5.0)
    cell = load_cell(CELL)
    for panel, view in ((above, ABOVE), (corner, CORNER)):
        panel.grid(visible=False)
        _machines(panel, cell, view)
        _robot(panel, cell, view, np.array(cell.park))
        panel.set_aspect("equal")
    named: set[str] = set()
    for row in rows:
        regional = row["kind"] == MovementKind.REGIONAL.value
        name = "regional movement" if regional else "service movement"
        path = np.array(row["path"]) @ CORNER.T
        colour = "tab:blue" if regional else "tab:red"
        corner.plot(*path.T, color=colour, lw=1.6, zorder=6, label=None if name in named else name)
        named.add(name)
    above.set(title="stations around the robot", xlabel="x [m]", ylabel="y [m]")
    corner.set(title="the tool's path in the program", xticks=[], yticks=[])
    for panel in (above, corner):
        panel.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.12), ncols=2)
    finished(figure, file)


def _machines(panel: Axes, cell: Cell, view: FloatArray) -> None:
    named: set[str] = set()
    for machine in cell.equipment:
        for body in machine.world_bodies():
            mesh = body_mesh(body)
            if mesh is not None:
                points = mesh.points @ body.pose[:3, :3].T + body.pose[:3, 3]
                _outline(panel, points @ view.T, fc="0.6", ec="0.4", alpha=0.35, lw=0.5, zorder=2)
        zone = machine.zone
        name = machine.zone.kind.lower().replace("_", "-") + " zone"
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        points = (0.5 * signs * zone.size) @ zone.pose[:3, :3].T + zone.pose[:3, 3]
        style = {"fc": "none", "ec": COLOURS[zone.kind], "lw": 1.6, "ls": "--", "zorder": 4}
        _outline(panel, points @ view.T, label=None if name in named else name, **style)
        named.add(name)
        x, y = view @ zone.pose[:3, 3]
        panel.text(x, y, machine.name, ha="center", va="center", fontsize=8, zorder=7, clip_on=True)


def _robot(panel: Axes, cell: Cell, view: FloatArray, q: FloatArray) -> None:
    scene = Planner(CELL).scene()
    links = scene.chain.link_poses(q[None])[0]
    loads = [capsule for load in scene.loads for capsule in load.capsules]
    for capsule in (*cell.robot.capsules, *loads):
        pose = links[capsule.link]
        points = capsule_mesh(capsule).points @ pose[:3, :3].T + pose[:3, 3]
        _outline(panel, points @ view.T, fc="tab:cyan", ec="tab:cyan", alpha=0.35, lw=0.5, zorder=3)


def _outline(panel: Axes, points: FloatArray, **style: Any) -> None:
    """The hull of points (P, 2)."""
    hull = points[ConvexHull(points).vertices]
    panel.add_patch(Polygon(hull, closed=True, **style))
    panel.update_datalim(hull)
    panel.autoscale_view()


PICTURES = Experiment(
    "figures_1_2",
    "Figures 1 and 2: metric distance and a trajectory through four points",
    "Figure 1 shows a robot in a semi-closed area with its metric distance of 20 units, the "
    "verdict, the type of collision and the parts in collision; figure 2 a trajectory through "
    "four points. (The figures themselves are not part of this repository; this is their "
    "description.)",
    f"In the semi-closed zone of `{STATION}` of `{CELL}` the first joint is turned until the "
    "service `check_state` answers a metric distance of 20 mm, and on until it answers a collision "
    "as deep; `plan_trajectory` is asked for four points around park. Drawn is what they answer.",
    measure_pictures,
    judge_pictures,
    follows_pictures,
    draw=draw_pictures,
    caption="Metric distance in a semi-closed area, free and in collision, from above; and the "
    "tool's path through four points.",
    seeded=False,
)

EXPERIMENT = Experiment(
    "figures",
    "The cell, service and regional movements",
    "The figures show a robot among technological equipment: stations around it with their "
    "forbidden zones, some open, some semi-closed, and movements of two kinds, service movements "
    "into and out of a machine's zone and regional ones from zone to zone. (The figures "
    "themselves are not part of this repository; this is their description.)",
    "The demonstration cell was made after them: five stations of equipment around the robot, "
    "two of them semi-closed. Drawn: the cell with its zones and the robot at its park posture; "
    "the path of the tool in the planned program, by kind of movement.",
    measure,
    judge,
    follows,
    draw=draw,
    caption="The demonstration from above with its zones (left), and the tool's path in its "
    "program (right).",
    seeded=False,
)
