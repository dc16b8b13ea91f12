"""Power at rest by posture and load, as a meter showed it: of saving modes, and on motors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ir_values.arrays import in_range
from ir_values.errors import InvalidValueError

_INSIDE = 1e-6  # rad and kg: so far beyond its rows a table still counts as asked inside


@dataclass(frozen=True)
class RestRow:
    """One rest: posture (n,) rad, load [kg] on the flange, and watts [W] at the mains in each mode
    of the table, with all that is attached.
    """

    posture: tuple[float, ...]
    load: float
    watts: tuple[float, ...]


@dataclass(frozen=True)
class RestTable:
    """Rows of measured rests; modes: what the watts of every row belong to.

    Between the rows: the posture is first brought into the span of the rows' postures, joint by
    joint. At each load of the table the rows of that load count by the inverse square of their
    distance in joint space (a row at the posture itself counts alone). Between two loads the power
    is linear in the mass, below the lightest and above the heaviest it is theirs. So no answer lies
    outside of what was measured; `outside` says where it was asked beyond.
    """

    modes: tuple[str, ...]
    rows: tuple[RestRow, ...]

    def __post_init__(self) -> None:
        if not self.modes or not self.rows:
            raise InvalidValueError("a table of rests needs a mode and a row at least")
        seen: set[tuple[tuple[float, ...], float]] = set()
        for k, row in enumerate(self.rows):
            if len(row.posture) != self.n or len(row.watts) != len(self.modes):
                raise InvalidValueError(
                    f"row {k} of the table of rests has {len(row.posture)} joints and "
                    f"{len(row.watts)} powers: the first row has {self.n}, the table "
                    f"{len(self.modes)} modes"
                )
            in_range(row.load, 0.0, 1e4, "kg", f"load of row {k} of the table of rests")
            for mode, watts in zip(self.modes, row.watts, strict=True):
                in_range(watts, 0.0, 1e5, "W", f"{mode} of row {k} of the table of rests")
            if (row.posture, row.load) in seen:
                raise InvalidValueError(f"row {k} of the table of rests stands there twice")
            seen.add((row.posture, row.load))

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.rows[0].posture)

    @property
    def loads(self) -> tuple[float, ...]:
        """The loads [kg] of the rows, light to heavy."""
        return tuple(sorted({row.load for row in self.rows}))

    @property
    def span(self) -> tuple[tuple[float, float], ...]:
        """Smallest and largest angle [rad] of each joint over all rows."""
        columns = zip(*(row.posture for row in self.rows), strict=True)
        return tuple((min(column), max(column)) for column in columns)

    def watts(self, mode: str, posture: Sequence[float], load: float) -> float:
        """Mains power [W] in a mode at a posture (n,) [rad] with a load [kg]."""
        inside = [
            min(max(angle, low), high)
            for angle, (low, high) in zip(posture, self.span, strict=True)
        ]
        loads = self.loads
        mass = min(max(load, loads[0]), loads[-1])
        above = next(each for each in loads if each >= mass)
        below = max(each for each in loads if each <= mass)
        k = self.modes.index(mode)
        light = self._at_load(k, inside, below)
        if above == below:
            return light
        share = (mass - below) / (above - below)
        return light + share * (self._at_load(k, inside, above) - light)

    def _at_load(self, k: int, posture: Sequence[float], load: float) -> float:
        """Power [W] in mode `k` by the rows of one load."""
        near = [
            (
                sum((a - b) * (a - b) for a, b in zip(posture, row.posture, strict=True)),
                row.watts[k],
            )
            for row in self.rows
            if row.load == load
        ]
        least, nearest = min(near)
        if least == 0.0:
            return nearest
        total = sum(least / square for square, _ in near)
        return sum(least / square * watts for square, watts in near) / total

    def outside(self, posture: Sequence[float], load: float) -> str:
        """Where a posture (n,) [rad] and a load [kg] lie beyond the rows, in words; "": inside."""
        words = []
        for k, (angle, (low, high)) in enumerate(zip(posture, self.span, strict=True), start=1):
            if not low - _INSIDE <= angle <= high + _INSIDE:
                words.append(f"joint {k} at {angle:.3g} rad (measured {low:.3g} to {high:.3g})")
        loads = self.loads
        if not loads[0] - _INSIDE <= load <= loads[-1] + _INSIDE:
            words.append(f"load {load:.4g} kg (measured {loads[0]:g} to {loads[-1]:g})")
        return ", ".join(words)
