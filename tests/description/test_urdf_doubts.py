"""Scalars of a URDF that its own geometry or the industry's range contradicts are doubted in a
sentence or refused, on drawn arms; those of a sound arm are not.
"""

from __future__ import annotations

from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from ir_description.files.making import (
    TEMPLATE,
    Meshes,
    UrdfArm,
    drive_sheet,
    estimated_sheet,
    link_bodies,
    urdf_arm,
    with_masses,
)
from ir_values.errors import RobotFileError

AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
SEEDS = range(8)


def drawn(seed: int) -> tuple[Xml.Element, np.random.Generator]:
    """A six-axis arm of boxes of drawn sizes, solid and full of holes, and what goes on drawing."""
    draw = np.random.default_rng(seed)
    root = Xml.Element("robot", name="drawn")
    scale = draw.uniform(0.3, 3.0)
    for k in range(7):
        edges = scale * draw.uniform(0.08, 0.5, 3)
        at = " ".join(f"{x:.6g}" for x in scale * draw.uniform(-0.1, 0.1, 3))
        mass = scale**3 * draw.uniform(5.0, 60.0)
        link = Xml.SubElement(root, "link", name=f"l{k}")
        inertial = Xml.SubElement(link, "inertial")
        Xml.SubElement(inertial, "origin", xyz=at)
        Xml.SubElement(inertial, "mass", value=f"{mass:.6g}")
        squares = edges**2
        moments = draw.uniform(0.3, 2.5) * mass / 12.0 * (squares.sum() - squares)
        entries = {f"i{a}{a}": f"{x:.9g}" for a, x in zip("xyz", moments, strict=True)}
        Xml.SubElement(inertial, "inertia", entries, ixy="0", ixz="0", iyz="0")
        collision = Xml.SubElement(link, "collision")
        Xml.SubElement(collision, "origin", xyz=at)
        geometry = Xml.SubElement(collision, "geometry")
        Xml.SubElement(geometry, "box", size=" ".join(f"{x:.6g}" for x in edges))
    for k, axis in enumerate(AXES):
        joint = Xml.SubElement(root, "joint", name=f"j{k + 1}", type="revolute")
        Xml.SubElement(joint, "parent", link=f"l{k}")
        Xml.SubElement(joint, "child", link=f"l{k + 1}")
        Xml.SubElement(joint, "origin", xyz=f"{0.3 * scale:.6g} 0 {0.2 * scale:.6g}")
        Xml.SubElement(joint, "axis", xyz=axis)
        low, high = (f"{x:.17g}" for x in (-draw.uniform(0.5, 9.4), draw.uniform(0.5, 9.4)))
        speed = f"{draw.uniform(0.5, 21.0):.6g}"
        Xml.SubElement(joint, "limit", lower=low, upper=high, velocity=speed, effort="0")
    return root, draw


def text_of(root: Xml.Element) -> str:
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode")


def line_of(root: Xml.Element, tag: str, name: str) -> int:
    """The line of the link or joint `name`."""
    lines = text_of(root).splitlines()
    return 1 + next(k for k, line in enumerate(lines) if f'<{tag} name="{name}"' in line)


def read(root: Xml.Element, mass: float | None = None) -> tuple[UrdfArm, tuple[str, ...]]:
    """The arm with its masses, and all sentences."""
    arm = urdf_arm(text_of(root), "arm.urdf")
    bodies = [link_bodies(link.shapes, Meshes(Path(), None)) for link in arm.links]
    weighed, notes = with_masses(arm, bodies, mass)
    sheet = estimated_sheet("drawn", "", 5.0, weighed)
    return weighed, (*arm.notes, *notes, *sheet.notes)


@pytest.mark.parametrize("seed", SEEDS)
def test_a_sound_arm_is_not_doubted(seed: int) -> None:
    root, _ = drawn(seed)
    assert read(root)[1] == ()


RANGE = {"position_min_deg": -90.0, "position_max_deg": 90.0}
LIMITS = {
    "lower": ("rad", RANGE),
    "upper": ("rad", RANGE),
    "velocity": ("rad/s", {"velocity_deg_s": 90.0}),
}


@pytest.mark.parametrize("key", LIMITS)
@pytest.mark.parametrize("seed", SEEDS)
def test_limits_in_degrees_are_refused_with_joint_line_and_remedy_unless_the_sheet_has_them(
    seed: int, key: str
) -> None:
    root, draw = drawn(seed)
    unit, stated = LIMITS[key]
    name = f"j{draw.integers(1, 7)}"
    degrees = (-1 if key == "lower" else 1) * draw.uniform(30.0, 360.0)
    limit = root.find(f"joint[@name='{name}']/limit")
    assert limit is not None
    limit.set(key, f"{degrees:.6g}")
    with pytest.raises(RobotFileError) as error:
        read(root)
    said = str(error.value)
    assert said.startswith(f"arm.urdf:{line_of(root, 'joint', name)}: joint {name} ")
    assert f"{degrees:.6g} {unit}, must be" in said
    assert "degrees?" in said
    assert "(--drives)" in said
    sheet = TEMPLATE
    for row, each in stated.items():
        known = f"{row}: {{value: {[each] * 6}, source: data sheet, confidence: H}}"
        sheet = sheet.replace(f"{row}: unknown", known)
    drive_sheet(sheet, "drives.yaml", urdf_arm(text_of(root), "arm.urdf"))
