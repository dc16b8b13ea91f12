// Closed-form inverse kinematics of a 6R arm with a spherical wrist.
#pragma once

#include <cstdint>
#include <vector>

namespace ir::inverse {

// Constants of the arm: see ir_kernels/wrist_geometry.py. Plane quantities are z + i x, as (z, x).
struct SphericalArm {
  double axis[6][3];
  double plane[3][3];
  double axis_point[3];
  double lateral, forward, elbow_sign, wrist_zero;
  double shoulder[2], upper_arm[2], forearm[2];
  double hand_rotation[3][3];  // of link 6 at q = 0
  double wrist_in_hand[3];
  double to_base[16], from_tcp[16];  // pose of the world in link 0, of link 6 in the tcp
  double low[6], high[6];
};

struct IkSolutions {
  std::vector<double> q;  // (M, 6)
  std::vector<std::int64_t> pose, branch;
  long refused = -1;  // index of the first pose that isn't a rigid transform: nothing is solved then
};

// All branches and all turns within the limits for poses (N, 4, 4) of the tcp in the world; by pose, branch, q.
IkSolutions solve(const SphericalArm& arm, const double* poses, long N);

}  // namespace ir::inverse
