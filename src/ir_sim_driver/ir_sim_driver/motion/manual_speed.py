"""Operating mode T1: the tool keeps 250 mm/s, by looking ahead along the path.

From path speed v a stop at rate r covers v^2 / 2r of path time, so the speed that may be had now is
bounded by what is allowed at every later place s': v^2 <= allowed(s')^2 + 2 r (s' - s).
"""

from __future__ import annotations

import numpy as np

from ir_sim_driver.motion.path import Path
from ir_sim_driver.motion.tool_point import ToolPoint

TOOL_SPEED = 0.25
"""Largest speed of the tool in T1 [m/s]."""
_MARGIN = 0.98  # the speed is kept from step to step, not exactly
_SHARE = 0.7  # of the rate; the limits of the joints may make stops longer
_SAMPLES = 24


def manual_scaling(tool: ToolPoint, path: Path, s: float, stop_time: float) -> float:
    """Largest path speed at path time s [s] that keeps the tool's speed from here on."""
    rate = _SHARE / stop_time
    ahead = np.linspace(0.0, 0.5 / rate, _SAMPLES)
    motions = [path.motion(min(s + float(step), path.duration)) for step in ahead]
    speeds = tool.speeds(np.array([m.q for m in motions]), np.array([m.qd for m in motions]))
    allowed = np.minimum(1.0, _MARGIN * TOOL_SPEED / np.maximum(speeds, 1e-9))
    return float(np.sqrt(allowed**2 + 2.0 * rate * ahead).min(initial=1.0))
