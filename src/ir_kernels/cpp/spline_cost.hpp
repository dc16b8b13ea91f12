// What a motion along a uniform cubic B-spline costs and by how much it leaves its bounds, with the derivatives by its
// control points and by the time between its knots: see ir_kernels/spline.py for the terms.
#pragma once

#include <array>
#include <vector>

#include "dynamics_adjoint.hpp"
#include "dynamics_kernels.hpp"
#include "visit.hpp"

namespace ir {

struct SplineTerms {
  std::vector<double> velocity, acceleration, jerk, low, high, travel;  // (n) each; travel: cost per rad
  double torque_share, energy_value, time_value, capacity, smoothing;
  dynamics::Regeneration regeneration;
  std::vector<double> threshold;  // (rows, pairs) [m]
  double clearance_margin, clearance_scale, penalty, clearance_penalty;
  std::vector<double> tilt_axis, tilt_direction;  // (3) each, of length 1: in the last link, in the world
  double tilt_max, tilt_scale;                    // [rad] between the two; pi: whatever it is
};

// Workspace of one thread: evaluates one motion after the other without allocating again.
class SplineCost {
 public:
  static constexpr int samples = 2;  // per interval between knots

  // All three have to outlive it; terms.threshold empty where there are no pairs.
  SplineCost(const Model& geometry, const dynamics::Core& drives, const SplineTerms& terms);

  // control (K, n) with K - 3 intervals of `interval` s; row (K - 3): which thresholds hold. Returns the cost; fills
  // gradient (K, n) and of_interval.
  double operator()(const double* control, int K, const std::int32_t* row, double interval, double* gradient,
                    double& of_interval);

  // Forgets what earlier calls found to be near: what follows depends on nothing but its own arguments.
  void forget() { near_.clear(); }

  double energy = 0.0;  // [J] at the mains for the axes, of the last call

 private:
  using Lane = Double8;
  struct Group {  // eight samples, and what the cost owes to each of their numbers
    Lane q[dynamics::kMaxJoints], qd[dynamics::kMaxJoints], qdd[dynamics::kMaxJoints];
    Lane s[dynamics::kMaxJoints], c[dynamics::kMaxJoints], tau[dynamics::kMaxJoints];
    Lane of_q[dynamics::kMaxJoints], of_qd[dynamics::kMaxJoints], of_qdd[dynamics::kMaxJoints];
    Lane of_tau[dynamics::kMaxJoints], power[dynamics::kMaxJoints];
    Lane turn[dynamics::kMaxJoints], of_turn[dynamics::kMaxJoints];  // speeds of motors that are coupled
    dynamics::LinkTrace<Lane> link[dynamics::kMaxJoints];
    Lane counts;  // 1 where the lane is a sample
  };
  void smooth_envelope();
  void sample(const double* control, double interval);
  double drives(double step);
  template <int kJoints> double drives_of(double step);
  double bus(double step);
  void exact_bus(double step);
  double smooth_bus(double step);
  double clearance(const std::int32_t* row, double step);
  double tilt(double step);
  double slower();
  template <int kJoints> double slower_of();
  double knots(int intervals, double interval, double* gradient, double& of_interval) const;
  void scatter(double interval, double* gradient);

  const Model& model_;
  const dynamics::Core& core_;
  const SplineTerms& terms_;
  int n_, count_ = 0, bends_ = 0;  // joints, samples, bends of each torque limit
  double of_step_ = 0.0;           // derivative of what is summed over time, by the time between samples
  std::vector<double> standing_;   // (n) torque limit at rest
  std::vector<double> bend_at_, bend_;  // (n, bends): speeds at which the smoothed limit changes its slope, by how much
  std::vector<Group> groups_;
  std::size_t column_ = 0;          // control points of a joint side by side, the last one repeated
  std::vector<double> columns_;     // (n, column): of the control points, or what the cost owes to them
  std::vector<double> power_, of_power_, left_, q_;  // (lanes) three times, (N, n)
  // clearance
  std::vector<double> widest_;  // (pairs) the largest threshold of all rows, with the margin
  Shifts<float> shift_float_;
  Shifts<double> shift_double_;
  Placement<Float16> placement_float_;
  Placement<Double8> placement_double_;
  std::vector<int> hits_[16];
  // Of one lane group: no pair matters while bodies move by less than `clear` from where they were at `seen`, and none
  // but `pairs` while they move by less than `around` from where they were at `listed`.
  struct Near {
    std::vector<double> seen, listed;       // joint values of the group's samples
    double clear = 0.0, around = 0.0;       // [m]
    std::vector<std::array<int, 2>> pairs;  // each with its capsule, or its number among the self pairs
  };
  std::vector<Near> near_;
  std::vector<double> lever_;  // (n) [m] of each joint: no point of a capsule's axis is farther from it
  double moved(const std::vector<double>& from, const double* q, int used) const;
  std::vector<Lane> slope_;
  Local tilt_axis_;                // in the last link's internal frame
  std::vector<Frame<Lane>> frames_;  // (n + 1)
  template <class V> double clearance_in(Placement<V>& placement, const Shifts<Scalar<V>>& shift,
                                         const std::int32_t* row, double step);
};

}  // namespace ir
