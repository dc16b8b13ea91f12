"""A small picture of a cell: bodies and robot as shaded outlines, seen from a corner above."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial import ConvexHull

from ir_description import Cell
from ir_kernels import Chain
from ir_msgs_py.arrays import FloatArray
from ir_recorder.report.number_text import text
from ir_recorder.report.shapes import body_mesh, capsule_mesh

WIDTH = 220.0  # of the drawing; its height follows
_AZIMUTH = math.radians(35.0)
_ELEVATION = math.radians(28.0)
_MARGIN = 6.0


def cell_picture(cell: Cell, q: FloatArray) -> str:
    """SVG of the cell with its robot at q (n,); each convex body is the hull of what is seen of
    it.
    """
    chain = Chain(cell.robot, cell.base_pose, cell.tcp)
    links = chain.link_poses(q[None])[0]
    solids: list[tuple[str, FloatArray]] = []
    for body in cell.bodies():
        mesh = body_mesh(body)
        if mesh is not None:
            solids.append(("base", mesh.points @ body.pose[:3, :3].T + body.pose[:3, 3]))
    loads = [capsule for load in cell.loads("") for capsule in load.capsules]
    for kind, capsules in (("a2", cell.robot.capsules), ("a5", loads)):
        for capsule in capsules:
            pose = links[capsule.link]
            solids.append((kind, capsule_mesh(capsule).points @ pose[:3, :3].T + pose[:3, 3]))
    return _drawn(cell.name, solids)


def _drawn(name: str, solids: list[tuple[str, FloatArray]]) -> str:
    """Solids (V, 3) m from far to near, as polygons."""
    right, up, near = _view()
    flat = [
        (kind, np.stack([points @ right, -(points @ up)], 1), points @ near)
        for kind, points in solids
    ]
    flat.sort(key=lambda one: float(one[2].mean()))
    every = np.concatenate([points for _, points, _ in flat])
    low = every.min(axis=0)
    high = every.max(axis=0)
    scale = (WIDTH - 2 * _MARGIN) / max(float(high[0] - low[0]), 1e-6)
    height = scale * float(high[1] - low[1]) + 2 * _MARGIN
    shapes = []
    for kind, points, _ in flat:
        outline = points[ConvexHull(points).vertices]
        corners = " ".join(f"{x:.1f},{y:.1f}" for x, y in scale * (outline - low) + _MARGIN)
        shapes.append(f'<polygon style="fill:var(--{kind})" points="{corners}"/>')
    return (
        f'<svg class="cell" viewBox="0 0 {WIDTH:g} {height:.0f}" role="img" '
        f'aria-label="{text(name)}">'
        f"{''.join(shapes)}</svg>"
    )


def _view() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Unit vectors to the right, up, and towards who looks."""
    ca = math.cos(_AZIMUTH)
    sa = math.sin(_AZIMUTH)
    ce = math.cos(_ELEVATION)
    se = math.sin(_ELEVATION)
    near = np.array([ce * ca, -ce * sa, se])
    right = np.array([sa, ca, 0.0])
    return right, np.cross(near, right), near
