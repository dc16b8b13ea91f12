// A serial chain in the form that costs least per sample: modified Denavit-Hartenberg frames and base inertial
// parameters (Khalil, Kleinfinger 1986, 1987). Built once per robot and load, read by every recursion.
#pragma once

#include <array>
#include <vector>

namespace ir::dynamics {

constexpr int kMaxJoints = 16;

using Vec3 = std::array<double, 3>;
using Mat3 = std::array<Vec3, 3>;

// What the model is built from: see ir_kernels/dynamics_data.py.
struct ChainInput {
  int n = 0;
  bool first_slides = false;  // joint 0 is a rail under the arm
  std::vector<double> origin, axis, mass, com, inertia;
  Vec3 gravity{};
  std::vector<double> rotor, viscous, coulomb, ratio, copper, envelope_speed, envelope_torque;
  std::vector<double> turns, inverse;  // (n, n) of the coupling; see ir_kernels/coupling.py
  int knots = 0;
  int balanced_joint = -1;
  std::array<double, 2> pivot{}, eye{};
  double piston_area = 0, gas_volume = 0, charge_pressure = 0, rod_length = 0, exponent = 0;
};

// Frame i from frame i-1: Rx(alpha) Tx(a) Rz(q + theta0) Tz(d). In the link: no mass, first moment (hx, hy, 0), inertia
// about the origin without yy: what turns with the joint but looks the same at every angle has moved to the link before.
template <class T>
struct Joint {
  enum Turn { kParallel, kPerpendicular, kAny };
  Turn turn;
  T cos_alpha, sin_alpha;
  T r[3];  // origin of frame i in frame i-1
  bool has[3], has_r;
  T theta0;
  T hx, hy;
  T xx, xy, xz, yz, zz;
  bool has_hx, has_hy, products;  // what a robot doesn't have isn't computed
};

template <class T>
struct Drive {
  T rotor, viscous, coulomb, ratio, copper_at_joint;  // copper losses in W per Nm^2 of joint torque
};

// Power [W] that an axis takes from the DC link; for numbers, their intervals and derivatives alike.
template <class T, class S>
inline S axis_power(const Drive<T>& drive, const S& torque, const S& speed) {
  return torque * speed + torque * drive.copper_at_joint * torque;
}

// Torque of the counterbalance: g(|P - B|^2) times the lever, g as a polynomial fitted to rounding (gas law, length).
template <class T>
struct Balance {
  static constexpr int kTerms = 20;
  int joint = -1;
  T lever_cos, lever_sin;    // of cos and sin (q + theta0)
  T square_cos, square_sin;  // |P - B|^2, centred and scaled to [-1, 1]
  T coefficient[kTerms];
};

// Motors that turn with other joints than their own: w = turns qd, torque of the motors = inverse' torque of the joints.
template <class T>
struct Coupling {
  bool any = false;
  T turns[kMaxJoints][kMaxJoints], inverse[kMaxJoints][kMaxJoints];
};

// x = matrix x, or matrix' x, for any kind of number; what counts for nothing is left out.
template <bool kTransposed = false, class S, class T>
inline void multiply(int n, const T (&matrix)[kMaxJoints][kMaxJoints], S* x) {
  S product[kMaxJoints];
  for (int i = 0; i < n; ++i) {
    bool begun = false;
    for (int j = 0; j < n; ++j) {
      const T share = kTransposed ? matrix[j][i] : matrix[i][j];
      if (share == T(0)) continue;
      product[i] = begun ? product[i] + x[j] * share : x[j] * share;
      begun = true;
    }
  }
  for (int i = 0; i < n; ++i) x[i] = product[i];
}

// A rail under the arm: joint 0 slides along a direction of frame 0 of the arm and moves all of the mass. What the arm on it
// needs doesn't depend on where it stands: the recursions are those of joints 1..n-1, whose base accelerates.
template <class T>
struct Rail {
  bool there = false;
  T along[3] = {};
  T mass = 0;
};

template <class T>
struct Model {
  int n = 0;
  Rail<T> rail;
  Joint<T> joint[kMaxJoints];
  Drive<T> drive[kMaxJoints];
  Balance<T> balance;
  Coupling<T> coupling;
  T lift[3];  // minus the acceleration of free fall, in frame 0 of the arm
};

Model<double> build_model(const ChainInput& input);
Model<float> to_single(const Model<double>& model);

}  // namespace ir::dynamics
