// Enclosures of the power that the axes take from the DC link over short pieces of time.
#include <algorithm>
#include <cmath>

#include "dynamics_enclosures.hpp"

namespace ir::dynamics {

PowerBounds power_bounds(const Model<double>& m, const double* coefficients, const double* durations, long S, int terms,
                         double longest) {
  std::vector<Piece> pieces;
  for (long s = 0; s < S; ++s) {
    const long count = std::max<long>(1, static_cast<long>(std::ceil(durations[s] / longest)));
    for (long k = 0; k < count; ++k)
      pieces.push_back({s, durations[s] * k / count, k + 1 == count ? durations[s] : durations[s] * (k + 1) / count});
  }
  PowerBounds bounds;
  for (const Piece& p : pieces) bounds.seconds.push_back(p.end - p.begin);
  for (std::size_t first = 0; first < pieces.size(); first += kLanes) {
    Batch batch;
    const std::size_t used = fill(m, batch, pieces, first, coefficients, terms);
    const Enclosure found = enclose(m, batch, terms);
    Interval middle = point(Doubles{}), slope = middle, over = middle;
    Doubles taken{};
    for (int i = 0; i < m.n; ++i) {
      // whatever the friction's sign is at an instant, it is one number of this interval there
      const Interval friction = coulomb(m, batch, i, found.speed[i].v);
      const Interval p0 = axis_power(m.drive[i], found.torque0[i] + friction, found.speed0[i]);
      const Dual<Interval> torque{found.torque[i].v + friction, found.torque[i].d};
      const Dual<Interval> p = axis_power(m.drive[i], torque, found.speed[i]);
      const Interval sharp = intersect(p.v, p0 + p.d * found.step);
      middle = middle + p0;
      slope = slope + p.d;
      over = over + sharp;
      taken += max(sharp.hi, Doubles{});
    }
    const Interval net = intersect(over, middle + slope * found.step);
    for (std::size_t l = 0; l < used; ++l) {
      bounds.net.push_back(net.hi[l]);
      bounds.taken.push_back(taken[l] * (1.0 + 8 * kOutward));
    }
  }
  return bounds;
}

}  // namespace ir::dynamics
