"""The angle about the tool's axis along the path, where it is free: from the steps of the search to a smooth
function of least travel.
"""

from dataclasses import replace

import numpy as np
from scipy.interpolate import make_interp_spline

from ir_planner.cartesian.joint_curve import Angle
from ir_planner.cartesian.layers import Chain
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.request import Context


def angle_along(
    path: ToolPath, chain: Chain, free_angle: float, context: Context
) -> tuple[Angle | None, Chain]:
    """The angle over the arc length, None: not free, and the chain with it."""
    if free_angle == 0.0:
        return None, chain
    angles = np.unwrap(chain.angles)
    spline = make_interp_spline(chain.s, angles, k=3)
    return (lambda s: np.asarray(spline(s))), replace(chain, angles=angles)
