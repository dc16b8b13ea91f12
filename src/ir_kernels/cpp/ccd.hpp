// Cyclic coordinate descent (eqs. 2 and 3) with a damped least-squares finish, a register of starts at once.
#pragma once

#include <cstdint>

namespace ir::inverse {

constexpr int kMaxJoints = 16;

struct CcdProblem {
  // origin (n,16), axis (n,3), base and tcp (16), pose (16) in the world, low and high (n); lambda of eq. 2, m/rad
  CcdProblem(int n, const double* origin, const double* axis, const double* base, const double* tcp, const double* pose,
             const double* low, const double* high, double rotation_length);

  int n;
  // joint i turns about z of its own frame: rotation and offset of that frame in the one before (the first: in the world)
  double turn[kMaxJoints][3][3], offset[kMaxJoints][3];
  double tool_turn[3][3], tool_offset[3];  // tcp in the last frame
  double target_turn[3][3], target[3];
  double low[kMaxJoints], high[kMaxJoints];
  double rotation_length;
  double xi = 0.0, newton_tolerance = 0.0;
  long max_sweeps = 0, newton_steps = 0;
};

// Where every start ended: q (P, n), the others (P,).
struct CcdArrays {
  double *q, *psi, *distance, *angle;
  std::int64_t *sweeps, *newton_steps;
};

void run(const CcdProblem& problem, const double* starts, long P, const CcdArrays& out);

}  // namespace ir::inverse
