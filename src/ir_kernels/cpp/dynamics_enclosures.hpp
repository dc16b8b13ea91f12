// Motions over pieces of time as intervals: what proofs of torque and bounds of power share. The mean value form: over a
// piece with middle m a smooth f lies in f(m) + f'(over the piece) (t - m), whose excess shrinks with the piece squared.
#pragma once

#include <algorithm>

#include "dynamics_bounds.hpp"
#include "dynamics_numbers.hpp"
#include "dynamics_recursion.hpp"

namespace ir::dynamics {

struct Piece {
  long segment;
  double begin, end;
};

// A register of pieces with their polynomials; unused lanes repeat the last piece.
struct Batch {
  Doubles begin, end;
  Doubles c[kMaxJoints][kMaxTerms];
  bool rests[kMaxJoints][kLanes];  // the motor doesn't move at all in the segment
};

inline Interval evaluate(const Interval* a, int terms, const Interval& x) {
  if (terms <= 0) return point(Doubles{});
  Interval value = a[terms - 1];
  for (int k = terms - 2; k >= 0; --k) value = value * x + a[k];
  return value;
}

// The motion about the middle of every piece: values there, enclosures over the piece, for q and its derivatives.
struct Motion {
  Interval at_middle[4], over[4];
};

inline Motion enclose(const Doubles* c, int terms, Doubles middle, const Interval& d) {
  Interval a[kMaxTerms];
  for (int k = 0; k < terms; ++k) a[k] = point(c[k]);
  for (int i = 0; i < terms - 1; ++i)  // Taylor shift to the middle by repeated synthetic division
    for (int k = terms - 2; k >= i; --k) a[k] = a[k] + a[k + 1] * point(middle);
  Motion motion;
  int left = terms;
  for (int order = 0; order < 4; ++order) {
    motion.at_middle[order] = left > 0 ? a[0] : point(Doubles{});
    motion.over[order] = evaluate(a, left, d);
    for (int k = 1; k < left; ++k) a[k - 1] = a[k] * double(k);
    --left;
  }
  return motion;
}

// Everything of the motors' torque but Coulomb friction; qd and qdd of the joints become those of the motors.
template <class S>
void smooth_torque(const Model<double>& m, const S* sn, const S* cs, S* qd, S* qdd, S* tau) {
  newton_euler(m, sn, cs, qd, qdd, tau);
  const int b = m.balance.joint;
  if (m.coupling.any) {
    if (b >= 0) tau[b] = tau[b] - balance_torque(m.balance, sn[b], cs[b]);
    multiply<true>(m.n, m.coupling.inverse, tau);
    multiply(m.n, m.coupling.turns, qd);
    multiply(m.n, m.coupling.turns, qdd);
  }
  for (int i = 0; i < m.n; ++i) tau[i] = tau[i] + qdd[i] * m.drive[i].rotor + qd[i] * m.drive[i].viscous;
  if (b >= 0 && !m.coupling.any) tau[b] = tau[b] - balance_torque(m.balance, sn[b], cs[b]);
}

// Pieces `first` onwards as a batch; how many of them are used. coefficients (S, n, terms).
inline std::size_t fill(const Model<double>& m, Batch& batch, const std::vector<Piece>& pieces, std::size_t first,
                        const double* coefficients, int terms) {
  const int n = m.n;
  const std::size_t used = std::min<std::size_t>(kLanes, pieces.size() - first);
  for (std::size_t l = 0; l < kLanes; ++l) {
    const Piece& p = pieces[first + std::min(l, used - 1)];
    batch.begin[l] = p.begin;
    batch.end[l] = p.end;
    for (int i = 0; i < n; ++i) {
      const double* c = coefficients + (p.segment * n + i) * terms;
      batch.rests[i][l] = std::all_of(c + 1, c + terms, [](double x) { return x == 0.0; });
      for (int k = 0; k < terms; ++k) batch.c[i][k][l] = c[k];
    }
  }
  if (!m.coupling.any) return used;
  bool moves[kMaxJoints];
  for (std::size_t l = 0; l < kLanes; ++l) {
    for (int j = 0; j < n; ++j) moves[j] = !batch.rests[j][l];
    for (int i = 0; i < n; ++i)
      for (int j = 0; j < n; ++j) batch.rests[i][l] = (j == 0 || batch.rests[i][l]) && !(moves[j] && m.coupling.turns[i][j] != 0.0);
  }
  return used;
}

// Speed and acceleration of the motors, and their torque but for Coulomb friction: at the middles of the pieces, and over them.
struct Enclosure {
  Interval step;  // t - m
  Interval speed0[kMaxJoints], torque0[kMaxJoints];
  Dual<Interval> speed[kMaxJoints], torque[kMaxJoints];
};

inline Enclosure enclose(const Model<double>& m, const Batch& batch, int terms) {
  const Doubles middle = 0.5 * (batch.begin + batch.end);
  const Interval d = point(batch.begin) - point(middle), e = point(batch.end) - point(middle);
  Enclosure found;
  found.step = {d.lo, e.hi};
  Interval sn0[kMaxJoints], cs0[kMaxJoints], qdd0[kMaxJoints];
  Dual<Interval> sn[kMaxJoints], cs[kMaxJoints], qdd[kMaxJoints];
  for (int i = 0; i < m.n; ++i) {
    const Motion motion = enclose(batch.c[i], terms, middle, found.step);
    const double theta0 = m.joint[i].theta0;
    sincos(motion.at_middle[0] + theta0, sn0[i], cs0[i]);
    found.speed0[i] = motion.at_middle[1];
    qdd0[i] = motion.at_middle[2];
    Interval s, c;
    sincos(motion.over[0] + theta0, s, c);
    const Interval& speed = motion.over[1];
    sn[i] = {s, c * speed};
    cs[i] = {c, -(s * speed)};
    found.speed[i] = {speed, motion.over[2]};
    qdd[i] = {motion.over[2], motion.over[3]};
  }
  smooth_torque(m, sn0, cs0, found.speed0, qdd0, found.torque0);
  smooth_torque(m, sn, cs, found.speed, qdd, found.torque);
  for (int i = 0; i < m.n; ++i)
    found.torque[i].v = intersect(found.torque[i].v, found.torque0[i] + found.torque[i].d * found.step);
  return found;
}

// Coulomb friction of a motor over the pieces: of either sign where its speed may vanish, none where it rests.
inline Interval coulomb(const Model<double>& m, const Batch& batch, int motor, const Interval& speed) {
  Interval friction;
  const double size = m.drive[motor].coulomb;
  for (int l = 0; l < kLanes; ++l) {
    const bool rests = batch.rests[motor][l];
    friction.lo[l] = rests ? 0.0 : speed.lo[l] > 0.0 ? size : -size;
    friction.hi[l] = rests ? 0.0 : speed.hi[l] < 0.0 ? -size : size;
  }
  return friction;
}

}  // namespace ir::dynamics
