"""Mixed-integer linear programs, row by row, solved by HiGHS."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field

import highspy
import numpy as np

from ir_values.arrays import FloatArray

Terms = Mapping[int, float]
"""Coefficients by the index of their variable."""

_FEASIBILITY = 1e-9  # of rows and bounds


@dataclass(frozen=True)
class LinearAnswer:
    """values: None where no point is known; bound: proved lower bound of the cost (inf:
    infeasible); finished: False where a limit ended the search.
    """

    values: FloatArray | None
    cost: float
    bound: float
    finished: bool


@dataclass
class LinearProgram:
    """Variables with bounds and costs, and rows low <= terms <= high; the cost is least."""

    low: list[float] = field(default_factory=list)
    high: list[float] = field(default_factory=list)
    cost: list[float] = field(default_factory=list)
    whole: list[int] = field(default_factory=list)
    _indices: list[int] = field(default_factory=list)
    _values: list[float] = field(default_factory=list)
    _begins: list[int] = field(default_factory=lambda: [0])
    _row_low: list[float] = field(default_factory=list)
    _row_high: list[float] = field(default_factory=list)
    _columns: list[Terms] = field(default_factory=list)
    _relaxed: highspy.Highs | None = None

    def variable(
        self, low: float = 0.0, high: float = np.inf, *, cost: float = 0.0, whole: bool = False
    ) -> int:
        """A new variable's index; every `column` comes after them."""
        assert not self._columns
        self.low.append(low)
        self.high.append(high)
        self.cost.append(cost)
        self.whole.append(int(whole))
        self._relaxed = None
        return len(self.low) - 1

    def binary(self, *, cost: float = 0.0) -> int:
        """A new variable that is 0 or 1."""
        return self.variable(0.0, 1.0, cost=cost, whole=True)

    def column(self, terms: Terms, *, cost: float) -> int:
        """A new variable of at least 0 that stands in rows which are there already, by their
        number; its index.
        """
        self._columns.append(terms)
        self.low.append(0.0)
        self.high.append(np.inf)
        self.cost.append(cost)
        self.whole.append(0)
        return len(self.low) - 1

    def close(self, variable: int) -> None:
        """Hold a variable at 0 from now on."""
        self.high[variable] = 0.0

    def row(self, terms: Terms, *, low: float = -np.inf, high: float = np.inf) -> int:
        """A new row's number; no `column` stands in it."""
        self._indices.extend(terms.keys())
        self._values.extend(terms.values())
        self._begins.append(len(self._indices))
        self._row_low.append(low)
        self._row_high.append(high)
        return len(self._row_high) - 1

    def relaxed(self, fixed: Mapping[int, float] | None = None) -> LinearAnswer:
        """The least cost where whole variables may be anything within their bounds; it goes on from
        the last answer. fixed: values by variable.
        """
        if self._relaxed is None:
            self._relaxed = self._empty()
        solver = self._relaxed
        self._add_rows(solver)
        self._add_columns(solver)
        self._bounds(solver, fixed or {})
        solver.run()
        if solver.getModelStatus() != highspy.HighsModelStatus.kOptimal:
            solver.clearSolver()
            solver.run()
        status = solver.getModelStatus()
        if status != highspy.HighsModelStatus.kOptimal:
            empty = status == highspy.HighsModelStatus.kInfeasible
            return LinearAnswer(None, np.inf, np.inf if empty else -np.inf, empty)
        cost = float(solver.getInfo().objective_function_value)
        return LinearAnswer(np.array(solver.getSolution().col_value), cost, cost, True)

    def solve(
        self,
        *,
        fixed: Mapping[int, float] | None = None,
        loose: Collection[int] = (),
        start: FloatArray | None = None,
        stopped: Callable[[], bool] | None = None,
        gap: float = 1e-7,
        limit: float = np.inf,
        first: bool = False,
    ) -> LinearAnswer:
        """The least cost. fixed: values by variable; loose: whole variables that needn't be whole;
        start: a point to begin with, its whole variables count; stopped: asked in between, the
        search ends where it says so; gap: relative, at which the search may end; limit: only what
        costs less is looked for; first: the first point found will do.
        """
        solver = self._empty()
        self._add_rows(solver)
        self._add_columns(solver)
        self._bounds(solver, fixed or {})
        count = len(self.low)
        kinds = np.array(self.whole, dtype=np.uint8)
        kinds[list(loose)] = 0
        solver.changeColsIntegrality(count, np.arange(count, dtype=np.int32), kinds)
        solver.setOptionValue("mip_rel_gap", gap)
        solver.setOptionValue("objective_bound", limit)
        if first:
            solver.setOptionValue("mip_max_improving_sols", 1)
        if stopped is not None:
            _interrupt(solver, stopped)
        if start is not None:
            chosen = np.flatnonzero(kinds).astype(np.int32)
            solver.setSolution(len(chosen), chosen, np.round(start[chosen]))
        solver.run()
        status = solver.getModelStatus()
        if status == highspy.HighsModelStatus.kInfeasible:
            return LinearAnswer(None, np.inf, np.inf, True)
        info = solver.getInfo()
        known = info.primal_solution_status == highspy.SolutionStatus.kSolutionStatusFeasible
        values = np.array(solver.getSolution().col_value) if known else None
        cost = float(info.objective_function_value) if known else np.inf
        finished = status == highspy.HighsModelStatus.kOptimal
        return LinearAnswer(values, cost, float(info.mip_dual_bound), finished)

    def _empty(self) -> highspy.Highs:
        """A solver with the variables and no rows, of one thread: the same answer every time."""
        solver = highspy.Highs()
        solver.silent()
        solver.setOptionValue("threads", 1)
        solver.setOptionValue("primal_feasibility_tolerance", _FEASIBILITY)
        solver.setOptionValue("mip_feasibility_tolerance", _FEASIBILITY)
        none = np.zeros(0, dtype=np.int32)
        count = len(self.low) - len(self._columns)
        solver.addCols(
            count, np.array(self.cost[:count]),
            np.array(self.low[:count]), np.array(self.high[:count]),
            0, np.zeros(count, dtype=np.int32), none, np.zeros(0),
        )  # fmt: skip
        return solver

    def _add_columns(self, solver: highspy.Highs) -> None:
        """Columns that the solver doesn't have yet."""
        first = solver.getNumCol()
        count = len(self.low) - first
        if count == 0:
            return
        new = self._columns[-count:]
        begins = np.cumsum([0, *(len(terms) for terms in new)])
        rows = np.concatenate([list(terms) for terms in new]).astype(np.int32)
        values = np.concatenate([list(terms.values()) for terms in new])
        solver.addCols(
            count, np.array(self.cost[first:]),
            np.array(self.low[first:]), np.array(self.high[first:]),
            len(rows), begins[:-1].astype(np.int32), rows, values,
        )  # fmt: skip

    def _bounds(self, solver: highspy.Highs, fixed: Mapping[int, float]) -> None:
        low = np.array(self.low)
        high = np.array(self.high)
        for index, value in fixed.items():
            low[index] = value
            high[index] = value
        solver.changeColsBounds(len(low), np.arange(len(low), dtype=np.int32), low, high)

    def _add_rows(self, solver: highspy.Highs) -> None:
        """Rows that the solver doesn't have yet."""
        first = solver.getNumRow()
        count = len(self._row_low) - first
        if count == 0:
            return
        begin = self._begins[first]
        begins = np.array(self._begins[first:-1], dtype=np.int32) - begin
        indices = np.array(self._indices[begin:], dtype=np.int32)
        values = np.array(self._values[begin:])
        solver.addRows(
            count, np.array(self._row_low[first:]), np.array(self._row_high[first:]),
            len(indices), begins, indices, values,
        )  # fmt: skip


def _interrupt(solver: highspy.Highs, stopped: Callable[[], bool]) -> None:
    def look(event: highspy.highs.HighsCallbackEvent) -> None:
        if stopped():
            event.interrupt()

    solver.cbMipInterrupt.subscribe(look)
