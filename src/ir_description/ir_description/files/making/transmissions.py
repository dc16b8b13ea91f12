"""Transmissions of a URDF: which motors turn with another joint than their own.

A robot file says so as `wrist_coupling`, a drive sheet too. What a URDF says of it is proposed in
words, not taken: its joints may already be those of the motors.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from xml.etree import ElementTree as Xml

FOUR_BAR = "FourBarLinkageTransmission"
DIFFERENTIAL = "DifferentialTransmission"
_PAIR = 2  # joints that share one of these


@dataclass(frozen=True)
class UrdfTransmission:
    """name; kind: FOUR_BAR or DIFFERENTIAL; joints: those that share it, first to last by their
    roles; reductions of these joints, 0 where one can't be read.
    """

    name: str
    kind: str
    joints: tuple[str, ...]
    reductions: tuple[float, ...]


def urdf_transmissions(root: Xml.Element) -> tuple[UrdfTransmission, ...]:
    """Those of a document that couple joints, in the notation of ROS 1 or of ros2_control."""
    found = []
    for element in root.iter("transmission"):
        kind = next((k for k in (FOUR_BAR, DIFFERENTIAL) if _kind(element).endswith(k)), "")
        if not kind:
            continue
        joints = sorted(element.findall("joint"), key=lambda joint: _text(joint, "role"))
        names = tuple(joint.get("name", "") for joint in joints)
        reductions = tuple(map(_reduction, joints))
        found.append(UrdfTransmission(element.get("name", ""), kind, names, reductions))
    return tuple(found)


def coupling_notes(found: Sequence[UrdfTransmission], axes: Sequence[str]) -> Iterator[str]:
    """What to say of those that couple two of the `axes`, by name from the first one on."""
    for each in found:
        if len(each.joints) != _PAIR or not set(each.joints) <= set(axes):
            continue
        said = "; what their motors turn with is left out until the drive sheet says it"
        if all(each.reductions):
            first, second = (axes.index(name) + 1 for name in each.joints)
            share = each.reductions[1] / each.reductions[0]
            if each.kind == FOUR_BAR:
                rows = f"[[{second}, {first}, {1.0 / each.reductions[1]:.4g}]]"
            else:
                there = f"{share:.4g}"
                back = f"{-1.0 / share:.4g}"
                rows = f"[[{first}, {second}, {there}], [{second}, {first}, {back}]]"
            said += (
                f": wrist_coupling: {{value: {rows}, source: URDF, confidence: M}}, if its joints "
                "are those of the arm and not those of the motors"
            )
        yield f"{each.joints[0]} and {each.joints[1]} share a {each.kind} ({each.name}){said}"


def _kind(element: Xml.Element) -> str:
    return _text(element, "type") or _text(element, "plugin") or element.get("type", "")


def _text(element: Xml.Element, tag: str) -> str:
    return (element.findtext(tag) or element.get(tag) or "").strip()


def _reduction(joint: Xml.Element) -> float:
    text = _text(joint, "mechanicalReduction") or _text(joint, "mechanical_reduction") or "1"
    try:
        return float(text)
    except ValueError:
        return 0.0
