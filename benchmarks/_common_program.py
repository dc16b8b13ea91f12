"""The common program: baseline movements through the same stations, each configuration nearest to
the last.

Service lines are the planner's. Where a straight segment is not free, the planner's path of least W
stands in for it, driven as fast as the limits allow; the share of such segments is reported.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass, replace

import numpy as np
from _baseline import baseline, fastest_baseline
from _drives import Drives
from _program_chains import Chains

from ir_msgs_py.options import PlanOptions
from ir_planner import Goal, Planner
from ir_planner.program.stop_nodes import StopNode


@dataclass(frozen=True)
class CommonProgram:
    """Duration [s], drive energy [J] of its movements, and the share of segments that are not
    free.
    """

    duration: float
    drive_energy: float
    not_free: float


def common_program(chains: Chains, planner: Planner, options: PlanOptions) -> CommonProgram:
    """The common program through the stops of `chains`, with the load of `options`."""
    scene = planner.scene(options.load)
    drives = Drives(scene)
    nodes = _nearest(chains)
    T = 0.0
    E = 0.0
    segments = 0
    not_free = 0
    for place, (first, second) in enumerate(itertools.pairwise(nodes)):
        for node, entry in ((first, False), (second, True)):
            line = chains.line(place, node, entry=entry)
            if line is not None:
                T = T + line.duration
                E = E + line.energy - line.base_energy
        if np.abs(second.arrival - first.departure).max() < 1e-9:
            continue
        segments += 1
        least = fastest_baseline(first.departure, second.arrival, scene, drives)
        movement = baseline(first.departure, second.arrival, scene, least)
        if planner.evaluate(
            movement, safety_distance=options.safety_distance, load=options.load
        ).verification.violation:
            not_free += 1
            goal = Goal(configuration=second.arrival)
            around = replace(options, objective="movement_cost")
            found = planner.plan_regional(
                start=first.departure, goal=goal, options=around
            ).trajectory
            assert found is not None
            movement = found
        T = T + movement.duration
        E = E + drives.energy(movement)
    return CommonProgram(T, E, not_free / max(segments, 1))


def _nearest(chains: Chains) -> list[StopNode]:
    """One node per stop: the nearest by W to the one before, turns included."""
    weights = chains.route.arriving(0).weights
    nodes = [chains.layers[0][0]]
    for layer in chains.layers[1:]:
        last = nodes[-1].interaction
        nodes.append(min(layer, key=lambda node: float(np.abs(node.interaction - last) @ weights)))
    return nodes
