// Eq. 3 in lanes; ir_kernels/reference/ccd.py is the same algorithm, written for reading.
#include "ccd.hpp"

#include <algorithm>
#include <cmath>

#include "dynamics_lanes.hpp"

namespace ir::inverse {
namespace {

using dynamics::Doubles;
using dynamics::Integers;
using dynamics::splat;

constexpr double kDampingStart = 1e-4, kDampingDown = 0.1, kDampingUp = 10.0;
constexpr double kDampingLeast = 1e-12, kDampingMost = 1e6;
constexpr double kTurn = 2.0 * M_PI;

struct V3 {
  Doubles x, y, z;
};
V3 operator+(const V3& a, const V3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
V3 operator-(const V3& a, const V3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
V3 operator*(const V3& a, Doubles s) { return {a.x * s, a.y * s, a.z * s}; }
Doubles dot(const V3& a, const V3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
V3 cross(const V3& a, const V3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
V3 constant(const double v[3]) { return {splat<Doubles>(v[0]), splat<Doubles>(v[1]), splat<Doubles>(v[2])}; }

// Orientation by columns.
struct M3 {
  V3 column[3];
};
V3 times(const M3& m, const double v[3]) {
  return {m.column[0].x * v[0] + m.column[1].x * v[1] + m.column[2].x * v[2],
          m.column[0].y * v[0] + m.column[1].y * v[1] + m.column[2].y * v[2],
          m.column[0].z * v[0] + m.column[1].z * v[1] + m.column[2].z * v[2]};
}
M3 times(const M3& m, const double R[3][3]) {
  M3 product;
  for (int j = 0; j < 3; ++j) {
    const double column[3] = {R[0][j], R[1][j], R[2][j]};
    product.column[j] = times(m, column);
  }
  return product;
}
M3 constant(const double R[3][3]) {
  M3 m;
  for (int j = 0; j < 3; ++j) m.column[j] = {splat<Doubles>(R[0][j]), splat<Doubles>(R[1][j]), splat<Doubles>(R[2][j])};
  return m;
}

// Arc tangent of y / x in all four quadrants (Cephes), atan2(0, 0) = 0.
Doubles arctan2(Doubles y, Doubles x) {
  const Doubles ax = dynamics::abs(x), ay = dynamics::abs(y);
  const Doubles large = dynamics::max(ax, ay), small = dynamics::min(ax, ay);
  Doubles t = small / dynamics::max(large, splat<Doubles>(1e-300));
  const Integers upper = t > 0.66;
  t = upper ? (t - 1.0) / (t + 1.0) : t;
  const Doubles z = t * t;
  const Doubles p = (((-8.750608600031904122785e-1 * z - 1.615753718733365076637e1) * z - 7.500855792314704667340e1) * z -
                1.228866684490136173410e2) * z - 6.485021904942025371773e1;
  const Doubles q = ((((z + 2.485846490142306297962e1) * z + 1.650270098316988542046e2) * z + 4.328810604912902668951e2) * z +
                4.853903996359136964868e2) * z + 1.945506571482613964425e2;
  Doubles angle = t * (z * p / q) + t;
  angle = upper ? angle + 3.061616997868382943065e-17 + 0.78539816339744830962 : angle;
  angle = ay > ax ? 1.57079632679489661923 - angle : angle;
  angle = x < 0.0 ? 3.14159265358979323846 - angle : angle;
  return dynamics::copysign(angle, y);
}

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

// Plain 3 x 3 products for the set-up.
void multiply(const double A[3][3], const double B[3][3], double C[3][3]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) C[i][j] = A[i][0] * B[0][j] + A[i][1] * B[1][j] + A[i][2] * B[2][j];
}
void multiply_transposed(const double A[3][3], const double B[3][3], double C[3][3]) {  // A' B
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) C[i][j] = A[0][i] * B[0][j] + A[1][i] * B[1][j] + A[2][i] * B[2][j];
}
void split(const double* pose, double R[3][3], double p[3]) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) R[i][j] = pose[4 * i + j];
    p[i] = pose[4 * i + 3];
  }
}
// A rotation whose third column is `axis`.
void frame_about(const double* axis, double Q[3][3]) {
  const int least = std::abs(axis[0]) <= std::abs(axis[1]) && std::abs(axis[0]) <= std::abs(axis[2]) ? 0
                    : std::abs(axis[1]) <= std::abs(axis[2])                                         ? 1
                                                                                                     : 2;
  double x[3] = {0, 0, 0}, size = 0.0;
  x[least] = 1.0;
  for (int i = 0; i < 3; ++i) x[i] -= axis[least] * axis[i];
  for (double v : x) size += v * v;
  size = std::sqrt(size);
  for (int i = 0; i < 3; ++i) {
    Q[i][0] = x[i] / size;
    Q[i][2] = axis[i];
  }
  for (int i = 0; i < 3; ++i) Q[i][1] = Q[(i + 1) % 3][2] * Q[(i + 2) % 3][0] - Q[(i + 2) % 3][2] * Q[(i + 1) % 3][0];
}

}  // namespace

CcdProblem::CcdProblem(int joints, const double* origin, const double* axis, const double* base, const double* tcp,
                       const double* pose, const double* lower, const double* upper, double weight)
    : n(joints), rotation_length(weight) {
  double before[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};  // the frame before, in its link's own frame
  for (int i = 0; i < n; ++i) {
    double E[3][3], p[3], Q[3][3], EQ[3][3];
    split(origin + 16 * i, E, p);
    frame_about(axis + 3 * i, Q);
    multiply(E, Q, EQ);
    multiply_transposed(before, EQ, turn[i]);
    for (int k = 0; k < 3; ++k) offset[i][k] = before[0][k] * p[0] + before[1][k] * p[1] + before[2][k] * p[2];
    std::copy(&Q[0][0], &Q[0][0] + 9, &before[0][0]);
    low[i] = lower[i];
    high[i] = upper[i];
  }
  double T[3][3], p[3], B[3][3], b[3], first[3][3];
  split(tcp, T, p);
  multiply_transposed(before, T, tool_turn);
  for (int k = 0; k < 3; ++k) tool_offset[k] = before[0][k] * p[0] + before[1][k] * p[1] + before[2][k] * p[2];
  split(base, B, b);
  multiply(B, turn[0], first);
  double shifted[3];
  for (int k = 0; k < 3; ++k)
    shifted[k] = b[k] + B[k][0] * offset[0][0] + B[k][1] * offset[0][1] + B[k][2] * offset[0][2];
  std::copy(&first[0][0], &first[0][0] + 9, &turn[0][0][0]);
  std::copy(shifted, shifted + 3, offset[0]);
  split(pose, target_turn, target);
}

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
