"""Time against energy: certified movements between the fastest and the one of least energy at the
mains.

Each is optimised at a duration of its own, from its neighbour among others. Energy is E_mains:
beyond the duration at which it is least, slower costs more of both.
"""

from ir_kernels import portable
from ir_planner.errors import RequestError
from ir_planner.optimize import Descents
from ir_planner.request import Context
from ir_planner.timing import Movement, at_the_mains

COUNT = 8  # durations from the fastest to the slowest end
_APART = (
    1.005,
    0.98,
)  # factors on duration or energy by which neighbours of a thinned front differ


def pareto_front(known: list[Movement], context: Context) -> tuple[Movement, ...]:
    """The non-dominated of the known certified movements and of those that are optimised from the
    first of
    them: durations increase, energies fall. The request's own objective and duration don't count.

    Ends early where the budget is exhausted. Raises CancelledError when asked to stop.
    """
    points = list(known)

    def descend(start: Movement, asked: Context) -> Movement | None:
        if context.work.exhausted:
            return None
        rounds = 1 if asked.options.duration > 0.0 else 3
        try:
            found = Descents(asked).improved(start.trajectory, rounds=rounds)
        except RequestError:  # longer than a movement may be
            return None
        if found is not None:
            points.append(found)
        return found

    fastest = context.asking("time")
    for asked in (at_the_mains(context), fastest):
        descend(points[0], asked)
    ends = non_dominated(points)
    neighbour = ends[-1]
    between = portable.geomspace(ends[0].report.duration, ends[-1].report.duration, COUNT)[1:-1]
    for duration in between[::-1] if len(ends) > 1 else ():  # slow movements lead to fast ones
        neighbour = descend(neighbour, context.asking("energy", float(duration))) or neighbour
    descend(neighbour, fastest)
    return non_dominated(points)


def non_dominated(points: list[Movement]) -> tuple[Movement, ...]:
    """Those beside which no other is as quick and takes as little energy; by duration."""
    front: list[Movement] = []
    for point in sorted(points, key=lambda point: (point.report.duration, point.report.energy)):
        if not front or point.report.energy < front[-1].report.energy:
            front.append(point)
    return tuple(front)


def thinned(front: tuple[Movement, ...]) -> tuple[Movement, ...]:
    """A front without points that hardly differ from the one before; both ends stay."""
    kept = list(front[:1])
    for point in front[1:]:
        last = kept[-1].report
        longer = point.report.duration / last.duration
        cheaper = point.report.energy / last.energy
        if longer >= _APART[0] or cheaper <= _APART[1]:
            kept.append(point)
        elif point is front[-1]:
            kept[1:] = [*kept[1:-1], point]
    return tuple(kept)
