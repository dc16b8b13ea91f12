// A proof of the torque limits: interval arithmetic over pieces of the trajectory, halved where it is not sharp enough.
#pragma once

#include <vector>

#include "dynamics_kernels.hpp"

namespace ir::dynamics {

constexpr int kMaxTerms = 8;  // of a polynomial segment

// Per joint: |tau| / limit is nowhere above `upper`, and reaches `sampled` at `time` from the start of the trajectory.
struct TorqueBounds {
  std::vector<double> upper, sampled, time;
  long intervals = 0;  // examined: the work
};

// coefficients (S, n, terms), lowest power first, in local time; durations (S,). Halves pieces until upper - sampled <=
// tolerance and no joint is left with sampled <= 1 < upper, or `most` intervals are spent.
TorqueBounds torque_bounds(const Model<double>& m, const Envelope& envelope, const double* coefficients,
                           const double* durations, long S, int terms, double tolerance, long most);

}  // namespace ir::dynamics
