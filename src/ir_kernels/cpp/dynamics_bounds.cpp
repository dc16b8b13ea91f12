// Enclosures of the joint torques over time intervals: mean value form of the recursion in dual numbers of intervals.
#include "dynamics_bounds.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics_numbers.hpp"
#include "dynamics_recursion.hpp"

namespace ir::dynamics {
namespace {

constexpr double kFirstPiece = 0.05;       // s, longest piece to begin with
constexpr int kFewestPieces = 8;           // of a segment to begin with
constexpr double kShortest = 1e-7;         // of a segment: pieces below this are not halved any more
constexpr double kRest = 1e-9;             // rad/s: below, a sample lets Coulomb friction have either sign
constexpr double kRoundingMargin = 1e-9;   // of the limit: parameters and fitted counterbalance carry rounding errors

struct Piece {
  long segment;
  double begin, end;
};

// A register of pieces with their polynomials; unused lanes repeat the last piece.
struct Batch {
  Doubles begin, end;
  Doubles c[kMaxJoints][kMaxTerms];
  bool rests[kMaxJoints][kLanes];  // the joint doesn't move at all in the segment
};

Interval evaluate(const Interval* a, int terms, const Interval& x) {
  if (terms <= 0) return point(Doubles{});
  Interval value = a[terms - 1];
  for (int k = terms - 2; k >= 0; --k) value = value * x + a[k];
  return value;
}

// The motion about the middle of every piece: values there, enclosures over the piece, for q and its derivatives.
struct Motion {
  Interval at_middle[4], over[4];
};

Motion enclose(const Doubles* c, int terms, Doubles middle, const Interval& d) {
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

// Everything of the torque but Coulomb friction.
template <class S>
void smooth_torque(const Model<double>& m, const S* sn, const S* cs, const S* qd, const S* qdd, S* tau) {
  newton_euler(m, sn, cs, qd, qdd, tau);
  for (int i = 0; i < m.n; ++i) tau[i] = tau[i] + qdd[i] * m.drive[i].rotor + qd[i] * m.drive[i].viscous;
  const int b = m.balance.joint;
  if (b >= 0) tau[b] = tau[b] - balance_torque(m.balance, sn[b], cs[b]);
}

// Largest |tau| / limit per joint over the pieces, never too small.
// long: interval arithmetic, term by term
void upper_ratios(const Model<double>& m, const Envelope& envelope, const Batch& batch, int terms,
                  double upper[][kLanes]) {
  const int n = m.n;
  const Doubles middle = 0.5 * (batch.begin + batch.end);
  const Interval d = point(batch.begin) - point(middle);
  const Interval e = point(batch.end) - point(middle);
  const Interval step{d.lo, e.hi};
  Interval sn0[kMaxJoints], cs0[kMaxJoints], qd0[kMaxJoints], qdd0[kMaxJoints], at_middle[kMaxJoints];
  Dual<Interval> sn[kMaxJoints], cs[kMaxJoints], qd[kMaxJoints], qdd[kMaxJoints], over[kMaxJoints];
  for (int i = 0; i < n; ++i) {
    const Motion motion = enclose(batch.c[i], terms, middle, step);
    const double theta0 = m.joint[i].theta0;
    sincos(motion.at_middle[0] + theta0, sn0[i], cs0[i]);
    qd0[i] = motion.at_middle[1];
    qdd0[i] = motion.at_middle[2];
    Interval s, c;
    sincos(motion.over[0] + theta0, s, c);
    const Interval& speed = motion.over[1];
    sn[i] = {s, c * speed};
    cs[i] = {c, -(s * speed)};
    qd[i] = {speed, motion.over[2]};
    qdd[i] = {motion.over[2], motion.over[3]};
  }
  smooth_torque(m, sn0, cs0, qd0, qdd0, at_middle);
  smooth_torque(m, sn, cs, qd, qdd, over);
  for (int i = 0; i < n; ++i) {
    const Interval tau = intersect(over[i].v, at_middle[i] + over[i].d * step);
    const Interval speed = qd[i].v;
    const double coulomb = m.drive[i].coulomb;
    for (int l = 0; l < kLanes; ++l) {
      const double v0 = speed.lo[l], v1 = speed.hi[l];
      const bool rests = batch.rests[i][l];
      const double least = rests || v0 > 0.0 ? (rests ? 0.0 : coulomb) : -coulomb;
      const double most = rests || v1 < 0.0 ? (rests ? 0.0 : -coulomb) : coulomb;
      const double size = std::max(std::abs(tau.lo[l] + least), std::abs(tau.hi[l] + most));
      const double slowest = rests || (v0 <= 0.0 && v1 >= 0.0) ? 0.0 : std::min(std::abs(v0), std::abs(v1));
      const double fastest = rests ? 0.0 : std::max(std::abs(v0), std::abs(v1));
      upper[i][l] = size / envelope.least(i, slowest, fastest) + kRoundingMargin;
    }
  }
}

// |tau| / limit per joint at times of the pieces.
void sampled_ratios(const Model<double>& m, const Envelope& envelope, const Batch& batch, int terms, Doubles t,
                    double ratio[][kLanes]) {
  const int n = m.n;
  Doubles theta[kMaxJoints], sn[kMaxJoints], cs[kMaxJoints], qd[kMaxJoints], qdd[kMaxJoints], tau[kMaxJoints];
  for (int i = 0; i < n; ++i) {
    const Doubles* c = batch.c[i];
    Doubles q{}, v{}, a{};
    for (int k = terms - 1; k >= 0; --k) {
      a = a * t + 2.0 * v;
      v = v * t + q;
      q = q * t + c[k];
    }
    theta[i] = q + m.joint[i].theta0;
    qd[i] = v;
    qdd[i] = a;
  }
  sincos(n, theta, sn, cs);
  smooth_torque(m, sn, cs, qd, qdd, tau);
  for (int i = 0; i < n; ++i)
    for (int l = 0; l < kLanes; ++l) {
      const double v = qd[i][l], coulomb = m.drive[i].coulomb;
      const double size = batch.rests[i][l]      ? std::abs(tau[i][l])
                          : std::abs(v) < kRest  ? std::abs(tau[i][l]) + coulomb
                                                 : std::abs(tau[i][l] + std::copysign(coulomb, v));
      ratio[i][l] = size / envelope.limit(i, std::abs(v));
    }
}

}  // namespace

// long: bisection and its bookkeeping share their arrays
TorqueBounds torque_bounds(const Model<double>& m, const Envelope& envelope, const double* coefficients,
                           const double* durations, long S, int terms, double tolerance, long most) {
  const int n = m.n;
  TorqueBounds bounds{std::vector<double>(n, 0.0), std::vector<double>(n, -1.0), std::vector<double>(n, 0.0), 0};
  std::vector<double> start(S, 0.0);
  std::vector<Piece> pieces, next;
  for (long s = 0; s < S; ++s) {
    if (s > 0) start[s] = start[s - 1] + durations[s - 1];
    const long count = std::max<long>(kFewestPieces, static_cast<long>(std::ceil(durations[s] / kFirstPiece)));
    for (long k = 0; k < count; ++k)
      pieces.push_back({s, durations[s] * k / count, k + 1 == count ? durations[s] : durations[s] * (k + 1) / count});
  }
  std::vector<double> upper_of;  // (pieces, n)
  while (!pieces.empty()) {
    upper_of.assign(pieces.size() * n, 0.0);
    for (std::size_t first = 0; first < pieces.size(); first += kLanes) {
      Batch batch;
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
      double upper[kMaxJoints][kLanes], ratio[kMaxJoints][kLanes];
      upper_ratios(m, envelope, batch, terms, upper);
      for (std::size_t l = 0; l < used; ++l)
        for (int i = 0; i < n; ++i) upper_of[(first + l) * n + i] = upper[i][l];
      for (const Doubles t : {batch.begin, 0.5 * (batch.begin + batch.end), batch.end}) {
        sampled_ratios(m, envelope, batch, terms, t, ratio);
        for (std::size_t l = 0; l < used; ++l)
          for (int i = 0; i < n; ++i)
            if (ratio[i][l] > bounds.sampled[i]) {
              bounds.sampled[i] = ratio[i][l];
              bounds.time[i] = start[pieces[first + l].segment] + t[l];
            }
      }
    }
    bounds.intervals += static_cast<long>(pieces.size());
    next.clear();
    for (std::size_t k = 0; k < pieces.size(); ++k) {
      const Piece& p = pieces[k];
      bool sharp = true;
      for (int i = 0; i < n; ++i) {
        const double upper = upper_of[k * n + i], sampled = bounds.sampled[i];
        sharp = sharp && upper <= sampled + tolerance * std::max(sampled, 1.0) && !(sampled <= 1.0 && upper > 1.0);
      }
      const bool halve = !sharp && p.end - p.begin > kShortest * durations[p.segment] &&
                         bounds.intervals + static_cast<long>(next.size()) + 2 <= most;
      if (halve) {
        const double middle = 0.5 * (p.begin + p.end);
        next.push_back({p.segment, p.begin, middle});
        next.push_back({p.segment, middle, p.end});
      } else {
        for (int i = 0; i < n; ++i) bounds.upper[i] = std::max(bounds.upper[i], upper_of[k * n + i]);
      }
    }
    pieces.swap(next);
  }
  return bounds;
}

}  // namespace ir::dynamics
