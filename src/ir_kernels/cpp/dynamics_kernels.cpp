// Inverse and forward dynamics, inertia, power and their derivatives over batches.
#include "dynamics_kernels.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics_numbers.hpp"
#include "dynamics_recursion.hpp"

namespace ir::dynamics {
namespace {

// Sum of x - x over all that is looked at: zero, or NaN when something was not finite. Costs nothing beside the recursion.
template <class V>
struct Finite {
  V sum{};
  void look(const V* columns, int n) {
    for (int j = 0; j < n; ++j) sum += columns[j] - columns[j];
  }
  bool all() const { return !any(sum != sum); }
};

// sin and cos of q + theta0
template <int kJoints, class V, class T>
inline void angles(const Model<T>& m, const V* q, V* s, V* c) {
  const int n = kJoints ? kJoints : m.n;
  V theta[kMaxJoints];
  for (int i = 0; i < n; ++i) theta[i] = q[i] + m.joint[i].theta0;
  sincos<kJoints>(n, theta, s, c);
}

template <class V, class T>
inline V friction(const Drive<T>& d, V qd) {
  const V coulomb = qd != 0 ? with_sign_of(qd, splat<V>(d.coulomb)) : V{};
  return qd * d.viscous + coulomb;
}

template <int kJoints, class V, class T>
bool inverse_dynamics_of(const Model<T>& m, const double* q, const double* qd, const double* qdd, long N, double* tau) {
  const int n = kJoints ? kJoints : m.n;
  V Q[kMaxJoints], D[kMaxJoints], A[kMaxJoints], s[kMaxJoints], c[kMaxJoints], t[kMaxJoints];
  Finite<V> finite;
  for (long first = 0; first < N; first += Lanes<V>::width) {
    load_columns(q, N, n, first, Q);
    load_columns(qd, N, n, first, D);
    load_columns(qdd, N, n, first, A);
    angles<kJoints>(m, Q, s, c);
    newton_euler<kJoints>(m, s, c, D, A, t);
    for (int i = 0; i < n; ++i) t[i] += A[i] * m.drive[i].rotor + friction(m.drive[i], D[i]);
    const int b = m.balance.joint;
    if (b >= 0) t[b] -= balance_torque(m.balance, s[b], c[b]);
    finite.look(t, n);  // what isn't finite makes its own joint's torque so
    store_columns(t, N, n, first, tau);
  }
  return finite.all();
}

// Symmetric inertia about the origin of a frame with its first moment; no mass is left in base parameters.
struct Composite {
  Vector<Doubles> h;
  Doubles xx, xy, xz, yy, yz, zz;
};

// The composite of frame i seen in frame i-1.
Composite out_of_link(const Joint<double>& j, Doubles s, Doubles c, const Composite& b) {
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

// H as columns H[i * n + k]
void composite_bodies(const Model<double>& m, const Doubles* s, const Doubles* c, Doubles* H) {
  const int n = m.n;
  Composite body{};
  for (int i = n - 1; i >= 0; --i) {
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
    for (int k = i; k > 0; --k) {
      force = out_of_link(m.joint[k], s[k], c[k], force);
      moment = add_moment(m.joint[k], out_of_link(m.joint[k], s[k], c[k], moment), force);
      H[i * n + k - 1] = H[(k - 1) * n + i] = moment.z;
    }
  }
}

// Solves the symmetric positive definite A x = b in place (L D L'); A is destroyed.
void solve_symmetric(int n, Doubles* A, Doubles* b) {
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

}  // namespace

bool inverse_dynamics(const Model<double>& m, const double* q, const double* qd, const double* qdd, long N,
                      double* tau) {
  return m.n == 6 ? inverse_dynamics_of<6, Doubles>(m, q, qd, qdd, N, tau)
                  : inverse_dynamics_of<0, Doubles>(m, q, qd, qdd, N, tau);
}

bool inverse_dynamics(const Model<float>& m, const double* q, const double* qd, const double* qdd, long N,
                      double* tau) {
  return m.n == 6 ? inverse_dynamics_of<6, Floats>(m, q, qd, qdd, N, tau)
                  : inverse_dynamics_of<0, Floats>(m, q, qd, qdd, N, tau);
}

bool bias(const Model<double>& m, const double* q, const double* qd, long N, double* tau) {
  Doubles Q[kMaxJoints], D[kMaxJoints] = {}, A[kMaxJoints] = {}, s[kMaxJoints], c[kMaxJoints], t[kMaxJoints];
  Finite<Doubles> finite;
  for (long first = 0; first < N; first += kLanes) {
    load_columns(q, N, m.n, first, Q);
    if (qd) load_columns(qd, N, m.n, first, D);
    finite.look(Q, m.n);
    finite.look(D, m.n);
    angles<0>(m, Q, s, c);
    newton_euler(m, s, c, D, A, t);
    store_columns(t, N, m.n, first, tau);
  }
  return finite.all();
}

bool counterbalance(const Model<double>& m, const double* q, long N, double* tau) {
  Doubles Q[kMaxJoints], s[kMaxJoints], c[kMaxJoints], t[kMaxJoints] = {};
  Finite<Doubles> finite;
  const int b = m.balance.joint;
  for (long first = 0; first < N; first += kLanes) {
    load_columns(q, N, m.n, first, Q);
    finite.look(Q, m.n);
    if (b >= 0) {
      angles<0>(m, Q, s, c);
      t[b] = balance_torque(m.balance, s[b], c[b]);
    }
    store_columns(t, N, m.n, first, tau);
  }
  return finite.all();
}

bool mass_matrix(const Model<double>& m, const double* q, long N, double* H) {
  Doubles Q[kMaxJoints], s[kMaxJoints], c[kMaxJoints], columns[kMaxJoints * kMaxJoints];
  Finite<Doubles> finite;
  for (long first = 0; first < N; first += kLanes) {
    load_columns(q, N, m.n, first, Q);
    finite.look(Q, m.n);
    angles<0>(m, Q, s, c);
    composite_bodies(m, s, c, columns);
    store_columns(columns, N, m.n * m.n, first, H);
  }
  return finite.all();
}

bool forward_dynamics(const Model<double>& m, const double* q, const double* qd, const double* tau, long N,
                      double* qdd) {
  const int n = m.n;
  Doubles Q[kMaxJoints], D[kMaxJoints], A[kMaxJoints] = {}, s[kMaxJoints], c[kMaxJoints], h[kMaxJoints], t[kMaxJoints];
  Doubles H[kMaxJoints * kMaxJoints];
  Finite<Doubles> finite;
  for (long first = 0; first < N; first += kLanes) {
    load_columns(q, N, n, first, Q);
    load_columns(qd, N, n, first, D);
    load_columns(tau, N, n, first, t);
    finite.look(Q, n);
    finite.look(D, n);
    finite.look(t, n);
    angles<0>(m, Q, s, c);
    newton_euler(m, s, c, D, A, h);
    composite_bodies(m, s, c, H);
    for (int i = 0; i < n; ++i) {
      t[i] -= h[i] + friction(m.drive[i], D[i]);
      H[i * n + i] += m.drive[i].rotor;
    }
    const int b = m.balance.joint;
    if (b >= 0) t[b] += balance_torque(m.balance, s[b], c[b]);
    solve_symmetric(n, H, t);
    store_columns(t, N, n, first, qdd);
  }
  return finite.all();
}

bool torque_gradients(const Model<double>& m, const double* q, const double* qd, const double* qdd, long N,
                      double* of_q, double* of_qd, double* of_qdd) {
  const int n = m.n;
  Doubles Q[kMaxJoints], D[kMaxJoints], A[kMaxJoints], s[kMaxJoints], c[kMaxJoints];
  Doubles by_q[kMaxJoints * kMaxJoints], by_qd[kMaxJoints * kMaxJoints], H[kMaxJoints * kMaxJoints];
  Dual<Doubles> sn[kMaxJoints], cs[kMaxJoints], speed[kMaxJoints], rate[kMaxJoints], t[kMaxJoints];
  Finite<Doubles> finite;
  for (long first = 0; first < N; first += kLanes) {
    load_columns(q, N, n, first, Q);
    load_columns(qd, N, n, first, D);
    load_columns(qdd, N, n, first, A);
    finite.look(Q, n);
    finite.look(D, n);
    finite.look(A, n);
    angles<0>(m, Q, s, c);
    for (int i = 0; i < n; ++i) {
      sn[i] = {s[i], Doubles{}};
      cs[i] = {c[i], Doubles{}};
      speed[i] = {D[i], Doubles{}};
      rate[i] = {A[i], Doubles{}};
    }
    for (int k = 0; k < n; ++k) {
      sn[k].d = c[k];
      cs[k].d = -s[k];
      newton_euler(m, sn, cs, speed, rate, t);
      if (m.balance.joint == k) t[k] = t[k] - balance_torque(m.balance, sn[k], cs[k]);
      for (int i = 0; i < n; ++i) by_q[i * n + k] = t[i].d;
      sn[k].d = cs[k].d = Doubles{};
      speed[k].d = splat<Doubles>(1.0);
      newton_euler(m, sn, cs, speed, rate, t);
      for (int i = 0; i < n; ++i) by_qd[i * n + k] = t[i].d;
      by_qd[k * n + k] += m.drive[k].viscous;
      speed[k].d = Doubles{};
    }
    composite_bodies(m, s, c, H);
    for (int i = 0; i < n; ++i) H[i * n + i] += m.drive[i].rotor;
    store_columns(by_q, N, n * n, first, of_q);
    store_columns(by_qd, N, n * n, first, of_qd);
    store_columns(H, N, n * n, first, of_qdd);
  }
  return finite.all();
}

bool axis_power(const Model<double>& m, const double* qd, const double* tau, long N, double* power) {
  bool finite = true;
  for (long k = 0; k < N; ++k)
    for (int i = 0; i < m.n; ++i) {
      const double t = tau[k * m.n + i], w = qd[k * m.n + i];
      const double p = t * w + m.drive[i].copper_at_joint * t * t;
      power[k * m.n + i] = p;
      finite &= p - p == 0.0;
    }
  return finite;
}

double Envelope::limit(int joint, double speed) const {
  const double* v = &speed_[joint * knots_];
  const double* t = &torque_[joint * (knots_ + 1)];
  if (speed < v[0]) return t[0];
  for (int k = 1; k < knots_; ++k)
    if (speed < v[k]) return t[k] + (t[k + 1] - t[k]) * (speed - v[k - 1]) / (v[k] - v[k - 1]);
  return t[knots_];
}

double Envelope::least(int joint, double slowest, double fastest) const {
  const double* v = &speed_[joint * knots_];
  const double* t = &torque_[joint * (knots_ + 1)];
  double least = std::min(limit(joint, slowest), limit(joint, fastest));
  for (int k = 0; k < knots_; ++k)
    if (slowest <= v[k] && v[k] <= fastest) least = std::min(least, t[k + 1]);
  return least;
}

bool Envelope::limits(const double* qd, long N, double* limit) const {
  bool finite = true;
  for (long k = 0; k < N * n_; ++k) {
    limit[k] = this->limit(static_cast<int>(k % n_), std::abs(qd[k]));
    finite &= qd[k] - qd[k] == 0.0;
  }
  return finite;
}

void dc_bus(const double* power, const double* dt, long N, int n, double capacity, Regeneration regeneration,
            double stored, double* mains, double* burnt, double* level) {
  for (long k = 0; k < N; ++k) {
    double wanted = 0.0, returned = 0.0, net = 0.0;
    for (int i = 0; i < n; ++i) {
      const double p = power[k * n + i];
      wanted += std::max(p, 0.0);
      returned += std::max(-p, 0.0);
      net += p;
    }
    burnt[k] = 0.0;
    if (regeneration == Regeneration::kNone) {
      mains[k] = wanted;
      burnt[k] = returned;
    } else {
      net *= dt[k];  // J that the axes want in this step
      const double moved = net > 0.0 ? std::min(net, stored) : -std::min(-net, capacity - stored);
      stored -= moved;
      double rest = net - moved;  // J that the capacitor could not give or take
      if (rest < 0.0 && regeneration == Regeneration::kShared) {
        burnt[k] = -rest / dt[k];
        rest = 0.0;
      }
      mains[k] = rest / dt[k];
    }
    level[k] = stored;
  }
}

}  // namespace ir::dynamics
