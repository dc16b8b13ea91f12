"""What the axes take from the DC bus at most, between samples too."""

from dataclasses import dataclass

from ir_values.arrays import FloatArray


@dataclass(frozen=True)
class PowerBounds:
    """Of consecutive pieces of a trajectory: seconds (K,) that they last. In each the sum of the
    axes' powers is at every instant at most net (K,) W, the sum of those that take power at most
    taken (K,) W; rounding and Coulomb friction of either sign where a joint turns are included.
    """

    seconds: FloatArray
    net: FloatArray
    taken: FloatArray


def power_bounds(seconds: FloatArray, net: FloatArray, taken: FloatArray) -> PowerBounds:
    """The bounds, read-only; arrays (K,)."""
    for array in (seconds, net, taken):
        array.setflags(write=False)
    return PowerBounds(seconds, net, taken)
