"""What the searches that a cell asks for at its stations and steps did for the chain that was
chosen.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.report import MovementKind, PlannedMovement
from ir_msgs_py.search_log import CorrectionLog, SearchLog, WithdrawalLog
from ir_planner.program.choice import Choice
from ir_planner.program.movements import Movements
from ir_planner.program.node import Node
from ir_planner.program.station_graph import Part
from ir_planner.program.withdrawals import leaves_zone
from ir_planner.request import Context, Journal, Work
from ir_planner.scene import PlanningScene
from ir_planner.service import ExitPath, lines_free, service_lines

_DROPPED = 300  # configurations that came too near something, kept for a picture
_BETWEEN = 12  # positions of the tool along a step of a path
_DRIVEN = 120  # along a movement
_EDGES = 1_000_000  # certified edges to look at one straight line: they are no work of the request
_SAME = 1e-6  # rad


def logs_of(choice: Choice, steps: Sequence[PlannedMovement]) -> Iterator[SearchLog]:
    """Of the withdrawals and genetic corrections along a chain, each once; steps: of its
    program.
    """
    movements = choice.movements
    seen = set[int]()
    for place, row in enumerate(choice.chain.chosen):
        node: Node = movements.layers[place][row]
        found = node.line.exit
        if found is not None and id(found) not in seen:
            seen.add(id(found))
            yield _withdrawal_log(place - 1, node, found, movements)
    for part in choice.parts:
        for log in movements.logs(part):
            if isinstance(log, CorrectionLog) and id(log) not in seen:
                seen.add(id(log))
                names = movements.route.name(part.hop - 1), movements.route.name(part.hop)
                driven = _driven(part, movements, steps)
                yield replace(log, start=names[0], goal=names[1], driven=driven)


def _driven(part: Part, movements: Movements, steps: Sequence[PlannedMovement]) -> FloatArray:
    """Positions (M, 3) of the tool along the step that a part became; none where no step has its
    ends.
    """
    ends = np.stack(movements.ends(part))
    scene = movements.route.arriving(part.hop)
    for step in steps:
        motion = step.trajectory
        if step.kind != MovementKind.REGIONAL or motion is None:
            continue
        if np.abs(motion.positions[[0, -1]] - ends).max() < _SAME:
            times = np.linspace(motion.times[0], motion.times[-1], _DRIVEN)
            return _tool(motion.sample(times).q, scene)
    return np.zeros((0, 3))


def _tool(q: FloatArray, scene: PlanningScene) -> FloatArray:
    return scene.chain.tcp_poses(np.ascontiguousarray(q))[:, :3, 3] if len(q) else np.zeros((0, 3))


def _withdrawal_log(place: int, node: Node, found: ExitPath, movements: Movements) -> WithdrawalLog:
    """The withdrawal at a stop, along its points `found` but for whole turns."""
    scene = movements.route.arriving(place)
    station = scene.station(movements.route.name(place))
    share = np.linspace(0.0, 1.0, _BETWEEN)[:, None, None]
    steps = found.points[:-1] + share * np.diff(found.points, axis=0)
    along = steps.transpose(1, 0, 2).reshape(-1, found.points.shape[1])
    walk = found.search.walk
    rejected = found.search.rejected
    kept = found.points[:1] if walk is None else walk.kept
    dropped = kept[:0] if walk is None else walk.dropped
    every = max(-(-len(dropped) // _DROPPED), 1)
    arriving = movements.context.inside(scene).at(station.name)
    return WithdrawalLog(
        station=station.name,
        load=scene.load_text,
        method=found.method,
        generations=0 if walk is None else walk.generations,
        candidates=0 if walk is None else walk.candidates,
        rejected=tuple(sorted(rejected.items(), key=lambda item: (-item[1], item[0]))),
        distance=(0.0, 0.0) if walk is None else walk.distance,
        kept=_tool(kept, scene),
        parents=np.zeros(1, dtype=np.int64) if walk is None else walk.parents,
        dropped=_tool(dropped[::every], scene),
        path=_tool(along, scene),
        asked=station.search.withdrawal != "",
        blocked=_blocked(
            node.interaction, (arriving, arriving.inside(movements.route.leaving(place)))
        ),
    )


def _blocked(q: FloatArray, both: tuple[Context, Context]) -> str:
    """Why the straight line back along the tool from q (n,) leads nowhere, on arriving or on
    leaving; "": it is free and leaves the zone.
    """
    uncounted = Journal(Work(_EDGES, np.inf, both[0].work.clock), both[0].journal.seed)
    contexts = [replace(context, journal=uncounted) for context in both]
    rejected: Counter[str] = Counter()
    lines = service_lines(q[None], contexts[0], rejected)
    free = bool(lines) and all(all(lines_free(lines, context, rejected)) for context in contexts)
    if free and all(leaves_zone(lines, contexts[0])):
        return ""
    return next(iter(rejected), f"line out of {both[0].station}: it ends within the zone")
