"""Figures 1 and 2 as pictures of the demonstration: cell and zones, service and regional
movements.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from _paper_result import MEASURED, Experiment, Row, Statement, finished, panels
from _regional_ours import planner_of
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from ir_description import Cell, load_cell
from ir_msgs_py.options import PlanOptions
from ir_msgs_py.report import MovementKind
from ir_recorder.report.shapes import body_mesh, capsule_mesh
from ir_values.arrays import FloatArray

CELL = "demo"
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
    planner = planner_of(CELL)
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


def draw(rows: Sequence[Row], file: Path) -> None:
    """The cell from above with its zones, and from a corner with the tool's paths."""
    figure, (above, corner) = panels(2, width=4.8, height=5.0)
    cell = load_cell(CELL)
    for panel, view in ((above, ABOVE), (corner, CORNER)):
        panel.grid(visible=False)
        _machines(panel, cell, view)
        _robot(panel, cell, view)
        panel.set_aspect("equal")
    named: set[str] = set()
    for row in rows:
        regional = row["kind"] == MovementKind.REGIONAL.value
        name = "regional movement" if regional else "service movement"
        path = np.array(row["path"]) @ CORNER.T
        colour = "tab:blue" if regional else "tab:red"
        corner.plot(*path.T, color=colour, lw=1.6, zorder=6, label=None if name in named else name)
        named.add(name)
    above.set(title="figure 1: stations around the robot", xlabel="x [m]", ylabel="y [m]")
    corner.set(title="figure 2: the tool's path in the program", xticks=[], yticks=[])
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
        panel.text(x, y, machine.name, ha="center", va="center", fontsize=8, zorder=7)


def _robot(panel: Axes, cell: Cell, view: FloatArray) -> None:
    scene = planner_of(CELL).scene()
    links = scene.chain.link_poses(np.array(cell.park)[None])[0]
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


EXPERIMENT = Experiment(
    "figures",
    "Figures 1 and 2: the cell, service and regional movements",
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
