// Extremes of polynomial segments; ir_kernels/reference/limits.py says why they can't be missed.
#pragma once

namespace ir::dynamics {

constexpr int kMaxDegree = 15;

// Of p(t) = sum_k c_k t^k on [0, duration] for `count` polynomials with `terms` coefficients each, `per_segment` of them
// to a duration; arrays (count,).
void polynomial_extrema(const double* coefficients, const double* durations, long count, int per_segment, int terms,
                        double* minimum, double* maximum, double* time_of_minimum, double* time_of_maximum);

}  // namespace ir::dynamics
