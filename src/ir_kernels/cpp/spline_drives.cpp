// The drives' share of the cost of a spline: torques, speeds and powers of the samples, and the energy over the DC link.
#include <algorithm>
#include <cmath>

#include "dynamics_numbers.hpp"
#include "spline_cost.hpp"

namespace ir {
namespace {

constexpr double still = 0.01;  // [rad/s] friction and |qd| are smoothed below

double sum(const Double8& v) {
  double s = 0.0;
  for (int k = 0; k < 8; ++k) s += v[k];
  return s;
}

// max(x, 0), a hyperbola that is `smoothing` above it at 0; its derivatives.
IR_INLINE double root_of(double x) { return std::sqrt(x); }
IR_INLINE Double8 root_of(Double8 x) { return sqrt(x); }
template <class V> struct Above {
  V value, slope, of_smoothing;
};
template <class V> IR_INLINE Above<V> rounded(V x, double smoothing) {
  const V root = root_of(x * x + 4.0 * smoothing * smoothing);
  return {0.5 * (x + root), 0.5 + 0.5 * x / root, 2.0 * smoothing / root};
}
IR_INLINE Above<Double8> above(Double8 x, double smoothing) {
  if (smoothing > 0.0) return rounded(x, smoothing);
  return {max(x, Double8{}), x > 0.0 ? splat<Double8>(1.0) : Double8{}, Double8{}};
}

}  // namespace

// Torques, their penalties and those of speed; the powers.
double SplineCost::drives(double step) {
  return n_ == 6 && !core_.model.rail.there ? drives_of<6>(step) : drives_of<0>(step);
}

template <int kJoints>
double SplineCost::drives_of(double step) {  // long: value and derivative side by side
  const auto& arm = core_.model;
  Lane cost{}, of_step{};
  for (Group& g : groups_) {
    Lane theta[dynamics::kMaxJoints];
    for (int j = 0; j < n_; ++j) theta[j] = g.q[j] + arm.joint[j].theta0;
    sincos(n_, theta, g.s, g.c);
    dynamics::newton_euler<kJoints>(arm, g.s, g.c, g.qd, g.qdd, g.tau, true, dynamics::Trace<Lane>{g.link});
    if (arm.balance.joint >= 0) {
      const int b = arm.balance.joint;
      g.tau[b] -= dynamics::balance_torque(arm.balance, g.s[b], g.c[b]);
    }
    Lane change[dynamics::kMaxJoints];  // of the motors' speeds
    for (int j = 0; j < n_; ++j) {
      g.turn[j] = g.qd[j];
      change[j] = g.qdd[j];
    }
    if (arm.coupling.any) {
      dynamics::multiply<true>(n_, arm.coupling.inverse, g.tau);
      dynamics::multiply(n_, arm.coupling.turns, g.turn);
      dynamics::multiply(n_, arm.coupling.turns, change);
    }
    for (int j = 0; j < n_; ++j) {
      const auto& d = arm.drive[j];
      const Lane v = g.turn[j], speed = abs(v), root = sqrt(v * v + still * still);
      g.tau[j] += change[j] * d.rotor + v * d.viscous + d.coulomb * v / root;
      g.power[j] = g.tau[j] * v + d.copper_at_joint * g.tau[j] * g.tau[j];
      Lane limit = splat<Lane>(standing_[j]), falls{};
      for (int k = 0; k < bends_; ++k) {
        const double at = bend_at_[j * bends_ + k], by = bend_[j * bends_ + k];
        const Lane over = speed - at;
        limit += over > 0.0 ? by * over : Lane{};
        falls += over > 0.0 ? splat<Lane>(by) : Lane{};
      }
      // near standstill friction may be as much more than it is with its smoothed sign
      const Lane unsure = d.coulomb * (still * still) / (root * root);
      const Lane torque = abs(g.tau[j]) + unsure, inverse = 1.0 / (limit * terms_.torque_share);
      const Lane use = max(torque * inverse - 1.0, Lane{}) * g.counts;
      const double fastest = 1.0 / terms_.velocity[j];
      const Lane q_speed = abs(g.qd[j]), over = max(q_speed * fastest - 1.0, Lane{}) * g.counts;
      const Lane penalty = terms_.penalty * (use * use + over * over);
      cost += penalty * step;
      of_step += penalty;
      const Lane weight = 2.0 * step * terms_.penalty * use;
      const Lane sign_v = v > 0.0 ? splat<Lane>(1.0) : splat<Lane>(-1.0);
      g.of_tau[j] = weight * inverse * (g.tau[j] > 0.0 ? splat<Lane>(1.0) : splat<Lane>(-1.0));
      const Lane too_fast = 2.0 * step * terms_.penalty * fastest * over;  // owed to the joint, the rest to the motor
      const Lane too_steep = weight * torque * inverse / limit * falls;
      const Lane too_slow = 2.0 * weight * inverse * unsure * v / (root * root);
      if (arm.coupling.any) {
        g.of_turn[j] = -(sign_v * too_steep) - too_slow;
        g.of_qd[j] = (g.qd[j] > 0.0 ? too_fast : -too_fast);
      } else {
        g.of_qd[j] = sign_v * (too_fast - too_steep) - too_slow;
      }
      if (terms_.travel[j] > 0.0) {
        const Lane way = arm.coupling.any ? sqrt(g.qd[j] * g.qd[j] + still * still) : root;
        const Lane travelled = terms_.travel[j] * (way - still) * g.counts;
        cost += travelled * step;
        of_step += travelled;
        g.of_qd[j] += (step * terms_.travel[j]) * g.counts * g.qd[j] / way;
      }
    }
  }
  of_step_ += sum(of_step);
  return sum(cost);
}

// Energy at the mains over the common DC link, sample after sample; and the derivative by each sample's power.
double SplineCost::bus(double step) {
  const bool alone = terms_.regeneration == dynamics::Regeneration::kNone;
  power_.resize(8 * groups_.size());
  of_power_.assign(power_.size(), 1.0);
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    const Group& g = groups_[k];
    Lane sum{};
    for (int j = 0; j < n_; ++j) sum += alone ? above(g.power[j], terms_.smoothing).value : g.power[j];
    store(&power_[8 * k], sum);
  }
  const double worth = terms_.energy_value;
  double of_step = 0.0;
  energy = 0.0;
  if (alone) for (int k = 0; k < count_; ++k) energy += power_[k] * step;
  else if (terms_.smoothing > 0.0) of_step = smooth_bus(step);
  else exact_bus(step);
  for (int k = 0; k < count_; ++k) {
    of_step += of_power_[k] * power_[k];
    of_power_[k] *= worth * step;
  }
  of_step_ += worth * of_step;
  return worth * energy;
}

// The DC link as it is: energy, and of_power_ what a joule more in each sample costs.
void SplineCost::exact_bus(double step) {
  const bool returns = terms_.regeneration == dynamics::Regeneration::kFedBack;
  // of_power_ first says where a joule of this sample comes from: 1 the mains (or goes back there), 2 the capacitor, 0
  // nowhere, as less is dissipated
  double stored = 0.0;
  for (int k = 0; k < count_; ++k) {
    const double wanted = power_[k] * step, full = stored - terms_.capacity;
    if (wanted > stored) {
      energy += wanted - stored;
      stored = 0.0;
      of_power_[k] = 1.0;
    } else if (wanted < full) {
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

// The same with smooth switches; returns what the smoothing itself adds per change of the time between samples.
double SplineCost::smooth_bus(double step) {
  const double most = terms_.smoothing * step;  // [J]
  const double back = terms_.regeneration == dynamics::Regeneration::kFedBack ? 1.0 : 0.0;
  double stored = 0.0;
  left_.assign(power_.size(), 0.0);
  for (int k = 0; k < count_; ++k) {
    left_[k] = stored - power_[k] * step;  // in the capacitor, if it had no ends
    const double mains = rounded(-left_[k], most).value, surplus = rounded(left_[k] - terms_.capacity, most).value;
    energy += mains - back * surplus;
    stored = left_[k] + mains - surplus;
  }
  double of_stored = 0.0, of_most = 0.0;
  for (std::size_t group = groups_.size(); group-- > 0;) {
    const Lane left = load<Lane>(&left_[8 * group]);
    const Above<Lane> mains = rounded(-left, most), surplus = rounded(left - terms_.capacity, most);
    const Lane kept = 1.0 - mains.slope - surplus.slope, given = mains.slope + back * surplus.slope;
    const Lane fixed = mains.of_smoothing - back * surplus.of_smoothing, moving = mains.of_smoothing - surplus.of_smoothing;
    const int used = std::min(8, count_ - static_cast<int>(8 * group));
    for (int l = used; l-- > 0;) {
      of_most += fixed[l] + moving[l] * of_stored;
      of_stored = of_stored * kept[l] - given[l];
      of_power_[8 * group + l] = -of_stored;
    }
  }
  return of_most * terms_.smoothing;
}

// From powers and torques back to positions, speeds and accelerations. Returns what the cost gains from a motion that is
// slower, per relative change of the time between knots.
double SplineCost::slower() {
  return n_ == 6 && !core_.model.rail.there ? slower_of<6>() : slower_of<0>();
}

template <int kJoints> double SplineCost::slower_of() {
  const auto& arm = core_.model;
  double gain = 0.0;
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    Group& g = groups_[k];
    const Lane of_power = load<Lane>(&of_power_[8 * k]) * g.counts;
    Lane* of_turn = arm.coupling.any ? g.of_turn : g.of_qd;
    for (int j = 0; j < n_; ++j) {
      const auto& d = arm.drive[j];
      const bool alone = terms_.regeneration == dynamics::Regeneration::kNone;
      const Lane w = alone ? of_power * above(g.power[j], terms_.smoothing).slope : of_power;
      g.of_tau[j] += w * (g.turn[j] + 2.0 * d.copper_at_joint * g.tau[j]);
      of_turn[j] += w * g.tau[j];
      const Lane root = g.turn[j] * g.turn[j] + still * still;
      of_turn[j] += g.of_tau[j] * (d.viscous + d.coulomb * still * still / (root * sqrt(root)));
      g.of_qdd[j] += g.of_tau[j] * d.rotor;
    }
    if (arm.coupling.any) {  // from the motors to the joints
      dynamics::multiply<true>(n_, arm.coupling.turns, g.of_turn);
      dynamics::multiply<true>(n_, arm.coupling.turns, g.of_qdd);
      dynamics::multiply(n_, arm.coupling.inverse, g.of_tau);
      for (int j = 0; j < n_; ++j) g.of_qd[j] += g.of_turn[j];
    }
    const int b = arm.balance.joint;
    if (b >= 0) {
      using Dual = dynamics::Dual<Lane>;
      const Dual s{g.s[b], g.c[b]}, c{g.c[b], -g.s[b]};
      g.of_q[b] -= g.of_tau[b] * dynamics::balance_torque(arm.balance, s, c).d;
    }
    dynamics::newton_euler_adjoint<kJoints>(arm, g.s, g.c, g.qd, g.link, g.of_tau, g.of_q, g.of_qd, g.of_qdd);
    Lane lane_gain{};
    for (int j = 0; j < n_; ++j) lane_gain += g.of_qd[j] * g.qd[j] + 2.0 * g.of_qdd[j] * g.qdd[j];
    gain += sum(lane_gain);
  }
  return gain;
}

}  // namespace ir
