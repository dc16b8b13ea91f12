"""What RViz and Foxglove see of service movements: the zone, all candidates, the closest pairs."""

from collections.abc import Sequence

import numpy as np

from ir_msgs_py.report import ServiceCandidate
from ir_planner.checks import CLOSEST, PATH, ZONES, Colour, Shape
from ir_planner.scene import PlanningScene

_NONE = np.zeros((0, 3))
_OTHERS: Colour = (0.45, 0.6, 0.85, 0.7)  # candidates after the best
_WHITE: Colour = (1.0, 1.0, 1.0, 1.0)
_SAMPLES = 60


def service_shapes(
    candidates: Sequence[ServiceCandidate], station: str, scene: PlanningScene
) -> tuple[Shape, ...]:
    """Shapes of ranked candidates at a station: the best path is thick, its closest pair has a
    label.
    """
    machine = scene.cell.machine(scene.station(station).equipment)
    zone = machine.zone
    shapes = []
    if machine.enabled:
        red, green, blue, alpha = ZONES[zone.kind]
        colour = (red, green, blue, min(2.0 * alpha, 1.0))
        shapes.append(Shape("service_zone", "box", zone.pose, zone.size, colour, _NONE))
    for rank, candidate in enumerate(candidates):
        if candidate.trajectory is None:
            continue
        times = np.linspace(candidate.trajectory.times[0], candidate.trajectory.times[-1], _SAMPLES)
        path = scene.chain.tcp_poses(candidate.trajectory.sample(times).q)[:, :3, 3]
        width = np.array([0.006 if rank else 0.014, 0.0, 0.0])
        colour = _OTHERS if rank else PATH
        shapes.append(Shape("service_candidates", "line", np.eye(4), width, colour, path))
        shapes.extend(_closest(candidate, rank == 0))
    return tuple(shapes)


def _closest(candidate: ServiceCandidate, labelled: bool) -> list[Shape]:
    """The line between the closest points of the path's nearest pair, and its label."""
    pair = candidate.report.closest
    if pair is None:
        return []
    ends = np.stack([pair.point_a, pair.point_b])
    shapes = [
        Shape("service_closest", "line", np.eye(4), np.array([0.012, 0.0, 0.0]), CLOSEST, ends)
    ]
    if labelled:
        pose = np.eye(4)
        pose[:3, 3] = ends.mean(axis=0) + np.array([0.0, 0.0, 0.05])
        text = f"{candidate.method}: {pair.distance * 1e3:.1f} mm {pair.body_a} - {pair.body_b}"
        shapes.append(Shape("service_closest", "text", pose, np.full(3, 0.06), _WHITE, _NONE, text))
    return shapes
