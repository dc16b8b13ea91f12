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
constexpr float visit_slack = 2e-5f; // [m] more than floats lose

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

// Lists, lane by lane, the pairs nearer than their threshold and margin.
template <class V> struct Within {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  std::vector<int>* hits;
  IR_INLINE V outside(int) const { return splat<V>(S(visit_slack)); }
  IR_INLINE V own(std::size_t) const { return splat<V>(S(visit_slack)); }
  IR_INLINE Float16 farthest(std::size_t) const { return splat<Float16>(static_cast<float>(shift.highest) + visit_slack); }
  IR_INLINE bool done() const { return false; }
  IR_INLINE void take(int z, int, V distance) {
    for (std::uint32_t left = bits(distance < shift.of[z]); left != 0; left &= left - 1)
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

SplineCost::SplineCost(const Model& geometry, const dynamics::Core& drives, SplineTerms terms)
    : model_(geometry), core_(drives), terms_(std::move(terms)), n_(drives.model.n),
      shift_float_(geometry, widest(terms_, geometry.pairs()).data()),
      shift_double_(geometry, widest(terms_, geometry.pairs()).data()),
      placement_float_(geometry), placement_double_(geometry), slope_(n_) {
  const int knots = core_.envelope.knots();
  for (int j = 0; j < n_; ++j) {  // continuous and never above the envelope: the step at its first speed becomes a ramp
    const double *v = core_.envelope.speeds(j), *t = core_.envelope.torques(j);
    double slope = 0.0;
    const auto bend = [&](double at, double now) {
      bend_at_.push_back(at);
      bend_.push_back(now - slope);
      slope = now;
    };
    bend(v[0] * (1 - ramp), (t[1] - t[0]) / (v[0] * ramp));
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
  of_interval = 0.0;
  sample(control);
  for (Group& g : groups_)
    for (int j = 0; j < n_; ++j) {
      const double per = 1.0 / interval;
      g.qd[j] *= per;
      g.qdd[j] *= per * per;
    }
  double value = drives(interval);
  value += bus(step);
  value += clearance(row, step, of_step_);
  // torques backwards; then what the times between knots do to speeds and accelerations
  const auto& arm = core_.model;
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
    Lane slower{};
    for (int j = 0; j < n_; ++j) slower += g.of_qd[j] * g.qd[j] + 2.0 * g.of_qdd[j] * g.qdd[j];
    of_interval -= sum(slower) / interval;
  }
  scatter(intervals, interval, gradient);
  of_interval += of_step_ / P + terms_.time_value * intervals;
  value += terms_.time_value * intervals * interval;
  return value + knots(control, intervals, interval, gradient, of_interval);
}

// Joint values and their derivatives by u of all samples; nothing is counted yet.
void SplineCost::sample(const double* control) {
  groups_.resize((count_ + 7) / 8);
  q_.resize(static_cast<std::size_t>(count_) * n_);
  const Basis* at = bases();
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    Group& g = groups_[k];
    for (int l = 0; l < 8; ++l) {
      const int wanted = static_cast<int>(8 * k) + l, i = std::min(wanted, count_ - 1);
      const Basis& b = at[i % P];
      const double* c = control + (i / P) * n_;
      g.counts[l] = wanted < count_;
      for (int j = 0; j < n_; ++j) {
        double v[3];
        for (int d = 0; d < 3; ++d)
          v[d] = b.of[d][0] * c[j] + b.of[d][1] * c[n_ + j] + b.of[d][2] * c[2 * n_ + j] + b.of[d][3] * c[3 * n_ + j];
        g.q[j][l] = v[0], g.qd[j][l] = v[1], g.qdd[j][l] = v[2];
        q_[static_cast<std::size_t>(i) * n_ + j] = v[0];
      }
    }
    for (int j = 0; j < n_; ++j) g.of_q[j] = g.of_qd[j] = g.of_qdd[j] = g.of_tau[j] = Lane{};
  }
}

// Torques, their penalties and those of speed; the powers.
double SplineCost::drives(double interval) {
  const auto& arm = core_.model;
  const double step = interval / P;
  const int bends = core_.envelope.knots() + 1;
  Lane cost{}, of_step{};
  for (Group& g : groups_) {
    for (int j = 0; j < n_; ++j) sincos(g.q[j] + arm.joint[j].theta0, g.s[j], g.c[j]);
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
      Lane limit = splat<Lane>(core_.envelope.torques(j)[0]), falls{};
      for (int k = 0; k < bends; ++k) {
        const double at = bend_at_[j * bends + k], by = bend_[j * bends + k];
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
    // of_power_ first says what a joule in this sample does: 1 drawn, 2 through the capacitor, 0 burnt, -1 fed back
    double stored = 0.0;
    for (int k = 0; k < count_; ++k) {
      const double wanted = power_[k] * step;
      if (wanted > stored) energy += wanted - stored, stored = 0.0, of_power_[k] = 1.0;
      else if (wanted < stored - terms_.capacity) {
        if (terms_.regeneration == Regeneration::kFedBack) energy += wanted - (stored - terms_.capacity), of_power_[k] = -1.0;
        stored = terms_.capacity;
      } else stored -= wanted, of_power_[k] = 2.0;
    }
    double of_stored = 0.0;  // what a joule more in the capacitor is worth from here on
    for (int k = count_ - 1; k >= 0; --k) {
      if (of_power_[k] == 2.0) of_power_[k] = -of_stored;
      else if (of_power_[k] == 0.0) of_stored = 0.0;
      else of_stored = -1.0, of_power_[k] = 1.0;  // drawn and fed back alike: a stored joule is one drawn less
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
                                double step, double& of_step) {
  constexpr int width = Lanes<V>::width;
  const std::size_t pairs = model_.pairs();
  const double* rows[width];
  double cost = 0.0;
  Within<V> within{shift, hits_};
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
          of_step += penalty;
          const double weight = 2.0 * terms_.clearance_penalty * step * lacks / terms_.clearance_scale;
          for (int j = 0; j < n_; ++j) groups_[k / 8].of_q[j][k % 8] -= weight * slope_[j][l];
        }
      }
    }
  }
  return cost;
}

double SplineCost::clearance(const std::int32_t* row, double step, double& of_step) {
  if (model_.wide) return clearance_in(placement_double_, shift_double_, row, step, of_step);
  return clearance_in(placement_float_, shift_float_, row, step, of_step);
}

// From samples to control points.
void SplineCost::scatter(int intervals, double interval, double* gradient) const {
  const Basis* at = bases();
  const double per = 1.0 / interval;
  for (int k = 0; k < intervals * P; ++k) {
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
double SplineCost::knots(const double* control, int intervals, double interval, double* gradient, double& of_interval) {
  const double second = 1.0 / (interval * interval), third = second / interval, weight = terms_.penalty * interval;
  constexpr double about = 100.0;  // 1 / rad: a position limit overrun by 0.01 rad counts like a limit used twice
  double cost = 0.0;
  for (int i = 0; i < intervals; ++i) {
    const double* c = control + static_cast<std::size_t>(i) * n_;
    double* g = gradient + static_cast<std::size_t>(i) * n_;
    for (int j = 0; j < n_; ++j) {
      const double jerk = (c[3 * n_ + j] - 3 * c[2 * n_ + j] + 3 * c[n_ + j] - c[j]) * third;
      double over = std::fabs(jerk) / terms_.jerk[j] - 1.0;
      if (over > 0.0) {
        const double slope = 2.0 * weight * over / terms_.jerk[j] * (jerk > 0 ? 1.0 : -1.0);
        cost += weight * over * over;
        of_interval += terms_.penalty * over * over - 3.0 * slope * jerk / interval;
        g[3 * n_ + j] += slope * third, g[2 * n_ + j] -= 3 * slope * third;
        g[n_ + j] += 3 * slope * third, g[j] -= slope * third;
      }
      if (i == 0) continue;
      const double acceleration = (c[2 * n_ + j] - 2 * c[n_ + j] + c[j]) * second;
      over = std::fabs(acceleration) / terms_.acceleration[j] - 1.0;
      if (over > 0.0) {
        const double slope = 2.0 * weight * over / terms_.acceleration[j] * (acceleration > 0 ? 1.0 : -1.0);
        cost += weight * over * over;
        of_interval += terms_.penalty * over * over - 2.0 * slope * acceleration / interval;
        g[2 * n_ + j] += slope * second, g[n_ + j] -= 2 * slope * second, g[j] += slope * second;
      }
      over = std::max(terms_.low[j] - c[n_ + j], c[n_ + j] - terms_.high[j]) * about;
      if (over > 0.0) {
        cost += weight * over * over;
        of_interval += terms_.penalty * over * over;
        g[n_ + j] += 2.0 * weight * over * about * (c[n_ + j] > terms_.high[j] ? 1.0 : -1.0);
      }
    }
  }
  return cost;
}

}  // namespace ir
