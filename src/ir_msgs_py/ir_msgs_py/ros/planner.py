"""The planner as a program runner sees it: programs and trajectories by id, for coroutines of one
node.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from rclpy.node import Node

from ir_msgs.srv import GetProgram, GetTrajectory
from ir_msgs_py.errors import InvalidValueError
from ir_msgs_py.report import PlannedMovement
from ir_msgs_py.ros.conversions import (
    planned_movement_from_msg,
    status_from_msg,
    trajectory_from_msg,
)
from ir_msgs_py.ros.quality import SERVICE
from ir_msgs_py.ros.waiting import Waiting
from ir_msgs_py.status import Status, StatusCode

Fetched = tuple[Status, tuple[PlannedMovement, ...]]


class Planner:
    """Clients of one planner; timeout [s]: longest wait for each answer."""

    def __init__(self, node: Node, waiting: Waiting, name: str, timeout: float = 2.0) -> None:
        self._waiting = waiting
        self._timeout = timeout
        self._program = node.create_client(GetProgram, f"{name}/get_program", qos_profile=SERVICE)
        self._trajectory = node.create_client(
            GetTrajectory, f"{name}/get_trajectory", qos_profile=SERVICE
        )

    async def program(self, program_id: str) -> Fetched:
        """Fetch the steps of a planned program, with the points of its movements."""
        request = GetProgram.Request(program_id=program_id)
        response = await self._waiting.ask(self._program, request, self._timeout)
        if isinstance(response, Status):
            return response, ()
        status = status_from_msg(response.status)
        if not status.ok:
            return status, ()
        try:
            movements = [planned_movement_from_msg(movement) for movement in response.movements]
        except InvalidValueError as error:
            return Status(StatusCode.INVALID_MOTION_PLAN, f"program {program_id}: {error}"), ()
        return await self.with_points(movements)

    async def with_points(self, movements: Sequence[PlannedMovement]) -> Fetched:
        """Fetch the points of those movements that only have an id."""
        complete = []
        for movement in movements:
            if movement.trajectory_id and movement.trajectory is None:
                request = GetTrajectory.Request(trajectory_id=movement.trajectory_id)
                response = await self._waiting.ask(self._trajectory, request, self._timeout)
                status = (
                    response if isinstance(response, Status) else status_from_msg(response.status)
                )
                if not status.ok:
                    return status, ()
                try:
                    points = trajectory_from_msg(response.trajectory)
                except InvalidValueError as error:
                    sentence = f"trajectory {movement.trajectory_id}: {error}"
                    return Status(StatusCode.INVALID_MOTION_PLAN, sentence), ()
                complete.append(replace(movement, trajectory=points))
            else:
                complete.append(movement)
        return Status.success(), tuple(complete)
