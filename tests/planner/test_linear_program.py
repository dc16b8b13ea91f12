"""Linear programs that grow, beside SciPy's solver given the whole at once."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import linprog

from ir_planner.cycle import LinearProgram


@pytest.mark.parametrize("seed", range(20))
def test_columns_and_rows_added_to_a_solved_program_give_the_least_cost_of_the_whole(
    seed: int,
) -> None:
    rng = np.random.default_rng(seed)
    first, late, rows, more_rows = 6, 4, 5, 3
    matrix = rng.uniform(0.1, 1.0, (rows + more_rows, first + late))
    matrix[rows:, first:] = 0.0
    bounds = rng.uniform(1.0, 2.0, rows + more_rows)
    cost = rng.uniform(0.5, 1.5, first + late)

    program = LinearProgram()
    for k in range(first):
        program.variable(cost=cost[k])
    numbers = [program.row(dict(enumerate(matrix[k, :first])), low=bounds[k]) for k in range(rows)]
    program.relaxed()
    for k in range(first, first + late):
        program.column({numbers[i]: matrix[i, k] for i in range(rows)}, cost=cost[k])
    for k in range(rows, rows + more_rows):
        program.row(dict(enumerate(matrix[k, :first])), low=bounds[k])
    grown = program.relaxed()
    whole = linprog(cost, A_ub=-matrix, b_ub=-bounds)
    assert grown.cost == pytest.approx(whole.fun, rel=1e-9)
    assert program.solve().cost == pytest.approx(whole.fun, rel=1e-9)

    shut = int(rng.integers(first + late))
    program.close(shut)
    limits = [(0.0, 0.0 if k == shut else None) for k in range(first + late)]
    without = linprog(cost, A_ub=-matrix, b_ub=-bounds, bounds=limits)
    assert program.relaxed().cost == pytest.approx(without.fun, rel=1e-9)
    assert program.solve().cost == pytest.approx(without.fun, rel=1e-9)
