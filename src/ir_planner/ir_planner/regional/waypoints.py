"""Waypoints of a movement whose straight steps are free: a movement that a guess became has none
yet.
"""

from ir_planner.checks import FreeSpace
from ir_planner.optimize import path_of
from ir_planner.search import straight_along
from ir_planner.timing import Movement


def over_free_steps(movement: Movement, space: FreeSpace) -> Movement:
    """The same trajectory with free straight steps along it as waypoints; as it is where its own
    are free, or where no work is left.
    """
    if space.edges_free(movement.path[:-1], movement.path[1:]).all():
        return movement
    along = straight_along(path_of(movement.trajectory, space.scene), space, space.scene.weights)
    return movement if along is None else movement.passing(along)
