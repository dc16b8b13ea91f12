// Derivatives of a weighted sum of joint torques by position, velocity and acceleration: the recursive Newton-Euler
// algorithm run backwards (reverse mode), at about twice its cost whatever the number of joints.
//
// With weights u on the torques, the adjoints of the loads are the velocities that the arm would have if its joints
// turned at u; the adjoints of the motions follow from them in the pass back to the base.
#pragma once

#include "dynamics_recursion.hpp"

namespace ir::dynamics {

template <class S>
struct LinkTrace {
  Vector<S> w, dw, a;        // angular velocity and acceleration, acceleration of the origin; in the link
  Vector<S> force, moment;   // that the link hands on to the one before
};

// Keeps what newton_euler passes.
template <class S>
struct Trace {
  LinkTrace<S>* link;
  void motion(int i, const Vector<S>& w, const Vector<S>& dw, const Vector<S>& a) {
    link[i].w = w, link[i].dw = dw, link[i].a = a;
  }
  void load(int i, const Vector<S>& force, const Vector<S>& moment) {
    link[i].force = force, link[i].moment = moment;
  }
};

template <class S>
inline Vector<S> cross(const Vector<S>& a, const Vector<S>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class S>
inline S dot(const Vector<S>& a, const Vector<S>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class S>
inline void add_scaled(Vector<S>& to, const Vector<S>& v, const S& k) {
  to = {to.x + v.x * k, to.y + v.y * k, to.z + v.z * k};
}

// Of arm_newton_euler. kMoves: of_base is the adjoint of the force on the base, and becomes that of its acceleration.
template <int kJoints, bool kMoves, class S, class T>
// long: the recursion backwards, step by step
inline void arm_newton_euler_adjoint(const Joint<T>* joint, int count, const S* sn, const S* cs, const S* qd,
                                     const LinkTrace<S>* link, const S* u, S* by_q, S* by_qd, S* by_qdd,
                                     Vector<S>* of_base) {
  const int n = kJoints ? kJoints : count;  // a number known at compile time unrolls the loops
  constexpr int kMost = kJoints ? kJoints : kMaxJoints;
  const S zero = u[0] * T(0);
  Vector<S> of_force[kMost], of_moment[kMost];
  of_force[0] = {zero, zero, zero};
  of_moment[0] = {zero, zero, u[0]};
  if constexpr (kMoves) {
    const Vector<S>& F = link[0].force;
    const Vector<S> f = into_link(joint[0], sn[0], cs[0], *of_base);
    by_q[0] = by_q[0] + (f.y * F.x - f.x * F.y);
    of_force[0] = f;
  }
  for (int i = 1; i < n; ++i) {
    const Joint<T>& j = joint[i];
    const Vector<S>& before = of_moment[i - 1];
    Vector<S> f = of_force[i - 1];  // moment + r x force: the force's adjoint is moment's x r
    f = {f.x + before.y * j.r[2] - before.z * j.r[1], f.y + before.z * j.r[0] - before.x * j.r[2],
         f.z + before.x * j.r[1] - before.y * j.r[0]};
    f = into_link(j, sn[i], cs[i], f);
    const Vector<S> t = into_link(j, sn[i], cs[i], before);
    const Vector<S>&F = link[i].force, &M = link[i].moment;
    by_q[i] = by_q[i] + (f.y * F.x - f.x * F.y) + (t.y * M.x - t.x * M.y);
    of_force[i] = f;
    of_moment[i] = {t.x, t.y, t.z + u[i]};
  }
  Vector<S> of_w{zero, zero, zero}, of_dw = of_w, of_next = of_w;  // of the motion of the link after this one's frame
  for (int i = n - 1; i >= 0; --i) {
    const Joint<T>& j = joint[i];
    const Vector<S>&w = link[i].w, &dw = link[i].dw, &a = link[i].a, &f = of_force[i], &t = of_moment[i];
    Vector<S> of_a = of_next;
    // K applied to r (next origin) and h (first moment): K v = dw x v + w (w . v) - |w|^2 v
    const auto field = [&](const Vector<S>& y, T vx, T vy, T vz) {
      const S wv = w.x * vx + w.y * vy + w.z * vz, yw = dot(y, w), yv = y.x * vx + y.y * vy + y.z * vz;
      of_w = {of_w.x + y.x * wv + yw * vx - (yv * w.x) * T(2), of_w.y + y.y * wv + yw * vy - (yv * w.y) * T(2),
              of_w.z + y.z * wv + yw * vz - (yv * w.z) * T(2)};
      of_dw = {of_dw.x + y.z * vy - y.y * vz, of_dw.y + y.x * vz - y.z * vx, of_dw.z + y.y * vx - y.x * vy};
    };
    if (i + 1 < n && joint[i + 1].has_r) field(of_next, joint[i + 1].r[0], joint[i + 1].r[1], joint[i + 1].r[2]);
    if (j.has_hx || j.has_hy) {
      field(f, j.hx, j.hy, T(0));
      of_a = {of_a.x - t.z * j.hy, of_a.y + t.z * j.hx, of_a.z + t.x * j.hy - t.y * j.hx};  // t . (h x a)
    }
    const auto inertia = [&](const Vector<S>& v) {
      return Vector<S>{v.x * j.xx + v.y * j.xy + v.z * j.xz, v.x * j.xy + v.z * j.yz, v.x * j.xz + v.y * j.yz + v.z * j.zz};
    };
    of_dw = of_dw + inertia(t);
    of_w = of_w + cross(inertia(w), t) + inertia(cross(t, w));
    by_qdd[i] = by_qdd[i] + of_dw.z;
    by_qd[i] = by_qd[i] + of_w.z;
    if (i == 0) {
      by_q[0] = by_q[0] + (of_a.x * a.y - of_a.y * a.x);
      if constexpr (kMoves) *of_base = out_of_link(j, sn[0], cs[0], of_a);
      break;
    }
    // the motion before the joint's own was added, in this link's frame
    const Vector<S> dw_before{dw.x - w.y * qd[i], dw.y + w.x * qd[i], zero};
    by_qd[i] = by_qd[i] + (of_dw.x * w.y - of_dw.y * w.x);
    of_w.x = of_w.x - of_dw.y * qd[i];
    of_w.y = of_w.y + of_dw.x * qd[i];
    by_q[i] = by_q[i] + (of_w.x * w.y - of_w.y * w.x) + (of_dw.x * dw_before.y - of_dw.y * dw_before.x) +
              (of_a.x * a.y - of_a.y * a.x);
    of_w = out_of_link(j, sn[i], cs[i], of_w);
    of_dw = out_of_link(j, sn[i], cs[i], of_dw);
    of_next = out_of_link(j, sn[i], cs[i], of_a);
  }
}

// newton_euler_adjoint of a model with a rail, defined in dynamics_rail.cpp.
template <class S, class T>
void rail_newton_euler_adjoint(const Model<T>& m, const S* sn, const S* cs, const S* qd, const LinkTrace<S>* link,
                               const S* u, S* by_q, S* by_qd, S* by_qdd);

// Adds to by_q, by_qd, by_qdd the derivatives of sum_i u_i tau_i, tau from newton_euler on the same numbers (with
// gravity) traced in `link`; sn, cs of q + theta0. kJoints as there.
template <int kJoints = 0, class S, class T>
inline void newton_euler_adjoint(const Model<T>& m, const S* sn, const S* cs, const S* qd, const LinkTrace<S>* link,
                                 const S* u, S* by_q, S* by_qd, S* by_qdd) {
  if (kJoints == 0 && m.rail.there) return rail_newton_euler_adjoint(m, sn, cs, qd, link, u, by_q, by_qd, by_qdd);
  arm_newton_euler_adjoint<kJoints, false, S>(m.joint, m.n, sn, cs, qd, link, u, by_q, by_qd, by_qdd, nullptr);
}

}  // namespace ir::dynamics
