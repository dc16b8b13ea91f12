"""Topics of MoveIt beside its services: what its panel in RViz looks at, and what it publishes.

Names, types and qualities of service are those of move_group in MoveIt 2 for Jazzy.
"""

from __future__ import annotations

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any

import numpy as np
from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from std_msgs.msg import String

from ir_description import Cell, cell_from_yaml
from ir_msgs.msg import CellState
from ir_msgs_py import names
from ir_msgs_py.ros.topics import LATCHED
from ir_planner.node.moveit_actions import STOP
from ir_planner.node.moveit_view import planning_scene, robot_state, semantic_description
from ir_values.arrays import FloatArray
from ir_values.errors import IrError

SEMANTIC = "robot_description_semantic"
MONITORED = "monitored_planning_scene"
SCENE = "planning_scene"
WORLD = "planning_scene_world"
OBJECT = "collision_object"
EVENT = "trajectory_execution_event"
DISPLAY = "display_planned_path"
_PERIOD = 0.25  # s: move_group publishes its scene four times a second at most
_MOVED = 1e-4  # rad
_DEPTH = 100  # messages that wait for a subscriber, as there
_SERVICES = QoSProfile(depth=10)


class SceneMonitor:
    """Publishes the scene as it changes, the semantic description and what was planned; takes
    scenes and objects that are published.

    where: the joints (n,) of a robot, None where nothing is known of it. apply: takes a scene.
    stop: stops what is driven.
    """

    def __init__(
        self,
        node: Node,
        msgs: Any,
        group_name: str,
        where: Callable[[tuple[str, ...]], FloatArray | None],
        apply: Callable[[Any, Any], Any],
        stop: Callable[[], None],
        group: CallbackGroup,
    ) -> None:
        self._node = node
        self._msgs = msgs
        self._group_name = group_name
        self._where = where
        self._apply = apply
        self._stop = stop
        self._cell: Cell | None = None
        self._told: FloatArray | None = None
        self._listeners = 0
        self._semantic = node.create_publisher(String, SEMANTIC, LATCHED)
        self._scenes = node.create_publisher(msgs.PlanningScene, MONITORED, _DEPTH)
        self._paths = node.create_publisher(msgs.DisplayTrajectory, DISPLAY, _SERVICES)
        for kind, topic, hear, quality in (
            (CellState, names.CELL, self._hear_cell, LATCHED),
            (msgs.PlanningScene, SCENE, self._hear_scene, _SERVICES),
            (msgs.PlanningSceneWorld, WORLD, self._hear_world, _SERVICES),
            (msgs.CollisionObject, OBJECT, self._hear_object, _SERVICES),
            (String, EVENT, self._hear_event, _SERVICES),
        ):
            node.create_subscription(kind, topic, hear, quality, callback_group=group)
        node.create_timer(_PERIOD, self._look, callback_group=group)

    def show_path(self, state: Any, trajectory: Any) -> None:
        """Let RViz draw a movement."""
        model = "" if self._cell is None else self._cell.robot.name
        self._paths.publish(
            self._msgs.DisplayTrajectory(
                model_id=model, trajectory=[trajectory], trajectory_start=state
            )
        )

    def scene(self, cell: Cell, wanted: int = 0) -> Any:
        """The scene as it stands."""
        q = self._where(cell.robot.joint_names)
        return planning_scene(self._msgs, cell, q, self._now(), wanted)

    def _now(self) -> Any:
        return self._node.get_clock().now().to_msg()

    def _hear_cell(self, message: CellState) -> None:
        try:
            self._cell = cell_from_yaml(message.cell_yaml)
        except IrError as error:
            self._node.get_logger().warning(f"{names.CELL} is ignored: {error}")
            return
        self._semantic.publish(String(data=semantic_description(self._cell, self._group_name)))
        self._publish_whole(self._cell)

    def _publish_whole(self, cell: Cell) -> None:
        if self._scenes.get_subscription_count():
            self._scenes.publish(self.scene(cell))

    def _look(self) -> None:
        """The whole scene for a new listener, and where the robot is when it has moved."""
        listeners = self._scenes.get_subscription_count()
        came = listeners > self._listeners
        self._listeners = listeners
        cell = self._cell
        if cell is None or not listeners:
            return
        if came:
            self._publish_whole(cell)
        q = self._where(cell.robot.joint_names)
        if q is None or (self._told is not None and _is_near(q, self._told)):
            return
        self._told = q
        diff = self._msgs.PlanningScene(
            name=cell.name, robot_model_name=cell.robot.name, is_diff=True
        )
        diff.robot_state = robot_state(self._msgs, cell.robot.joint_names, q, self._now())
        diff.robot_state.is_diff = True
        self._scenes.publish(diff)

    def _hear_scene(self, scene: Any) -> None:
        self._apply(SimpleNamespace(scene=scene), SimpleNamespace())

    def _hear_world(self, world: Any) -> None:
        self._hear_scene(self._msgs.PlanningScene(is_diff=True, world=world))

    def _hear_object(self, collision_object: Any) -> None:
        world = self._msgs.PlanningSceneWorld(collision_objects=[collision_object])
        self._hear_world(world)

    def _hear_event(self, message: String) -> None:
        if message.data == STOP:
            self._stop()
        else:
            self._node.get_logger().warning(f"{EVENT} {message.data[:40]!a}: only {STOP} is known")


def _is_near(a: FloatArray, b: FloatArray) -> bool:
    return a.shape == b.shape and bool(np.abs(a - b).max() < _MOVED)
