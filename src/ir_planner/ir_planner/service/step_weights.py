"""How far each joint steps in the walk of eq. (7): weighted by the mass from the tool to the joint.

M_i = sum_{l>=i} m_l, the load with the last link. As printed W_i is proportional to M_i
("literal"); the option "inverse" lets the light joints, which move little of the arm, step more.
"""

import numpy as np

from ir_msgs_py.arrays import FloatArray

WEIGHTINGS = ("literal", "inverse")


def accumulated_mass(link_mass: FloatArray, load_mass: float = 0.0) -> FloatArray:
    """M (n,) kg behind each joint; `link_mass` (n+1,) from the base on."""
    mass = np.array(link_mass[1:], dtype=float)
    mass[-1] += load_mass
    return np.ascontiguousarray(np.cumsum(mass[::-1])[::-1])


def step_weights(link_mass: FloatArray, load_mass: float, weighting: str) -> FloatArray:
    """W (n,) with mean 1: proportional to M, or to 1/M."""
    mass = accumulated_mass(link_mass, load_mass)
    weight = mass if weighting == "literal" else 1.0 / np.maximum(mass, 1e-9)
    return np.asarray(weight / weight.mean())
