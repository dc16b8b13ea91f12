"""Where the elements of an SDF model or world stand.

Poses are relative to the parent, or to a frame by its name: a link, a joint, a <frame>, a model
beside it, or a frame of one (model::frame).

SDFormat 1.7 calls it relative_to, versions 1.5 and 1.6 frame.
"""

from __future__ import annotations

from xml.etree import ElementTree as Xml

import numpy as np

from ir_description.poses import (
    composed,
    inverse,
    pose_of,
    rotation_from_abc,
    rotation_from_quaternion,
)
from ir_values.arrays import FloatArray, number_of
from ir_values.errors import listed, shown

ROOTS = ("", "__model__", "world", "__root__")
"""What a model or world calls its own frame."""
_NAMED = ("link", "frame", "joint", "model", "include")


class Frames:
    """The frames of a model or world. Errors are ValueError in words."""

    def __init__(self, scope: Xml.Element) -> None:
        self._elements: dict[str, list[Xml.Element]] = {}
        for each in scope:
            if each.tag in _NAMED:
                name = each.findtext("name") if each.tag == "include" else each.get("name")
                self._elements.setdefault((name or "").strip(), []).append(each)

    def placed(self, element: Xml.Element, parent: FloatArray | None = None) -> FloatArray:
        """Pose (4, 4) of an element in the frame of the model or world; parent (4, 4): of what it
        is relative to where it names nothing.
        """
        named = _reference(element)
        if named or parent is None:
            return self._placed(element, named, ())
        return composed(parent, sdf_pose(element.find("pose")))

    def frame(self, name: str) -> FloatArray:
        """Pose (4, 4) of a frame by its name."""
        return self._frame(name, ())

    def _placed(self, element: Xml.Element, reference: str, asked: tuple[str, ...]) -> FloatArray:
        own = sdf_pose(element.find("pose"))
        placement = element.get("placement_frame") if element.tag == "model" else ""
        if placement:
            own = composed(own, inverse(Frames(element).frame(placement)))
        return composed(self._frame(reference, asked), own)

    def _frame(self, name: str, asked: tuple[str, ...]) -> FloatArray:
        if name in ROOTS:
            return np.eye(4)
        if name in asked:
            raise ValueError(f"the frames {listed(asked)} are relative to each other in a ring")
        first, _, rest = name.partition("::")
        found = self._elements.get(first, [])
        if len(found) != 1:
            known = listed(sorted(each for each in self._elements if each))
            raise ValueError(
                f"a pose is relative to {shown(name)}, of which there are {len(found)}; known are "
                f"{known or 'none'}"
            )
        (element,) = found
        parents = {"frame": element.get("attached_to"), "joint": element.findtext("child")}
        reference = _reference(element) or (parents.get(element.tag) or "").strip()
        pose = self._placed(element, reference, (*asked, name))
        if not rest:
            return pose
        if element.tag != "model":
            raise ValueError(
                f"a pose is relative to {shown(name)}, but {shown(first)} is no model of this "
                "file: write the pose out"
            )
        return composed(pose, Frames(element).frame(rest))


def _reference(element: Xml.Element) -> str:
    """The frame that the pose of an element names, "" for none."""
    pose = element.find("pose")
    named = "" if pose is None else pose.get("relative_to") or pose.get("frame") or ""
    return named.strip()


def sdf_pose(pose: Xml.Element | None) -> FloatArray:
    """The pose (4, 4) that a <pose> says by its numbers, whatever it is relative to."""
    words = [] if pose is None else (pose.text or "").split()
    if pose is None or not words:
        return np.eye(4)
    form = pose.get("rotation_format", "euler_rpy")
    if form not in ("euler_rpy", "quat_xyzw"):
        raise ValueError(f"a pose has the rotation_format {shown(form)}")
    count = 7 if form == "quat_xyzw" else 6
    values = np.array([number_of(word) for word in words])
    if len(values) != count or not np.isfinite(values).all():
        raise ValueError(f"the pose {shown(pose.text or '')} must be {count} numbers")
    if count == 6:
        angles = values[3:] if pose.get("degrees") == "true" else np.degrees(values[3:])
        return pose_of(values[:3], rotation_from_abc(angles[::-1]))
    length = float(np.linalg.norm(values[3:]))
    if abs(length - 1.0) > 1e-3:  # of printed digits
        raise ValueError(f"the pose {shown(pose.text or '')} has no quaternion of length 1")
    return pose_of(values[:3], rotation_from_quaternion(values[3:] / length))
