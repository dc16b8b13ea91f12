// The joint-space inertia H by composite bodies, and the solution of linear equations with it.
#pragma once

#include "dynamics_recursion.hpp"

namespace ir::dynamics {

// Symmetric inertia about the origin of a frame with its first moment; no mass is left in base parameters.
struct Composite {
  Vector<Doubles> h;
  Doubles xx, xy, xz, yy, yz, zz;
};

// The composite of frame i seen in frame i-1.
inline Composite out_of_link(const Joint<double>& j, Doubles s, Doubles c, const Composite& b) {
  const Vector<Doubles> x = out_of_link(j, s, c, {b.xx, b.xy, b.xz});
  const Vector<Doubles> y = out_of_link(j, s, c, {b.xy, b.yy, b.yz});
  const Vector<Doubles> z = out_of_link(j, s, c, {b.xz, b.yz, b.zz});
  const Vector<Doubles> row0 = out_of_link(j, s, c, {x.x, y.x, z.x});
  const Vector<Doubles> row1 = out_of_link(j, s, c, {x.y, y.y, z.y});
  const Vector<Doubles> row2 = out_of_link(j, s, c, {x.z, y.z, z.z});
  Composite a;
  a.h = out_of_link(j, s, c, b.h);
  const auto [r0, r1, r2] = j.r;
  const Doubles spread = 2.0 * (a.h.x * r0 + a.h.y * r1 + a.h.z * r2);
  a.xx = row0.x + spread - 2.0 * r0 * a.h.x;
  a.yy = row1.y + spread - 2.0 * r1 * a.h.y;
  a.zz = row2.z + spread - 2.0 * r2 * a.h.z;
  a.xy = row0.y - r0 * a.h.y - r1 * a.h.x;
  a.xz = row0.z - r0 * a.h.z - r2 * a.h.x;
  a.yz = row1.z - r1 * a.h.z - r2 * a.h.y;
  return a;
}

// H as columns H[i * n + k]; of a rail: mass and first moments.
inline void composite_bodies(const Model<double>& m, const Doubles* s, const Doubles* c, Doubles* H) {
  const int n = m.n, first = m.rail.there ? 1 : 0;
  Composite body{};
  for (int i = n - 1; i >= first; --i) {
    const Joint<double>& j = m.joint[i];
    Composite own{{splat<Doubles>(j.hx), splat<Doubles>(j.hy), Doubles{}}, splat<Doubles>(j.xx), splat<Doubles>(j.xy), splat<Doubles>(j.xz),
                  Doubles{},        splat<Doubles>(j.yz), splat<Doubles>(j.zz)};
    if (i + 1 < n) {
      const Composite outer = out_of_link(m.joint[i + 1], s[i + 1], c[i + 1], body);
      own = {own.h + outer.h, own.xx + outer.xx, own.xy + outer.xy, own.xz + outer.xz,
             own.yy + outer.yy, own.yz + outer.yz, own.zz + outer.zz};
    }
    body = own;
    H[i * n + i] = body.zz;
    Vector<Doubles> force{-body.h.y, body.h.x, Doubles{}}, moment{body.xz, body.yz, body.zz};
    for (int k = i; k > first; --k) {
      force = out_of_link(m.joint[k], s[k], c[k], force);
      moment = add_moment(m.joint[k], out_of_link(m.joint[k], s[k], c[k], moment), force);
      H[i * n + k - 1] = H[(k - 1) * n + i] = moment.z;
    }
    if (m.rail.there) {
      force = out_of_link(m.joint[1], s[1], c[1], force);
      H[i * n] = H[i] = m.rail.along[0] * force.x + m.rail.along[1] * force.y + m.rail.along[2] * force.z;
    }
  }
  if (m.rail.there) H[0] = splat<Doubles>(m.rail.mass);
}

// Solves the symmetric positive definite A x = b in place (L D L'); A is destroyed.
inline void solve_symmetric(int n, Doubles* A, Doubles* b) {
  for (int j = 0; j < n; ++j) {
    const Doubles inverse = 1.0 / A[j * n + j];
    for (int i = j + 1; i < n; ++i) {
      const Doubles factor = A[i * n + j] * inverse;
      for (int k = j + 1; k <= i; ++k) A[i * n + k] -= factor * A[k * n + j];
      b[i] -= factor * b[j];
    }
  }
  for (int j = n - 1; j >= 0; --j) {
    Doubles x = b[j];
    for (int i = j + 1; i < n; ++i) x -= A[i * n + j] * b[i];
    b[j] = x / A[j * n + j];
  }
}

}  // namespace ir::dynamics
