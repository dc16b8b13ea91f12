"""URDF as a tree: links with masses and collision shapes, joints with limits, each with its line.

Every shape is read or refused with its line: a body that is left out without a word would make
every proof of clearance wrong.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree as Xml
from xml.parsers import expat

import numpy as np

from ir_description.files.making.transmissions import UrdfTransmission, urdf_transmissions
from ir_description.files.robot_file import inertia_matrix
from ir_description.poses import rotation_from_abc
from ir_values.arrays import FloatArray, number_of
from ir_values.errors import RobotFileError, listed, shown
from ir_values.files import is_utf16, text_of

KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
_WITHOUT_AXIS = ("fixed", "floating")
LENGTH_MAX = 100.0
"""Largest length [m] of a robot: beyond, the unit is hardly meant."""
_LINKS_MAX = 1000
_NAME = re.compile(r"[A-Za-z][A-Za-z0-9_.-]{0,63}")


@dataclass(frozen=True, eq=False)
class UrdfShape:
    """A collision shape of a link.

    kind: "mesh", "box", "cylinder", "sphere", "capsule". pose (4, 4) in its link. size (3,) [m]:
    box: edges; cylinder: radius, length; capsule: radius, length between the centres of its ends;
    mesh: scale. file: of a mesh. link, line: where it stands. visual: whether the link has no
    collision shape and this is what people see of it.
    """

    kind: str
    pose: FloatArray
    size: FloatArray
    file: str = ""
    link: str = ""
    line: int = 0
    visual: bool = False

    @property
    def place(self) -> str:
        """For people: which shape of which link."""
        what = f"{self.kind} {self.file}" if self.file else self.kind
        return f"{what} of link {self.link} (line {self.line})"


@dataclass(frozen=True, eq=False)
class UrdfLink:
    """mass [kg] (0: none is given), com (3,) [m], inertia (3, 3) [kg m^2] about it, in the link's
    frame.
    """

    name: str
    mass: float
    com: FloatArray
    inertia: FloatArray
    shapes: tuple[UrdfShape, ...]
    line: int = 0


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint, the pose (4, 4) of its frame in the parent link, limits [rad or m, rad/s, Nm], 0:
    not given. mimic: the joint that it follows, "" for none, times multiplier plus offset.
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: FloatArray
    axis: FloatArray
    lower: float
    upper: float
    velocity: float
    effort: float
    mimic: str = ""
    line: int = 0
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class UrdfTree:
    """A robot: its links and joints by name; joints by the link that they carry. notes: what was
    read otherwise than it stands there, in words. transmissions: those that couple motors.
    """

    name: str
    links: dict[str, UrdfLink]
    above: dict[str, UrdfJoint]
    notes: tuple[str, ...] = field(default=())
    transmissions: tuple[UrdfTransmission, ...] = field(default=())

    def below(self, name: str) -> list[UrdfJoint]:
        """Joints that a link carries, in the order of the file."""
        return [joint for joint in self.above.values() if joint.parent == name]

    def path(self, name: str) -> list[UrdfJoint]:
        """The joints from the root to a link."""
        path: list[UrdfJoint] = []
        while name in self.above:
            path.insert(0, self.above[name])
            name = path[0].parent
        return path


_BLANK_ABOVE = re.compile(r"\A(\s+)<\?xml.*?\?>", re.DOTALL)
"""Blank lines above an XML declaration, which other readers of URDFs pass over."""


_DECLARED = re.compile(rb"""\A\s*<\?xml[^>]*?\sencoding\s*=\s*["']([^"'>]{1,40})["']""")
_EIGHT_BITS = re.compile(r"(?i)(iso[-_]8859[-_]\d+|latin-?1|windows-?125\d|cp125\d)")
_UNICODE = re.compile("(?i)(utf-?8|us-ascii|ascii)")


def xml_text(content: bytes, source: str) -> str:
    """The text of an XML file in the encoding that it declares, UTF-8 where it declares none.
    Raises RobotFileError for one that is not read.
    """
    found = _DECLARED.match(content)
    declared = found[1].decode("ascii", "replace") if found else "UTF-8"
    if content.isascii() or is_utf16(content) or _UNICODE.fullmatch(declared):
        return text_of(content, source, RobotFileError)
    fault = "which is not read: save it as UTF-8"
    if _EIGHT_BITS.fullmatch(declared):
        try:
            return content.decode(declared)
        except LookupError:
            pass
        except UnicodeDecodeError as error:
            fault = f"where byte 0x{content[error.start]:02x} is no character"
    raise RobotFileError(source, 1, f"the file declares the encoding {shown(declared)}, {fault}")


def urdf_tree(text: str, source: str) -> UrdfTree:
    """Read a URDF. Raises RobotFileError with the line of what is wrong."""
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise RobotFileError(source, 0, "the URDF defines entities: they are not read")
    try:
        root = _parsed(_BLANK_ABOVE.sub(r"\1", text))
    except expat.ExpatError as error:
        raise RobotFileError(source, error.lineno, f"this is not XML: {error}") from error
    macro = next((each for each in root.iter() if each.tag.startswith("xacro:")), None)
    if macro is not None:
        line = getattr(macro, "line", 0)
        raise RobotFileError(
            source, line, "this is a xacro file: expand it first (xacro FILE > robot.urdf)"
        )
    if root.tag != "robot":
        raise RobotFileError(source, 0, f"the document is {shown(root.tag)}, must be 'robot'")
    try:
        return _Reader().tree(root)
    except _UrdfError as error:
        raise RobotFileError(source, error.line, str(error)) from error


class _UrdfError(Exception):
    """What is wrong, and on which line."""

    def __init__(self, element: Xml.Element, sentence: str) -> None:
        super().__init__(sentence)
        self.line = getattr(element, "line", 0)


class _Element(Xml.Element):
    """An element that knows its line."""

    line = 0


def _parsed(text: str) -> Xml.Element:
    """The document; elements know their lines."""
    builder = Xml.TreeBuilder(element_factory=_Element)
    parser = expat.ParserCreate("UTF-8")  # in place of what the file declares

    def start(tag: str, attributes: dict[str, str]) -> None:
        element = builder.start(tag, attributes)
        element.line = parser.CurrentLineNumber  # type: ignore[attr-defined]  # of _Element

    parser.StartElementHandler = start
    parser.EndElementHandler = builder.end
    parser.CharacterDataHandler = builder.data
    parser.Parse(text.encode(), True)
    return builder.close()


class _Reader:
    """One reading."""

    def __init__(self) -> None:
        self._notes: list[str] = []

    def tree(self, root: Xml.Element) -> UrdfTree:
        """The links and joints as a tree: no name twice, and no link carried by two joints."""
        self._notes += _not_read(root)
        elements = root.findall("link")
        if len(elements) > _LINKS_MAX:
            raise _UrdfError(elements[-1], f"there are {len(elements)} links, must be at most 1000")
        links: dict[str, UrdfLink] = {}
        for element in elements:
            link = self._link(element)
            if link.name in links:
                raise _UrdfError(element, f"link {link.name} is there twice")
            links[link.name] = link
        joints: dict[str, UrdfJoint] = {}
        above: dict[str, UrdfJoint] = {}
        for element in root.findall("joint"):
            joint = self._joint(element)
            for name in (joint.parent, joint.child):
                if name not in links:
                    known = listed(links)
                    raise _UrdfError(
                        element,
                        f"joint {joint.name} names the link {shown(name)}, which the file does "
                        f"not have; it has {known}: add it, or take the joint out",
                    )
            if joint.name in joints:
                raise _UrdfError(element, f"joint {joint.name} is there twice")
            if joint.child in above:
                both = f"{above[joint.child].name} and {joint.name}"
                raise _UrdfError(element, f"link {joint.child} is carried by two joints, {both}")
            joints[joint.name] = joint
            above[joint.child] = joint
        _check_tree(root, links, above)
        self._notes += _led_by_none(joints)
        name = root.get("name") or "robot"
        return UrdfTree(name, links, above, tuple(self._notes), urdf_transmissions(root))

    def _link(self, element: Xml.Element) -> UrdfLink:
        """A link with its shapes and its inertia (3, 3) [kg m^2] about the centre of mass, in the
        link's frame. Entries that the file leaves out are 0, with a note.
        """
        name = _name(element, "link")
        _check_once(element, ("inertial",), f"link {name}")
        shapes = [self._shape(one, name) for one in element.findall("collision")]
        if not shapes:
            shapes = [self._shape(one, name) for one in element.findall("visual")]
            if shapes:
                self._notes.append(
                    f"link {name} has no collision shape: its {len(shapes)} visual ones are taken"
                )
        line = getattr(element, "line", 0)
        inertial = element.find("inertial")
        if inertial is None:
            return UrdfLink(name, 0.0, np.zeros(3), np.zeros((3, 3)), tuple(shapes), line)
        pose = _origin(inertial, f"the <inertial> of link {name}")
        mass = inertial.find("mass")
        inertia = inertial.find("inertia")
        keys = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        entries = [
            _number(inertia, key, f"inertia of link {name}", "0") if inertia is not None else 0.0
            for key in keys
        ]
        absent = [key for key in keys if inertia is not None and key not in inertia.attrib]
        if absent:
            self._notes.append(
                f"the <inertia> of link {name} (line {getattr(inertia, 'line', 0)}) has no "
                f"{listed(absent)}: 0 kg m^2 {'is' if len(absent) == 1 else 'are'} taken; write "
                "all six"
            )
        about = pose[:3, :3] @ inertia_matrix(entries) @ pose[:3, :3].T
        weight = _number(mass, "value", f"mass of link {name}") if mass is not None else 0.0
        if weight < 0.0 or weight > 1e5:
            raise _UrdfError(
                inertial, f"link {name} weighs {weight:g} kg, must be from 0 to 100000 kg"
            )
        return UrdfLink(name, weight, pose[:3, 3], about, tuple(shapes), line)

    def _joint(self, element: Xml.Element) -> UrdfJoint:
        """A joint with its limits; without an axis that of URDF's default, x."""
        name = _name(element, "joint")
        once = ("parent", "child", "origin", "axis", "limit", "mimic")
        _check_once(element, once, f"joint {name}")
        kind = element.get("type", "")
        if kind not in KINDS:
            raise _UrdfError(
                element, f"joint {name} is of type {shown(kind)}: {listed(KINDS)} are known"
            )
        ends: list[str] = []
        for end in ("parent", "child"):
            place = element.find(end)
            if place is None or not place.get("link"):
                raise _UrdfError(element, f"joint {name} has no {end}")
            ends.append(place.get("link", ""))
        mimic = element.find("mimic")
        followed = "" if mimic is None else mimic.get("joint", "") or "another joint"
        multiplier, offset = (
            _number(mimic, key, f"<mimic> of joint {name}", default) if mimic is not None else value
            for key, default, value in (("multiplier", "1", 1.0), ("offset", "0", 0.0))
        )
        lower, upper, velocity, effort = self._limits(element, name, kind)
        return UrdfJoint(
            name,
            kind,
            ends[0],
            ends[1],
            _origin(element, f"joint {name}"),
            _axis(element, name) if kind not in _WITHOUT_AXIS else np.array([1.0, 0.0, 0.0]),
            lower,
            upper,
            velocity,
            effort,
            followed,
            getattr(element, "line", 0),
            multiplier,
            offset,
        )

    def _limits(self, element: Xml.Element, name: str, kind: str) -> list[float]:
        """lower, upper, velocity, effort; 0 where the file has none."""
        limit = element.find("limit")
        if limit is None:
            if kind in ("revolute", "prismatic"):
                raise _UrdfError(element, f"joint {name} is {kind} and has no <limit>")
            return [0.0, 0.0, 0.0, 0.0]
        keys = ("lower", "upper", "velocity", "effort")
        values = [_number(limit, key, f"limit of joint {name}", "0") for key in keys]
        unit = "m" if kind == "prismatic" else "rad"
        span = f"joint {name} may turn from {values[0]:g} to {values[1]:g} {unit}"
        if kind in ("revolute", "prismatic") and not values[0] < values[1]:
            raise _UrdfError(limit, f"{span}: lower must be below upper")
        for key, value in zip(keys[2:], values[2:], strict=True):
            if value < 0.0:
                raise _UrdfError(limit, f"{key} of joint {name} is {value:g}, must not be negative")
        if kind == "continuous" and values[0] < values[1]:
            self._notes.append(
                f"{span} and is continuous: its limits are kept (make it revolute to say so)"
            )
        return values

    def _shape(self, element: Xml.Element, link: str) -> UrdfShape:
        """The shape of a <collision> or <visual>. Raises _UrdfError where it isn't known."""
        what = f"a <{element.tag}> of link {link}"
        _check_once(element, ("geometry", "origin"), what)
        geometry = element.find("geometry")
        shapes = [] if geometry is None else list(geometry)
        line = getattr(element, "line", 0)
        if len(shapes) != 1:
            raise _UrdfError(element, f"{what} has {len(shapes)} shapes, must have one")
        (one,) = shapes
        if one.tag not in _SIZES:
            raise _UrdfError(
                one, f"{what} is a {shown(one.tag)}: {listed(_SIZES)} are read; replace it by these"
            )
        size = np.zeros(3)
        file = ""
        if one.tag == "mesh":
            size[:] = _three_numbers(one, "scale", what, "1 1 1")
            file = one.get("filename", "")
            if not file or not size.all():
                raise _UrdfError(one, f"{what} is a mesh without a filename, or of scale 0")
        elif one.tag == "box":
            size[:] = _three_numbers(one, "size", what)
        else:
            lengths = [_number(one, key, what) for key in _SIZES[one.tag]]
            size[: len(lengths)] = lengths
        if one.tag != "mesh":
            used = 3 if one.tag == "box" else len(_SIZES[one.tag])
            least = size[:1] if one.tag == "capsule" else size[:used]
            if (least <= 0.0).any() or (size < 0.0).any() or (size > LENGTH_MAX).any():
                raise _UrdfError(
                    one,
                    f"{what} is a {one.tag} of {', '.join(f'{s:g}' for s in size[:used])} m: "
                    f"lengths must be above 0 and at most {LENGTH_MAX:g} m; a body without a size "
                    "is none: take it out",
                )
        visual = element.tag == "visual"
        return UrdfShape(one.tag, _origin(element, what), size, file, link, line, visual)


_SIZES: Mapping[str, tuple[str, ...]] = {
    "mesh": (),
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "sphere": ("radius",),
    "capsule": ("radius", "length"),
}


def _check_once(element: Xml.Element, tags: Sequence[str], what: str) -> None:
    """Raise _UrdfError where an element has another of these: others would read one of both."""
    for tag in tags:
        found = element.findall(tag)
        if len(found) > 1:
            raise _UrdfError(found[1], f"{what} has {len(found)} <{tag}>, must have at most one")


def _not_read(root: Xml.Element) -> Iterator[str]:
    """A sentence for each shape that belongs to no link, as those of other programs do."""
    read = {
        shape
        for kind in ("collision", "visual")
        for geometry in root.findall(f"link/{kind}/geometry")
        for shape in geometry
    }
    for parent in root.iter():
        for shape in parent:
            if shape.tag in _SIZES and shape not in read:
                line = getattr(shape, "line", 0)
                yield (
                    f"the {shape.tag} in <{parent.tag}> (line {line}) is in no <collision> of a "
                    "link: it is not read"
                )


def _check_tree(
    root: Xml.Element, links: Mapping[str, UrdfLink], above: Mapping[str, UrdfJoint]
) -> None:
    if not links:
        raise _UrdfError(root, "the robot has no link")
    roots = [name for name in links if name not in above]
    if len(roots) > 1:
        raise _UrdfError(
            root, f"the links {listed(roots)} hang on no joint: one of them must carry the others"
        )
    for name in links:
        at = name
        seen = set[str]()
        while at in above:
            if at in seen:
                raise _UrdfError(root, f"link {name} carries itself: its joints form a ring")
            seen.add(at)
            at = above[at].parent


def _led_by_none(joints: Mapping[str, UrdfJoint]) -> Iterator[str]:
    """A sentence for each joint that follows none that leads."""
    for joint in joints.values():
        at = joint.mimic
        seen = {joint.name}
        while at in joints and at not in seen:
            seen.add(at)
            at = joints[at].mimic
        if joint.mimic and joint.mimic not in joints:
            fault = "which the file does not have"
        elif at == joint.name:
            fault = "and so itself"
        else:
            continue
        yield (
            f"joint {joint.name} (line {joint.line}) mimics {shown(joint.mimic)}, {fault}: it "
            "moves within its own limits; correct its <mimic>"
        )


def _name(element: Xml.Element, what: str) -> str:
    name = element.get("name", "")
    if not _NAME.fullmatch(name):
        raise _UrdfError(
            element,
            f"a {what} is called {shown(name)}: rename it with a letter first, then letters, "
            "digits, _ . or -, at most 64",
        )
    return name


def _axis(element: Xml.Element, name: str) -> FloatArray:
    axis = element.find("axis")
    direction = (
        _three_numbers(axis, "xyz", f"the axis of joint {name}", "1 0 0")
        if axis is not None
        else np.array([1.0, 0.0, 0.0])
    )
    length = float(np.linalg.norm(direction))
    if not length > 0.0:
        raise _UrdfError(element, f"the axis of joint {name} has no length")
    return direction / length


def _origin(element: Xml.Element, what: str) -> FloatArray:
    """The pose (4, 4) of an element's origin."""
    pose = np.eye(4)
    origin = element.find("origin")
    if origin is not None:
        if "quat_xyzw" in origin.attrib:
            raise _UrdfError(
                origin, f"{what} has an orientation as quat_xyzw: write it as rpy (URDF 1.0)"
            )
        roll, pitch, yaw = np.degrees(_three_numbers(origin, "rpy", what, "0 0 0"))
        pose[:3, :3] = rotation_from_abc((yaw, pitch, roll))
        pose[:3, 3] = _three_numbers(origin, "xyz", what, "0 0 0")
        if np.abs(pose[:3, 3]).max() > LENGTH_MAX:
            raise _UrdfError(
                origin, f"{what} is {np.abs(pose[:3, 3]).max():g} m away: is its unit another?"
            )
    return pose


def _number(element: Xml.Element, key: str, what: str, missing: str | None = None) -> float:
    text = element.get(key, missing)
    if text is None:
        raise _UrdfError(element, f"{what} has no {key}")
    try:
        value = number_of(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise _UrdfError(element, f"{key} of {what} is {shown(text)}, must be a finite number")
    return value


def _three_numbers(
    element: Xml.Element, key: str, what: str, missing: str | None = None
) -> FloatArray:
    """The numbers (3,) of an attribute; missing: its text where it is not there."""
    text = element.get(key, missing)
    if text is None:
        raise _UrdfError(element, f"{what} has no {key}")
    try:
        values = np.array([number_of(word) for word in text.split()])
    except ValueError:
        values = np.zeros(0)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise _UrdfError(element, f"{key} of {what} is {shown(text)}, must be three finite numbers")
    return values
