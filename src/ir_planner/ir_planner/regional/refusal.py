"""Why no regional movement was found: the pair that blocks the straight one, where, and what was
tried.
"""

from ir_kernels.collision import FREE
from ir_msgs_py.arrays import FloatArray
from ir_msgs_py.status import Status, StatusCode
from ir_planner.checks import FreeSpace, pair_value
from ir_planner.request import Journal


def refusal(
    start: FloatArray, goal: FloatArray, space: FreeSpace, journal: Journal, *, path: bool
) -> Status:
    """The status for a movement from start to goal (n,), both free, that was not found; path: one
    was.
    """
    found = space.scene.collision.certify_edges(start[None], goal[None], space.threshold)
    tried = ", ".join(f"{stage.name} ({stage.note})" for stage in journal.stages) or "nothing"
    cut = " within planning_time" if journal.work.truncated else ""
    if found.verdict[0] == FREE:
        rejected = (f"{reason} ({count})" for reason, count in journal.rejected.items())
        reasons = (
            "; ".join(rejected) or "max_iterations or planning_time ended before one was timed"
        )
        return Status(
            StatusCode.PLANNING_FAILED,
            f"the straight path is free but no movement could be certified: {reasons}"
            if path
            else f"no path found{cut}, though the straight movement is free: tried: {tried}",
        )
    share = float(found.t1[0])
    q = start + share * (goal - start)
    pair = pair_value(space.scene, q, int(found.pair[0]))
    x, y, z = space.scene.chain.tcp_poses(q[None])[0, :3, 3]
    needed = float(space.threshold[int(found.pair[0])])
    return Status(
        StatusCode.PLANNING_FAILED,
        f"no path found{cut}: on the straight movement {pair.body_a} and {pair.body_b} "
        f"({pair.kind}) come to {pair.distance * 1e3:.1f} mm at {100 * share:.0f} % of it (tcp "
        f"at {x:.2f}, {y:.2f}, {z:.2f} m), {1e3 * max(needed - pair.distance, 0.0):.1f} mm below "
        f"the {needed * 1e3:.1f} mm they must keep; tried: {tried}; another start or goal "
        "configuration, or a smaller safety distance, may help",
    )
