"""The drives' common DC bus, step by step: the oracle of the compiled scan."""

import numpy as np

from ir_values.arrays import FloatArray


def dc_bus(
    axis_power: FloatArray, dt: FloatArray, capacity: float, regeneration: str, stored: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mains W, dissipated W and stored J (N,) for axis_power (N, n) W; see
    `ir_kernels.power.dc_bus`.
    """
    N = len(axis_power)
    mains = np.empty(N)
    dissipated = np.zeros(N)
    level = np.empty(N)
    for k in range(N):
        if regeneration == "none":
            mains[k] = sum(max(p, 0.0) for p in axis_power[k])
            dissipated[k] = sum(max(-p, 0.0) for p in axis_power[k])
        else:
            net = float(sum(axis_power[k])) * dt[k]  # J that the axes want in this step
            moved = min(net, stored) if net > 0.0 else -min(-net, capacity - stored)
            stored -= moved
            rest = net - moved  # J that the capacitor could not give or take
            if rest < 0.0 and regeneration == "shared":
                dissipated[k] = -rest / dt[k]
                rest = 0.0
            mains[k] = rest / dt[k]
        level[k] = stored
    return mains, dissipated, level
