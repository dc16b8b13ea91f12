"""The torque that is left to the feedback, where a heavy load leaves less of it.

The reserve is a wish of whoever plans, the rated payload a promise of the maker: where a load needs
so much of the torque to be moved slowly that the reserve isn't there, what is there is left, and
the answer says how much.
"""

from collections.abc import Iterable, Iterator

import numpy as np

from ir_planner.request import Context
from ir_planner.scene import PlanningScene, torque_use
from ir_values.arrays import FloatArray

_SLOW = 0.05  # of the speed limits: friction counts in full
_ROOM = 0.06  # share of the torque that accelerations get
_PLACES = 17


def need_of(lines: Iterable[tuple[FloatArray, FloatArray]], scene: PlanningScene) -> float:
    """Share of the torque envelope that slow movements along straight lines of the joints (n,) need
    at most, at samples.
    """
    share = np.linspace(0.0, 1.0, _PLACES)[:, None]
    worst = 0.0
    for first, second in lines:
        q = first + share * (second - first)
        for way in (1.0, -1.0):
            speed = way * _SLOW * np.sign(second - first) * scene.limits.velocity
            qd = np.broadcast_to(speed, q.shape).copy()
            worst = max(worst, float(torque_use(scene.dynamics, q, qd, np.zeros_like(q)).max()))
    return worst


def with_less_reserve(
    lines: Iterable[tuple[FloatArray, FloatArray]], context: Context
) -> Iterator[Context]:
    """The request with as much of its torque reserve as slow movements along straight lines of the
    joints leave, then with none, each with a remark that says so: for whom a torque doesn't
    suffice.
    """
    asked = context.scene.drives.torque_reserve
    need = need_of(lines, context.scene)
    there = max(1.0 - need - _ROOM, 0.0)
    for left in sorted({there, 0.0}, reverse=True):
        if left >= asked:
            continue
        context.journal.note(
            "torque reserve",
            f"{context.scene.load_text} needs {need:.3f} of the torque to be moved slowly: "
            f"{left:.3f} of it is left to the feedback instead of {asked:g}",
        )
        yield context.inside(context.scene.leaving(left))
