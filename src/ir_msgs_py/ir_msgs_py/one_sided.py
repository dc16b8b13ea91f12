"""Why an interval lies mostly above its value: said wherever people are shown both."""

from __future__ import annotations

ONE_SIDED = "mostly above it: losses that the data sheet puts at zero can only add"
_NEAR = 0.2  # of the interval: a value so near to its lower end


def one_sided(value: float, low: float, high: float) -> str:
    """The reason where a value [J] is near the lower end of its interval, else ""."""
    return ONE_SIDED if high > low and value - low < _NEAR * (high - low) else ""
