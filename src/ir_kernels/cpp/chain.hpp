// A serial chain of revolute joints, forward kinematics for eight configurations at a time.
//
// Every link carries an internal frame whose z axis is its joint's axis (chosen once, at construction), so that a joint
// turns x and y of the frame and leaves z alone. World coordinates are taken relative to the base's origin.
#pragma once

#include <vector>

#include "lanes.hpp"

namespace ir {

struct Joint {
  double turn[9];   // fixed rotation from the previous internal frame to this one at q = 0, row major
  double shift[3];  // origin of this one in the previous internal frame
};

template <class V> struct Frame {
  Vec<V> x, y, z, origin;
};

// acc + k v where k is often 0 or 1
template <class V> IR_INLINE void add_scaled(Vec<V>& acc, double k, const Vec<V>& v) {
  if (k == 0.0) return;
  const V s = splat<V>(Scalar<V>(k));
  acc = {acc.x + s * v.x, acc.y + s * v.y, acc.z + s * v.z};
}

struct Chain {
  int n = 0;
  double base_turn[9], base_origin[3];
  std::vector<Joint> joints;
  std::vector<double> internal;  // (n + 1) x 9: internal frame in the link's own frame, row major

  // joint_origin (n, 4, 4), joint_axis (n, 3), base_pose (4, 4), all row major
  Chain(int joints, const double* joint_origin, const double* joint_axis, const double* base_pose);

  // a point of a link's own frame in its internal frame
  void to_internal(int link, const double point[3], double result[3]) const;

  // frames[0..n] at q[0..n-1]
  void forward(const Double8* q, Frame<Double8>* frames) const;
};

template <class V> IR_INLINE Vec<V> place(const Frame<V>& f, const double p[3]) {
  Vec<V> r = f.origin;
  add_scaled(r, p[0], f.x);
  add_scaled(r, p[1], f.y);
  add_scaled(r, p[2], f.z);
  return r;
}

}  // namespace ir
