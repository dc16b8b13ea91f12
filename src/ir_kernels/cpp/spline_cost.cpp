// The cost of a spline put together: sampling, the bounds at its knots and control points, and derivatives by them.
#include "spline_cost.hpp"

#include <algorithm>
#include <cmath>

namespace ir {
namespace {

constexpr int P = SplineCost::samples;
constexpr double ramp = 0.05;    // share of the speed over which a step of the torque limit is smoothed
constexpr double about = 100.0;  // 1 / rad: a position limit overrun by 0.01 rad counts like a limit used twice

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
    for (int p = 0; p < P; ++p) b.push_back(basis(static_cast<double>(p) / P));
    return b;
  }();
  return all.data();
}

// Of each pair the largest threshold of all rows, with the margin.
std::vector<double> widest(const SplineTerms& t, int pairs) {
  std::vector<double> most(pairs, -std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < t.threshold.size(); ++k) most[k % pairs] = std::max(most[k % pairs], t.threshold[k]);
  for (double& value : most) value += t.clearance_margin;
  return most;
}

// Along the links, whatever the joint values.
std::vector<double> levers(const Model& model) {
  const int n = model.chain.n;
  std::vector<double> to_joint(n + 1, 0.0), longest(n, 0.0);
  for (int k = 0; k < n; ++k) {
    const Local& s = model.chain.joints[k].shift;
    to_joint[k + 1] = to_joint[k] + std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
  }
  for (const Capsule& c : model.capsules) {
    double to_end = 0.0;
    for (const double sign : {-1.0, 1.0}) {
      double square = 0.0;
      for (int i = 0; i < 3; ++i) square += std::pow(c.middle[i] + sign * c.axis[i], 2);
      to_end = std::max(to_end, std::sqrt(square));
    }
    for (int k = 0; k < c.link; ++k) longest[k] = std::max(longest[k], to_joint[c.link] - to_joint[k + 1] + to_end);
  }
  return longest;
}

}  // namespace

SplineCost::SplineCost(const Model& geometry, const dynamics::Core& drives, const SplineTerms& terms)
    : model_(geometry), core_(drives), terms_(terms), n_(drives.model.n), widest_(widest(terms, geometry.pairs())),
      shift_float_(geometry, widest_.data()), shift_double_(geometry, widest_.data()), placement_float_(geometry),
      placement_double_(geometry), lever_(levers(geometry)), slope_(n_) {
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
// long: value and derivative side by side
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
