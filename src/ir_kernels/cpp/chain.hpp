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
  int only[3];      // of each of its columns the only row that isn't 0, or -1
  double shift[3];  // origin of this one in the previous internal frame
};

template <class V> struct Frame {
  Vec<V> x, y, z, origin;
};

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

 private:
  static constexpr int most_at_once = 16;  // joints whose sines are computed ahead
};

template <class V> IR_INLINE Vec<V> place(const Frame<V>& f, const double p[3]) {
  const V x = splat<V>(Scalar<V>(p[0])), y = splat<V>(Scalar<V>(p[1])), z = splat<V>(Scalar<V>(p[2]));
  return {f.origin.x + x * f.x.x + y * f.y.x + z * f.z.x, f.origin.y + x * f.x.y + y * f.y.y + z * f.z.y,
          f.origin.z + x * f.x.z + y * f.y.z + z * f.z.z};
}

}  // namespace ir
