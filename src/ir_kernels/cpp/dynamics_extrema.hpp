// Extremes of polynomial segments; ir_kernels/reference/limits.py says why they can't be missed.
#pragma once

namespace ir::dynamics {

constexpr int kMaxDegree = 15;

// Of p(t) = sum_k c_k t^k on [0, duration] for `count` polynomials with `terms` coefficients each, `per_segment` of them
// to a duration; arrays (count,).
void polynomial_extrema(const double* coefficients, const double* durations, long count, int per_segment, int terms,
                        double* minimum, double* maximum, double* time_of_minimum, double* time_of_maximum);

// q, qd, qdd (M, n) at times (M,) of S segments with n polynomials of `terms` coefficients each, which begin at `begins` (S,)
// and last `durations` (S,); times beyond them are those of the ends.
void polynomial_samples(const double* coefficients, const double* durations, const double* begins, long S, int n, int terms,
                        const double* times, long M, double* q, double* qd, double* qdd);

}  // namespace ir::dynamics
