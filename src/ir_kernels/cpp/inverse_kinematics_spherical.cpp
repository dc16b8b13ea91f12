// Pieper's closed form, with sines and cosines carried as complex numbers instead of angles; see
// ir_kernels/reference/inverse_kinematics.py, which names every step.
#include "inverse_kinematics_spherical.hpp"

#include <algorithm>
#include <cmath>
#include <complex>

#include "elementary.hpp"

namespace ir::inverse {
namespace {

using Complex = std::complex<double>;

constexpr double kReachTolerance = 1e-10;     // m
constexpr double kLimitTolerance = 1e-10;     // rad
constexpr double kSingularWrist = 1e-10;      // sine of the wrist angle
constexpr double kRotationTolerance = 1e-6;   // of R R' - 1
constexpr double kTurn = 2.0 * M_PI;

struct Vec {
  double x, y, z;
};
double dot(const Vec& a, const Vec& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
Vec cross(const Vec& a, const Vec& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
struct Mat {
  Vec row[3];
};
Vec operator*(const Mat& m, const Vec& a) { return {dot(m.row[0], a), dot(m.row[1], a), dot(m.row[2], a)}; }
Mat transpose(const Mat& m) {
  const Vec *r = m.row;
  return {{{r[0].x, r[1].x, r[2].x}, {r[0].y, r[1].y, r[2].y}, {r[0].z, r[1].z, r[2].z}}};
}
Mat operator*(const Mat& a, const Mat& b) {
  const Mat t = transpose(b);
  Mat m;
  for (int i = 0; i < 3; ++i) m.row[i] = {dot(a.row[i], t.row[0]), dot(a.row[i], t.row[1]), dot(a.row[i], t.row[2])};
  return m;
}
Mat rotation_of(const double* pose) {
  return {{{pose[0], pose[1], pose[2]}, {pose[4], pose[5], pose[6]}, {pose[8], pose[9], pose[10]}}};
}
Vec origin_of(const double* pose) { return {pose[3], pose[7], pose[11]}; }
Vec vec(const double* v) { return {v[0], v[1], v[2]}; }
Vec operator+(const Vec& a, const Vec& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
Vec operator-(const Vec& a, const Vec& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }

Complex times(Complex a, Complex b) {  // without the checks for infinities of std::complex
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
double size(Complex a) { return std::sqrt(a.real() * a.real() + a.imag() * a.imag()); }

bool is_rigid(const double* pose) {
  const Mat R = rotation_of(pose);
  const Mat square = R * transpose(R);
  const double identity[3][3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  double deviation = 0.0;
  for (int i = 0; i < 3; ++i)
    deviation += std::abs(square.row[i].x - identity[i][0]) + std::abs(square.row[i].y - identity[i][1]) +
                 std::abs(square.row[i].z - identity[i][2]);
  const double handed = dot(R.row[0], cross(R.row[1], R.row[2]));
  const Vec o = origin_of(pose);
  return deviation <= kRotationTolerance && handed > 0.0 && std::isfinite(o.x + o.y + o.z) && pose[12] == 0.0 &&
         pose[13] == 0.0 && pose[14] == 0.0 && pose[15] == 1.0;
}

// Everything in plane coordinates (x, y, z) = (z2 x z1, z2, z1).
class Solver {
 public:
  explicit Solver(const SphericalArm& arm) : arm_(arm) {
    for (int i = 0; i < 3; ++i) plane_.row[i] = vec(arm.plane[i]);
    const Mat hand{{vec(arm.hand_rotation[0]), vec(arm.hand_rotation[1]), vec(arm.hand_rotation[2])}};
    hand_to_plane_ = transpose(hand) * transpose(plane_);
    z4_ = plane_ * vec(arm.axis[3]);
    z5_ = plane_ * vec(arm.axis[4]);
    z6_ = plane_ * vec(arm.axis[5]);
    e3_ = cross(z4_, z5_);
    to_base_ = rotation_of(arm.to_base);
    from_tcp_ = rotation_of(arm.from_tcp);
    shoulder_ = {arm.shoulder[0], arm.shoulder[1]};
    upper_ = {arm.upper_arm[0], arm.upper_arm[1]};
    fore_ = {arm.forearm[0], arm.forearm[1]};
    upper_length_ = size(upper_);
    fore_length_ = size(fore_);
    const Complex opening = times(std::conj(upper_), fore_);
    opening_ = ir::arc_tangent(opening.imag(), opening.real());
    unopened_ = std::conj(opening) / size(opening);
    free_q4_ = std::clamp(0.0, arm.low[3], arm.high[3]);
  }

  void solve(const double* pose, long index, IkSolutions& out) const {
    const Mat rotation = rotation_of(pose);
    const Mat hand = to_base_ * rotation * from_tcp_;
    const Vec in_tcp = origin_of(arm_.from_tcp);
    const Vec origin = to_base_ * (rotation * in_tcp + origin_of(pose)) + origin_of(arm_.to_base);
    const Vec centre = plane_ * (origin + hand * vec(arm_.wrist_in_hand) - vec(arm_.axis_point));
    const Mat turned = plane_ * hand * hand_to_plane_;
    const double radius = std::sqrt(centre.x * centre.x + centre.y * centre.y);
    const double d = arm_.lateral;
    if (radius < std::abs(d) - kReachTolerance) return;
    const double reach = arm_.forward * std::sqrt(std::max(radius * radius - d * d, 0.0));
    const double heading = radius > 0.0 ? ir::arc_tangent(centre.y, centre.x) : 0.0;
    for (int back = 0; back < 2; ++back)
      arm(heading, back ? -reach : reach, centre, turned, 4 * back, index, out);
  }

 private:
  void arm(double heading, double reach, const Vec& centre, const Mat& turned, int branch, long index,
           IkSolutions& out) const {
    double q[6];
    q[0] = heading - ir::arc_tangent(arm_.lateral, reach);
    const Complex target = Complex{centre.z, reach} - shoulder_;
    const double distance = size(target), longest = upper_length_ + fore_length_;
    const double shortest = std::abs(upper_length_ - fore_length_);
    if (distance > longest + kReachTolerance || distance < shortest - kReachTolerance) return;
    const bool stretched = distance > longest || distance < shortest;
    double cosine = (distance * distance - upper_length_ * upper_length_ - fore_length_ * fore_length_) /
                    (2.0 * upper_length_ * fore_length_);
    cosine = stretched ? std::copysign(1.0, cosine) : std::clamp(cosine, -1.0, 1.0);
    const double sine = std::sqrt((1.0 - cosine) * (1.0 + cosine));
    const double bend = ir::arc_tangent(sine, cosine);
    const double s1 = ir::sine(q[0]), c1 = ir::cosine(q[0]);
    const auto unturn = [=](const Vec& v) { return Vec{c1 * v.x + s1 * v.y, c1 * v.y - s1 * v.x, v.z}; };
    const Vec pointing = unturn(turned * z6_), across = unturn(turned * z5_);
    for (int low = 0; low < (stretched ? 1 : 2); ++low) {
      const Complex turn = times(Complex{cosine, low ? -sine : sine}, unopened_);
      const Complex elbow = upper_ + times(fore_, turn);
      const Complex shoulder = times(target, std::conj(elbow));
      q[1] = ir::arc_tangent(shoulder.imag(), shoulder.real());
      q[2] = arm_.elbow_sign * ((low ? -bend : bend) - opening_);
      const double length = size(shoulder);
      const Complex lift = length > 0.0 ? times(shoulder / length, turn) : turn;  // exp(i (q2 +- q3))
      wrist(q, lift, pointing, across, branch + 2 * low, index, out);
    }
  }

  void wrist(double* q, Complex lift, const Vec& pointing, const Vec& across, int branch, long index,
             IkSolutions& out) const {
    const double cosine = lift.real(), sine = lift.imag();
    const auto unlift = [=](const Vec& v) { return Vec{cosine * v.x - sine * v.z, v.y, sine * v.x + cosine * v.z}; };
    const Vec p = unlift(pointing), v = unlift(across);
    const double c = dot(p, z4_), a = dot(p, z5_), b = dot(p, e3_);
    const double s = std::sqrt(a * a + b * b);
    const bool singular = s < kSingularWrist;
    const double q4 = singular ? free_q4_ : ir::arc_tangent(a, -b);
    const double s4 = singular ? ir::sine(q4) : a / s, c4 = singular ? ir::cosine(q4) : -b / s;
    const double v1 = dot(v, z4_), v2 = dot(v, z5_), v3 = dot(v, e3_);
    const double q5 = ir::arc_tangent(s, c);
    const double q6 = ir::arc_tangent(v1 * s + (c4 * v3 - s4 * v2) * c, c4 * v2 + s4 * v3);
    q[3] = q4;
    q[4] = q5 - arm_.wrist_zero;
    q[5] = q6;
    all_turns(q, branch, index, out);
    if (singular) return;
    q[3] = q4 > 0.0 ? q4 - M_PI : q4 + M_PI;
    q[4] = -q5 - arm_.wrist_zero;
    q[5] = q6 > 0.0 ? q6 - M_PI : q6 + M_PI;
    all_turns(q, branch + 1, index, out);
  }

  void all_turns(const double* q, int branch, long index, IkSolutions& out) const {
    double first[6];
    int count[6], k[6] = {};
    for (int j = 0; j < 6; ++j) {
      const double from = std::ceil((arm_.low[j] - kLimitTolerance - q[j]) / kTurn);
      const double to = std::floor((arm_.high[j] + kLimitTolerance - q[j]) / kTurn);
      if (to < from) return;
      first[j] = q[j] + kTurn * from;
      count[j] = static_cast<int>(to - from) + 1;
    }
    for (;;) {
      for (int j = 0; j < 6; ++j)
        out.q.push_back(std::clamp(first[j] + kTurn * k[j], arm_.low[j], arm_.high[j]));
      out.pose.push_back(index);
      out.branch.push_back(branch);
      int j = 5;
      while (j >= 0 && ++k[j] == count[j]) k[j--] = 0;
      if (j < 0) return;
    }
  }

  const SphericalArm& arm_;
  Mat plane_, hand_to_plane_, to_base_, from_tcp_;
  Vec z4_, z5_, z6_, e3_;
  Complex shoulder_, upper_, fore_, unopened_;
  double upper_length_, fore_length_, opening_, free_q4_;
};

}  // namespace

IkSolutions solve(const SphericalArm& arm, const double* poses, long N) {
  IkSolutions out;
  for (long k = 0; k < N; ++k)
    if (!is_rigid(poses + 16 * k)) {
      out.refused = k;
      return out;
    }
  const Solver solver(arm);
  out.q.reserve(6 * 20 * N);
  out.pose.reserve(20 * N);
  out.branch.reserve(20 * N);
  for (long k = 0; k < N; ++k) solver.solve(poses + 16 * k, k, out);
  return out;
}

}  // namespace ir::inverse
