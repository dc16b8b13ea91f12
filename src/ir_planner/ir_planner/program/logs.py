"""What the searches that a cell asks for at its stations and steps did for the chain that was chosen."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ir_description import Station
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.search_log import CorrectionLog, SearchLog, WithdrawalLog
from ir_planner.program.choice import Choice
from ir_planner.program.node import Node
from ir_planner.scene import PlanningScene
from ir_planner.service import ExitPath

_DROPPED = 300  # configurations that came too near something, kept for a picture
_BETWEEN = 12  # positions of the tool along a step of a path


def logs_of(choice: Choice) -> Iterator[SearchLog]:
    """Of the withdrawals and genetic corrections along a chain, each once."""
    movements, seen = choice.movements, set[int]()
    for place, row in enumerate(choice.chain.chosen):
        node: Node = movements.layers[place][row]
        found = node.line.exit
        if found is not None and id(found) not in seen:
            seen.add(id(found))
            scene = movements.route.arriving(place - 1)
            yield _withdrawal_log(scene.station(movements.route.name(place - 1)), found, scene)
    for part in choice.parts:
        for log in movements.logs(part):
            if isinstance(log, CorrectionLog) and id(log) not in seen:
                seen.add(id(log))
                names = movements.route.name(part.hop - 1), movements.route.name(part.hop)
                yield replace(log, start=names[0], goal=names[1])


def _withdrawal_log(station: Station, found: ExitPath, scene: PlanningScene) -> WithdrawalLog:
    share = np.linspace(0.0, 1.0, _BETWEEN)[:, None, None]
    steps = found.points[:-1] + share * np.diff(found.points, axis=0)
    along = np.ascontiguousarray(steps.transpose(1, 0, 2).reshape(-1, found.points.shape[1]))
    walk, rejected = found.search.walk, found.search.rejected

    def tool(q: FloatArray) -> FloatArray:
        return scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3] if len(q) else np.zeros((0, 3))

    kept = found.points[:1] if walk is None else walk.kept
    dropped = kept[:0] if walk is None else walk.dropped
    every = max(-(-len(dropped) // _DROPPED), 1)
    return WithdrawalLog(
        station=station.name,
        load=scene.load_text,
        method=found.method,
        generations=0 if walk is None else walk.generations,
        candidates=0 if walk is None else walk.candidates,
        rejected=tuple(sorted(rejected.items(), key=lambda item: (-item[1], item[0]))),
        distance=(0.0, 0.0) if walk is None else walk.distance,
        kept=tool(kept),
        parents=np.zeros(1, dtype=np.int64) if walk is None else walk.parents,
        dropped=tool(dropped[::every]),
        path=tool(along),
    )
