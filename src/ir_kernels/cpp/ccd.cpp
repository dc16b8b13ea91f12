// Eq. 3 in lanes; ir_kernels/reference/ccd.py is the same algorithm, written for reading.
#include "ccd.hpp"

#include <algorithm>
#include <cmath>

#include "ccd_vectors.hpp"

namespace ir::inverse {
namespace {

constexpr double kDampingStart = 1e-4, kDampingDown = 0.1, kDampingUp = 10.0;
constexpr double kDampingLeast = 1e-12, kDampingMost = 1e6;
constexpr double kTurn = 2.0 * M_PI;

struct Pose {
  M3 R;
  V3 p;
};

// Axes z through o of all joints and the pose of the tool, in the world.
Pose forward(const CcdProblem& c, const Doubles* q, V3* z, V3* o) {
  Doubles s[kMaxJoints], k[kMaxJoints];
  dynamics::sincos(c.n, q, s, k);
  M3 R = constant(c.turn[0]);
  V3 p = constant(c.offset[0]);
  for (int i = 0; i < c.n; ++i) {
    if (i > 0) {
      p = p + times(R, c.offset[i]);
      R = times(R, c.turn[i]);
    }
    o[i] = p;
    z[i] = R.column[2];
    const V3 x = R.column[0], y = R.column[1];
    R.column[0] = x * k[i] + y * s[i];
    R.column[1] = y * k[i] - x * s[i];
  }
  return {times(R, c.tool_turn), p + times(R, c.tool_offset)};
}

Doubles psi_of(const CcdProblem& c, const Pose& pose) {
  const V3 step = pose.p - constant(c.target);
  const M3 target = constant(c.target_turn);
  Doubles turn{};
  for (int j = 0; j < 3; ++j) {
    const V3 d = pose.R.column[j] - target.column[j];
    turn += dot(d, d);
  }
  return dot(step, step) + 0.5 * c.rotation_length * c.rotation_length * turn;
}

// Axis times sine (doubled) and cosine (doubled, less one) of the rotation that brings the tool to the target.
struct Turn {
  V3 twice_sine;
  Doubles length, angle;
};
Turn turn_to_target(const CcdProblem& c, const Pose& pose) {
  const M3 target = constant(c.target_turn);
  V3 sine{Doubles{}, Doubles{}, Doubles{}};
  Doubles trace{};
  for (int j = 0; j < 3; ++j) {
    sine = sine + cross(pose.R.column[j], target.column[j]);
    trace += dot(pose.R.column[j], target.column[j]);
  }
  const Doubles length = dynamics::sqrt(dot(sine, sine));
  return {sine, length, arctan2(length, trace - 1.0)};
}

// The value within the limits that minimises Psi = const - 2 (c cos + s sin) of the increment; of equal ones the nearest.
Doubles best_value(Doubles q, Doubles c, Doubles s, double low, double high) {
  const Doubles phi = arctan2(s, c);
  const Doubles free = q + phi;
  const Doubles turn = dynamics::copysign(splat<Doubles>(kTurn), phi);
  const auto inside = [=](Doubles x) { return (x >= low) & (x <= high); };
  const Integers here = inside(free), back = inside(free - turn), on = inside(free + turn);
  Doubles value = here ? free : (back ? free - turn : free + turn);
  if (dynamics::any(~(here | back | on))) {
    Doubles ends[2] = {low - q, high - q}, sine[2]{}, cosine[2]{};
    dynamics::sincos(2, ends, sine, cosine);
    const Integers lower = c * cosine[0] + s * sine[0] >= c * cosine[1] + s * sine[1];
    value = here | back | on ? value : (lower ? splat<Doubles>(low) : splat<Doubles>(high));
  }
  return value;
}

// One pass over the joints of the lanes in `going`, from the tool to the base. `pose` and the axes belong to q.
void sweep(const CcdProblem& c, Doubles* q, Pose pose, const V3* z, const V3* o, Integers going) {
  const M3 target = constant(c.target_turn);
  const double wo = 0.5 * c.rotation_length * c.rotation_length;
  for (int i = c.n - 1; i >= 0; --i) {
    const V3 from = pose.p - o[i], to = constant(c.target) - o[i];
    Doubles along{}, together{};
    V3 across{Doubles{}, Doubles{}, Doubles{}};
    for (int j = 0; j < 3; ++j) {
      along += dot(pose.R.column[j], z[i]) * dot(target.column[j], z[i]);
      together += dot(pose.R.column[j], target.column[j]);
      across = across + cross(pose.R.column[j], target.column[j]);
    }
    const Doubles k1 = dot(to, z[i]) * dot(from, z[i]) + wo * along;
    const Doubles k2 = dot(to, from) + wo * together;
    const Doubles k3 = dot(z[i], cross(from, to) + across * splat<Doubles>(wo));
    const Doubles value = going ? best_value(q[i], k2 - k1, k3, c.low[i], c.high[i]) : q[i];
    const Doubles phi = value - q[i];
    q[i] = value;
    if (i == 0) break;
    Doubles sine{}, cosine{};
    dynamics::sincos(1, &phi, &sine, &cosine);
    const auto turned = [&](const V3& v) { return v * cosine + cross(z[i], v) * sine + z[i] * (dot(z[i], v) * (1.0 - cosine)); };
    for (V3& column : pose.R.column) column = turned(column);
    pose.p = o[i] + turned(from);
  }
}

// Damped least-squares step; joints at a limit that would leave it are held.
void newton_step(const CcdProblem& c, const Doubles* q, const Pose& pose, const V3* z, const V3* o, Doubles damping, Doubles* next) {
  const int n = c.n;
  const Turn turn = turn_to_target(c, pose);
  const Doubles factor = turn.length > 1e-12 ? turn.angle / dynamics::max(turn.length, splat<Doubles>(1e-12)) : splat<Doubles>(0.5);
  const V3 step = constant(c.target) - pose.p;
  const V3 rotation = turn.twice_sine * (factor * c.rotation_length);
  V3 linear[kMaxJoints], angular[kMaxJoints];
  Doubles A[kMaxJoints * kMaxJoints], b[kMaxJoints];
  for (int i = 0; i < n; ++i) {
    linear[i] = cross(z[i], pose.p - o[i]);
    angular[i] = z[i] * splat<Doubles>(c.rotation_length);
    b[i] = dot(linear[i], step) + dot(angular[i], rotation);
    const Integers held = ((q[i] <= c.low[i]) & (b[i] < 0.0)) | ((q[i] >= c.high[i]) & (b[i] > 0.0));
    const Doubles free = held ? Doubles{} : splat<Doubles>(1.0);
    linear[i] = linear[i] * free;
    angular[i] = angular[i] * free;
    b[i] *= free;
    for (int j = 0; j <= i; ++j) A[i * n + j] = dot(linear[i], linear[j]) + dot(angular[i], angular[j]);
    A[i * n + i] += damping;
  }
  for (int j = 0; j < n; ++j) {  // L D L'
    const Doubles inverse = 1.0 / A[j * n + j];
    for (int i = j + 1; i < n; ++i) {
      const Doubles f = A[i * n + j] * inverse;
      for (int k = j + 1; k <= i; ++k) A[i * n + k] -= f * A[k * n + j];
      b[i] -= f * b[j];
    }
  }
  for (int j = n - 1; j >= 0; --j) {
    Doubles x = b[j];
    for (int i = j + 1; i < n; ++i) x -= A[i * n + j] * b[i];
    b[j] = x / A[j * n + j];
    next[j] = dynamics::min(dynamics::max(q[j] + b[j], splat<Doubles>(c.low[j])), splat<Doubles>(c.high[j]));
  }
}

// long: the sweep over joints, lane by lane
void run_lanes(const CcdProblem& c, Doubles* q, Doubles& psi, Doubles& distance, Doubles& angle, Integers& sweeps, Integers& steps) {
  V3 z[kMaxJoints], o[kMaxJoints];
  for (int i = 0; i < c.n; ++i) q[i] = dynamics::min(dynamics::max(q[i], splat<Doubles>(c.low[i])), splat<Doubles>(c.high[i]));
  sweeps = steps = Integers{};
  Pose pose = forward(c, q, z, o);
  psi = psi_of(c, pose);
  for (long k = 0; k < c.max_sweeps; ++k) {
    const Integers going = psi >= c.xi;
    if (!dynamics::any(going)) break;
    sweep(c, q, pose, z, o, going);
    pose = forward(c, q, z, o);
    psi = psi_of(c, pose);
    sweeps -= going;
  }
  Doubles damping = splat<Doubles>(kDampingStart), next[kMaxJoints];
  V3 next_z[kMaxJoints], next_o[kMaxJoints];
  for (long k = 0; k < c.newton_steps; ++k) {
    const Integers going = (psi >= c.newton_tolerance) & (damping < kDampingMost);
    if (!dynamics::any(going)) break;
    newton_step(c, q, pose, z, o, damping, next);
    const Pose tried = forward(c, next, next_z, next_o);
    const Doubles value = psi_of(c, tried);
    const Integers better = (value < psi) & going;
    const auto take = [better](V3& a, const V3& b) {
      a = {better ? b.x : a.x, better ? b.y : a.y, better ? b.z : a.z};
    };
    for (int i = 0; i < c.n; ++i) {
      q[i] = better ? next[i] : q[i];
      take(z[i], next_z[i]);
      take(o[i], next_o[i]);
    }
    for (int j = 0; j < 3; ++j) take(pose.R.column[j], tried.R.column[j]);
    take(pose.p, tried.p);
    psi = better ? value : psi;
    const Doubles following = dynamics::max(damping * (better ? splat<Doubles>(kDampingDown) : splat<Doubles>(kDampingUp)),
                                       splat<Doubles>(kDampingLeast));
    damping = going ? following : damping;
    steps -= going;
  }
  const V3 gap = pose.p - constant(c.target);
  distance = dynamics::sqrt(dot(gap, gap));
  angle = turn_to_target(c, pose).angle;
}

}  // namespace

void run(const CcdProblem& c, const double* starts, long P, const CcdArrays& out) {
  for (long first = 0; first < P; first += dynamics::kLanes) {
    Doubles q[kMaxJoints], psi, distance, angle;
    Integers sweeps, steps;
    dynamics::load_columns(starts, P, c.n, first, q);
    run_lanes(c, q, psi, distance, angle, sweeps, steps);
    dynamics::store_columns(q, P, c.n, first, out.q);
    for (long l = 0; l < std::min<long>(dynamics::kLanes, P - first); ++l) {
      out.psi[first + l] = psi[l];
      out.distance[first + l] = distance[l];
      out.angle[first + l] = angle[l];
      out.sweeps[first + l] = sweeps[l];
      out.newton_steps[first + l] = steps[l];
    }
  }
}

}  // namespace ir::inverse
