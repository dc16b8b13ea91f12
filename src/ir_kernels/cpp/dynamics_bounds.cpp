// Enclosures of the joint torques over time intervals: mean value form of the recursion in dual numbers of intervals.
#include "dynamics_bounds.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics_enclosures.hpp"

namespace ir::dynamics {
namespace {

constexpr double kFirstPiece = 0.05;       // s, longest piece to begin with
constexpr int kFewestPieces = 8;           // of a segment to begin with
constexpr double kShortest = 1e-7;         // of a segment: pieces below this are not halved any more
constexpr double kRest = 1e-9;             // rad/s: below, a sample lets Coulomb friction have either sign
constexpr double kRoundingMargin = 1e-9;   // of the limit: parameters and fitted counterbalance carry rounding errors

// Largest |tau| / limit per joint over the pieces, never too small.
void upper_ratios(const Model<double>& m, const Envelope& envelope, const Batch& batch, int terms,
                  double upper[][kLanes]) {
  const Enclosure found = enclose(m, batch, terms);
  for (int i = 0; i < m.n; ++i) {
    const Interval &tau = found.torque[i].v, &speed = found.speed[i].v;
    const Interval friction = coulomb(m, batch, i, speed);
    for (int l = 0; l < kLanes; ++l) {
      const double v0 = speed.lo[l], v1 = speed.hi[l];
      const bool rests = batch.rests[i][l];
      const double size = std::max(std::abs(tau.lo[l] + friction.lo[l]), std::abs(tau.hi[l] + friction.hi[l]));
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
      const std::size_t used = fill(m, batch, pieces, first, coefficients, terms);
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
