"""What stands in a URDF is read or refused with its line: numbers, names, limits, bodies."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

from ir_description import InvalidValueError
from ir_description.files.collada import triangles_from_collada
from ir_description.files.making import (
    Meshes,
    expanded,
    fitted,
    link_bodies,
    urdf_arm,
    with_masses,
    xml_text,
)
from ir_values.arrays import FloatArray
from ir_values.errors import RobotFileError

AXES = ("0 0 1", "0 1 0", "0 1 0", "1 0 0", "0 1 0", "1 0 0")
PLACES = ("0 0 0.4", "0.2 0 0", "0 0 0.6", "0.3 0 0.1", "0.3 0 0", "0.1 0 0")


def arm_text(
    extra: str = "",
    shape: str = '<sphere radius="0.06"/>',
    inertial: str = '<inertial><origin xyz="0 0 0.05"/><mass value="9"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>',
) -> str:
    """A URDF of six axes, each link with one shape; `extra` stands at its end."""
    names = ["base_link", *(f"l{k}" for k in range(1, 7))]
    body = f"<collision><geometry>{shape}</geometry></collision>"
    lines = ['<robot name="arm">']
    lines += [f'<link name="{name}">{inertial}{body}</link>' for name in names]
    for k in range(6):
        lines.append(
            f'<joint name="j{k + 1}" type="revolute"><parent link="{names[k]}"/>'
            f'<child link="{names[k + 1]}"/><origin xyz="{PLACES[k]}"/><axis xyz="{AXES[k]}"/>'
            '<limit lower="-2.5" upper="2.5" effort="900" velocity="3"/></joint>'
        )
    lines.append('<link name="tool0"/><joint name="jt" type="fixed"><parent link="l6"/>')
    lines.append('<child link="tool0"/><origin xyz="0.08 0 0"/></joint>')
    return "\n".join([*lines, extra, "</robot>"])


@pytest.mark.parametrize("lines", [1, 3])
def test_blank_lines_above_the_declaration_count_as_lines_alone(lines: int) -> None:
    declared = f'{chr(10) * lines}<?xml version="1.0" encoding="utf-8"?>{arm_text()}'
    assert urdf_arm(declared, "arm.urdf").origin == pytest.approx(
        urdf_arm(arm_text(), "arm.urdf").origin
    )
    wrong = declared.replace('lower="-2.5"', 'lower="nan"', 1)
    with pytest.raises(RobotFileError, match=rf":{9 + lines}: lower of limit of joint j1"):
        urdf_arm(wrong, "arm.urdf")


@pytest.mark.parametrize("encoding", ["ISO-8859-1", "windows-1252", "iso-8859-15", "utf-8", ""])
def test_a_urdf_is_read_in_the_encoding_that_it_declares(encoding: str) -> None:
    text = arm_text().replace('name="arm"', 'name="Kräftig"')
    declared = f" encoding='{encoding}'" if encoding else ""
    text = f'<?xml version="1.0"{declared}?>\n{text}'
    assert xml_text(text.encode(encoding or "utf-8"), "arm.urdf") == text
    assert urdf_arm(text, "arm.urdf").name == "Kräftig"


@pytest.mark.parametrize(
    ("encoding", "content", "said"),
    [
        ("shift_jis", "力".encode("shift_jis"), "declares the encoding 'shift_jis', which is not"),
        ("rot13", b"\xe4", "declares the encoding 'rot13', which is not read: save it as UTF-8"),
        ("windows-1252", b"\x81", "'windows-1252', where byte 0x81 is no character"),
        ("iso-8859-99", b"\xe4", "'iso-8859-99', which is not read"),
        ("utf-8", b"\xe4", "byte 0xe4 is not UTF-8 text"),
    ],
)
def test_an_encoding_that_is_not_read_is_named(encoding: str, content: bytes, said: str) -> None:
    text = f'<?xml version="1.0" encoding="{encoding}"?><robot name="'.encode() + content + b'"/>'
    with pytest.raises(RobotFileError, match=said):
        xml_text(text, "arm.urdf")


HOSTILE = (
    ('lower="-2.5"', 'lower="nan"', r":9: lower of limit of joint j1 is 'nan', must be a finite"),
    ('upper="2.5"', 'upper="inf"', r"is 'inf', must be a finite number"),
    ('lower="-2.5" upper="2.5"', 'lower="2.5" upper="-2.5"', "from 2.5 to -2.5 rad: lower must be"),
    ('effort="900"', 'effort="-1"', "effort of joint j1 is -1, must not be negative"),
    ('velocity="3"', 'velocity="fast"', "velocity of limit of joint j1 is 'fast'"),
    ('link name="l1"', 'link name="arm/l1"', "a link is called 'arm/l1': rename it"),
    ('joint name="j1"', 'joint name="1"', "a joint is called '1': rename it"),
    ('mass value="9"', 'mass value="heavy"', "value of mass of link base_link is 'heavy'"),
    ('mass value="9"', 'mass value="-9"', "link base_link weighs -9 kg"),
    ('ixx="0.1"', 'ixx="1e999"', "ixx of inertia of link base_link is '1e999'"),
    ('radius="0.06"', 'radius="0"', "a sphere of 0 m: lengths must be above 0"),
    ('radius="0.06"', 'radius="-0.06"', "a sphere of -0.06 m"),
    ('radius="0.06"', "", "a <collision> of link base_link has no radius"),
    ('<sphere radius="0.06"/>', "<cone/>", "is a 'cone': mesh, box, cylinder, sphere, capsule are"),
    ('<sphere radius="0.06"/>', "", "has 0 shapes, must have one"),
    ('<sphere radius="0.06"/>', '<sphere radius="1"/><sphere radius="2"/>', "has 2 shapes"),
    ('xyz="0 0 0.4"', 'xyz="0 0"', "xyz of joint j1 is '0 0', must be three finite numbers"),
    ('xyz="0 0 0.4"', 'xyz="0 0 400"', "joint j1 is 400 m away: is its unit another"),
    ('axis xyz="0 0 1"', 'axis xyz="0 0 0"', "the axis of joint j1 has no length"),
    ('type="revolute"', 'type="hinge"', "joint j1 is of type 'hinge'"),
    ('type="revolute"', 'type="prismatic"', "on the rail j1: arms of six axes"),
    ('<child link="l1"/>', '<child link="l9"/>', "joint j1 names the link 'l9'"),
    ('<child link="l1"/>', '<child link="l2"/>', "link l2 is carried by two joints, j1 and j2"),
    ('<child link="l1"/>', "", "joint j1 has no child"),
    ('<parent link="base_link"/>', '<parent link="l6"/>', "carries itself|hang on no joint"),
    ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><mimic joint="j2"/>', "joint j1 mimics j2"),
    ('name="l2"', 'name="l1"', "link l1 is there twice"),
    ("</geometry>", '</geometry><geometry><box size="1 1 1"/></geometry>', "has 2 <geometry>"),
    ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><axis xyz="0 1 0"/>', "joint j1 has 2 <axis>"),
    ('xyz="0 0 0.4"', 'xyz="0 0 0.4" quat_xyzw="0 0 1 0"', "joint j1 has an orientation as quat"),
    ('<limit lower="-2.5" upper="2.5" effort="900" velocity="3"/>', "", "and has no <limit>"),
    ("<link name=\"tool0\"/>", '<link name="tool0"/><link name="alone"/>', "hang on no joint"),
)  # fmt: skip


@pytest.mark.parametrize(("old", "new", "sentence"), HOSTILE)
def test_what_makes_no_sense_is_one_sentence_with_its_line(
    old: str, new: str, sentence: str
) -> None:
    text = arm_text().replace(old, new, 1)
    with pytest.raises(RobotFileError, match=sentence):
        urdf_arm(text, "arm.urdf")


def test_what_does_not_matter_is_no_reason_to_refuse_a_file() -> None:
    """A joint that does not turn needs no axis, and a macro in a comment needs no xacro."""
    still = '<joint name="jt" type="fixed"><axis xyz="0 0 0"/>'
    text = arm_text().replace('<joint name="jt" type="fixed">', still)
    assert still in text
    urdf_arm(text.replace("</robot>", "<!-- <xacro:macro/> --></robot>"), "arm.urdf")
    macro = text.replace("</robot>", '<xacro:macro name="m"/></robot>')
    with pytest.raises(RobotFileError, match=r":1[0-9]: this is a xacro file"):
        urdf_arm(macro, "arm.urdf")


@pytest.mark.long
def test_an_argument_that_a_xacro_file_does_not_have_is_refused_with_those_it_has(
    tmp_path: Path,
) -> None:
    """What is declared, in a file that is included too, or asked for counts, with a default or
    not.
    """
    pytest.importorskip("xacro")
    name = 'xmlns:xacro="http://ros.org/wiki/xacro"'
    (tmp_path / "more.xacro").write_text(
        f'<robot {name}><xacro:arg name="part" default="a"/></robot>'
    )
    path = tmp_path / "arm.xacro"
    path.write_text(
        f'<robot {name} name="arm"><xacro:include filename="more.xacro"/>'
        '<xacro:arg name="reach" default="1"/><xacro:arg name="unused" default="2"/>'
        '<link name="$(arg part)_$(eval reach + 3)_$(arg tool)"/></robot>'
    )
    given = {"tool": "t", "reach": "2", "unused": "0", "part": "b"}
    assert 'name="b_5_t"' in expanded(path, None, given)
    said = "--set nope: it has no such argument, it has part, reach, tool, unused$"
    with pytest.raises(InvalidValueError, match=said):
        expanded(path, None, {"tool": "t", "nope": "1"})
    path.write_text(f'<robot {name} name="arm"/>')
    with pytest.raises(InvalidValueError, match=r"--set nope: .* it has none$"):
        expanded(path, None, {"nope": "1"})


SHAPES = {
    "box": '<box size="0.2 0.1 0.3"/>',
    "cylinder": '<cylinder radius="0.1" length="0.3"/>',
    "capsule": '<capsule radius="0.05" length="0.3"/>',
    "sphere": '<sphere radius="0.1"/>',
}


@pytest.mark.parametrize("kind", SHAPES)
@pytest.mark.parametrize("place", ["collision", "visual"])
def test_every_body_wherever_it_hangs_belongs_to_a_link(kind: str, place: str) -> None:
    """Two more bodies: one fixed to the world below the base, one on a finger that slides."""
    body = f"<{place}><geometry>{SHAPES[kind]}</geometry></{place}>"
    extra = (
        f'<link name="world">{body}</link><joint name="jw" type="fixed"><parent link="world"/>'
        f'<child link="base_link"/></joint><link name="finger">{body}</link>'
        '<joint name="jf" type="prismatic"><parent link="l6"/><child link="finger"/>'
        '<origin xyz="0.1 0 0"/><axis xyz="0 1 0"/><limit lower="0" upper="0.05"/></joint>'
    )
    arm = urdf_arm(arm_text(extra), "arm.urdf")
    assert [len(link.shapes) for link in arm.links] == [2, 1, 1, 1, 1, 1, 2]
    assert any("jf (prismatic) leads to no flange" in note for note in arm.notes)
    left = urdf_arm(arm_text(extra), "arm.urdf", without=["finger"])
    assert [len(link.shapes) for link in left.links] == [2, 1, 1, 1, 1, 1, 1]
    assert any("finger is left out as asked, with 1 bodies" in note for note in left.notes)


FINGER = (
    '<link name="{0}"/><joint name="j{0}" type="revolute"><parent link="hand"/><child link="{0}"/>'
    '<axis xyz="0 0 1"/><limit lower="0" upper="0.5"/></joint>'
)


@pytest.mark.parametrize(
    "place",
    [
        "<self_collision_checking>{}</self_collision_checking>",
        '<gazebo reference="l6"><collision><geometry>{}</geometry></collision></gazebo>',
        "<group><link name='g'><collision><geometry>{}</geometry></collision></link></group>",
    ],
)
@pytest.mark.parametrize("kind", SHAPES)
def test_a_shape_that_is_none_of_a_link_is_named_with_its_line(kind: str, place: str) -> None:
    text = arm_text().replace("</robot>", f"\n{place.format(SHAPES[kind])}</robot>")
    line = text[: text.index(SHAPES[kind])].count("\n") + 1
    arm = urdf_arm(text, "arm.urdf")
    assert any(f"the {kind} in <" in each and f"(line {line})" in each for each in arm.notes)


@pytest.mark.parametrize("limit", ["", '<limit lower="-0.1" upper="0.2"/>'])
def test_a_follower_reaches_what_it_is_driven_to_whatever_its_own_limits_say(limit: str) -> None:
    """j6 turns from -2.5 to 2.5 rad."""
    extra = (
        f'<link name="f"><collision><geometry>{SHAPES["box"]}</geometry></collision></link>'
        '<joint name="jf" type="continuous"><parent link="l6"/><child link="f"/>'
        f'<axis xyz="0 1 0"/><mimic joint="j6" multiplier="-0.5" offset="0.2"/>{limit}</joint>'
    )
    arm = urdf_arm(arm_text(extra), "arm.urdf")
    (motion,) = arm.links[6].shapes[-1].motions
    assert (motion.lower, motion.upper) == pytest.approx((-1.05, 1.45))
    assert arm.leaders == {"j6"}
    assert any("jf (continuous, follows j6) leads to no flange" in note for note in arm.notes)


def test_fingers_behind_the_sixth_axis_are_no_seventh_axis() -> None:
    """Two side by side are a hand; one alone may be an axis, which is refused with its name."""
    text = arm_text().replace("tool0", "hand")
    two = text.replace("</robot>", FINGER.format("left") + FINGER.format("right") + "</robot>")
    arm = urdf_arm(two, "arm.urdf")
    assert [joint.name for joint in arm.joints] == [f"j{k}" for k in range(1, 7)]
    np.testing.assert_allclose(arm.origin[5], [0.18, 0.0, 0.0], atol=1e-12)
    one = text.replace("</robot>", FINGER.format("left") + "</robot>")
    with pytest.raises(RobotFileError, match=r"has 7 axes \(j1, .*jleft\).*see --tip"):
        urdf_arm(one, "arm.urdf")


def test_a_side_joint_sweeps_its_body_through_its_whole_range() -> None:
    """A point of a flap on a hinge lies in the body of its link at every angle."""
    extra = (
        '<link name="flap"><collision><origin xyz="0.2 0 0"/><geometry><box size="0.1 0.1 0.1"/>'
        '</geometry></collision></link><joint name="hinge" type="revolute"><parent link="l6"/>'
        '<child link="flap"/><origin xyz="0 0.1 0" rpy="0.3 0 0"/><axis xyz="0 0 1"/>'
        '<limit lower="-0.7" upper="1.1"/></joint>'
    )
    arm = urdf_arm(arm_text(extra), "arm.urdf")
    (_, flap) = link_bodies(arm.links[6].shapes, Meshes(Path(), None))
    from scipy.spatial import ConvexHull

    planes = ConvexHull(flap.triangles.reshape(-1, 3)).equations
    (motion,) = arm.links[6].shapes[1].motions
    corner = np.array([0.25, 0.05, 0.05, 1.0])
    for angle in np.linspace(-0.7, 1.1, 41):
        point = (motion.at(angle) @ corner)[:3]
        assert (planes[:, :3] @ point + planes[:, 3]).max() < 1e-9


def test_missing_masses_share_the_stated_total_by_volume() -> None:
    arm = urdf_arm(arm_text(inertial="", shape=SHAPES["box"]), "arm.urdf")
    bodies = [link_bodies(link.shapes, Meshes(Path(), None)) for link in arm.links]
    weighed, notes = with_masses(arm, bodies, 70.0)
    assert [link.mass for link in weighed.links] == pytest.approx([10.0] * 7)
    assert all(link.estimate for link in weighed.links)
    assert "70 kg in proportion to their volume" in notes[0]
    expected = 10.0 / 12.0 * np.array([0.1**2 + 0.3**2, 0.2**2 + 0.3**2, 0.2**2 + 0.1**2])
    assert np.diag(weighed.links[1].inertia) == pytest.approx(expected)


def test_masses_that_contradict_the_stated_total_are_not_taken() -> None:
    arm = urdf_arm(arm_text(), "arm.urdf")
    bodies = [link_bodies(link.shapes, Meshes(Path(), None)) for link in arm.links]
    weighed, notes = with_masses(arm, bodies, 250.0)
    assert sum(link.mass for link in weighed.links) == pytest.approx(250.0)
    assert "add up to 63 kg, the arm weighs 250 kg" in notes[0]
    kept, notes = with_masses(arm, bodies, 64.0)
    assert not notes
    assert sum(link.mass for link in kept.links) == pytest.approx(63.0)


@pytest.mark.parametrize(
    ("moments", "sentence"),
    [
        ("0.1 0.1 0.201", "by rounding: raised"),
        ("0 0 0", "solid of its shape"),
        ("0.1 0.1 3", "solid"),
    ],
)
def test_an_inertia_that_no_body_has_is_mended_or_estimated_and_said(
    moments: str, sentence: str
) -> None:
    x, y, z = moments.split()
    text = re.sub(
        'ixx="0.1" iyy="0.1" izz="0.1"', f'ixx="{x}" iyy="{y}" izz="{z}"', arm_text(), count=1
    )
    arm = urdf_arm(text, "arm.urdf")
    bodies = [link_bodies(link.shapes, Meshes(Path(), None)) for link in arm.links]
    weighed, notes = with_masses(arm, bodies, None)
    assert sentence in notes[0]
    low, middle, high = np.linalg.eigvalsh(weighed.links[0].inertia)
    assert low > 0.0 and high <= (low + middle) * (1.0 + 1e-9)  # noqa: PT018


COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>
<unit name="mm" meter="0.001"/></asset><library_geometries><geometry id="g"><mesh><source id="s">
<float_array id="a" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array><technique_common>
<accessor source="#a" count="4" stride="3"/></technique_common></source><vertices id="v">
<input semantic="POSITION" source="#s"/></vertices>{faces}</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="vs"><node><translate>50 0 0</translate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#vs"/></scene></COLLADA>"""
FACES = {
    "triangles": '<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>'
    "<p>0 2 1 0 1 3 1 2 3 0 3 2</p></triangles>",
    "polylist": '<polylist count="4"><input semantic="VERTEX" source="#v" offset="0"/>'
    "<vcount>3 3 3 3</vcount><p>0 2 1 0 1 3 1 2 3 0 3 2</p></polylist>",
}


@pytest.mark.parametrize("above", ["", " \n\n"])
@pytest.mark.parametrize("kind", FACES)
def test_a_collada_file_counts_in_its_own_unit(kind: str, above: str) -> None:
    triangles = triangles_from_collada(
        f'{above}<?xml version="1.0"?>{COLLADA.format(faces=FACES[kind])}'.encode()
    )
    assert triangles.shape == (4, 3, 3)
    assert np.ptp(triangles.reshape(-1, 3), axis=0) == pytest.approx([0.1, 0.2, 0.3])
    assert triangles.reshape(-1, 3)[:, 0].min() == pytest.approx(0.05)


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("1 2 3 0 3 2", "1 2 9 0 3 2", "names corner 9 of 4"),
        ("#g", "#h", "names '#h', which it does not have"),
        ("0 0 300<", "0 0<", "fewer than its accessor says"),
        ('meter="0.001"', 'meter="0"', "<unit> is 0 m"),
        ("</COLLADA>", "", "not XML"),
    ],
)
def test_a_collada_file_that_is_none_is_a_sentence(old: str, new: str, sentence: str) -> None:
    text = COLLADA.format(faces=FACES["triangles"]).replace(old, new, 1)
    with pytest.raises(InvalidValueError, match=sentence):
        triangles_from_collada(text.encode())


def test_a_mesh_is_taken_from_its_own_package_only(tmp_path: Path) -> None:
    for name in ("one", "two"):
        (tmp_path / name / "meshes").mkdir(parents=True)
        (tmp_path / name / "package.xml").write_text(f"<package><name>{name}</name></package>")
        (tmp_path / name / "meshes" / "a.obj").write_text(
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 2 3 4\nf 1 3 4\n"
            if name == "two"
            else "broken"
        )
    meshes = Meshes(tmp_path / "one", None)
    assert len(meshes.triangles("package://two/meshes/a.obj")[0]) == 4
    with pytest.raises(InvalidValueError, match="package 'three' is not found; --packages"):
        meshes.triangles("package://three/meshes/a.obj")


def farthest(fits: tuple[object, ...], points: FloatArray) -> float:
    """How far the points (N, 3) stand out from the capsules, at most [m]."""
    depth = []
    for p0, p1, radius, _ in fits:  # type: ignore[misc]
        along = p1 - p0
        share = np.clip((points - p0) @ along / max(float(along @ along), 1e-30), 0.0, 1.0)
        depth.append(np.linalg.norm(points - p0 - share[:, None] * along, axis=1) - radius)
    return float(np.min(depth, axis=0).max())


@pytest.mark.parametrize("seed", range(4))
def test_capsules_hold_their_triangles_and_stand_out_by_no_more_than_they_say(seed: int) -> None:
    generator = np.random.default_rng(seed)
    from scipy.spatial import ConvexHull

    points = generator.normal(size=(60, 3)) * generator.uniform(0.05, 0.5, 3)
    triangles = points[ConvexHull(points).simplices]
    fits = fitted(triangles)
    shares = generator.dirichlet((1.0, 1.0, 1.0), 3000)
    on = np.einsum("nk,nkj->nj", shares, triangles[generator.integers(len(triangles), size=3000)])
    assert farthest(fits, on) < 1e-9
    hull = ConvexHull(points)
    for k, fit in enumerate(fits):
        others = [each for n, each in enumerate(fits) if n != k]
        sphere = generator.normal(size=(2000, 3))
        sphere /= np.linalg.norm(sphere, axis=1, keepdims=True)
        surface = np.where((sphere @ (fit.p1 - fit.p0) > 0.0)[:, None], fit.p1, fit.p0)
        surface = surface + fit.radius * sphere
        if others:
            inside = np.array([farthest(tuple(others), p[None]) < 0.0 for p in surface])
            surface = surface[~inside]
        beyond = surface @ hull.equations[:, :3].T + hull.equations[:, 3]
        assert beyond.max(initial=0.0) <= fit.overhang


@pytest.mark.parametrize(
    ("kind", "rows"),
    [
        ("FourBarLinkageTransmission", "[[6, 5, 0.5]]"),
        ("DifferentialTransmission", "[[5, 6, 0.5], [6, 5, -2]]"),
    ],
)
@pytest.mark.parametrize("wrapped", ["{}", '<ros2_control name="x">{}</ros2_control>'])
def test_a_transmission_that_couples_motors_is_proposed_as_the_sheet_says_it(
    kind: str, rows: str, wrapped: str
) -> None:
    tag = "plugin" if "ros2" in wrapped else "type"
    joints = "".join(
        f'<joint name="{name}"><role>joint{k}</role><mechanicalReduction>{n}</mechanicalReduction>'
        "</joint>"
        for k, name, n in ((2, "j6", 2), (1, "j5", 4))
    )
    text = f'<transmission name="wrist"><{tag}>transmission_interface/{kind}</{tag}>{joints}'
    arm = urdf_arm(arm_text(wrapped.format(f"{text}</transmission>")), "arm.urdf")
    (note,) = (note for note in arm.notes if "j5 and j6 share" in note)
    assert f"wrist_coupling: {{value: {rows}," in note
