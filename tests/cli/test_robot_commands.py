"""`ir robot`: a file from a URDF by the guide's commands, what a check says, what is refused."""

from __future__ import annotations

import itertools
import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ir_cli import robot_from_urdf
from ir_cli.main import main
from ir_cli.robot_from_urdf import RobotSource
from ir_cli.robot_remarks import remarks_on
from ir_cli.robot_shapes import Shapes, capsules_of
from ir_cli.self_pairs import Pairs, kept_sentences
from ir_description import InvalidValueError, load_cell, load_robot, robot_urdf
from ir_description.files.making import estimated_sheet, urdf_arm
from ir_description.library import robot_named
from ir_description.robot import ReducedDistance
from ir_kernels import Chain, DynamicsModel

EXACT = 1e-9
SMALL = '<collision><geometry><sphere radius="0.02"/></geometry></collision>'  # soon looked at


def sheet(name: str, **known: str) -> str:
    """The filled template: its figures, some of them known."""
    from ir_description.files.making import TEMPLATE

    robot = load_robot(name)
    home = np.round(np.degrees(robot.machine_home), 9).tolist()
    text = TEMPLATE.replace("name: my_robot", "name: copied").replace(
        "[0, -90, 90, 0, 0, 0]", str(home)
    )
    for key, value in known.items():
        text = re.sub(rf"^{key}: .*$", f"{key}: {value}", text, flags=re.MULTILINE)
    return text


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A robot file made from the URDF of the bundled UR10e."""
    tmp_path = tmp_path_factory.mktemp("made")
    (tmp_path / "robot.urdf").write_text(robot_urdf(load_robot("ur10e")))
    (tmp_path / "drives.yaml").write_text(sheet("ur10e"))
    out = tmp_path / "copied.yaml"
    urdf = str(tmp_path / "robot.urdf")
    drives = str(tmp_path / "drives.yaml")
    assert main(["robot", "new", "--urdf", urdf, "--drives", drives, "-o", str(out)]) == 0
    return out


@pytest.fixture
def made(first: Path, tmp_path: Path) -> Path:
    """A copy of it that a test may change."""
    return Path(shutil.copy(first, tmp_path))


@pytest.mark.long
def test_a_robot_made_from_a_urdf_moves_and_weighs_as_the_urdf_says(made: Path) -> None:
    robot = robot_named(str(made))
    original = load_robot("ur10e")
    q = np.random.default_rng(0).uniform(original.position_min, original.position_max, (50, 6))
    poses, expected = (Chain(each).link_poses(q)[:, -1] for each in (robot, original))
    assert np.abs(poses - expected).max() < EXACT
    own, other = (DynamicsModel(each).bias(q, np.zeros_like(q)) for each in (robot, original))
    assert np.abs(own - other).max() < 1e-6  # Nm
    assert np.allclose(robot.velocity_max, original.velocity_max)


def test_its_capsules_enclose_the_shapes_of_the_urdf(made: Path) -> None:
    robot = robot_named(str(made))
    original = load_robot("ur10e")
    for link in range(7):
        inside = [capsule for capsule in robot.capsules if capsule.link == link]
        for capsule in (each for each in original.capsules if each.link == link):
            for point in (capsule.p0, capsule.p1):
                depth = [each.radius - distance(point, each.p0, each.p1) for each in inside]
                assert max(depth) > capsule.radius - 0.005  # of a sphere with some corners cut


def distance(point: np.ndarray, a: np.ndarray, b: np.ndarray) -> float:
    along = b - a
    share = np.clip((point - a) @ along / max(along @ along, 1e-12), 0.0, 1.0)
    return float(np.linalg.norm(point - a - share * along))


def test_a_cell_beside_it_is_planned_in(made: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = made.parent / "cell.yaml"
    cell.write_text("format: ir_cell/1\nname: first\nrobot: copied.yaml\n")
    assert load_cell(cell).robot.name == "copied"
    goal = "A1 30 A2 -80 A3 -80 A4 -80 A5 80 A6 20"
    assert main(["ask", "move", str(cell), "home", goal, "--json"]) == 0
    assert json.loads(capsys.readouterr().out.partition("{")[2].join(["{", ""]))["certified"]


def test_a_check_says_what_is_estimated_and_how_poses_are_solved(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    main(["robot", "check", str(made)])
    out = capsys.readouterr().out
    assert "closed form (axes 2, 3 and 4 parallel)" in out
    assert "drives.friction_coulomb_nm" in out
    assert "pauses stay on motors" in out


def test_a_check_finds_a_drive_that_cannot_hold_the_arm(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = re.sub(r"(gear_peak_torque_nm: .value: .330.0, )330.0", r"\g<1>20.0", made.read_text())
    rows = "[[1.0, 19.0], [2.1, 10.0]]"
    text = re.sub(
        r"(envelope_rad_s_nm: .value: .)(\[\[.*?\]\]), \[\[.*?\]\]", rf"\g<1>\g<2>, {rows}", text
    )
    made.write_text(text)
    assert main(["robot", "check", str(made)]) == 1
    out = capsys.readouterr().out
    assert re.search(
        r"shoulder_lift_joint: at machine home, empty, gravity needs \d+ Nm, the drive has 20 Nm",
        out,
    )


def test_a_check_names_links_that_are_near_in_most_postures() -> None:
    robot = load_robot("ur10e")
    assert not [each for each in remarks_on(robot) if each.subject == "self_pairs"]
    *others, last = robot.capsules
    wide = replace(robot, capsules=(*others, replace(last, radius=last.radius + 0.06)))
    found = [each for each in remarks_on(wide) if each.subject == "self_pairs"]
    assert any(
        last.name in each.sentence and "in 100 % of 2000 postures" in each.sentence
        for each in found
    )
    assert {each.severity for each in found} == {"warning"}


def test_two_links_that_are_near_by_construction_have_one_sentence_on_their_least_pair() -> None:
    robot = load_robot("kr210_r2700_extra")
    one, other, third = (
        [each.name for each in robot.capsules if each.link == link] for link in (0, 2, 3)
    )
    far = [*itertools.product(one, other), *itertools.product(one, third)]
    reduced = [ReducedDistance(*pair, 0.01 - 0.001 * k, "near") for k, pair in enumerate(far)]
    sentences = kept_sentences(reduced, robot.capsules)
    assert len(sentences) == 2
    last = far[len(one) * len(other) - 1]
    assert sentences[0].startswith(f"{last[0]} and {last[1]} keep")
    assert sentences[1].startswith(f"{far[-1][0]} and {far[-1][1]} ")


@pytest.mark.parametrize(("left", "taken"), [(0.3, 0), (0.5, 1)])
def test_tighter_capsules_are_taken_unless_they_leave_fewer_postures(
    left: float, taken: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before them four of ten are left; the tighter ones have one capsule more."""
    path = tmp_path / "robot.urdf"
    path.write_text(robot_urdf(load_robot("ur10e")))
    fits: list[Shapes] = []

    def fitted(*given: object, **tighter: object) -> Shapes:
        some = capsules_of(*given)  # type: ignore[arg-type]
        extra = replace(some.capsules[-1], name="extra")
        last = (*some.capsules, extra) if tighter else some.capsules
        fits.append(Shapes(last, some.sentences))
        return fits[-1]

    def paired(*given: object, **tighter: object) -> Pairs:
        return Pairs((), (), frozenset({(4, 6)}), left if tighter else 0.4)

    monkeypatch.setattr(robot_from_urdf, "capsules_of", fitted)
    monkeypatch.setattr(robot_from_urdf, "pairs_of", paired)
    made = robot_from_urdf.made_robot(RobotSource(path, payload=10.0))
    assert made.shapes is fits[taken]


def test_all_errors_of_a_file_are_printed_in_one_run(
    made: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = made.read_text().replace("source:", "sauce:", 1).replace("radius: ", "radius: -", 1)
    made.write_text(text)
    assert main(["robot", "check", str(made)]) == 1
    assert "ir: 2 errors" in capsys.readouterr().err


def test_seven_axes_are_refused_with_their_names(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf = robot_urdf(load_robot("ur10e")).replace(
        'name="flange_joint" type="fixed"', 'name="axis_7" type="continuous"'
    )
    (tmp_path / "robot.urdf").write_text(urdf)
    (tmp_path / "drives.yaml").write_text(sheet("ur10e"))
    arguments = ["--urdf", str(tmp_path / "robot.urdf"), "--drives", str(tmp_path / "drives.yaml")]
    assert main(["robot", "new", *arguments, "-o", str(tmp_path / "out.yaml")]) == 2
    assert "has 7 axes (shoulder_pan_joint, " in capsys.readouterr().err


@pytest.mark.sampled
@pytest.mark.parametrize("seed", range(8))
def test_a_planned_axis_that_others_follow_turns_as_the_urdf_says_and_never_farther(
    seed: int,
) -> None:
    """Limits become degrees and radians again, which rounds them."""
    arm = urdf_arm(robot_urdf(load_robot("kr6_r900_2")), "arm.urdf")
    draw = np.random.default_rng(seed)
    for _ in range(20):
        ends = np.stack([-draw.uniform(0.1, 6.3, 6), draw.uniform(0.1, 6.3, 6)])
        joints = tuple(
            replace(joint, lower=float(low), upper=float(high))
            for joint, low, high in zip(arm.joints, *ends, strict=True)
        )
        led = replace(arm, joints=joints, leaders=frozenset(joint.name for joint in joints))
        values = estimated_sheet("arm", "", 6.0, led).values
        low, high = (
            np.radians([float(f"{x:.11g}") for x in values[f"position_{end}_deg"].numbers])
            for end in ("min", "max")
        )
        robot_from_urdf.check_leaders(led, low, high)
        with pytest.raises(InvalidValueError, match=r"\(<mimic>\), and the URDF turns it from"):
            robot_from_urdf.check_leaders(led, low, high + 1e-6 * np.eye(6)[draw.integers(6)])


def test_torques_that_a_urdf_does_not_have_are_estimated_unless_the_sheet_has_them(
    tmp_path: Path,
) -> None:
    urdf = re.sub(r'effort="[^"]*"', 'effort="0"', robot_urdf(load_robot("kr6_r900_2")))
    urdf = re.sub(r"(<collision.*?</collision>\s*)+", SMALL, urdf, flags=re.DOTALL)
    (tmp_path / "robot.urdf").write_text(urdf)
    (tmp_path / "drives.yaml").write_text(sheet("kr6_r900_2"))
    arguments = ["--urdf", str(tmp_path / "robot.urdf"), "--drives", str(tmp_path / "drives.yaml")]
    out = str(tmp_path / "out.yaml")
    assert main(["robot", "new", *arguments, "-o", out]) == 0
    assert robot_named(out).marks["drives.gear_peak_torque_nm"] == "L"
    known = "{value: [335, 261, 138, 43, 46, 23], source: test, confidence: M}"
    (tmp_path / "drives.yaml").write_text(sheet("kr6_r900_2", gear_peak_torque_nm=known))
    assert main(["robot", "new", *arguments, "-o", out]) == 0
    assert robot_named(out).marks["drives.gear_peak_torque_nm"] == "M"


def test_a_check_of_a_urdf_says_what_is_doubted_in_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    urdf = re.sub(r'<mass value="[^"]*"', '<mass value="1"', robot_urdf(load_robot("kr6_r900_2")))
    urdf = re.sub(r"(<collision.*?</collision>\s*)+", SMALL, urdf, flags=re.DOTALL)
    (tmp_path / "robot.urdf").write_text(urdf)
    assert main(["robot", "check", str(tmp_path / "robot.urdf"), "--payload", "6"]) == 0
    assert "note: robot.urdf: link link_1 (line" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("<robot", '<!DOCTYPE r [<!ENTITY a "b">]><robot', "defines entities"),
        ("<link", "<xacro:macro/><link", "xacro can't expand it"),
        ("</robot>", "", "this is not XML"),
    ],
)
def test_a_urdf_that_is_none_is_a_sentence(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], old: str, new: str, sentence: str
) -> None:
    text = robot_urdf(load_robot("ur10e")).replace('<?xml version="1.0"?>\n', "")
    (tmp_path / "robot.urdf").write_text(text.replace(old, new, 1))
    (tmp_path / "drives.yaml").write_text(sheet("ur10e"))
    arguments = ["--urdf", str(tmp_path / "robot.urdf"), "--drives", str(tmp_path / "drives.yaml")]
    assert main(["robot", "new", *arguments]) == 2
    assert sentence in capsys.readouterr().err
