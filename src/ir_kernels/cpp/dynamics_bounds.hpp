// Torque and power by interval arithmetic over pieces of the trajectory: never too small, whatever is between samples.
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

// Of consecutive pieces of time: their lengths [s]; the sum of the axes' powers at the DC link is nowhere above `net` W in
// them, the sum of those that take power nowhere above `taken` W.
struct PowerBounds {
  std::vector<double> seconds, net, taken;
};

// The same arguments; no piece is longer than `longest` s.
PowerBounds power_bounds(const Model<double>& m, const double* coefficients, const double* durations, long S, int terms,
                         double longest);

}  // namespace ir::dynamics
