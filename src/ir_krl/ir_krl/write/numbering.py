"""Numbers of TOOL_DATA, LOAD_DATA and BASE_DATA that inline forms name: asked for, the plant's own
where its $config.dat says the same, free ones of it, else the highest downwards.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ir_krl.errors import KrlError, SourcePlace
from ir_krl.language import SourceFile
from ir_krl.run.commands import Payload
from ir_krl.run.motions import payload_of
from ir_krl.run.program import data_of
from ir_krl.run.values import Array, Structure, Value, pose
from ir_values.arrays import FloatArray

FRAMES_MAX = 128
"""Numbers of tools, and of bases, that a KR C4 has at most."""
TOOL_HIGHEST = 16  # that every controller has
BASES_MAX = 15
"""Bases of a program: numbers of BASE_DATA that inline forms take where nobody asks for others."""
_SAME_PLACE = 1e-4  # m
_SAME_TURN = 1e-4  # of the entries of a rotation
_SAME_LOAD = (0.05, 1e-3, 0.05)  # kg, m, kg m^2

Origin = Literal["asked", "plant", "free", "own"]
"""Why a number was taken: somebody asked for it, the plant has the same there, nothing stands there
in the plant, the program's own choice.
"""


@dataclass(frozen=True)
class FrameNumbers:
    """What a user says of numbers. tools: by the part that the gripper holds, "" for none; bases:
    by machine; plant: the plant's $config.dat.
    """

    tools: Mapping[str, int] = field(default_factory=dict)
    bases: Mapping[str, int] = field(default_factory=dict)
    plant: SourceFile | None = None


def frame_numbers(
    tools: Sequence[str], bases: Sequence[str], plant: SourceFile | None = None
) -> FrameNumbers:
    """What texts say: tools "N" or "N=PART", bases "N=MACHINE", the plant's $config.dat. Raises
    KrlError.
    """
    return FrameNumbers(
        _by_name("tool", tools, "N or N=PART"), _by_name("base", bases, "N=MACHINE"), plant
    )


def _by_name(kind: str, texts: Sequence[str], form: str) -> dict[str, int]:
    """Numbers by what they are of. Raises KrlError."""
    found: dict[str, int] = {}
    for given in texts:
        number, _, name = given.partition("=")
        if not number.isdecimal() or (kind == "base" and not name) or name in found:
            raise KrlError(f"--{kind} {given[:40]}: it is {form}, each once")
        found[name] = int(number)
    return found


@dataclass(frozen=True)
class Chosen:
    """A number, and why it was taken."""

    number: int
    origin: Origin = "own"


def tool_numbers(
    asked: FrameNumbers, tool: FloatArray, loads: Mapping[str, Payload]
) -> tuple[Chosen, ...]:
    """Of the tool (4, 4) [m] with each load, by what is held. Raises KrlError."""
    tools, carried = (_plant(asked, name) for name in ("TOOL_DATA", "LOAD_DATA"))

    def origin(name: str, number: int) -> Origin | None:
        load = payload_of(carried.get(number), SourcePlace())
        if _is_null(tools.get(number)) and (load is None or load.mass <= 0.0):
            return "free"
        same = load is not None and _is_same_load(load, loads[name])
        return "plant" if same and _is_same_frame(tools.get(number), tool) else None

    return _numbered(
        "tool", list(loads), asked.tools, TOOL_HIGHEST, origin if asked.plant else None
    )


def base_numbers(asked: FrameNumbers, bases: Mapping[str, FloatArray]) -> tuple[Chosen, ...]:
    """Of the machines, with their poses (4, 4) [m] in the robot's foot. Raises KrlError."""
    there = _plant(asked, "BASE_DATA")

    def origin(name: str, number: int) -> Origin | None:
        if _is_same_frame(there.get(number), bases[name]):
            return "plant"
        return "free" if _is_null(there.get(number)) else None

    return _numbered("base", list(bases), asked.bases, BASES_MAX, origin if asked.plant else None)


def _numbered(
    kind: str,
    names: Sequence[str],
    asked: Mapping[str, int],
    highest: int,
    origin: Callable[[str, int], Origin | None] | None,
) -> tuple[Chosen, ...]:
    """A number for each of the names, no two the same. Raises KrlError."""
    unknown = next((name for name in asked if name not in names), None)
    if unknown is not None:
        known = ", ".join(name or "nothing" for name in names) or "none"
        raise KrlError(f"--{kind} {asked[unknown]}={unknown}: the program has {known}")
    beyond = next((n for n in asked.values() if not 1 <= n <= FRAMES_MAX), None)
    if beyond is not None:
        raise KrlError(f"--{kind} {beyond}: numbers are from 1 to {FRAMES_MAX}")
    if len(set(asked.values())) < len(asked):
        raise KrlError(f"--{kind}: two have one number, give each its own")
    found: dict[str, Chosen] = {name: Chosen(n, "asked") for name, n in asked.items()}
    wanted: tuple[Origin, ...] = ("plant", "free") if origin else ("own",)
    for why, name in itertools.product(wanted, names):
        if name in found:
            continue
        taken = {one.number for one in found.values()}
        if origin is None:
            left = (n for n in range(highest, 0, -1) if n not in taken)
        else:
            every = (n for n in range(1, FRAMES_MAX + 1) if n not in taken)
            left = (n for n in every if origin(name, n) == why)
        first = next(left, None)
        if first is not None:
            found[name] = Chosen(first, why)
    missing = next((name for name in names if name not in found), None)
    if missing is not None:
        raise KrlError(
            f"no number is left for the {kind} of {missing or 'nothing'}: give one by --{kind}"
        )
    return tuple(found[name] for name in names)


def _plant(asked: FrameNumbers, name: str) -> dict[int, Value]:
    """Elements of one of the plant's arrays by their numbers. Raises KrlError where it has none."""
    if asked.plant is None:
        return {}
    array = data_of(asked.plant).get(name)
    if not isinstance(array, Array):
        raise KrlError(f"{asked.plant.file} has no {name}: give the plant's $config.dat")
    return {index[0]: value for index, value in array.elements.items() if len(index) == 1}


def _is_null(value: Value | None) -> bool:
    """Whether nothing stands at a number: no frame, or one of zeros."""
    return not isinstance(value, Structure) or _is_same_frame(value, np.eye(4))


def _is_same_frame(value: Value | None, frame: FloatArray) -> bool:
    if not isinstance(value, Structure):
        return False
    apart = np.abs(pose(value, "the plant's frame", SourcePlace()) - frame)
    return bool(apart[:3, 3].max() <= _SAME_PLACE and apart[:3, :3].max() <= _SAME_TURN)


def _is_same_load(a: Payload, b: Payload) -> bool:
    mass, place, inertia = _SAME_LOAD
    return (
        abs(a.mass - b.mass) <= mass
        and bool(np.abs(np.subtract(a.centre, b.centre)).max() <= place)
        and bool(np.abs(np.subtract(sorted(a.inertia), sorted(b.inertia))).max() <= inertia)
    )
