// Inverse and forward dynamics, inertia, power and their derivatives over batches.
#include "dynamics_kernels.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics_composite.hpp"
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
    if (kJoints == 0 && m.rail.there) finite.look(Q, 1);  // where a rail stands changes nothing
    const int b = m.balance.joint;
    if (m.coupling.any) {
      if (b >= 0) t[b] -= balance_torque(m.balance, s[b], c[b]);
      multiply<true>(n, m.coupling.inverse, t);
      multiply(n, m.coupling.turns, D);
      multiply(n, m.coupling.turns, A);
    }
    for (int i = 0; i < n; ++i) t[i] += A[i] * m.drive[i].rotor + friction(m.drive[i], D[i]);
    if (b >= 0 && !m.coupling.any) t[b] -= balance_torque(m.balance, s[b], c[b]);
    finite.look(t, n);  // what isn't finite makes its own joint's torque so
    store_columns(t, N, n, first, tau);
  }
  return finite.all();
}

}  // namespace

bool inverse_dynamics(const Model<double>& m, const double* q, const double* qd, const double* qdd, long N,
                      double* tau) {
  return m.n == 6 && !m.rail.there ? inverse_dynamics_of<6, Doubles>(m, q, qd, qdd, N, tau)
                                   : inverse_dynamics_of<0, Doubles>(m, q, qd, qdd, N, tau);
}

bool inverse_dynamics(const Model<float>& m, const double* q, const double* qd, const double* qdd, long N,
                      double* tau) {
  return m.n == 6 && !m.rail.there ? inverse_dynamics_of<6, Floats>(m, q, qd, qdd, N, tau)
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
    if (m.coupling.any) {
      multiply(n, m.coupling.turns, D);
      for (int i = 0; i < n; ++i) t[i] -= friction(m.drive[i], D[i]);
      multiply<true>(n, m.coupling.turns, t);
      for (int i = 0; i < n; ++i) {
        t[i] -= h[i];
        for (int k = 0; k < n; ++k)
          for (int l = 0; l < n; ++l)
            H[k * n + l] += splat<Doubles>(m.coupling.turns[i][k] * m.drive[i].rotor * m.coupling.turns[i][l]);
      }
    } else {
      for (int i = 0; i < n; ++i) {
        t[i] -= h[i] + friction(m.drive[i], D[i]);
        H[i * n + i] += m.drive[i].rotor;
      }
    }
    const int b = m.balance.joint;
    if (b >= 0) t[b] += balance_torque(m.balance, s[b], c[b]);
    solve_symmetric(n, H, t);
    store_columns(t, N, n, first, qdd);
  }
  return finite.all();
}

namespace {

// What the motors' torques gain per acceleration of the joints, from the arm's inertia H (n, n).
void of_motors(const Model<double>& m, Doubles* H) {
  const int n = m.n;
  Doubles column[kMaxJoints];
  for (int k = 0; k < n; ++k) {
    for (int i = 0; i < n; ++i) column[i] = H[i * n + k];
    multiply<true>(n, m.coupling.inverse, column);
    for (int i = 0; i < n; ++i) H[i * n + k] = column[i] + m.drive[i].rotor * m.coupling.turns[i][k];
  }
}

}  // namespace

// long: one block of lanes and its rest
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
      if (m.coupling.any) multiply<true>(n, m.coupling.inverse, t);
      for (int i = 0; i < n; ++i) by_q[i * n + k] = t[i].d;
      sn[k].d = cs[k].d = Doubles{};
      speed[k].d = splat<Doubles>(1.0);
      newton_euler(m, sn, cs, speed, rate, t);
      if (m.coupling.any) multiply<true>(n, m.coupling.inverse, t);
      for (int i = 0; i < n; ++i) by_qd[i * n + k] = t[i].d;
      if (m.coupling.any) {
        for (int i = 0; i < n; ++i) by_qd[i * n + k] += m.drive[i].viscous * m.coupling.turns[i][k];
      } else {
        by_qd[k * n + k] += m.drive[k].viscous;
      }
      speed[k].d = Doubles{};
    }
    composite_bodies(m, s, c, H);
    if (m.coupling.any) of_motors(m, H);
    else for (int i = 0; i < n; ++i) H[i * n + i] += m.drive[i].rotor;
    store_columns(by_q, N, n * n, first, of_q);
    store_columns(by_qd, N, n * n, first, of_qd);
    store_columns(H, N, n * n, first, of_qdd);
  }
  return finite.all();
}

}  // namespace ir::dynamics
