// Batches of samples through the recursions; pointers to C-contiguous (N, n) doubles. Nothing of Python in here.
#pragma once

#include <string>

#include "dynamics_model.hpp"

namespace ir::dynamics {

// Each returns whether all it read was finite.
bool inverse_dynamics(const Model<double>& m, const double* q, const double* qd, const double* qdd, long N, double* tau);
bool inverse_dynamics(const Model<float>& m, const double* q, const double* qd, const double* qdd, long N, double* tau);
// h = C qd + g; without qd: g
bool bias(const Model<double>& m, const double* q, const double* qd, long N, double* tau);
bool counterbalance(const Model<double>& m, const double* q, long N, double* tau);
bool mass_matrix(const Model<double>& m, const double* q, long N, double* H);
bool forward_dynamics(const Model<double>& m, const double* q, const double* qd, const double* tau, long N, double* qdd);
bool torque_gradients(const Model<double>& m, const double* q, const double* qd, const double* qdd, long N,
                      double* of_q, double* of_qd, double* of_qdd);
bool axis_power(const Model<double>& m, const double* qd, const double* tau, long N, double* power);

// Torque available at a speed: a step down at the first speed, then linear between the pairs.
class Envelope {
 public:
  Envelope(int n, int knots, std::vector<double> speed, std::vector<double> torque)
      : n_(n), knots_(knots), speed_(std::move(speed)), torque_(std::move(torque)) {}
  double limit(int joint, double speed) const;
  double least(int joint, double slowest, double fastest) const;  // over a range of speeds, both >= 0
  bool limits(const Model<double>& m, const double* qd, long N, double* limit) const;  // at the speeds of the joints
  int knots() const { return knots_; }
  const double* speeds(int joint) const { return &speed_[joint * knots_]; }             // (knots)
  const double* torques(int joint) const { return &torque_[joint * (knots_ + 1)]; }     // (knots + 1)

 private:
  int n_, knots_;
  std::vector<double> speed_, torque_;
};

// What is built once per robot and load.
struct Core {
  Model<double> model;
  Model<float> single;
  Envelope envelope;
};

enum class Regeneration { kShared, kNone, kFedBack };
void dc_bus(const double* power, const double* dt, long N, int n, double capacity, Regeneration regeneration,
            double stored, double* mains, double* dissipated, double* level);

}  // namespace ir::dynamics
