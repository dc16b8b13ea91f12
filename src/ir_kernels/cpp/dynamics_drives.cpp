// The drives: power of the axes, torque that is available at a speed, and the common DC link.
#include <algorithm>
#include <cmath>

#include "dynamics_kernels.hpp"

namespace ir::dynamics {

namespace {

// Speeds of the motors where the joints turn at qd.
struct MotorSpeed {
  double w[kMaxJoints];
  MotorSpeed(const Model<double>& m, const double* qd) {
    std::copy(qd, qd + m.n, w);
    if (m.coupling.any) multiply(m.n, m.coupling.turns, w);
  }
};

}  // namespace

bool axis_power(const Model<double>& m, const double* qd, const double* tau, long N, double* power) {
  bool finite = true;
  for (long k = 0; k < N; ++k) {
    const MotorSpeed speed(m, qd + k * m.n);
    for (int i = 0; i < m.n; ++i) {
      const double p = axis_power(m.drive[i], tau[k * m.n + i], speed.w[i]);
      power[k * m.n + i] = p;
      finite &= p - p == 0.0;
    }
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

bool Envelope::limits(const Model<double>& m, const double* qd, long N, double* limit) const {
  bool finite = true;
  for (long k = 0; k < N; ++k) {
    const MotorSpeed speed(m, qd + k * n_);
    for (int i = 0; i < n_; ++i) {
      limit[k * n_ + i] = this->limit(i, std::abs(speed.w[i]));
      finite &= speed.w[i] - speed.w[i] == 0.0;
    }
  }
  return finite;
}

void dc_bus(const double* power, const double* dt, long N, int n, double capacity, Regeneration regeneration,
            double stored, double* mains, double* dissipated, double* level) {
  for (long k = 0; k < N; ++k) {
    double wanted = 0.0, returned = 0.0, net = 0.0;
    for (int i = 0; i < n; ++i) {
      const double p = power[k * n + i];
      wanted += std::max(p, 0.0);
      returned += std::max(-p, 0.0);
      net += p;
    }
    dissipated[k] = 0.0;
    if (regeneration == Regeneration::kNone) {
      mains[k] = wanted;
      dissipated[k] = returned;
    } else {
      net *= dt[k];  // J that the axes want in this step
      const double moved = net > 0.0 ? std::min(net, stored) : -std::min(-net, capacity - stored);
      stored -= moved;
      double rest = net - moved;  // J that the capacitor could not give or take
      if (rest < 0.0 && regeneration == Regeneration::kShared) {
        dissipated[k] = -rest / dt[k];
        rest = 0.0;
      }
      mains[k] = rest / dt[k];
    }
    level[k] = stored;
  }
}

}  // namespace ir::dynamics
