// The share of the cost of a spline that the tilt of the tool has: where an axis of the last link leans farther from a
// direction of the world than it may.
#include <cmath>

#include "elementary.hpp"
#include "spline_cost.hpp"

namespace ir {
namespace {

constexpr double straight = 1e-12;  // sine of an angle at which no way back is nearer than another

}  // namespace

// The angle between axis and direction changes by -(axis x direction) z / sin(angle) as a joint turns about its axis z.
double SplineCost::tilt(double step) {
  if (!(terms_.tilt_max < kPi)) return 0.0;
  const double *d = terms_.tilt_direction.data(), least = cosine(terms_.tilt_max);
  const Vec<Lane> direction{splat<Lane>(d[0]), splat<Lane>(d[1]), splat<Lane>(d[2])};
  double cost = 0.0;
  for (Group& g : groups_) {
    model_.chain.forward(g.q, frames_.data());
    const Vec<Lane> axis = tilt_axis_.after(Vec<Lane>{}, frames_[n_]);
    const Lane along = dot(axis, direction);
    const std::uint32_t beyond = bits((along < least) & (g.counts > 0.0));
    if (beyond == 0) continue;
    const Vec<Lane> around = cross(axis, direction);
    Lane weight{};
    for (std::uint32_t left = beyond; left != 0; left &= left - 1) {
      const int l = __builtin_ctz(left);
      const double sine = std::sqrt(around.x[l] * around.x[l] + (around.y[l] * around.y[l] + around.z[l] * around.z[l]));
      const double lacks = (arc_tangent(sine, along[l]) - terms_.tilt_max) / terms_.tilt_scale;
      if (!(lacks > 0.0)) continue;
      const double penalty = terms_.clearance_penalty * lacks * lacks;
      cost += penalty * step;
      of_step_ += penalty;
      if (sine > straight) weight[l] = 2.0 * terms_.clearance_penalty * step * lacks / (terms_.tilt_scale * sine);
    }
    for (int j = model_.chain.first_slides ? 1 : 0; j < n_; ++j) g.of_q[j] -= weight * dot(around, frames_[j + 1].z);
  }
  return cost;
}

}  // namespace ir
