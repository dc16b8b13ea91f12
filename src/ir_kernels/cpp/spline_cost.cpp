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

// The same for the eight samples of four intervals.
struct LaneBasis {
  Double8 of[3][4];
};
const LaneBasis& lane_basis() {
  static const LaneBasis all = [] {
    LaneBasis b;
    for (int l = 0; l < 8; ++l) {
      const Basis at = basis(static_cast<double>(l % P) / P);
      for (int d = 0; d < 3; ++d)
        for (int a = 0; a < 4; ++a) b.of[d][a][l] = at.of[d][a];
    }
    return b;
  }();
  return all;
}
static_assert(P == 2, "a group of lanes is four intervals with two samples each");

// Of eight control points those that count as number `a` in each sample of the first four intervals.
template <int a> IR_INLINE Double8 spread(Double8 v) {
  return Double8{v[a], v[a], v[a + 1], v[a + 1], v[a + 2], v[a + 2], v[a + 3], v[a + 3]};
}
// And back: what the samples owe to their control point number `a`, summed by control point.
template <int a> IR_INLINE Double8 gathered(Double8 v) {
  v += Double8{v[1], v[0], v[3], v[2], v[5], v[4], v[7], v[6]};
  if constexpr (a == 0) return Double8{v[0], v[2], v[4], v[6], 0, 0, 0, 0};
  else if constexpr (a == 1) return Double8{0, v[0], v[2], v[4], v[6], 0, 0, 0};
  else if constexpr (a == 2) return Double8{0, 0, v[0], v[2], v[4], v[6], 0, 0};
  else return Double8{0, 0, 0, v[0], v[2], v[4], v[6], 0};
}

// Of each pair the largest threshold of all rows, with the margin.
std::vector<double> widest(const SplineTerms& t, int pairs) {
  std::vector<double> most(pairs, -std::numeric_limits<double>::infinity());
  for (std::size_t k = 0; k < t.threshold.size(); ++k) most[k % pairs] = std::max(most[k % pairs], t.threshold[k]);
  for (double& value : most) value += t.clearance_margin;
  return most;
}

// Along the links, whatever the joint values; of a rail 1: what it moves goes as far as itself.
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
  if (model.chain.first_slides) longest[0] = 1.0;
  return longest;
}

// A direction of the last link's own frame in its internal frame.
Local turned(const Chain& chain, const double direction[3]) {
  const double none[3] = {};
  double from[3], to[3], result[3];
  chain.to_internal(chain.n, none, from);
  chain.to_internal(chain.n, direction, to);
  for (int i = 0; i < 3; ++i) result[i] = to[i] - from[i];
  return Local(result);
}

}  // namespace

SplineCost::SplineCost(const Model& geometry, const dynamics::Core& drives, const SplineTerms& terms)
    : model_(geometry), core_(drives), terms_(terms), n_(drives.model.n), widest_(widest(terms, geometry.pairs())),
      shift_float_(geometry, widest_.data()), shift_double_(geometry, widest_.data()), placement_float_(geometry),
      placement_double_(geometry), lever_(levers(geometry)), slope_(n_),
      tilt_axis_(turned(geometry.chain, terms.tilt_axis.data())), frames_(n_ + 1) {
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
  value += tilt(step);
  of_interval = -slower() / interval + of_step_ / P + terms_.time_value * intervals;
  value += terms_.time_value * intervals * interval;
  value += knots(intervals, interval, gradient, of_interval);
  scatter(interval, gradient);
  return value;
}

// Joint values, speeds and accelerations of all samples; lanes without a sample rest at the last control point.
void SplineCost::sample(const double* control, double interval) {
  const std::size_t last = count_ / P + 2;  // of the control points
  groups_.resize((count_ + 7) / 8);
  q_.resize(static_cast<std::size_t>(count_) * n_);
  column_ = 4 * groups_.size() + 16;  // eight lanes and three points may be read from any
  columns_.resize(column_ * n_);
  for (int j = 0; j < n_; ++j)
    for (std::size_t i = 0; i < column_; ++i) columns_[j * column_ + i] = control[std::min(i, last) * n_ + j];
  const LaneBasis& b = lane_basis();
  const double per = 1.0 / interval;
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    Group& g = groups_[k];
    const int used = std::min(8, count_ - static_cast<int>(8 * k));
    for (int l = 0; l < 8; ++l) g.counts[l] = l < used;
    for (int j = 0; j < n_; ++j) {
      const Double8 c = load<Double8>(&columns_[j * column_ + 4 * k]);
      const Double8 c0 = spread<0>(c), c1 = spread<1>(c), c2 = spread<2>(c), c3 = spread<3>(c);
      const auto along = [&](const Double8* w) { return w[0] * c0 + w[1] * c1 + w[2] * c2 + w[3] * c3; };
      g.q[j] = along(b.of[0]);
      g.qd[j] = along(b.of[1]) * per;
      g.qdd[j] = along(b.of[2]) * (per * per);
      g.of_q[j] = g.of_qdd[j] = Lane{};
      double* to = &q_[8 * k * n_ + j];
      for (int l = 0; l < used; ++l) to[l * n_] = g.q[j][l];
    }
  }
}

// From samples to control points.
void SplineCost::scatter(double interval, double* gradient) {
  const LaneBasis& b = lane_basis();
  const double per = 1.0 / interval;
  const std::size_t points = count_ / P + 3;
  std::fill(columns_.begin(), columns_.end(), 0.0);
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    const Group& g = groups_[k];
    for (int j = 0; j < n_; ++j) {
      const Lane q = g.of_q[j], qd = g.of_qd[j] * per, qdd = g.of_qdd[j] * (per * per);
      const auto owed = [&](int a) { return b.of[0][a] * q + b.of[1][a] * qd + b.of[2][a] * qdd; };
      double* to = &columns_[j * column_ + 4 * k];
      store(to, load<Lane>(to) + (gathered<0>(owed(0)) + gathered<1>(owed(1))) +
                    (gathered<2>(owed(2)) + gathered<3>(owed(3))));
    }
  }
  for (std::size_t i = 0; i < points; ++i)
    for (int j = 0; j < n_; ++j) gradient[i * n_ + j] += columns_[j * column_ + i];
}

// Accelerations at the knots (linear between), jerk of each interval (constant), positions by the control points.
// long: value and derivative side by side
double SplineCost::knots(int intervals, double interval, double* gradient,
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
  // in eight places at a time: which of `most` exceed the limit in size
  const auto each = [&](int most, const auto& size, double limit, const auto& punish) {
    for (int first = 0; first < most; first += 8)
      for (std::uint32_t left = bits(size(first) > limit); left != 0; left &= left - 1)
        if (first + __builtin_ctz(left) < most) punish(first + __builtin_ctz(left));
  };
  for (int j = 0; j < n_; ++j) {
    const double* c = &columns_[j * column_];
    double* g = gradient + j;
    const auto point = [c](int i) { return load<Lane>(c + i); };
    const auto jerk = [&](const auto& at, int i) { return ((at(i + 3) - at(i)) + 3.0 * (at(i + 1) - at(i + 2))) * third; };
    const auto acceleration = [&](const auto& at, int i) { return ((at(i + 2) - at(i + 1)) - (at(i + 1) - at(i))) * second; };
    const auto one = [c](int i) { return c[i]; };
    each(intervals, [&](int i) { return abs(jerk(point, i)); }, terms_.jerk[j], [&](int i) {
      const double slope = beyond(jerk(one, i), terms_.jerk[j], 3) * third;
      g[(i + 3) * n_] += slope, g[(i + 2) * n_] -= 3 * slope, g[(i + 1) * n_] += 3 * slope, g[i * n_] -= slope;
    });
    each(intervals + 1, [&](int i) { return abs(acceleration(point, i)); }, terms_.acceleration[j], [&](int i) {
      const double slope = beyond(acceleration(one, i), terms_.acceleration[j], 2) * second;
      g[(i + 2) * n_] += slope, g[(i + 1) * n_] -= 2 * slope, g[i * n_] += slope;
    });
    const double low = terms_.low[j], high = terms_.high[j];
    each(intervals + 3, [&](int i) { return max(low - point(i), point(i) - high); }, 0.0, [&](int i) {
      const double over = std::max(low - c[i], c[i] - high) * about;
      cost += weight * over * over;
      of_interval += terms_.penalty * over * over;
      g[i * n_] += std::copysign(2.0 * weight * over * about, c[i] - high);
    });
  }
  return cost;
}

}  // namespace ir
