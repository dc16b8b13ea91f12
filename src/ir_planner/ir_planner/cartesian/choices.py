"""Certified movements along a path from and to different configurations, for a program to choose
among.

Candidates are the cheapest chain to each different end and from each different start; those that
differ by whole turns of joints are one movement, shifted.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from ir_kernels import portable
from ir_msgs_py.arrays import BoolArray, FloatArray
from ir_msgs_py.cartesian import CartesianPath
from ir_planner.cartesian.best import DrivenPath, best_along, timed, within_limits
from ir_planner.cartesian.chains import Chain
from ir_planner.cartesian.drawn import Drawn, drawn
from ir_planner.cartesian.finer import chains_through
from ir_planner.cartesian.refusal import PathRefusedError
from ir_planner.checks import FreeSpace
from ir_planner.curves import extremes
from ir_planner.request import Context
from ir_planner.timing import Movement

_OF_EACH = 12  # chains by their ends, and as many by their starts
_SAME = 1e-3  # rad: chains that are nearer are one
_TURNS = (-2, -1, 0, 1, 2)


@dataclass(frozen=True, eq=False)
class Choice:
    """A movement along a path with its configurations (N, n) from its beginning to its end."""

    points: FloatArray
    movement: Movement


def choices_along(
    path: CartesianPath, context: Context, after: FreeSpace, most: int
) -> list[Choice]:
    """Certified movements whose ends keep the safety distance from everything, at their end also in
    the space `after`; at most `most`. Raises PathRefusedError, HeadingError, RequestError.
    """
    whole = drawn(path, None, False, context)
    whole = replace(whole, layers=replace(whole.layers, free=_ends_free(whole, after)))
    reason: PathRefusedError | None = None
    found: list[DrivenPath] = []
    for chain in _different(whole):
        context.work.check()
        try:
            driven = within_limits(whole.asked, timed(whole.asked, chain))
            if driven.movement.certified:
                whole.kept(driven)
                found.append(driven)
        except PathRefusedError as error:
            reason = reason or error
    if not found:
        found = [best_along(whole.asked, whole.layers)]
        whole.kept(found[0])
    turned = (choice for driven in found for choice in _turned(driven))
    return list(itertools.islice(turned, most))


def _ends_free(whole: Drawn, after: FreeSpace) -> BoolArray:
    """Which configurations take part (M,): at the ends those that nothing is allowed to touch."""
    layers = whole.layers
    context = whole.asked.context
    free = layers.free.copy()
    plain = FreeSpace.of(context.scene, context.safety_distance, context.work)
    for k, spaces in ((0, (plain,)), (len(layers.s) - 1, (plain, after))):
        there = np.flatnonzero(free & (layers.layer == k))
        if len(there) == 0:
            continue
        for space in spaces:
            free[there] &= space.states_free(layers.q[there])
        if not free[there].any():
            end = "its end: give it a retract" if k else "its beginning: give it an approach"
            raise PathRefusedError(
                f"no configuration keeps {1e3 * context.safety_distance:g} mm from everything at "
                f"{end}"
            )
    return free


def _different(whole: Drawn) -> list[Chain]:
    """The cheapest chains by their ends and by their starts, each once, cheapest first."""
    asked = whole.asked
    layers = whole.layers
    by_end, layers = chains_through(asked, layers, _OF_EACH)
    by_start, _ = chains_through(asked, layers, _OF_EACH, by_start=True)
    kept: list[Chain] = []
    for chain in sorted((*by_end, *by_start), key=lambda one: one.joules):
        if all(
            np.abs(portable.sin(0.5 * (chain.q - other.q))).max() > 0.5 * _SAME for other in kept
        ):
            kept.append(chain)
    return kept


def _turned(driven: DrivenPath) -> Iterator[Choice]:
    """A movement as it is, then by whole turns of joints as far as their limits allow."""
    movement = driven.movement
    robot = movement.context.scene.cell.robot
    trajectory = movement.trajectory
    largest = extremes(*trajectory.coefficients())
    low = largest.lowest.min(axis=0)
    high = largest.highest.max(axis=0)
    turns = [
        [k for k in _TURNS if a + 2.0 * np.pi * k >= least and b + 2.0 * np.pi * k <= most]
        for a, b, least, most in zip(low, high, robot.position_min, robot.position_max, strict=True)
    ]
    own = trajectory.positions
    for shift in sorted(itertools.product(*turns), key=lambda one: sum(map(abs, one))):
        if not any(shift):
            yield Choice(own, movement)
            continue
        moved = own + 2.0 * np.pi * np.array(shift)
        yield Choice(moved, replace(movement, trajectory=replace(trajectory, positions=moved)))
