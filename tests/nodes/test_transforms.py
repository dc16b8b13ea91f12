"""The frames on tf and tf_static; tf2_msgs has no wheel, so messages and publishers are stand-ins
here.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from xml.etree import ElementTree as Xml

import numpy as np
import pytest
from builtin_interfaces.msg import Time
from rclpy.qos import DurabilityPolicy
from scipy.spatial.transform import Rotation
from visualization_msgs.msg import Marker

from ir_description import load_cell
from ir_sim_driver.controller import Driver, make_simulation
from ir_sim_driver.controller.settings import SimulationSettings
from ir_sim_driver.node.visualization import RobotMarkers, Transforms, open_transforms
from ir_sim_driver.plant import carried

TOLERANCE = 1e-9  # m and rad: quaternions keep double precision


@dataclass
class Frames:
    """What tf2_msgs/TFMessage is."""

    transforms: list = field(default_factory=list)


class Listener:
    """A node that keeps what its publishers publish, by topic."""

    def __init__(self):
        self.heard = {}
        self.qualities = {}

    def create_publisher(self, message_type, topic, quality):
        assert message_type is Frames
        self.heard[topic] = []
        self.qualities[topic] = quality
        return self.Publisher(self.heard[topic])

    class Publisher:
        def __init__(self, heard):
            self.publish = heard.append


@pytest.fixture
def driver():
    driver = Driver(make_simulation(load_cell("demo"), "cell", "ideal", SimulationSettings()))
    yield driver
    driver.close()


def tree(*messages):
    """Parent and pose by frame."""
    found = {}
    for message in messages:
        for each in message.transforms:
            place = each.transform.translation
            turned = each.transform.rotation
            pose = np.eye(4)
            pose[:3, 3] = place.x, place.y, place.z
            pose[:3, :3] = Rotation.from_quat((turned.x, turned.y, turned.z, turned.w)).as_matrix()
            found[each.child_frame_id] = (each.header.frame_id, pose)
    return found


def in_the_cell(frames, name):
    pose = np.eye(4)
    while name != "cell":
        name, step = frames[name]
        pose = step @ pose
    return pose


def test_every_link_of_the_description_has_its_place_in_the_cell(driver):
    node = Listener()
    transforms = Transforms(node, driver, Frames)
    q = np.array(load_cell("demo").machine_home) + 0.1
    transforms.publish_fixed(Time(sec=1))
    transforms.publish_moving(q, 2_000_000_001)
    frames = tree(*node.heard["tf_static"], *node.heard["tf"])
    links = {link.get("name") for link in Xml.fromstring(driver.description()).iter("link")}
    assert set(frames) | {"cell"} == links
    poses = driver.link_poses(q)
    for k, name in enumerate(load_cell("demo").robot.link_names):
        assert np.abs(in_the_cell(frames, name) - poses[k]).max() < TOLERANCE
    assert node.heard["tf"][0].transforms[0].header.stamp == Time(sec=2, nanosec=1)


def test_what_is_fixed_is_latched_and_follows_the_load(driver):
    node = Listener()
    transforms = Transforms(node, driver, Frames)
    transforms.publish_fixed(Time())
    assert "load_gripper" in tree(node.heard["tf_static"][-1])
    driver.set_load(lambda cell: carried(cell, "none"))
    transforms.publish_fixed(Time())
    assert "load_gripper" not in tree(node.heard["tf_static"][-1])
    assert node.qualities["tf_static"].durability == DurabilityPolicy.TRANSIENT_LOCAL


def test_nothing_is_published_where_it_is_not_wanted(driver):
    assert open_transforms(Listener(), driver, wanted=False) is None


def test_markers_are_the_capsules_wherever_the_robot_stands(driver):
    robot, load = driver.capsules()
    markers = RobotMarkers(robot, load)
    for k, q in enumerate(np.random.default_rng(1).uniform(-1.5, 1.5, (5, 6))):
        poses = driver.link_poses(q)
        drawn = markers.at(poses, Time(sec=k)).markers
        assert len(drawn) == 2 * len(robot + load)
        for capsule, cylinder, balls in zip(robot + load, drawn[::2], drawn[1::2], strict=True):
            T = poses[capsule.link]
            ends = np.array([T[:3, :3] @ p + T[:3, 3] for p in (capsule.p0, capsule.p1)])
            place = cylinder.pose.position
            turn = cylinder.pose.orientation
            axis = Rotation.from_quat([turn.x, turn.y, turn.z, turn.w]).apply([0.0, 0.0, 1.0])
            centre = np.array([place.x, place.y, place.z])
            half = 0.5 * cylinder.scale.z * axis
            assert np.array([centre - half, centre + half]) == pytest.approx(ends, abs=2e-6)
            assert np.array([(p.x, p.y, p.z) for p in balls.points]) == pytest.approx(ends)
            assert (cylinder.type, balls.type) == (Marker.CYLINDER, Marker.SPHERE_LIST)
            assert cylinder.scale.x == balls.scale.x == 2.0 * capsule.radius
            assert cylinder.header.stamp.sec == balls.header.stamp.sec == k


def test_a_load_that_is_put_down_is_no_longer_drawn(driver):
    """Every message deletes what an earlier, larger load has left, and nothing that is shown."""
    robot, load = driver.capsules()
    poses = driver.link_poses(np.zeros(6))
    kept = {("robot", k) for k in range(2 * len(robot))}
    markers = RobotMarkers(robot, load)
    for left in (load[:1], load[:2], load[:0]):
        markers = RobotMarkers(robot, left, markers.loads)
        found = markers.at(poses, Time()).markers
        shown = {(m.ns, m.id) for m in found if m.action == Marker.ADD}
        gone = {(m.ns, m.id) for m in found if m.action == Marker.DELETE}
        assert shown == kept | {("load", k) for k in range(2 * len(left))}
        assert gone == {("load", k) for k in range(2 * len(left), 2 * len(load))}
