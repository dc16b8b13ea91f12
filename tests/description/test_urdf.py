"""The URDF is the robot data: PyBullet, which knows nothing else, agrees on kinematics, masses,
gravity.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from ir_description import Load, RobotModel, bundled_cells, load_cell, load_robot, robot_urdf
from ir_description.robot import fixed_frames, moving_frames
from ir_values.arrays import FloatArray, solid_box_inertia

pybullet = pytest.importorskip("pybullet")

POSITION_TOLERANCE = 1e-9  # m; the centre-of-mass frame is kept in double precision
GRAVITY = 9.80665
TOOL_155KG = Load(
    "tool_155kg",
    "tool",
    155.0,
    np.array([0.24, 0.0, 0.0]),
    solid_box_inertia(155.0, (0.465, 0.66, 0.22)),
)


class Bullet:
    """The robot in a PyBullet of its own."""

    def __init__(self, folder: Path, text: str) -> None:
        path = folder / "robot.urdf"
        path.write_text(text)
        self.client = pybullet.connect(pybullet.DIRECT)
        self.body = pybullet.loadURDF(
            str(path),
            useFixedBase=True,
            flags=pybullet.URDF_USE_INERTIA_FROM_FILE,
            physicsClientId=self.client,
        )
        self.names = ["base_link"]
        self.joints = []
        for j in range(pybullet.getNumJoints(self.body, physicsClientId=self.client)):
            info = pybullet.getJointInfo(self.body, j, physicsClientId=self.client)
            self.names.append(info[12].decode())
            if info[2] == pybullet.JOINT_REVOLUTE:
                self.joints.append(j)
        pybullet.setGravity(0, 0, -GRAVITY, physicsClientId=self.client)

    def place(self, q: FloatArray) -> None:
        for joint, value in zip(self.joints, q, strict=True):
            pybullet.resetJointState(self.body, joint, float(value), physicsClientId=self.client)

    def com_position(self, link: str) -> FloatArray:
        index = self.names.index(link) - 1
        state = pybullet.getLinkState(
            self.body, index, computeForwardKinematics=True, physicsClientId=self.client
        )
        return np.array(state[0])

    def gravity(self, q: FloatArray) -> FloatArray:
        zeros = [0.0] * len(self.joints)
        torque = pybullet.calculateInverseDynamics(
            self.body, list(map(float, q)), zeros, zeros, physicsClientId=self.client
        )
        return np.array(torque)

    def dynamics(self, link: str) -> tuple[float, FloatArray]:
        info = pybullet.getDynamicsInfo(
            self.body, self.names.index(link) - 1, physicsClientId=self.client
        )
        return info[0], np.array(info[2])


@pytest.fixture
def robot() -> RobotModel:
    return load_robot()


@pytest.fixture
def bullet(tmp_path: Path, robot: RobotModel) -> Iterator[Bullet]:
    world = Bullet(tmp_path, robot_urdf(robot))
    yield world
    pybullet.disconnect(physicsClientId=world.client)


@pytest.fixture
def loaded(tmp_path: Path, robot: RobotModel) -> Iterator[Bullet]:
    world = Bullet(tmp_path, robot_urdf(robot, TOOL_155KG))
    yield world
    pybullet.disconnect(physicsClientId=world.client)


def link_poses(robot: RobotModel, q: FloatArray) -> list[FloatArray]:
    """Poses (4, 4) of links 0..n in the base, straight from the chain's definition."""
    poses = [np.eye(4)]
    for i in range(robot.n):
        axis = robot.joint_axis[i]
        angle = q[i]
        K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
        turn = np.eye(4)
        turn[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
        poses.append(poses[-1] @ robot.joint_origin[i] @ turn)
    return poses


def test_every_link_stands_where_the_chain_says(bullet: Bullet, robot: RobotModel) -> None:
    generator = np.random.default_rng(7)
    for q in generator.uniform(robot.position_min, robot.position_max, (50, robot.n)):
        bullet.place(q)
        for i, pose in enumerate(link_poses(robot, q)[1:], start=1):
            expected = pose[:3, :3] @ robot.link_com[i] + pose[:3, 3]
            assert (
                np.abs(bullet.com_position(robot.link_names[i]) - expected).max()
                < POSITION_TOLERANCE
            )


def test_machine_home_puts_the_flange_where_the_data_sheet_says(
    bullet: Bullet, robot: RobotModel
) -> None:
    bullet.place(robot.machine_home)
    assert bullet.com_position("flange") == pytest.approx(
        [1.765, 0.0, 1.784], abs=POSITION_TOLERANCE
    )
    assert bullet.com_position("tool0") == pytest.approx(
        [1.765, 0.0, 1.784], abs=POSITION_TOLERANCE
    )


def test_masses_and_inertias_are_those_of_the_data(bullet: Bullet, robot: RobotModel) -> None:
    for i, name in enumerate(robot.link_names):
        if i == 0:  # Bullet takes a fixed base for massless
            continue
        mass, inertia = bullet.dynamics(name)
        assert mass == pytest.approx(robot.link_mass[i], rel=1e-12)
        assert inertia == pytest.approx(np.diag(robot.link_inertia[i]), rel=1e-12)


def test_every_link_has_a_mass() -> None:
    tree = Xml.fromstring(robot_urdf(load_robot(), TOOL_155KG))
    assert all(float(link.find("inertial/mass").get("value")) > 0 for link in tree.iter("link"))  # type: ignore


def test_gravity_torques_at_machine_home_empty(bullet: Bullet, robot: RobotModel) -> None:
    """991 Nm at A2 and A3 (check of the machine data); positive A2 lowers the arm, so the sign is
    -.
    """
    torque = bullet.gravity(robot.machine_home)
    assert torque[1] == pytest.approx(-991, abs=0.5)
    assert torque[2] == pytest.approx(-991, abs=0.5)
    assert np.abs(torque[[0, 3, 4, 5]]).max() < 1e-5  # the wrist carries no moment about A4, A5, A6


def test_gravity_torques_at_machine_home_with_155_kg(loaded: Bullet, robot: RobotModel) -> None:
    torque = loaded.gravity(robot.machine_home)
    assert torque[1] == pytest.approx(-3506, abs=0.5)
    assert torque[4] == pytest.approx(-692, abs=0.5)


def test_the_wrist_carries_no_moment_about_a5_anywhere(bullet: Bullet, robot: RobotModel) -> None:
    generator = np.random.default_rng(3)
    for q in generator.uniform(robot.position_min, robot.position_max, (20, robot.n)):
        assert abs(bullet.gravity(q)[4]) < 1e-5


def test_a_tool_and_a_part_can_be_fixed_together(tmp_path: Path) -> None:
    cell = load_cell("demo")
    world = Bullet(tmp_path, robot_urdf(cell.robot, cell.loads("gear"), cell.tcp))
    try:
        assert world.dynamics("load_gripper")[0] == pytest.approx(155.0)
        assert world.dynamics("load_gear")[0] == pytest.approx(20.0)
        world.place(cell.robot.machine_home)
        assert world.com_position("tcp") == pytest.approx(
            [2.185, 0.0, 1.784], abs=POSITION_TOLERANCE
        )
    finally:
        pybullet.disconnect(physicsClientId=world.client)


def test_capsules_are_cylinders_with_round_ends() -> None:
    robot = load_robot()
    tree = Xml.fromstring(robot_urdf(robot))
    for i, name in enumerate(robot.link_names):
        link = tree.find(f"link[@name='{name}']")
        assert link is not None
        count = sum(capsule.link == i for capsule in robot.capsules)
        assert len(link.findall("collision/geometry/cylinder")) == count
        assert len(link.findall("collision/geometry/sphere")) == 2 * count


def test_limits_are_those_of_the_data() -> None:
    robot = load_robot()
    tree = Xml.fromstring(robot_urdf(robot))
    for i, name in enumerate(robot.joint_names):
        limit = tree.find(f"joint[@name='{name}']/limit")
        assert limit is not None
        assert float(limit.get("lower", "nan")) == robot.position_min[i]
        assert float(limit.get("upper", "nan")) == robot.position_max[i]
        assert float(limit.get("velocity", "nan")) == robot.velocity_max[i]
        assert float(limit.get("effort", "nan")) == robot.envelope_torque[i, 0]


def fixed_in_tree(tree: Xml.Element) -> dict[str, tuple[str, FloatArray]]:
    """Parent and pose (4, 4) of every link that a fixed joint holds, as the text says it."""
    found = {}
    for joint in tree.iter("joint"):
        if joint.get("type") == "fixed":
            origin = joint.find("origin")
            parent = joint.find("parent")
            child = joint.find("child")
            assert origin is not None and parent is not None and child is not None  # noqa: PT018
            pose = np.eye(4)
            pose[:3, 3] = [float(x) for x in origin.get("xyz", "").split()]
            roll, pitch, yaw = (float(x) for x in origin.get("rpy", "").split())
            pose[:3, :3] = turn(2, yaw) @ turn(1, pitch) @ turn(0, roll)
            found[child.get("link", "")] = (parent.get("link", ""), pose)
    return found


def turn(axis: int, angle: float) -> FloatArray:
    a = (axis + 1) % 3
    b = (axis + 2) % 3
    R = np.eye(3)
    R[a, a] = R[b, b] = np.cos(angle)
    R[b, a] = np.sin(angle)
    R[a, b] = -np.sin(angle)
    return R


@pytest.mark.parametrize("name", bundled_cells())
def test_the_root_is_the_cell_without_inertia_and_everything_below_has_one(name: str) -> None:
    cell = load_cell(name)
    tree = Xml.fromstring(robot_urdf(cell.robot, cell.tool, cell.tcp, cell.base_pose))
    links = {link.get("name"): link for link in tree.iter("link")}
    children = {joint.find("child").get("link") for joint in tree.iter("joint")}  # type: ignore[union-attr]
    assert set(links) - children == {"cell"}
    assert [link for link, element in links.items() if element.find("inertial") is None] == ["cell"]


@pytest.mark.parametrize("name", bundled_cells())
def test_fixed_frames_are_those_of_the_urdf(name: str) -> None:
    cell = load_cell(name)
    loads = () if cell.tool is None else (cell.tool,)
    tree = Xml.fromstring(robot_urdf(cell.robot, loads, cell.tcp, cell.base_pose))
    said = fixed_in_tree(tree)
    frames = fixed_frames(cell.robot, loads, cell.tcp, cell.base_pose)
    assert {frame.name for frame in frames} == set(said)
    for frame in frames:
        parent, pose = said[frame.name]
        assert frame.parent == parent
        assert np.abs(frame.pose - pose).max() < POSITION_TOLERANCE


def test_moving_frames_lead_from_link_to_link(robot: RobotModel) -> None:
    generator = np.random.default_rng(5)
    for q in generator.uniform(robot.position_min, robot.position_max, (20, robot.n)):
        poses = np.array(link_poses(robot, q))
        at = np.eye(4)
        for k, frame in enumerate(moving_frames(robot, poses), start=1):
            assert (frame.parent, frame.name) == robot.link_names[k - 1 : k + 1]
            at = at @ frame.pose
            assert np.abs(at - poses[k]).max() < POSITION_TOLERANCE
