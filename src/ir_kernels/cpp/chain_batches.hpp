// Kinematics of a chain over batches of configurations q (count, n).
#pragma once

#include <cstddef>

#include "chain.hpp"

namespace ir {

// Poses of the links' own frames in the world, (count, n + 1, 4, 4).
void link_poses(const Chain& chain, const double* q, std::size_t count, double* result);

// Linear and angular velocity of the tool centre point per unit of joint speed, (count, 6, n); tcp (4, 4) in the last
// link.
void jacobians(const Chain& chain, const double* tcp, const double* q, std::size_t count, double* result);

}  // namespace ir
