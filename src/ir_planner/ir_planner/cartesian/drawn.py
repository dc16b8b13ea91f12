"""A request's path as it is drawn, with all configurations along it, and what a movement keeps of
it.
"""

from dataclasses import dataclass, replace

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.cartesian import TANGENT, CartesianPath
from ir_msgs_py.status import StatusCode
from ir_planner.cartesian.asked import Asked
from ir_planner.cartesian.best import T1_SPEED, DrivenPath
from ir_planner.cartesian.corners import REVERSAL, Joint, joined
from ir_planner.cartesian.layers import Layers, layers_of
from ir_planner.cartesian.parts import parts_of
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.cartesian.tool_error import Kept, kept_of
from ir_planner.cartesian.tool_path import ToolPath
from ir_planner.request import Context

TOOL_ERROR_MAX = 1e-4  # m


@dataclass(frozen=True, eq=False)
class Drawn:
    """What is asked for, how its parts are joined, and the configurations along it."""

    asked: Asked
    joints: tuple[Joint, ...]
    layers: Layers

    @property
    def lengths(self) -> FloatArray:
        """Where the K segments end (K,) m."""
        whole = self.asked.whole
        return whole.ends[1:][[part.kept for part in whole.parts]]

    def kept(self, driven: DrivenPath) -> Kept:
        """What a movement keeps of the path. Raises PathRefusedError where that isn't enough."""
        found = kept_of(driven.sent, self.asked.whole, driven.angle, self.asked.context.scene)
        leaves = max((joint.leaves for joint in self.joints), default=0.0)
        turns = max((joint.turns for joint in self.joints), default=0.0)
        found = replace(
            found, tool_error=found.tool_error + leaves, rotation_error=found.rotation_error + turns
        )
        if found.tool_error > TOOL_ERROR_MAX:
            raise PathRefusedError(
                f"the tool can't be shown to keep within {TOOL_ERROR_MAX * 1e3:g} mm of the path: "
                f"{found.tool_error * 1e3:.3g} mm"
            )
        return found


def drawn(path: CartesianPath, start: FloatArray | None, t1: bool, context: Context) -> Drawn:
    """A path with its configurations, from `start` (n,) or from all. Raises PathRefusedError."""
    if t1:
        path = _at_most(path, T1_SPEED)
    with context.journal.stage("path") as notes:
        whole, joints = joined(path, parts_of(path))
        _check_corners(path, whole, joints)
        notes.append(f"{whole.length:.3f} m in {len(whole.parts)} parts")
        if (reduced := _reduced(path, whole, joints)) < path.blending_radius:
            notes.append(f"blending radius down to {reduced:.4g} m: half of a part")
    asked = Asked(path, whole, start is not None, t1, context)
    with context.journal.stage("configurations") as notes:
        layers = layers_of(whole, path.free_angle, asked.space, start)
        notes.append(f"{len(layers.q)} at {len(layers.s)} samples, {int(layers.free.sum())} free")
    return Drawn(asked, joints, layers)


def _at_most(path: CartesianPath, speed: float) -> CartesianPath:
    segments = tuple(replace(one, tool_speed=min(one.tool_speed, speed)) for one in path.segments)
    return replace(path, tool_speed=min(path.tool_speed, speed), segments=segments)


def _reduced(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> float:
    """The smallest radius [m] of a corner that is rounded as asked for."""
    rounded = [joint.radius for joint in joints if joint.rounded]
    return min(rounded, default=path.blending_radius)


def _check_corners(path: CartesianPath, whole: ToolPath, joints: tuple[Joint, ...]) -> None:
    """Raise PathRefusedError at a corner within the path where the tool would have to stop and may
    not.
    """
    for k, joint in enumerate(joints, start=1):
        before = whole.parts[k - 1]
        after = whole.parts[k]
        if joint.radius > 0.0 or not (before.kept and after.kept):
            continue
        corner = (
            f"at {whole.ends[k]:.3f} m the path has a corner of {np.degrees(joint.angle):.1f} deg"
        )
        if path.orientation == TANGENT:
            raise PathRefusedError(
                f"{corner}: a tool that turns with the path can't follow it; give a "
                "blending_radius",
                StatusCode.INVALID_MOTION_PLAN,
            )
        if path.speed_tolerance < 1.0:
            rounding = "" if joint.angle > REVERSAL else "give a blending_radius, or "
            raise PathRefusedError(
                f"{corner}, where the tool can't keep {before.speed:g} m/s: {rounding}"
                f"speed_tolerance 1 to stop there (it is {path.speed_tolerance:g})",
                StatusCode.INVALID_MOTION_PLAN,
            )
