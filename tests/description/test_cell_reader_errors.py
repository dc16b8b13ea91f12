"""Every class of broken cell file is answered by one sentence with its line, value, bound and
unit.
"""

from __future__ import annotations

import itertools
import os
import re
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ir_description import CellFileError, UnknownNameError, cell_from_yaml, cell_to_yaml, load_cell
from ir_description.files import robot_file_errors
from ir_description.library import cell_file_errors, robot_named
from ir_msgs_py.plc import Signal
from ir_values.errors import RobotFileError

GOOD = """\
format: ir_cell/1
name: small
robot: kr210_r2700_extra
base: {xyz: [0, 0, 0]}
floor: true
park_deg: [0, -125, 120, 0, 80, 0]
tool:
  name: gripper
  mass: 100
  com: [0.2, 0, 0]
  inertia_box: [0.4, 0.6, 0.2]
  capsules:
    - {name: finger, p0: [0.1, 0, 0], p1: [0.4, 0, 0], radius: 0.05}
tcp: {xyz: [0.42, 0, 0]}
parts:
  - name: gear
    mass: 20
    com: [0, 0, 0]
    inertia: [0.1, 0.1, 0.1, 0, 0, 0]
    capsules: [{name: gear_held, p0: [0, 0, 0], p1: [0, 0, 0], radius: 0.1}]
    bodies: [{name: gear_lying, kind: sphere, radius: 0.1}]
    station: pick
equipment:
  - name: mill
    pose: {xyz: [2, 0, 0], abc_deg: [90, 0, 0]}
    zone: {kind: CLOSED, size: [1, 1, 2], xyz: [0, 0, 1]}
    states:
      door_open: [mill_door]
      door_closed: []
    state: door_open
    switch: {signal: ask, on: door_open, off: door_closed, time: 1.5}
    bodies:
      - {name: mill_bed, kind: box, size: [1, 1, 0.5], xyz: [0, 0, 0.25]}
      - {name: mill_door, kind: cylinder, radius: 0.1, length: 1}
    stations:
      - name: pick
        pose: {xyz: [0, 0, 0.8], quaternion: [0, 0, 0, 1]}
        approach_distance: 0.3
        allowed_contacts: [{between: [gear_held, mill_bed], safety_distance: 0.001}]
      - {name: place, pose: {xyz: [0, 0.2, 0.8]}}
signals: [{name: ask}, {name: open, follows: ask, delay: 1}]
program:
  - {posture: home}
  - {station: pick, attach: gear, dwell: 1}
  - {station: place, detach: gear, wait_for: [open], set_signals: [not ask]}
  - {pause: 60, power_mode: BUS_POWER_OFF}
tasks:
  - {name: there, start: [0, -1, 1, 0, 0, 0], goal: [0, -2, 2, 0, 0, 0]}
"""

BROKEN = {
    # YAML itself
    "empty": ("", "the file is empty", GOOD),
    "tab": ("name: small", "\tname: small"),
    "second document": ("tcp:", "---\ntcp:", "a second document starts here"),
    "alias": ("base: {xyz: [0, 0, 0]}", "base: &a {xyz: [0, 0, 0]}", "anchors and aliases"),
    "tag": ("floor: true", "floor: !!python/name:os.system true", "the tag"),
    "merge key": ("base: {xyz: [0, 0, 0]}", "base: {<<: 1}", "unknown key '<<'"),
    "duplicate key": ("floor: true", "name: again", "'name' stands here twice, first in line 2"),
    "key that is a list": ("floor: true", "[a, b]: true", "a key must be a word"),
    "control character": ("name: small", "name: sm\x07all", "is not allowed in YAML"),
    "deep nesting": ("floor: true", f"floor: {'[' * 40}{']' * 40}", "nested more than 16 deep"),
    # words
    "format": (
        "format: ir_cell/1",
        "format: ir_cell/9",
        "is 'ir_cell/9', must be one of ir_cell/1",
    ),
    "unknown robot": (
        "robot: kr210_r2700_extra",
        "robot: kr3",
        "robot 'kr3' is unknown; known are kr210_r2700",
    ),
    "unknown key": (
        "floor: true",
        "flor: true",
        "the file has the unknown key 'flor'; known are format, name",
    ),
    "missing key": ("  mass: 100\n", "", "tool has no mass"),
    "no name": ("name: small", 'name: ""', "name is a name of 0 characters, must have 1 to 64"),
    "long name": (
        "name: small",
        f"name: {'x' * 10_000}",
        "name is a name of 10000 characters, must have 1 to 64",
    ),
    "path as name": ("name: small", "name: ~/small", "name is '~/small', must be a name"),
    "newline in name": ("name: small", 'name: "a\\nb"', r"name is 'a\\nb', must be a name"),
    "NUL in name": ("name: small", 'name: "a\\0b"', r"name is 'a\\x00b', must be a name"),
    "non-ASCII name": (
        "name: small",
        "name: Zelle_ä",
        "name is 'Zelle_ä', must be a name: a letter of A to Z or a to z",
    ),
    "not a boolean": ("floor: true", "floor: yes", "floor is 'yes', must be true or false"),
    "value missing": ("  mass: 100", "  mass:", "tool.mass is empty, must be a number"),
    "list for mapping": (
        "tcp: {xyz: [0.42, 0, 0]}",
        "tcp: [0.42, 0, 0]",
        "tcp must be a mapping (key: value) of xyz, abc_deg",
    ),
    # numbers
    "NaN": ("  mass: 100", "  mass: .nan", "tool.mass is .nan, which is not finite"),
    "infinite": ("xyz: [2, 0, 0]", "xyz: [2, .inf, 0]", "pose.xyz[1] is .inf, which is not finite"),
    "overflow": ("  mass: 100", "  mass: 1e999", "tool.mass is '1e999', which is not finite"),
    "text": ("  mass: 100", "  mass: 100 kg", "tool.mass is '100 kg', must be a number"),
    "quoted": ("  mass: 100", '  mass: "100"', "tool.mass is '100', must be a number"),
    "negative mass": ("  mass: 100", "  mass: -1", "tool.mass is -1 kg, must be in (0, 2000] kg"),
    "ten tonnes": (
        "  mass: 100",
        "  mass: 10000",
        "tool.mass is 10000 kg, must be in (0, 2000] kg",
    ),
    "overload": (
        "  mass: 100",
        "  mass: 250",
        "mass is 250 kg, kr210_r2700_extra carries at most 210 kg",
    ),
    "overload with part": ("mass: 20", "mass: 120", "gripper and gear: mass is 220 kg"),
    "two coordinates": ("xyz: [2, 0, 0]", "xyz: [2, 0]", "pose.xyz has 2 entries, must have 3"),
    "far away": (
        "xyz: [2, 0, 0]",
        "xyz: [2e6, 0, 0]",
        "pose.xyz[0] is 2e6 m, must be in [-1000, 1000] m",
    ),
    "flat inertia": (
        "[0.1, 0.1, 0.1, 0, 0, 0]",
        "[0.1, 0.1, 0.5, 0, 0, 0]",
        "breaks the triangle inequality",
    ),
    "negative inertia": (
        "[0.1, 0.1, 0.1, 0, 0, 0]",
        "[-0.1, 0.1, 0.1, 0, 0, 0]",
        "must be above 0",
    ),
    "two inertias": (
        "  inertia_box: [0.4, 0.6, 0.2]",
        "  inertia_box: [1, 1, 1]\n  inertia: [1, 1, 1, 0, 0, 0]",
        "",
    ),
    "park out of limits": (
        "[0, -125, 120,",
        "[0, -3, 120,",
        "park: joint_a2 is -3 deg, must be in [-140, -5] deg",
    ),
    "task out of limits": (
        "start: [0, -1,",
        "start: [0, 1,",
        "start of there: joint_a2 is 57.2958 deg",
    ),
    # orientations
    "zero quaternion": (
        "[0, 0, 0, 1]",
        "[0, 0, 0, 0]",
        "quaternion has length 0, must be 1 within 0.001",
    ),
    "long quaternion": ("[0, 0, 0, 1]", "[0, 0, 0, 1.1]", "quaternion has length 1.1, must be 1"),
    "two orientations": (
        "abc_deg: [90, 0, 0]",
        "abc_deg: [90, 0, 0], quaternion: [0, 0, 0, 1]",
        "exactly one of",
    ),
    "mirrored": (
        "quaternion: [0, 0, 0, 1]",
        "rotation: [[1, 0, 0], [0, 1, 0], [0, 0, -1]]",
        "right-handed",
    ),
    "radians for turns": (
        "abc_deg: [90, 0, 0]",
        "abc_deg: [900, 0, 0]",
        "is 900 deg, must be in [-360, 360] deg",
    ),
    # bodies
    "unknown kind": (
        "kind: box",
        "kind: cone",
        "is 'cone', must be one of box, cylinder, sphere, capsule, plane",
    ),
    "zero size": (
        "size: [1, 1, 0.5]",
        "size: [1, 0, 0.5]",
        "size[1] is 0 m, must be in (0, 1000] m",
    ),
    "negative radius": (
        "cylinder, radius: 0.1",
        "cylinder, radius: -0.1",
        "radius is -0.1 m, must be in (0, 1000] m",
    ),
    "wrong key for kind": (
        "size: [1, 1, 0.5],",
        "size: [1, 1, 0.5], radius: 1,",
        "does not belong to a box; its keys",
    ),
    "no size": ("kind: box, size: [1, 1, 0.5],", "kind: box,", "has no size; a box has size"),
    "body twice": ("mill_door, kind", "mill_bed, kind", "capsule or body mill_bed is there twice"),
    "body like a capsule": (
        "mill_door, kind",
        "finger, kind",
        "capsule or body finger is there twice",
    ),
    "body like a link's": ("mill_door, kind", "l2, kind", "capsule or body l2 is there twice"),
    "body called floor": ("mill_door, kind", "floor, kind", "capsule or body floor is there twice"),
    "mesh by URL": (
        "kind: box, size: [1, 1, 0.5],",
        "kind: mesh, file: 'http://x/y.stl',",
        "a mesh file can be named",
    ),
    "flat mesh": (
        "kind: box, size: [1, 1, 0.5],",
        "kind: mesh, vertices: [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]],",
        "span no volume",
    ),
    # zones and states
    "unknown zone": (
        "kind: CLOSED",
        "kind: SHUT",
        "is 'SHUT', must be one of OPEN, SEMI_CLOSED, CLOSED",
    ),
    "zero zone": (
        "size: [1, 1, 2]",
        "size: [1, 1, 0]",
        "zone.size[2] is 0 m, must be in (0, 10000] m",
    ),
    "NaN zone": (
        "size: [1, 1, 2]",
        "size: [1, .nan, 2]",
        "zone.size[1] is .nan, which is not finite",
    ),
    "unknown state": (
        "state: door_open",
        "state: ajar",
        "state of mill 'ajar' is unknown; known are door_open",
    ),
    "no state": (
        "    state: door_open\n",
        "",
        "has states and must say its state, one of door_open, door_closed",
    ),
    "state of no body": (
        "[mill_door]\n",
        "[door]\n",
        "body in state door_open of mill 'door' is unknown",
    ),
    "switch by nobody": (
        "signal: ask, on",
        "signal: aks, on",
        "signal that switches mill 'aks' is unknown",
    ),
    "switch to no state": (
        "off: door_closed",
        "off: shut",
        "is 'shut', must be one of door_open, door_closed",
    ),
    "switch to itself": ("off: door_closed", "off: door_open", "on and off are both door_open"),
    "slow switch": ("time: 1.5}", "time: -1}", "switch.time is -1 s, must be in [0, 3600] s"),
    # stations
    "station twice": ("- {name: place,", "- {name: pick,", "station pick is there twice"),
    "contact with nobody": (
        "[gear_held, mill_bed]",
        "[gear_held, mil]",
        "capsule or body 'mil' is unknown; known are",
    ),
    "contact of bodies": (
        "[gear_held, mill_bed]",
        "[mill_door, mill_bed]",
        "has no capsule of robot, tool or part",
    ),
    "contact with itself": (
        "[gear_held, mill_bed]",
        "[gear_held, gear_held]",
        "pairs gear_held with itself",
    ),
    "negative contact": (
        "safety_distance: 0.001",
        "safety_distance: -1",
        "is -1 m, must be in [0, 10] m",
    ),
    "long approach": (
        "approach_distance: 0.3",
        "approach_distance: 30",
        "is 30 m, must be in [0, 5] m",
    ),
    "equipment twice": (
        "signals:",
        "  - {name: mill, zone: {kind: OPEN, size: [1, 1, 1]}, bodies: []}\nsignals:",
        "",
    ),
    "no bodies, no zone": (
        "signals:",
        "  - {name: empty, bodies: []}\nsignals:",
        "has no bodies to enclose",
    ),
    # parts, signals, program
    "part nowhere": (
        "station: pick\n",
        "station: peck\n",
        "station 'peck' is unknown; known are pick, place",
    ),
    "signal follows nobody": (
        "follows: ask",
        "follows: aks",
        "'aks' is unknown; known are ask, open",
    ),
    "signal twice": (
        "{name: open, follows: ask, delay: 1}",
        "{name: ask}",
        "signal ask is there twice",
    ),
    "unknown station": (
        "station: place, detach",
        "station: plaice, detach",
        "station 'plaice' is unknown",
    ),
    "unknown posture": ("posture: home", "posture: house", "is 'house', must be one of home, park"),
    "unknown part": ("attach: gear", "attach: wheel", "part 'wheel' is unknown; known are gear"),
    "attach elsewhere": ("{station: pick, attach", "{station: place, attach", "it lies at pick"),
    "detach what is not held": ("attach: gear, ", "", "gear can't be detached, no part is held"),
    "unknown signal": (
        "wait_for: [open]",
        "wait_for: [opened]",
        "signal 'opened' is unknown; known are ask, open",
    ),
    "unknown mode": (
        "BUS_POWER_OFF",
        "SLEEP",
        "is 'SLEEP', must be one of AUTO, STAND_ON_MOTORS, STAND_ON_BRAKES",
    ),
    "no pause": ("pause: 60", "pause: 0", "is 0 s, must be in (0, 604800] s"),
    "mode of a station": ("dwell: 1}", "power_mode: AUTO}", "does not belong to a station step"),
    "two kinds of step": (
        "{posture: home}",
        "{posture: home, pause: 1}",
        "exactly one of station, posture, path, pause",
    ),
    "negative dwell": ("dwell: 1}", "dwell: -1}", "dwell is -1 s, must be in [0, 604800] s"),
}
CHECKED_AS_A_WHOLE = {"empty", "missing key", "no state", "detach what is not held"}


def broken(case: str) -> tuple[str, str]:
    """Return the broken text and what its sentence must hold."""
    entry = BROKEN[case]
    if case == "empty":
        return "", entry[1]
    old = entry[0]
    new = entry[1]
    assert old in GOOD, old
    return GOOD.replace(old, new, 1), entry[2] if len(entry) > 2 else ""


def test_the_good_file_is_good() -> None:
    cell = cell_from_yaml(GOOD)
    assert [step.kind for step in cell.program] == ["POSTURE", "STATION", "STATION", "PAUSE"]
    assert cell.program[2].set_signals == (Signal("ask", False),)


@pytest.mark.parametrize("case", BROKEN)
def test_a_broken_file_is_answered_by_a_sentence_with_its_line(case: str) -> None:
    text, sentence = broken(case)
    with pytest.raises(CellFileError, match=r"^cell.yaml:\d+: ") as caught:
        cell_from_yaml(text, "cell.yaml")
    error = caught.value
    assert sentence.replace("\\\\", "\\") in error.sentence
    assert "\n" not in str(error)
    assert len(str(error)) < 1000
    assert error.line >= 1
    if case not in CHECKED_AS_A_WHOLE:
        changed = 1 + next(
            i
            for i, (a, b) in enumerate(zip(GOOD.split("\n"), text.split("\n"), strict=False))
            if a != b
        )
        # the line itself, or the head of the entry it belongs to
        head = max(
            (
                i
                for i, row in enumerate(text.split("\n")[:changed], 1)
                if re.match(r"(  - )|\S", row)
            ),
            default=1,
        )
        assert head <= error.line <= changed + 1


def test_a_text_beyond_the_limit_is_refused_at_once() -> None:
    with pytest.raises(CellFileError, match=r"has 9000000 characters, must be at most 8000000"):
        cell_from_yaml("#" * 9_000_000)


def test_too_many_bodies_are_refused() -> None:
    bodies = "\n".join(f"      - {{name: b{i}, kind: sphere, radius: 1}}" for i in range(10_001))
    text = GOOD.replace("    bodies:\n", f"    bodies:\n{bodies}\n", 1)
    with pytest.raises(CellFileError, match=r"has 10003 entries, must have 0 to 10000"):
        cell_from_yaml(text)


@pytest.mark.long
def test_ten_thousand_zones_are_read() -> None:
    machines = "\n".join(
        f"  - {{name: m{i}, zone: {{kind: OPEN, size: [1, 1, 1], xyz: [0, 0, {i % 900}]}}, "
        "bodies: []}"
        for i in range(9_999)
    )
    cell = cell_from_yaml(GOOD.replace("signals:", f"{machines}\nsignals:", 1))
    assert len(cell.equipment) == 10_000


def test_files_that_are_no_files_are_refused(tmp_path: Path) -> None:
    fifo = tmp_path / "pipe.yaml"
    os.mkfifo(fifo)
    for path in (fifo, tmp_path, tmp_path / "none.yaml", Path("/dev/zero"), Path("a\0b.yaml")):
        with pytest.raises(CellFileError):
            load_cell(path)


def test_a_file_that_is_not_text_is_refused_with_its_line(tmp_path: Path) -> None:
    path = tmp_path / "cell.yaml"
    path.write_bytes(b"format: ir_cell/1\nname: \xff\n")
    with pytest.raises(CellFileError, match=r"cell.yaml:2: byte 0xff is not UTF-8 text"):
        load_cell(path)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be"])
def test_text_of_two_bytes_a_letter_is_named(tmp_path: Path, encoding: str) -> None:
    path = tmp_path / "cell.yaml"
    path.write_bytes(GOOD.encode(encoding))
    sentence = r"cell.yaml:1: the file is UTF-16 text, must be UTF-8"
    with pytest.raises(CellFileError, match=sentence):
        load_cell(path)
    with pytest.raises(RobotFileError, match=sentence):
        robot_named(str(path))
    assert [error.line for error in (*cell_file_errors(path), *robot_file_errors(path))] == [1, 1]


def test_the_largest_numbers_are_refused_in_their_line_wherever_they_stand() -> None:
    numbers = re.finditer(r"(?<![\w.])-?\d+(?:\.\d+)?(?![\w.])", GOOD)
    for number, huge in zip(numbers, itertools.cycle(("1e308", "-1.7e+308")), strict=False):
        text = f"{GOOD[: number.start()]}{huge}{GOOD[number.end() :]}"
        line = GOOD.count("\n", 0, number.start()) + 1
        with pytest.raises(CellFileError, match=rf"^<text>:{line}: .*{re.escape(huge)}"):
            cell_from_yaml(text)


def test_a_large_file_is_refused_unread(tmp_path: Path) -> None:
    path = tmp_path / "cell.yaml"
    with path.open("wb") as file:
        file.truncate(2_000_000_000)
    with pytest.raises(CellFileError, match="has 2000000000 bytes, must be at most 8000000 bytes"):
        load_cell(path)


@pytest.mark.parametrize("name", ["", "dem", "x" * 10_000, "de\nmo", "../demo", "~"])
def test_an_unknown_name_lists_the_known(name: str) -> None:
    with pytest.raises((UnknownNameError, CellFileError)) as caught:
        load_cell(name)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


@given(
    st.integers(0, len(GOOD) - 1),
    st.integers(0, 12),
    st.one_of(
        st.text(max_size=4),
        st.sampled_from(
            [
                "{",
                "}",
                "[",
                "]",
                ":",
                "\n",
                "- ",
                "&a ",
                "*a",
                "!x ",
                "null",
                "1e400",
                ".nan",
                "\ud800",
                "\0",
            ]
        ),
    ),
)
@settings(max_examples=300, deadline=None)
def test_whatever_is_typed_into_a_file_is_read_or_answered_by_a_sentence(
    at: int, removed: int, typed: str
) -> None:
    text = GOOD[:at] + typed + GOOD[at + removed :]
    answer = ""
    try:
        cell = cell_from_yaml(text, "cell.yaml")
    except CellFileError as error:
        answer = str(error)
    if answer:
        assert re.match(r"cell.yaml:(\d+:)? ", answer)
        assert answer.isprintable()
    else:
        assert cell_to_yaml(cell_from_yaml(cell_to_yaml(cell))) == cell_to_yaml(cell)
