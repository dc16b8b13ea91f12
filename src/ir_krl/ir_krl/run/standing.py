"""Where the robot stands while a program is followed: $POS_ACT and $AXIS_ACT."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ir_description.poses import pose_of, rotation_from_abc
from ir_krl.errors import KrlRunError, SourcePlace
from ir_krl.run.commands import Command, Motion, SplineBlock, Target
from ir_krl.run.system import AXES, axis_fields
from ir_krl.run.values import (
    AXIS_NAMES,
    FRAME_NAMES,
    RAIL_NAME,
    Structure,
    Unknown,
    Value,
    axes,
    frame,
    kind_of,
    rail,
    real,
)
from ir_values.arrays import FloatArray

_MM = 1e-3  # m
AXES_NOW = ("$AXIS_ACT", "$AXIS_ACT_MEAS")
PLACE_NOW = ("$POS_ACT", "$POS_ACT_MES")


class Kinematics(Protocol):
    """What of the robot decides where a motion ends."""

    def flange(self, q: FloatArray) -> FloatArray:
        """KUKA's flange (N, 4, 4) [m] in the robot's foot, of q (N, n) [rad]."""

    def reached(self, target: Target, q: FloatArray, place: SourcePlace) -> FloatArray:
        """The configuration (n,) that a motion from q (n,) to the target ends in."""

    def status_turn(self, q: FloatArray) -> tuple[int, int]:
        """S and T of q (n,)."""


@dataclass
class Standing:
    """Where the commands so far have led from `home` (n,) [rad]."""

    commands: Sequence[Command]
    home: FloatArray
    kinematics: Kinematics | None = None
    _replayed: int = 0  # commands that `_q` stands behind
    _q: FloatArray | None = None
    _slid: int = 0  # commands that `_rails` stands behind
    _rails: FloatArray | None = None

    @property
    def moved(self) -> bool:
        """Whether a motion to a place of its own was among the commands: before, it stands where it
        is assumed to.
        """
        parts = (part for command in self.commands for part in _motions_of(command))
        return any(not part.target.relative for part in parts)

    def axes(self) -> Value | None:
        """$AXIS_ACT; None where it isn't known."""
        q = self._configuration()
        if q is None:
            return None
        return _angles(q)

    def place(self, frames: Target) -> Value | None:
        """$POS_ACT with the base and the tool of `frames`; None where it isn't known."""
        target = self._last()
        if target is not None and _is_whole(target):
            flange = _flange_at(target)
            known = {"S": target.status, "T": target.turn}
            state: dict[str, Value] = {k: v for k, v in known.items() if v is not None}
            state |= _rail_fields(self._rail())
        else:
            q = self._configuration()
            if q is None or self.kinematics is None:
                return None
            return self._position(frames, self.kinematics.flange(q[None])[0], q)
        found = frame(frames.pose(flange))
        return Structure({**found.fields, **state}, "E6POS")

    def forward(self, value: Value, frames: Target, place: SourcePlace) -> Value | None:
        """FORWARD: the E6POS of axis angles with the base and the tool of `frames`; None without a
        robot. Raises KrlRunError.
        """
        q = _whole_axes(value, place, self.home)
        if self.kinematics is None:
            return None
        return self._position(frames, self.kinematics.flange(q[None])[0], q)

    def inverse(self, target: Target, start: Value, place: SourcePlace) -> Value | None:
        """INVERSE: the axis angles at a target, from where they start; None without a robot. Raises
        KrlRunError, and KrlMotionError where no angles lead there.
        """
        q = _whole_axes(start, place, self.home)
        if self.kinematics is None:
            return None
        return _angles(self.kinematics.reached(target, q, place))

    def _position(self, frames: Target, flange: FloatArray, q: FloatArray) -> Value:
        """The E6POS of the configuration q (n,) whose flange is known."""
        assert self.kinematics is not None
        status, turn = self.kinematics.status_turn(q)
        state: dict[str, Value] = {"S": status, "T": turn, **_rail_fields(q[:-AXES])}
        return Structure({**frame(frames.pose(flange)).fields, **state}, "E6POS")

    def _rail(self) -> FloatArray:
        """Where (1,) [m] the motions so far lead a rail; (0,) without one."""
        now = self.home[:-AXES] if self._rails is None else self._rails
        for command in self.commands[self._slid :]:
            for motion in _motions_of(command):
                now = motion.target.rail_after(now)
        self._slid = len(self.commands)
        self._rails = now
        return now

    def _last(self) -> Target | None:
        """Where the last motion leads; None before the first one, and where a circle ends by its
        angle.
        """
        for command in reversed(self.commands):
            if isinstance(command, Motion):
                return None if command.angle is not None else command.target
            if isinstance(command, SplineBlock):
                return command.parts[-1].target
        return None

    def _configuration(self) -> FloatArray | None:
        """Axes (n,) [rad], by the motions that were not looked at before."""
        q = self.home if self._q is None else self._q
        for command in self.commands[self._replayed :]:
            for motion in _motions_of(command):
                if motion.angle is not None:
                    return None
                if self.kinematics is not None:
                    q = self.kinematics.reached(motion.target, q, motion.place)
                elif motion.target.axes is None or motion.target.relative:
                    return None
                else:
                    given = motion.target.axes
                    arm = [given.get(n, q[-AXES:][j]) for j, n in enumerate(AXIS_NAMES)]
                    rails = q[:-AXES] if motion.target.rail is None else [motion.target.rail]
                    q = np.array([*rails, *arm])
        self._replayed = len(self.commands)
        self._q = q
        return q


def _rail_fields(rails: FloatArray) -> dict[str, Value]:
    """E1 [mm] of a rail (1,) [m]; nothing without one (0,)."""
    return {RAIL_NAME: real(float(rails[0]) / _MM)} if len(rails) else {}


def _angles(q: FloatArray) -> Structure:
    """The E6AXIS of a configuration q (n,) [rad, of a rail m]."""
    fields: dict[str, Value] = {name: real(value) for name, value in axis_fields(q).items()}
    return Structure(fields, "E6AXIS")


def _whole_axes(value: Value, place: SourcePlace, home: FloatArray) -> FloatArray:
    """The configuration (n,) [rad] of axis angles, of a rail that they don't name as in `home`
    (n,). Raises KrlRunError where an angle lacks.
    """
    if isinstance(value, Unknown):
        raise KrlRunError(value.refusal("a computed position"), place)
    given = axes(value, place) if isinstance(value, Structure) else {}
    missing = ", ".join(name for name in AXIS_NAMES if name not in given)
    if missing:
        raise KrlRunError(f"{kind_of(value)} has no {missing}: give all axis angles", place)
    where = rail(value, place) if isinstance(value, Structure) else None
    rails = home[:-AXES] if where is None or len(home) == AXES else [where]
    return np.array([*rails, *(given[name] for name in AXIS_NAMES)])


def _motions_of(command: Command) -> Sequence[Motion]:
    if isinstance(command, SplineBlock):
        return command.parts
    return (command,) if isinstance(command, Motion) else ()


def _is_whole(target: Target) -> bool:
    """Whether a target says all of a frame."""
    given = target.frame
    return given is not None and not target.relative and len(given) == len(FRAME_NAMES)


def _flange_at(target: Target) -> FloatArray:
    """The flange (4, 4) [m] in the foot at a target that says all of a frame."""
    given = target.frame or {}
    xyz = [_MM * given[name] for name in FRAME_NAMES[:3]]
    pose = pose_of(xyz, rotation_from_abc([given[name] for name in FRAME_NAMES[3:]]))
    return target.flange(pose)
