// The recursive Newton-Euler algorithm, once, for every kind of number: lanes of samples, dual numbers (derivatives),
// intervals (guaranteed enclosures) and dual numbers of intervals.
//
// A number S needs + - * with S, and * with the scalar T of its lanes.
#pragma once

#include "dynamics_lanes.hpp"
#include "dynamics_model.hpp"

namespace ir::dynamics {

template <class S>
struct Vector {
  S x, y, z;
};

template <class S>
inline Vector<S> operator+(const Vector<S>& a, const Vector<S>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}

// A vector of frame i-1 written in frame i.
template <class S, class T>
inline Vector<S> into_link(const Joint<T>& j, const S& s, const S& c, const Vector<S>& v) {
  switch (j.turn) {
    case Joint<T>::kParallel:
      return {c * v.x + s * v.y, c * v.y - s * v.x, v.z};
    case Joint<T>::kPerpendicular:
      return {c * v.x + s * v.z, c * v.z - s * v.x, -v.y};
    default: {
      const S y = v.y * j.cos_alpha + v.z * j.sin_alpha;
      return {c * v.x + s * y, c * y - s * v.x, v.z * j.cos_alpha - v.y * j.sin_alpha};
    }
  }
}

// A vector of frame i written in frame i-1.
template <class S, class T>
inline Vector<S> out_of_link(const Joint<T>& j, const S& s, const S& c, const Vector<S>& v) {
  const S x = c * v.x - s * v.y;
  const S y = s * v.x + c * v.y;
  switch (j.turn) {
    case Joint<T>::kParallel:
      return {x, y, v.z};
    case Joint<T>::kPerpendicular:
      return {x, -v.z, y};
    default:
      return {x, y * j.cos_alpha - v.z * j.sin_alpha, y * j.sin_alpha + v.z * j.cos_alpha};
  }
}

// v + r x f, of which r is mostly zeros
template <class S, class T>
inline Vector<S> add_moment(const Joint<T>& j, Vector<S> v, const Vector<S>& f) {
  if (j.has[0]) {
    v.y = v.y - f.z * j.r[0];
    v.z = v.z + f.y * j.r[0];
  }
  if (j.has[1]) {
    v.x = v.x + f.z * j.r[1];
    v.z = v.z - f.x * j.r[1];
  }
  if (j.has[2]) {
    v.x = v.x - f.y * j.r[2];
    v.y = v.y + f.x * j.r[2];
  }
  return v;
}

// Acceleration field of a link about its origin: K = [dw]x + w w' - |w|^2, so that a point r accelerates by K r more.
template <class S>
struct Field {
  S xx, xy, xz, yx, yy, yz, zx, zy, zz;
  Field(const Vector<S>& w, const Vector<S>& dw) {
    const S x2 = w.x * w.x, y2 = w.y * w.y, z2 = w.z * w.z;
    const S p = w.x * w.y, q = w.x * w.z, r = w.y * w.z;
    xx = -(y2 + z2), yy = -(x2 + z2), zz = -(x2 + y2);
    xy = p - dw.z, yx = p + dw.z;
    xz = q + dw.y, zx = q - dw.y;
    yz = r - dw.x, zy = r + dw.x;
  }
};

// Acceleration of the next frame's origin, seen from a link that only turns about its z axis.
template <class S, class T>
inline Vector<S> move_field(const Joint<T>& next, const S& square, const S& rate, Vector<S> a) {
  if (next.has[0]) a = {a.x - square * next.r[0], a.y + rate * next.r[0], a.z};
  if (next.has[1]) a = {a.x - rate * next.r[1], a.y - square * next.r[1], a.z};
  return a;
}

// For callers that need nothing of what the recursion passes on.
struct NoTrace {
  template <class S> void motion(int, const Vector<S>&, const Vector<S>&, const Vector<S>&) {}
  template <class S> void load(int, const Vector<S>&, const Vector<S>&) {}
};

// An arm of joints 0..count-1 whose base accelerates by `base` in frame 0, what holds its weight included. kMoves: `push`
// gets the force that it hands on to its base, but for mass times acceleration. `trace` receives the motion of each link
// (angular velocity and acceleration, acceleration of its origin) and the load that it hands on.
template <int kJoints, bool kMoves, class S, class T, class Trace>
// long: unrolled out and back, so that what a link hands on stays in registers
inline void arm_newton_euler(const Joint<T>* joint, int count, const Vector<S>& base, const S* sn, const S* cs,
                             const S* qd, const S* qdd, S* tau, Vector<S>* push, Trace&& trace) {
  const int n = kJoints ? kJoints : count;  // a number known at compile time unrolls the loops
  constexpr int kMost = kJoints ? kJoints : kMaxJoints;
  Vector<S> force[kMost], moment[kMost];
  const S zero = qd[0] * T(0);
  Vector<S> w{zero, zero, qd[0]}, dw{zero, zero, qdd[0]};
  Vector<S> a = into_link(joint[0], sn[0], cs[0], base);
  trace.motion(0, w, dw, a);
  const Joint<T>& first = joint[0];
  const S square = qd[0] * qd[0];
  force[0] = {square * -first.hx - qdd[0] * first.hy, qdd[0] * first.hx - square * first.hy, zero};
  moment[0] = {zero, zero, qdd[0] * first.zz + a.y * first.hx - a.x * first.hy};
  if (n > 1) a = move_field(joint[1], square, qdd[0], a);
#pragma GCC unroll 8
  for (int i = 1; i < n; ++i) {
    const Joint<T>& j = joint[i];
    const Vector<S> w_before = into_link(j, sn[i], cs[i], w);
    const Vector<S> dw_before = into_link(j, sn[i], cs[i], dw);
    a = into_link(j, sn[i], cs[i], a);
    w = {w_before.x, w_before.y, w_before.z + qd[i]};
    dw = {dw_before.x + w_before.y * qd[i], dw_before.y - w_before.x * qd[i], dw_before.z + qdd[i]};
    trace.motion(i, w, dw, a);
    Vector<S>& f = force[i];
    Vector<S>& t = moment[i];
    if (j.products) {
      const Vector<S> L{w.x * j.xx + w.y * j.xy + w.z * j.xz, w.x * j.xy + w.z * j.yz,
                        w.x * j.xz + w.y * j.yz + w.z * j.zz};
      t = {dw.x * j.xx + dw.y * j.xy + dw.z * j.xz + w.y * L.z - w.z * L.y,
           dw.x * j.xy + dw.z * j.yz + w.z * L.x - w.x * L.z,
           dw.x * j.xz + dw.y * j.yz + dw.z * j.zz + w.x * L.y - w.y * L.x};
    } else {
      const S Lx = w.x * j.xx, Lz = w.z * j.zz;
      t = {dw.x * j.xx + w.y * Lz, w.z * Lx - w.x * Lz, dw.z * j.zz - w.y * Lx};
    }
    const bool last = i + 1 == n;
    if (!j.has_hx && !j.has_hy) {
      f = {zero, zero, zero};
      if (last || !joint[i + 1].has_r) continue;
    }
    const Field<S> K(w, dw);
    if (j.has_hx) {
      t.y = t.y - a.z * j.hx;
      t.z = t.z + a.y * j.hx;
      f = {K.xx * j.hx, K.yx * j.hx, K.zx * j.hx};
      if (j.has_hy) f = f + Vector<S>{K.xy * j.hy, K.yy * j.hy, K.zy * j.hy};
    } else if (j.has_hy) {
      f = {K.xy * j.hy, K.yy * j.hy, K.zy * j.hy};
    }
    if (j.has_hy) {
      t.x = t.x + a.z * j.hy;
      t.z = t.z - a.x * j.hy;
    }
    if (!last) {  // to the origin of the next frame
      const Joint<T>& next = joint[i + 1];
      if (next.has[0]) a = a + Vector<S>{K.xx * next.r[0], K.yx * next.r[0], K.zx * next.r[0]};
      if (next.has[1]) a = a + Vector<S>{K.xy * next.r[1], K.yy * next.r[1], K.zy * next.r[1]};
      if (next.has[2]) a = a + Vector<S>{K.xz * next.r[2], K.yz * next.r[2], K.zz * next.r[2]};
    }
  }
#pragma GCC unroll 8
  for (int i = n - 1; i > 0; --i) {
    const Joint<T>& j = joint[i];
    tau[i] = moment[i].z;
    trace.load(i, force[i], moment[i]);
    const Vector<S> f = out_of_link(j, sn[i], cs[i], force[i]);
    const Vector<S> t = add_moment(j, out_of_link(j, sn[i], cs[i], moment[i]), f);
    if (i == 1) {
      moment[0].z = moment[0].z + t.z;
      if constexpr (kMoves) force[0] = force[0] + f;
    } else {
      force[i - 1] = force[i - 1] + f;
      moment[i - 1] = moment[i - 1] + t;
    }
  }
  tau[0] = moment[0].z;
  if constexpr (kMoves) {
    trace.load(0, force[0], moment[0]);
    *push = out_of_link(joint[0], sn[0], cs[0], force[0]);
  }
}

// newton_euler of a model with a rail, defined in dynamics_rail.cpp: inlined nowhere, so that what arms without one run stays
// as it would be compiled without it.
template <class S, class T, class Trace>
void rail_newton_euler(const Model<T>& m, const S* sn, const S* cs, const S* qd, const S* qdd, S* tau, bool gravity,
                       Trace& trace);

// H qdd + h: sin and cos of q + theta0, torque per joint, force of a rail. Without `gravity` the weight is left out.
// kJoints: known at compile time, of an arm without a rail; 0: whatever the model has. What is traced are the links of the
// arm, from 0 on.
template <int kJoints = 0, class S, class T, class Trace = NoTrace>
inline void newton_euler(const Model<T>& m, const S* sn, const S* cs, const S* qd, const S* qdd, S* tau,
                         bool gravity = true, Trace&& trace = {}) {
  if (kJoints == 0 && m.rail.there) return rail_newton_euler(m, sn, cs, qd, qdd, tau, gravity, trace);
  const S zero = qd[0] * T(0);
  const T on = gravity ? T(1) : T(0);
  const Vector<S> lift{zero + m.lift[0] * on, zero + m.lift[1] * on, zero + m.lift[2] * on};
  arm_newton_euler<kJoints, false, S>(m.joint, m.n, lift, sn, cs, qd, qdd, tau, nullptr, trace);
}

// What the counterbalance does about +axis, from sin and cos of q + theta0 of its joint.
template <class S, class T>
inline S balance_torque(const Balance<T>& b, const S& s, const S& c) {
  const S x = c * b.square_cos + s * b.square_sin;
  const S x2 = x * x;
  constexpr int m = Balance<T>::kTerms;  // even and odd powers side by side
  S even = x2 * b.coefficient[m - 2] + b.coefficient[m - 4];
  S odd = x2 * b.coefficient[m - 1] + b.coefficient[m - 3];
  for (int k = m - 6; k >= 0; k -= 2) {
    even = even * x2 + b.coefficient[k];
    odd = odd * x2 + b.coefficient[k + 1];
  }
  return (even + odd * x) * (c * b.lever_cos + s * b.lever_sin);
}

}  // namespace ir::dynamics
