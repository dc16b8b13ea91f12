// A serial chain of revolute joints, forward kinematics for eight configurations at a time.
//
// Every link carries an internal frame whose z axis is its joint's axis (chosen once, at construction), so that a joint
// turns x and y of the frame and leaves z alone. World coordinates are taken relative to the base's origin.
#pragma once

#include <vector>

#include "lanes.hpp"

namespace ir {

template <class V> struct Frame {
  Vec<V> x, y, z, origin;
};

// A vector in a link's internal frame, in both precisions; most coordinates are 0 and cost nothing.
class Local {
 public:
  Local() = default;
  explicit Local(const double v[3]) {
    for (int i = 0; i < 3; ++i) exact_[i] = v[i], rounded_[i] = static_cast<float>(v[i]), has_[i] = v[i] != 0.0;
  }
  double operator[](int i) const { return exact_[i]; }
  bool is_zero() const { return !has_[0] && !has_[1] && !has_[2]; }
  // p + this vector, seen from the world
  template <class V> IR_INLINE Vec<V> after(Vec<V> p, const Frame<V>& f) const {
    if (has_[0]) p = p + at<V>(0) * f.x;
    if (has_[1]) p = p + at<V>(1) * f.y;
    if (has_[2]) p = p + at<V>(2) * f.z;
    return p;
  }
  // p - this vector
  template <class V> IR_INLINE Vec<V> before(Vec<V> p, const Frame<V>& f) const {
    if (has_[0]) p = p - at<V>(0) * f.x;
    if (has_[1]) p = p - at<V>(1) * f.y;
    if (has_[2]) p = p - at<V>(2) * f.z;
    return p;
  }

 private:
  template <class V> IR_INLINE V at(int i) const {
    if constexpr (sizeof(Scalar<V>) == 4) return splat<V>(rounded_[i]);
    else return splat<V>(exact_[i]);
  }
  double exact_[3];
  float rounded_[3];
  bool has_[3];
};

struct Joint {
  double turn[9];  // fixed rotation from the previous internal frame to this one at q = 0, row major
  int only[3];     // of each of its columns the only row that isn't 0, or -1
  Local shift;     // origin of this one in the previous internal frame
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

template <class V> IR_INLINE Vec<V> place(const Frame<V>& f, const Local& p) { return p.after(f.origin, f); }

}  // namespace ir
