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
        speed = f"{draw.uniform(0.5, 25.3):.6g}"
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
    degrees = (-1 if key == "lower" else 1) * draw.uniform(31.0, 360.0)
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


def part(root: Xml.Element, path: str) -> Xml.Element:
    found = root.find(path)
    assert found is not None
    return found


def scaled(inertia: Xml.Element, factor: float) -> None:
    for key in ("ixx", "iyy", "izz"):
        inertia.set(key, f"{factor * float(inertia.get(key, '')):.9g}")


SPOILED = {
    "com": (1.0, 1e3, " m beside its bodies, must be at most ", "correct the <origin>"),
    "kg cm^2": (1e4, 1e7, " m, for bodies of its size it must be from ", "correct its <inertia>"),
    "placeholder": (1e-9, 1e-4, " m, for bodies of its size it must be", "correct its <inertia>"),
}


@pytest.mark.parametrize("what", SPOILED)
@pytest.mark.parametrize("seed", SEEDS)
def test_what_the_bodies_of_a_link_contradict_is_doubted_with_its_line_and_remedy(
    seed: int, what: str
) -> None:
    root, draw = drawn(seed)
    least, most, bound, remedy = SPOILED[what]
    name = f"l{draw.integers(0, 7)}"
    amount = np.exp(draw.uniform(np.log(least), np.log(most)))
    if what == "com":
        size = part(root, f"link[@name='{name}']/collision/geometry/box").get("size", "")
        far = (4.0 + amount) * np.linalg.norm([float(x) for x in size.split()])
        direction = draw.normal(size=3)
        to = np.minimum(far, 90.0) * direction / np.linalg.norm(direction)
        at = " ".join(f"{x:.6g}" for x in to)
        part(root, f"link[@name='{name}']/inertial/origin").set("xyz", at)
    else:
        scaled(part(root, f"link[@name='{name}']/inertial/inertia"), amount)
    arm, notes = read(root)
    (said, *more) = notes
    assert said.startswith(f"link {name} (line {line_of(root, 'link', name)}): its ")
    assert bound in said
    assert remedy in said
    assert not more
    link = arm.links[int(name[1:])]
    assert link.doubted == (what == "com")
    assert bool(link.moments) == (what != "com")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_torque_that_a_doubted_centre_of_mass_raises_names_it(seed: int) -> None:
    root, draw = drawn(seed)
    for limit in root.iter("limit"):
        limit.set("effort", "200000")
    k = int(draw.integers(3, 7))
    part(root, f"link[@name='l{k}']/inertial/origin").set("xyz", "60 50 40")
    part(root, f"link[@name='l{k}']/inertial/mass").set("value", "9000")
    notes = read(root)[1]
    raised = [note for note in notes if note.startswith("effort of ")]
    place = f"link l{k} (line {line_of(root, 'link', f'l{k}')})"
    assert any(note.startswith("effort of j2 is 200000 Nm") for note in raised)
    for note in raised:
        assert (f"the doubted centre of mass of {place}" in note) == (int(note[11]) <= k)


@pytest.mark.parametrize("seed", SEEDS)
def test_masses_that_are_all_alike_are_doubted_unless_the_mass_is_stated(seed: int) -> None:
    root, _ = drawn(seed)
    for link in root.iter("link"):
        mass = part(link, "inertial/mass")
        scaled(part(link, "inertial/inertia"), 1.0 / float(mass.get("value", "")))
        mass.set("value", "1")
    (said,) = read(root)[1]
    assert said.startswith("link l1 (line ")
    assert "all other moving links weigh 1 kg" in said
    assert "--mass KG" in said
    assert read(root, 7.0)[1] == ()


@pytest.mark.parametrize("seed", SEEDS)
def test_missing_entries_of_an_inertia_are_said(seed: int) -> None:
    root, draw = drawn(seed)
    name = f"l{draw.integers(0, 7)}"
    keys = [key for key in ("ixy", "ixz", "iyz") if draw.random() < 0.5] or ["iyz"]
    for key in keys:
        del part(root, f"link[@name='{name}']/inertial/inertia").attrib[key]
    (said,) = read(root)[1]
    assert said.startswith(f"the <inertia> of link {name} (line ")
    assert f"has no {', '.join(keys)}: 0 kg m^2 " in said


@pytest.mark.parametrize("k", range(7))
def test_a_link_of_the_arm_itself_is_never_left_out(k: int) -> None:
    root, _ = drawn(k)
    with pytest.raises(RobotFileError, match=rf"arm.urdf:\d+: link l{k} is part of the arm"):
        urdf_arm(text_of(root), "arm.urdf", without=[f"l{k}"])


@pytest.mark.parametrize("leader", ["none", "follower"])
@pytest.mark.parametrize("seed", SEEDS)
def test_a_follower_of_no_joint_or_itself_keeps_its_own_limits_and_says_so(
    seed: int, leader: str
) -> None:
    root, draw = drawn(seed)
    rod = Xml.SubElement(root, "link", name="rod")
    geometry = Xml.SubElement(Xml.SubElement(rod, "collision"), "geometry")
    Xml.SubElement(geometry, "sphere", radius="0.05")
    joint = Xml.SubElement(root, "joint", name="follower", type="prismatic")
    Xml.SubElement(joint, "parent", link=f"l{draw.integers(0, 7)}")
    Xml.SubElement(joint, "child", link="rod")
    Xml.SubElement(joint, "limit", lower="0", upper="0.1")
    Xml.SubElement(joint, "mimic", joint=leader, multiplier="3")
    arm = urdf_arm(text_of(root), "arm.urdf", tip="l6")
    (motion,) = (each for link in arm.links for s in link.shapes for each in s.motions)
    assert (motion.lower, motion.upper) == (0.0, 0.1)
    line = line_of(root, "joint", "follower")
    assert arm.notes[0].startswith(f"joint follower (line {line}) mimics '{leader}', ")
    assert "within its own limits" in arm.notes[0]
