"""Where a trajectory is at many instants: the interpolant that everything rests on, by the compiled
core.
"""

import numpy as np
from numpy.typing import NDArray

from ir_kernels import polynomial_samples
from ir_msgs_py.trajectory import JointTrajectory, Samples


def motion_at(trajectory: JointTrajectory, times: NDArray[np.floating]) -> Samples:
    """q, qd, qdd (M, n) at times (M,) s within the trajectory; jerk (0, n) is left out."""
    coefficients, durations = trajectory.coefficients()
    if len(durations) == 0:
        return trajectory.sample(times)
    found = polynomial_samples(coefficients, durations, trajectory.times[:-1], times)
    return Samples(*found, np.zeros((0, coefficients.shape[1])))
