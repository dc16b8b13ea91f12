"""Second opinions on service movements: distances by Coal at 0.0005 rad, limits at 10 kHz; and the node."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time

import numpy as np
from _kernels_peers import Coal

from ir_msgs.srv import PlanServiceMovement
from ir_msgs_py import names
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.ros.client import Client
from ir_msgs_py.trajectory import JointTrajectory
from ir_planner.scene.planning_scene import PlanningScene
from ir_planner.scene.zones import tcp_inside

STEP = 0.0005  # rad between two configurations that Coal is asked about
RATE = 10_000.0  # Hz


def clearance_left(
    trajectory: JointTrajectory, scene: PlanningScene, station: str, margin: float
) -> tuple[float, int]:
    """Least distance minus what the pair must keep [m] by Coal, and how many configurations were asked."""
    loads = [capsule for load in scene.loads for capsule in load.capsules]
    coal = Coal(scene.collision, [*scene.cell.robot.capsules, *loads], scene.cell.bodies())
    coal.precise()
    fine = trajectory.sample(np.linspace(trajectory.times[0], trajectory.times[-1], 20_000)).q
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(fine, axis=0)).max(axis=1))])
    asked = fine[np.unique(np.searchsorted(way, np.arange(0.0, way[-1], STEP)))]
    inside = tcp_inside(asked, scene, station, margin)
    relaxed, plain = scene.thresholds(margin, station), scene.thresholds(margin)
    least = min(
        float((coal.distances(q) - (relaxed if within else plain)).min())
        for q, within in zip(asked, inside, strict=True)
    )
    return least, len(asked)


def largest_share(trajectory: JointTrajectory, scene: PlanningScene) -> float:
    """Largest used share of position, speed, acceleration, jerk and torque limits, sampled at 10 kHz."""
    count = int((trajectory.times[-1] - trajectory.times[0]) * RATE) + 1
    at = trajectory.sample(np.linspace(trajectory.times[0], trajectory.times[-1], count))
    robot = scene.cell.robot
    middle, half = (
        0.5 * (robot.position_max + robot.position_min),
        0.5 * (robot.position_max - robot.position_min),
    )
    torque = scene.dynamics.inverse_dynamics(at.q, at.qd, at.qdd) / scene.dynamics.torque_limit(at.qd)
    shares = (
        (at.q - middle) / half,
        at.qd / robot.velocity_max,
        at.qdd / robot.acceleration_max,
        at.qddd / robot.jerk_max,
        torque,
    )
    return float(max(np.abs(share).max() for share in shares))


def over_ros(cell: str, stations: list[str], seeds: int) -> tuple[FloatArray, bool]:
    """Milliseconds that an answer of the node takes beyond its own planning_time, and whether ids repeat."""
    os.environ.setdefault("ROS_DOMAIN_ID", "84")
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    command = [sys.executable, "-m", "ir_planner.node", "--ros-args", "-p", f"cell:={cell}"]
    node = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    extra, repeats = [], True
    try:
        with Client(timeout=60.0) as client:
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
    finally:
        node.send_signal(signal.SIGINT)
        node.wait(10.0)
    return np.array(extra[1:]), repeats  # the first one finds its service
