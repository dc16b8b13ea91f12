"""Forbidden zones of machines: oriented boxes that a regional movement stays out of."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from ir_description.poses import pose_of
from ir_description.shapes import SIZE_MAX, Body
from ir_values.arrays import FloatArray, frozen, frozen_pose
from ir_values.errors import InvalidValueError

ZoneKind = Literal["OPEN", "SEMI_CLOSED", "CLOSED"]
ZONE_KINDS: tuple[ZoneKind, ...] = get_args(ZoneKind)
ZONE_MAX = 10.0 * SIZE_MAX
"""Largest edge [m] of a zone: it holds bodies far apart."""


@dataclass(frozen=True, eq=False)
class Zone:
    """A forbidden zone: an oriented box, pose (4, 4) of its centre and full size (3,) [m].

    The kind is a name for pages and studies: it changes neither the zone nor a search.
    """

    kind: ZoneKind
    pose: FloatArray
    size: FloatArray

    def __post_init__(self) -> None:
        if self.kind not in ZONE_KINDS:
            raise InvalidValueError(
                f"kind of zone is {self.kind!r}, must be one of {', '.join(ZONE_KINDS)}"
            )
        object.__setattr__(self, "pose", frozen_pose(self.pose, "pose of the zone"))
        object.__setattr__(self, "size", frozen(self.size, (3,), "size of the zone"))
        if (self.size <= 0.0).any() or (self.size > ZONE_MAX).any():
            raise InvalidValueError(
                f"size of the zone is {self.size.tolist()} m, must be in (0, {ZONE_MAX:g}] m"
            )


def zone_around(kind: ZoneKind, bodies: Iterable[Body], tcps: Iterable[FloatArray] = ()) -> Zone:
    """Return the box of a machine's bodies and its stations' tcps (3,) [m] along the axes of its
    frame.

    What stands on a table belongs to it, up to the height of the station above it. Planes don't
    count. Raises InvalidValueError where there is nothing to enclose.
    """
    bounds = [body.bounds() for body in bodies if body.kind != "plane"]
    if not bounds:
        raise InvalidValueError(
            "the zone has no bodies to enclose; give its box (zone: {kind, size, ...})"
        )
    points = [*tcps]
    low = np.min([*(low for low, _ in bounds), *points], axis=0)
    high = np.max([*(high for _, high in bounds), *points], axis=0)
    return Zone(kind, pose_of((low + high) / 2.0), high - low)
