"""Speed and acceleration from positions alone: local polynomials (Savitzky and Golay, 1964), zero
phase.

On a uniform grid a polynomial of degree 4 is fitted to the neighbours of each sample; its value and
derivatives in the middle are one convolution each. Half the signal passes at the stated bandwidth
(Schafer, "What is a Savitzky-Golay filter?", 2011, eq. 12, inverted for the half width).
"""

from __future__ import annotations

import math

import numpy as np

from ir_msgs_py.arrays import FloatArray

BANDWIDTH = 16.0  # Hz: above what a loaded arm does, below the rounding of encoders
_DEGREE = 4


def half_width(rate: float, bandwidth: float = BANDWIDTH) -> int:
    """Neighbours on each side for a cut-off of `bandwidth` [Hz] (3 dB) at `rate` [Hz]; at least
    3.
    """
    return max(3, math.ceil(((_DEGREE + 1) * rate / (2.0 * bandwidth) + 4.6) / 3.2))


def kernels(width: int, step: float) -> FloatArray:
    """Weights (3, 2 width + 1) of the neighbours for value, first and second derivative at step
    [s].
    """
    places = np.arange(-width, width + 1) * step
    scale = width * step  # keeps the powers within 1
    powers = np.vander(places / scale, _DEGREE + 1, increasing=True)
    weights = np.linalg.pinv(powers)[:3]
    return np.asarray(weights * np.array([[1.0], [1.0 / scale], [2.0 / scale**2]]))


def differentiated(values: FloatArray, step: float, bandwidth: float = BANDWIDTH) -> FloatArray:
    """Value, speed and acceleration (3, N, n) of positions (N, n) on a grid of `step` [s].

    At both ends the robot counts as at rest there.
    """
    width = half_width(1.0 / step, bandwidth)
    padded = np.pad(values, ((width, width), (0, 0)), mode="edge")
    found = np.empty((3, *values.shape))
    for order, weights in enumerate(kernels(width, step)):
        for joint in range(values.shape[1]):
            found[order, :, joint] = np.correlate(padded[:, joint], weights, mode="valid")
    return found
