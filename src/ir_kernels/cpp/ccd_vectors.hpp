// Vectors and rotations of several configurations at once, and the arc tangent of lanes, for cyclic coordinate descent.
#pragma once

#include "dynamics_lanes.hpp"

namespace ir::inverse {

using dynamics::Doubles;
using dynamics::Integers;
using dynamics::splat;

// Included by one file; internal linkage lets the compiler inline it there as it likes (3 % of a descent).
namespace {

struct V3 {
  Doubles x, y, z;
};
V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
V3 operator*(const V3& a, Doubles s) { return {a.x * s, a.y * s, a.z * s}; }
Doubles dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
V3 constant(const double v[3]) { return {splat<Doubles>(v[0]), splat<Doubles>(v[1]), splat<Doubles>(v[2])}; }

// Orientation by columns.
struct M3 {
  V3 column[3];
};
V3 times(const M3& m, const double v[3]) {
  return {m.column[0].x * v[0] + m.column[1].x * v[1] + m.column[2].x * v[2],
          m.column[0].y * v[0] + m.column[1].y * v[1] + m.column[2].y * v[2],
          m.column[0].z * v[0] + m.column[1].z * v[1] + m.column[2].z * v[2]};
}
M3 times(const M3& m, const double R[3][3]) {
  M3 product;
  for (int j = 0; j < 3; ++j) {
    const double column[3] = {R[0][j], R[1][j], R[2][j]};
    product.column[j] = times(m, column);
  }
  return product;
}
M3 constant(const double R[3][3]) {
  M3 m;
  for (int j = 0; j < 3; ++j) m.column[j] = {splat<Doubles>(R[0][j]), splat<Doubles>(R[1][j]), splat<Doubles>(R[2][j])};
  return m;
}

// Arc tangent of y / x in all four quadrants (Cephes), atan2(0, 0) = 0.
Doubles arctan2(Doubles y, Doubles x) {
  const Doubles ax = dynamics::abs(x), ay = dynamics::abs(y);
  const Doubles large = dynamics::max(ax, ay), small = dynamics::min(ax, ay);
  Doubles t = small / dynamics::max(large, splat<Doubles>(1e-300));
  const Integers upper = t > 0.66;
  t = upper ? (t - 1.0) / (t + 1.0) : t;
  const Doubles z = t * t;
  const Doubles p = (((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z - 7.500855792314704667340e1) * z -
                1.228866684490136173410e2) * z - 6.485021904942025371773e1;
  const Doubles q = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z + 4.328810604912902668951e2) * z +
                4.853903996359136964868e2) * z + 1.945506571482613964425e2;
  Doubles angle = t * (z * p / q) + t;
  angle = upper ? angle + 3.061616997868382943065e-17 + 0.78539816339744830962 : angle;
  angle = ay > ax ? 1.57079632679489661923 - angle : angle;
  angle = x < 0.0 ? 3.14159265358979323846 - angle : angle;
  return dynamics::copysign(angle, y);
}

}  // namespace
}  // namespace ir::inverse
