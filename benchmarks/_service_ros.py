"""The node beside the core: what an answer over ROS takes longer, and whether ids repeat."""

from __future__ import annotations

import time

import numpy as np
from _node_process import running

from ir_msgs.srv import PlanServiceMovement
from ir_msgs_py import names
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.ros.client import Client


def over_ros(cell: str, stations: list[str], seeds: int) -> tuple[FloatArray, bool]:
    """Milliseconds that an answer of the node takes beyond its own planning_time, and whether ids
    repeat.
    """
    extra = []
    repeats = True
    with running("ir_planner.node", cell=cell), Client(timeout=60.0) as client:
        for station in stations:
            for seed in range(seeds):
                request = PlanServiceMovement.Request(station=station, max_candidates=1)
                request.options.seed = seed
                ids = []
                for _ in range(2):
                    begin = time.perf_counter()
                    answer = client.ask(names.PLAN_SERVICE_MOVEMENT, request)
                    took = time.perf_counter() - begin
                    extra.append((took - answer.info.planning_time) * 1e3)
                    ids.append(answer.candidates[0].trajectory_id)
                repeats &= ids[0] == ids[1]
    return np.array(extra[1:]), repeats  # the first one finds its service
