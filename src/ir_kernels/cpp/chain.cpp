#include "chain.hpp"

#include <algorithm>
#include <cmath>

namespace ir {
namespace {

void multiply(const double a[9], const double b[9], double r[9]) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) r[3 * i + j] = a[3 * i] * b[j] + a[3 * i + 1] * b[3 + j] + a[3 * i + 2] * b[6 + j];
}
void transposed_times(const double a[9], const double* b, int columns, double* r) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < columns; ++j)
      r[columns * i + j] = a[i] * b[j] + a[3 + i] * b[columns + j] + a[6 + i] * b[2 * columns + j];
}

// A rotation whose third column is the unit vector `axis`, made of zeros and ones where the axis is.
void frame_about(const double axis[3], double r[9]) {
  int least = 0;
  for (int i = 1; i < 3; ++i)
    if (std::fabs(axis[i]) < std::fabs(axis[least])) least = i;
  double x[3] = {0, 0, 0};
  x[least] = 1.0;
  double length = 0.0;
  for (int i = 0; i < 3; ++i) x[i] -= axis[least] * axis[i];
  for (double c : x) length += c * c;
  for (double& c : x) c /= std::sqrt(length);
  const double y[3] = {axis[1] * x[2] - axis[2] * x[1], axis[2] * x[0] - axis[0] * x[2],
                       axis[0] * x[1] - axis[1] * x[0]};
  for (int i = 0; i < 3; ++i) r[3 * i] = x[i], r[3 * i + 1] = y[i], r[3 * i + 2] = axis[i];
}

}  // namespace

Chain::Chain(int count, const double* joint_origin, const double* joint_axis, const double* base_pose)
    : n(count), joints(count), internal(9 * (count + 1), 0.0) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) base_turn[3 * i + j] = base_pose[4 * i + j];
    base_origin[i] = base_pose[4 * i + 3];
    internal[4 * i] = 1.0;
  }
  for (int k = 0; k < n; ++k) {
    const double* pose = joint_origin + 16 * k;
    double turn[9], shift[3], turned[9], local[3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) turn[3 * i + j] = pose[4 * i + j];
      shift[i] = pose[4 * i + 3];
    }
    frame_about(joint_axis + 3 * k, &internal[9 * (k + 1)]);
    multiply(turn, &internal[9 * (k + 1)], turned);
    transposed_times(&internal[9 * k], turned, 3, joints[k].turn);
    transposed_times(&internal[9 * k], shift, 1, local);
    joints[k].shift = Local(local);
    for (int j = 0; j < 3; ++j) {
      int used = 0;
      for (int i = 0; i < 3; ++i)
        if (joints[k].turn[3 * i + j] != 0.0) ++used, joints[k].only[j] = i;
      if (used != 1) joints[k].only[j] = -1;
    }
  }
}

void Chain::to_internal(int link, const double point[3], double result[3]) const {
  transposed_times(&internal[9 * link], point, 1, result);
}

void Chain::forward(const Double8* q, Frame<Double8>* frames) const {
  Frame<Double8> f;
  const auto column = [&](int j) {
    return Vec<Double8>{splat<Double8>(base_turn[j]), splat<Double8>(base_turn[3 + j]), splat<Double8>(base_turn[6 + j])};
  };
  f.x = column(0), f.y = column(1), f.z = column(2);
  f.origin = Vec<Double8>{};
  frames[0] = f;
  Double8 sines[most_at_once], cosines[most_at_once];
  for (int k = 0; k < n; ++k) {
    if (k % most_at_once == 0) sincos(std::min(n - k, most_at_once), q + k, sines, cosines);
    const Joint& joint = joints[k];
    const Vec<Double8> columns[3] = {f.x, f.y, f.z}, origin = place(f, joint.shift);
    Vec<Double8> turned[3];
    for (int j = 0; j < 3; ++j) {
      if (joint.only[j] >= 0) {  // axes along or across each other: most robots
        turned[j] = splat<Double8>(joint.turn[3 * joint.only[j] + j]) * columns[joint.only[j]];
      } else {
        turned[j] = splat<Double8>(joint.turn[j]) * f.x + splat<Double8>(joint.turn[3 + j]) * f.y +
                    splat<Double8>(joint.turn[6 + j]) * f.z;
      }
    }
    const Double8 s = sines[k % most_at_once], c = cosines[k % most_at_once];
    f.x = c * turned[0] + s * turned[1];
    f.y = c * turned[1] - s * turned[0];
    f.z = turned[2];
    f.origin = origin;
    frames[k + 1] = f;
  }
}

}  // namespace ir
