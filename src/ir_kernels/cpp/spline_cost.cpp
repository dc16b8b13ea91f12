#include "spline_cost.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics_numbers.hpp"
#include "queries.hpp"

namespace ir {
namespace {

constexpr int P = SplineCost::samples;
constexpr double still = 0.02;       // [rad/s] friction and |qd| are smoothed below
constexpr double ramp = 0.05;        // share of the speed over which a step of the torque limit is smoothed
constexpr double about = 100.0;      // 1 / rad: a position limit overrun by 0.01 rad counts like a limit used twice

// Weights of the four control points at a place u of an interval, for position and its two derivatives by u.
struct Basis {
  double of[3][4];
};
Basis basis(double u) {
  const double v = 1.0 - u;
  return {{{v * v * v / 6, (3 * u * u * u - 6 * u * u + 4) / 6, (-3 * u * u * u + 3 * u * u + 3 * u + 1) / 6, u * u * u / 6},
           {-v * v / 2, (3 * u * u - 4 * u) / 2, (-3 * u * u + 2 * u + 1) / 2, u * u / 2},
           {v, 3 * u - 2, 1 - 3 * u, u}}};
}
const Basis* bases() {
  static const std::vector<Basis> all = [] {
    std::vector<Basis> b;
    for (int p = 0; p < P; ++p) b.push_back(basis((p + 0.5) / P));
    return b;
  }();
  return all.data();
}

double sum(const Double8& v) {
  double s = 0.0;
  for (int k = 0; k < 8; ++k) s += v[k];
  return s;
}

// Lists, lane by lane, the pairs nearer than their threshold and margin; and those that may be, as far as lanes can tell.
template <class V> struct Within {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  std::vector<int>* hits;
  S slack;  // [m] more than the lanes lose
  static constexpr bool one_bound = true;
  IR_INLINE V outside(int) const { return splat<V>(slack); }
  IR_INLINE V own(std::size_t) const { return splat<V>(slack); }
  IR_INLINE Float16 farthest(std::size_t, int) const { return splat<Float16>(static_cast<float>(shift.highest + slack)); }
  IR_INLINE bool known(int) const { return false; }
  IR_INLINE bool done() const { return false; }
  IR_INLINE void take(int z, int, V distance) {
    for (std::uint32_t left = bits(distance < shift.of[z] + slack); left != 0; left &= left - 1)
      hits[__builtin_ctz(left)].push_back(z);
  }
};

// Of each pair the largest threshold of all rows, with the margin.
std::vector<double> widest(const SplineTerms& t, int pairs) {
  std::vector<double> most(pairs, -std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < t.threshold.size(); ++k) most[k % pairs] = std::max(most[k % pairs], t.threshold[k]);
  for (double& value : most) value += t.clearance_margin;
  return most;
}

}  // namespace

SplineCost::SplineCost(const Model& geometry, const dynamics::Core& drives, const SplineTerms& terms)
    : model_(geometry), core_(drives), terms_(terms), n_(drives.model.n), widest_(widest(terms, geometry.pairs())),
      shift_float_(geometry, widest_.data()), shift_double_(geometry, widest_.data()), placement_float_(geometry),
      placement_double_(geometry), slope_(n_) {
  smooth_envelope();
}

// The torque limits as sums of bends: continuous, as the step at the first speed becomes a ramp below it, which stays
// within the envelope where that falls.
void SplineCost::smooth_envelope() {
  const int knots = core_.envelope.knots();
  bends_ = knots > 0 ? knots + 1 : 0;
  for (int j = 0; j < n_; ++j) {
    const double *v = core_.envelope.speeds(j), *t = core_.envelope.torques(j);
    const bool step = knots > 0 && v[0] > 0.0;
    standing_.push_back(knots > 0 && !step ? t[1] : t[0]);
    if (knots == 0) continue;
    double slope = 0.0;
    const auto bend = [&](double at, double now) {
      bend_at_.push_back(at);
      bend_.push_back(now - slope);
      slope = now;
    };
    bend(v[0] * (1 - ramp), step ? (t[1] - t[0]) / (v[0] * ramp) : 0.0);
    for (int k = 1; k < knots; ++k) bend(v[k - 1], (t[k + 1] - t[k]) / (v[k] - v[k - 1]));
    bend(v[knots - 1], 0.0);
  }
}

double SplineCost::operator()(const double* control, int K, const std::int32_t* row, double interval, double* gradient,
                              double& of_interval) {
  const int intervals = K - 3;
  const double step = interval / P;
  count_ = intervals * P;
  of_step_ = 0.0;
  std::fill_n(gradient, static_cast<std::size_t>(K) * n_, 0.0);
  sample(control, interval);
  double value = drives(step);
  value += bus(step);
  value += clearance(row, step);
  of_interval = -slower() / interval + of_step_ / P + terms_.time_value * intervals;
  value += terms_.time_value * intervals * interval;
  scatter(interval, gradient);
  return value + knots(control, intervals, interval, gradient, of_interval);
}

// Joint values, speeds and accelerations of all samples; lanes without a sample repeat the last one.
void SplineCost::sample(const double* control, double interval) {
  groups_.resize((count_ + 7) / 8);
  q_.resize(static_cast<std::size_t>(count_) * n_);
  const Basis* at = bases();
  const double per = 1.0 / interval;
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    Group& g = groups_[k];
    for (int l = 0; l < 8; ++l) {
      const int wanted = static_cast<int>(8 * k) + l, i = std::min(wanted, count_ - 1);
      const Basis& b = at[i % P];
      const double* c = control + static_cast<std::size_t>(i / P) * n_;
      g.counts[l] = wanted < count_;
      for (int j = 0; j < n_; ++j) {
        double v[3];
        for (int d = 0; d < 3; ++d)
          v[d] = b.of[d][0] * c[j] + b.of[d][1] * c[n_ + j] + b.of[d][2] * c[2 * n_ + j] + b.of[d][3] * c[3 * n_ + j];
        g.q[j][l] = v[0], g.qd[j][l] = v[1], g.qdd[j][l] = v[2];
        q_[static_cast<std::size_t>(i) * n_ + j] = v[0];
      }
    }
    for (int j = 0; j < n_; ++j) {
      g.qd[j] *= per;
      g.qdd[j] *= per * per;
      g.of_q[j] = g.of_qdd[j] = Lane{};
    }
  }
}

// Torques, their penalties and those of speed; the powers.
double SplineCost::drives(double step) {
  const auto& arm = core_.model;
  Lane cost{}, of_step{};
  for (Group& g : groups_) {
    Lane theta[dynamics::kMaxJoints];
    for (int j = 0; j < n_; ++j) theta[j] = g.q[j] + arm.joint[j].theta0;
    sincos(n_, theta, g.s, g.c);
    dynamics::newton_euler(arm, g.s, g.c, g.qd, g.qdd, g.tau, true, dynamics::Trace<Lane>{g.link});
    if (arm.balance.joint >= 0) {
      const int b = arm.balance.joint;
      g.tau[b] -= dynamics::balance_torque(arm.balance, g.s[b], g.c[b]);
    }
    for (int j = 0; j < n_; ++j) {
      const auto& d = arm.drive[j];
      const Lane v = g.qd[j], speed = abs(v), root = sqrt(v * v + still * still);
      g.tau[j] += g.qdd[j] * d.rotor + v * d.viscous + d.coulomb * v / root;
      g.power[j] = g.tau[j] * v + d.copper_at_joint * g.tau[j] * g.tau[j];
      Lane limit = splat<Lane>(standing_[j]), falls{};
      for (int k = 0; k < bends_; ++k) {
        const double at = bend_at_[j * bends_ + k], by = bend_[j * bends_ + k];
        const Lane over = speed - at;
        limit += over > 0.0 ? by * over : Lane{};
        falls += over > 0.0 ? splat<Lane>(by) : Lane{};
      }
      const Lane torque = abs(g.tau[j]), inverse = 1.0 / (limit * terms_.torque_share);
      const Lane use = max(torque * inverse - 1.0, Lane{}) * g.counts;
      const double fastest = 1.0 / terms_.velocity[j];
      const Lane over = max(speed * fastest - 1.0, Lane{}) * g.counts;
      const Lane penalty = terms_.penalty * (use * use + over * over);
      cost += penalty * step;
      of_step += penalty;
      const Lane weight = 2.0 * step * terms_.penalty * use;
      const Lane sign_v = v > 0.0 ? splat<Lane>(1.0) : splat<Lane>(-1.0);
      g.of_tau[j] = weight * inverse * (g.tau[j] > 0.0 ? splat<Lane>(1.0) : splat<Lane>(-1.0));
      g.of_qd[j] = sign_v * (2.0 * step * terms_.penalty * fastest * over - weight * torque * inverse / limit * falls);
      if (terms_.travel[j] > 0.0) {
        const Lane way = terms_.travel[j] * (root - still) * g.counts;
        cost += way * step;
        of_step += way;
        g.of_qd[j] += (step * terms_.travel[j]) * g.counts * v / root;
      }
    }
  }
  of_step_ += sum(of_step);
  return sum(cost);
}

// Energy at the mains over the common bus, sample after sample; and the derivative by each sample's power.
double SplineCost::bus(double step) {
  using dynamics::Regeneration;
  power_.assign(count_, 0.0);
  of_power_.assign(count_, 0.0);
  for (int k = 0; k < count_; ++k)
    for (int j = 0; j < n_; ++j) {
      const double p = groups_[k / 8].power[j][k % 8];
      power_[k] += terms_.regeneration == Regeneration::kNone ? std::max(p, 0.0) : p;
    }
  energy = 0.0;
  if (terms_.regeneration == Regeneration::kNone) {
    for (int k = 0; k < count_; ++k) energy += power_[k] * step;
    std::fill(of_power_.begin(), of_power_.end(), 1.0);
  } else {
    // of_power_ first says where a joule of this sample comes from: 1 the mains (or goes back there), 2 the capacitor, 0
    // nowhere, as one is burnt less
    double stored = 0.0;
    for (int k = 0; k < count_; ++k) {
      const double wanted = power_[k] * step, full = stored - terms_.capacity;
      if (wanted > stored) {
        energy += wanted - stored;
        stored = 0.0;
        of_power_[k] = 1.0;
      } else if (wanted < full) {
        const bool returns = terms_.regeneration == Regeneration::kFedBack;
        if (returns) energy += wanted - full;
        stored = terms_.capacity;
        of_power_[k] = returns ? 1.0 : 0.0;
      } else {
        stored -= wanted;
        of_power_[k] = 2.0;
      }
    }
    double of_stored = 0.0;  // what a joule more in the capacitor costs from here on
    for (int k = count_ - 1; k >= 0; --k) {
      if (of_power_[k] == 2.0) of_power_[k] = -of_stored;
      else of_stored = -of_power_[k];
    }
  }
  const double worth = terms_.energy_value;
  double of_step = 0.0;
  for (int k = 0; k < count_; ++k) {
    of_step += of_power_[k] * power_[k];
    of_power_[k] *= worth * step;
  }
  of_step_ += worth * of_step;
  return worth * energy;
}

template <class V>
double SplineCost::clearance_in(Placement<V>& placement, const Shifts<Scalar<V>>& shift, const std::int32_t* row,
                                double step) {
  constexpr int width = Lanes<V>::width;
  const std::size_t pairs = model_.pairs();
  const double* rows[width];
  double cost = 0.0;
  Within<V> within{shift, hits_, static_cast<Scalar<V>>(width == 16 ? model_.float_margin : 1e-9)};
  for (int first = 0; first < count_; first += width) {
    const int used = std::min(width, count_ - first);
    for (int l = 0; l < used; ++l) rows[l] = &q_[static_cast<std::size_t>(first + l) * n_];
    placement.place(rows, used);
    for (auto& list : hits_) list.clear();
    visit(model_, placement.state, within);
    for (int part = 0; 8 * part < used; ++part) {
      for (std::size_t round = 0;; ++round) {
        int pair[8], any = -1;
        for (int l = 0; l < 8; ++l) {
          const bool there = 8 * part + l < used && round < hits_[8 * part + l].size();
          pair[l] = there ? hits_[8 * part + l][round] : -1;
          if (there) any = pair[l];
        }
        if (any < 0) break;
        int asked[8];
        for (int l = 0; l < 8; ++l) asked[l] = pair[l] < 0 ? any : pair[l];
        Double8 distance;
        pair_slopes(model_, placement.exact[part], asked, distance, slope_.data());
        for (int l = 0; l < 8; ++l) {
          if (pair[l] < 0) continue;
          const int k = first + 8 * part + l;
          const double kept = terms_.threshold[row[k / P] * pairs + pair[l]] + terms_.clearance_margin;
          const double lacks = (kept - distance[l]) / terms_.clearance_scale;
          if (!(lacks > 0.0)) continue;
          const double penalty = terms_.clearance_penalty * lacks * lacks;
          cost += penalty * step;
          of_step_ += penalty;
          const double weight = 2.0 * terms_.clearance_penalty * step * lacks / terms_.clearance_scale;
          for (int j = 0; j < n_; ++j) groups_[k / 8].of_q[j][k % 8] -= weight * slope_[j][l];
        }
      }
    }
  }
  return cost;
}

double SplineCost::clearance(const std::int32_t* row, double step) {
  if (model_.pairs() == 0) return 0.0;
  if (model_.wide) return clearance_in(placement_double_, shift_double_, row, step);
  return clearance_in(placement_float_, shift_float_, row, step);
}

// From powers and torques back to positions, speeds and accelerations. Returns what the cost gains from a motion that is
// slower, per relative change of the time between knots.
double SplineCost::slower() {
  const auto& arm = core_.model;
  double gain = 0.0;
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    Group& g = groups_[k];
    Lane of_power{};
    for (int l = 0; l < 8; ++l) of_power[l] = 8 * k + l < static_cast<std::size_t>(count_) ? of_power_[8 * k + l] : 0.0;
    for (int j = 0; j < n_; ++j) {
      const auto& d = arm.drive[j];
      Lane w = of_power;
      if (terms_.regeneration == dynamics::Regeneration::kNone) w = g.power[j] > 0.0 ? w : Lane{};
      g.of_tau[j] += w * (g.qd[j] + 2.0 * d.copper_at_joint * g.tau[j]);
      g.of_qd[j] += w * g.tau[j];
      const Lane root = g.qd[j] * g.qd[j] + still * still;
      g.of_qd[j] += g.of_tau[j] * (d.viscous + d.coulomb * still * still / (root * sqrt(root)));
      g.of_qdd[j] += g.of_tau[j] * d.rotor;
    }
    const int b = arm.balance.joint;
    if (b >= 0) {
      using Dual = dynamics::Dual<Lane>;
      const Dual s{g.s[b], g.c[b]}, c{g.c[b], -g.s[b]};
      g.of_q[b] -= g.of_tau[b] * dynamics::balance_torque(arm.balance, s, c).d;
    }
    dynamics::newton_euler_adjoint(arm, g.s, g.c, g.qd, g.link, g.of_tau, g.of_q, g.of_qd, g.of_qdd);
    Lane lane_gain{};
    for (int j = 0; j < n_; ++j) lane_gain += g.of_qd[j] * g.qd[j] + 2.0 * g.of_qdd[j] * g.qdd[j];
    gain += sum(lane_gain);
  }
  return gain;
}

// From samples to control points.
void SplineCost::scatter(double interval, double* gradient) const {
  const Basis* at = bases();
  const double per = 1.0 / interval;
  for (int k = 0; k < count_; ++k) {
    const Group& g = groups_[k / 8];
    const Basis& b = at[k % P];
    double* to = gradient + static_cast<std::size_t>(k / P) * n_;
    for (int j = 0; j < n_; ++j) {
      const double q = g.of_q[j][k % 8], qd = g.of_qd[j][k % 8] * per, qdd = g.of_qdd[j][k % 8] * per * per;
      for (int a = 0; a < 4; ++a) to[a * n_ + j] += b.of[0][a] * q + b.of[1][a] * qd + b.of[2][a] * qdd;
    }
  }
}

// Accelerations at the knots (linear between), jerk of each interval (constant), positions by the control points.
double SplineCost::knots(const double* control, int intervals, double interval, double* gradient,
                         double& of_interval) const {
  const double second = 1.0 / (interval * interval), third = second / interval, weight = terms_.penalty * interval;
  double cost = 0.0;
  // a derivative of order `order`, beyond its limit; returns what the cost gains per unit of it
  const auto beyond = [&](double derivative, double limit, int order) {
    const double over = std::fabs(derivative) / limit - 1.0;
    const double slope = std::copysign(2.0 * weight * over / limit, derivative);
    cost += weight * over * over;
    of_interval += terms_.penalty * over * over - order * slope * derivative / interval;
    return slope;
  };
  for (int i = 0; i < intervals; ++i) {
    const double* c = control + static_cast<std::size_t>(i) * n_;
    double* g = gradient + static_cast<std::size_t>(i) * n_;
    for (int j = 0; j < n_; ++j) {
      const double jerk = (c[3 * n_ + j] - 3 * c[2 * n_ + j] + 3 * c[n_ + j] - c[j]) * third;
      if (!(std::fabs(jerk) > terms_.jerk[j])) continue;
      const double slope = beyond(jerk, terms_.jerk[j], 3) * third;
      g[3 * n_ + j] += slope, g[2 * n_ + j] -= 3 * slope, g[n_ + j] += 3 * slope, g[j] -= slope;
    }
  }
  for (int i = 0; i <= intervals; ++i) {
    const double* c = control + static_cast<std::size_t>(i) * n_;
    double* g = gradient + static_cast<std::size_t>(i) * n_;
    for (int j = 0; j < n_; ++j) {
      const double acceleration = (c[2 * n_ + j] - 2 * c[n_ + j] + c[j]) * second;
      if (!(std::fabs(acceleration) > terms_.acceleration[j])) continue;
      const double slope = beyond(acceleration, terms_.acceleration[j], 2) * second;
      g[2 * n_ + j] += slope, g[n_ + j] -= 2 * slope, g[j] += slope;
    }
  }
  for (int i = 0; i < intervals + 3; ++i)
    for (int j = 0; j < n_; ++j) {
      const std::size_t at = static_cast<std::size_t>(i) * n_ + j;
      const double over = std::max(terms_.low[j] - control[at], control[at] - terms_.high[j]) * about;
      if (!(over > 0.0)) continue;
      cost += weight * over * over;
      of_interval += terms_.penalty * over * over;
      gradient[at] += std::copysign(2.0 * weight * over * about, control[at] - terms_.high[j]);
    }
  return cost;
}

}  // namespace ir
