"""Which station or posture a configuration stands at."""

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import FloatArray
from ir_planner.curves import turn_of
from ir_planner.request import POSTURES
from ir_planner.scene import PlanningScene

PLACE_TOLERANCE = 2e-3  # m: taught points differ from a station's pose by about this
TURN_TOLERANCE = np.radians(0.5)
AXIS_TOLERANCE = np.radians(0.2)


def station_at(scene: PlanningScene, q: FloatArray) -> str:
    """Name of the station whose pose the tcp has at q (n,), else ""."""
    tcp = scene.chain.tcp_poses(q[None])[0]
    for station in scene.cell.stations:
        away = float(portable.norm(station.pose[:3, 3] - tcp[:3, 3]))
        turned = turn_of(portable.matmul(station.pose[:3, :3].T, tcp[:3, :3]))
        if away <= PLACE_TOLERANCE and turned <= TURN_TOLERANCE:
            return station.name
    return ""


def posture_at(scene: PlanningScene, q: FloatArray) -> str:
    """Name of the posture that q (n,) is, else ""."""
    for name in POSTURES:
        if np.abs(q - scene.cell.posture(name)).max() <= AXIS_TOLERANCE:
            return name
    return ""
