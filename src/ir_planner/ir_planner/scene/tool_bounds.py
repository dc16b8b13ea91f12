"""Bounds of how fast the tool may move and change its speed, whatever the joints could do."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from ir_description.robot import ToolLimits


class PointBounds(NamedTuple):
    """speed [m/s] and acceleration [m/s^2] that a point may have; inf: any."""

    speed: float = np.inf
    acceleration: float = np.inf

    @property
    def asked(self) -> bool:
        """Whether one of them is finite."""
        return min(self.speed, self.acceleration) < np.inf

    def within(self, other: PointBounds) -> PointBounds:
        """The smaller ones of both."""
        return PointBounds(min(self.speed, other.speed), min(self.acceleration, other.acceleration))

    def for_speed(self, share: float) -> PointBounds:
        """What a motion has to keep so that it keeps these at 1 / share times its speed."""
        return PointBounds(self.speed * share, self.acceleration * (share * share))

    def longer(self, speed: float, acceleration: float) -> float:
        """By what factor a motion with these largest values should last longer; at most 1: within
        the bounds.
        """
        return max(speed / self.speed, float(np.sqrt(acceleration / self.acceleration)))


ANY = PointBounds()


class ToolBounds(NamedTuple):
    """Of the tcp, and of every point of the capsules of tool and part."""

    tcp: PointBounds = ANY
    whole: PointBounds = ANY

    @staticmethod
    def of(limits: Iterable[ToolLimits]) -> ToolBounds:
        """What keeps all of the limits."""
        bounds = ToolBounds()
        for one in limits:
            asked = PointBounds(one.speed or np.inf, one.acceleration or np.inf)
            bounds = bounds.within(ToolBounds(whole=asked) if one.whole else ToolBounds(tcp=asked))
        return bounds

    @property
    def asked(self) -> bool:
        """Whether anything is bounded."""
        return self.tcp.asked or self.whole.asked

    def within(self, other: ToolBounds) -> ToolBounds:
        """The smaller ones of both."""
        return ToolBounds(self.tcp.within(other.tcp), self.whole.within(other.whole))

    def for_speed(self, share: float) -> ToolBounds:
        """What a motion has to keep so that it keeps these at 1 / share times its speed."""
        if not self.asked:
            return self
        return ToolBounds(self.tcp.for_speed(share), self.whole.for_speed(share))

    def text(self) -> str:
        """What is bounded, as a sentence goes on; "" for nothing."""
        said = []
        for what, bounds in (("the tcp", self.tcp), ("tool and part", self.whole)):
            if bounds.speed < np.inf:
                said.append(f"{what} at most {bounds.speed:g} m/s")
            if bounds.acceleration < np.inf:
                said.append(f"{what} at most {bounds.acceleration:g} m/s^2")
        return ", ".join(said)


UNBOUNDED = ToolBounds()
"""As fast as the axes allow."""
