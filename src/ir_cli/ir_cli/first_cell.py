"""A robot on an empty floor, and a movement for it to begin with: what `ir plan --robot` plans."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ir_cli.errors import CommandError, InputError, unknown_name
from ir_cli.robot_shapes import floor_below, lowest_points
from ir_cli.self_pairs import SAFETY
from ir_description import Cell, RobotModel, UnknownNameError, is_path
from ir_description.files import read_cell
from ir_description.library import robot_named
from ir_kernels import Chain, CollisionModel
from ir_values.arrays import BoolArray, FloatArray

TEXT = """\
format: ir_cell/1
name: first
robot: {robot}
base: {{xyz: [0, 0, {foot}]}}
home_deg: {home}
park_deg: {park}
program: [{{posture: home}}, {{posture: park}}]
"""
_STEP = np.radians((60.0, 20.0, -20.0, 40.0, 30.0, 60.0))
_SHARES = (1.0, 0.7, 0.5, 0.35, 0.25)
_SIGNS = ((1, 1, 1, 1, 1, 1), (1, -1, 1, 1, 1, 1), (1, 1, -1, 1, -1, 1), (-1, -1, -1, 1, -1, 1))
_INSIDE = 1e-3  # rad from both ends of an axis
_ROOM = 1e-3  # m above what is kept
_NARROW = 1e-4  # m above what pairs keep that are near by construction
_WAY = 24  # postures of a straight line between two in joint space
_LINES = 400  # that are looked at
_DRAWN = 2000  # postures within 1 rad of machine home


def first_cell(robot: str) -> Cell:
    """The cell of a robot file, of one in this folder by its name, or of a bundled robot; its
    program leads from a second free posture home and back. Raises InputError, CommandError.
    """
    beside = [Path(f"{robot[:80]}{ending}") for ending in (".yaml", ".yml")]
    file = next((path for path in beside if path.is_file()), None)
    name = robot if file is None else str(file)
    try:
        model = robot_named(name)
    except UnknownNameError as error:
        raise InputError(unknown_name("robot", robot[:80], error.known, "ir robot list")) from error
    text = TEXT.format(
        robot=Path(name).name if is_path(name) else name,
        foot=-floor_below(Chain(model), model.capsules),
        home=np.degrees(model.machine_home).tolist(),
        park=np.degrees(second_posture(model)).tolist(),
    )
    return read_cell(text, "the first cell", lambda _: model, Path(name).parent)


def second_posture(robot: RobotModel) -> FloatArray:
    """A free posture (6,) [rad] some way from machine home; where there is one, one to which every
    axis can turn straight from there.
    """
    chain = Chain(robot)
    model = CollisionModel(chain, robot.capsules, (), robot.self_pairs)
    own = {frozenset(each[:2]): each.distance for each in robot.reduced_distances}
    distances = []
    for _, first, second in model.pairs:
        reduced = own.get(frozenset((first, second)))
        if reduced is None:
            distances.append(SAFETY + _ROOM)
        else:
            distances.append(min(SAFETY, reduced) + _NARROW)
    kept = np.array(distances)

    # small steps of all axes from machine home first, then anything
    steps = []
    for size in _SHARES:
        steps += [size * _STEP * sign for sign in _SIGNS]
    drawn = np.random.default_rng(0).uniform(-1.0, 1.0, (_DRAWN, robot.n))
    low = robot.position_min + _INSIDE
    high = robot.position_max - _INSIDE
    q = np.clip(robot.machine_home + np.concatenate([np.array(steps), drawn]), low, high)
    others = [each for each in robot.capsules if each.link > 1]
    floor = floor_below(chain, robot.capsules) + SAFETY + _ROOM

    def free(postures: FloatArray) -> BoolArray:
        apart = (model.distances(postures) > kept).all(axis=1)
        return np.asarray(apart & (lowest_points(chain, postures, others) > floor))

    good = free(q)
    if not good.any():
        raise CommandError(
            f"robot {robot.name} has no free posture near its machine home to move to: choose "
            "another machine_home_deg"
        )
    found = q[good]
    share = np.linspace(0.0, 1.0, _WAY)[1:, None]
    for end in found[:_LINES]:
        if free(robot.machine_home + share * (end - robot.machine_home)).all():
            return np.asarray(end)
    return np.asarray(found[0])
