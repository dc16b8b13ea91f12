#include "chain.hpp"

#include <algorithm>
#include <cmath>

#include "elementary.hpp"

namespace ir {
namespace {

constexpr double aligned = 1e-15;  // sines and cosines below count as zero

void multiply(const double a[9], const double b[9], double r[9]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) r[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}
void transposed_times(const double a[9], const double* b, int columns, double* r) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < columns; ++j)
      r[columns * i + j] = a[i] * b[j] + a[3 + i] * b[columns + j] + a[6 + i] * b[2 * columns + j];
}

void cross(const double a[3], const double b[3], double r[3]) {
  r[0] = a[1] * b[2] - a[2] * b[1], r[1] = a[2] * b[0] - a[0] * b[2], r[2] = a[0] * b[1] - a[1] * b[0];
}
double dot(const double a[3], const double b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Columns x, y, z: z the unit vector `axis`, x perpendicular to it and to `next`; where that leaves it open, made of
// zeros and ones where the axis is.
void frame_about(const double axis[3], const double next[3], double r[9]) {
  double x[3], y[3];
  cross(axis, next, x);
  if (dot(x, x) < aligned * aligned) {
    int least = 0;
    for (int i = 1; i < 3; ++i)
      if (std::fabs(axis[i]) < std::fabs(axis[least])) least = i;
    for (int i = 0; i < 3; ++i) x[i] = (i == least) - axis[least] * axis[i];
  }
  const double length = std::sqrt(dot(x, x));
  for (double& c : x) c /= length;
  cross(axis, x, y);
  for (int i = 0; i < 3; ++i) r[3 * i] = x[i], r[3 * i + 1] = y[i], r[3 * i + 2] = axis[i];
}

}  // namespace

Chain::Chain(int count, const double* joint_origin, const double* joint_axis, const double* base_pose, bool slides)
    : n(count), first_slides(slides), joints(count), internal(9 * (count + 1)) {
  // the joints' rotations at q = 0, their origins, and their axes, each in the frame of the link before
  std::vector<double> turn(9 * n), shift(3 * n), axis(3 * (n + 1), 0.0);
  for (int k = 0; k < n; ++k) {
    const double* pose = joint_origin + 16 * k;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) turn[9 * k + 3 * i + j] = pose[4 * i + j];
      shift[3 * k + i] = pose[4 * i + 3];
    }
    for (int i = 0; i < 3; ++i) axis[3 * k + i] = dot(&turn[9 * k + 3 * i], joint_axis + 3 * k);
  }
  for (int k = 0; k < n; ++k) frame_about(joint_axis + 3 * k, &axis[3 * (k + 1)], &internal[9 * (k + 1)]);
  multiply(&turn[0], &internal[9], &internal[0]);  // of the base: what the first one is at q = 0
  for (int k = 0; k < n; ++k) {
    double turned[9], step[9], local[3];
    multiply(&turn[9 * k], &internal[9 * (k + 1)], turned);
    transposed_times(&internal[9 * k], turned, 3, step);  // from frame to frame at q = 0
    transposed_times(&internal[9 * k], &shift[3 * k], 1, local);
    Joint& joint = joints[k];
    joint.shift = Local(local);
    // the axis is (0, -sine, cosine), x is (cos offset, cosine sin offset, sine sin offset)
    joint.cosine = step[8], joint.sine = -step[5];
    joint.turn = std::fabs(joint.sine) < aligned && joint.cosine > 0 ? Joint::parallel
                 : std::fabs(joint.cosine) < aligned                 ? Joint::perpendicular
                                                                     : Joint::oblique;
    joint.offset = ir::arc_tangent(joint.cosine * step[3] + joint.sine * step[6], step[0]);
  }
  double base_turn[9];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) base_turn[3 * i + j] = base_pose[4 * i + j];
    base_origin[i] = base_pose[4 * i + 3];
  }
  double columns[9];
  multiply(base_turn, &internal[0], columns);
  const auto column = [&](int j) {
    return Vec<Double8>{splat<Double8>(columns[j]), splat<Double8>(columns[3 + j]), splat<Double8>(columns[6 + j])};
  };
  base = {column(0), column(1), column(2), Vec<Double8>{}};
}

void Chain::to_internal(int link, const double point[3], double result[3]) const {
  transposed_times(&internal[9 * link], point, 1, result);
}

void Chain::forward(const Double8* q, Frame<Double8>* frames) const {
  Frame<Double8> f = base;
  frames[0] = f;
  Double8 angles[most_at_once], sines[most_at_once], cosines[most_at_once];
  for (int k = 0; k < n; ++k) {
    const Joint& joint = joints[k];
    if (k % most_at_once == 0) {
      const int ahead = std::min(n - k, most_at_once);
      for (int j = 0; j < ahead; ++j) angles[j] = q[k + j] + joints[k + j].offset;
      if (k == 0 && first_slides) angles[0] = splat<Double8>(joints[0].offset);
      sincos(ahead, angles, sines, cosines);
    }
    const Double8 s = sines[k % most_at_once], c = cosines[k % most_at_once];
    Vec<Double8> y, axis;
    joint.tilt(f, y, axis);
    f.origin = place(f, joint.shift);
    f.y = c * y - s * f.x;
    f.x = c * f.x + s * y;
    f.z = axis;
    if (k == 0 && first_slides) f.origin = f.origin + q[0] * axis;
    frames[k + 1] = f;
  }
}

}  // namespace ir
