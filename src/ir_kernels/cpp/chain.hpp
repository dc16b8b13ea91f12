// A serial chain of revolute joints, the first of which may slide instead (a rail under the arm); forward kinematics for
// eight configurations at a time.
//
// Every link carries an internal frame (chosen once, at construction): z is its joint's axis, x the common normal of
// that and the next one, as Denavit and Hartenberg have it. World coordinates are taken relative to the base's origin.
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

// From the frame before: about its x by alpha, which brings its z to the joint's axis, then about that by q + offset.
struct Joint {
  enum Turn { parallel, perpendicular, oblique };
  Turn turn;
  double cosine, sine;  // of alpha; perpendicular: 0 and 1
  double offset;        // [rad]
  Local shift;          // origin in the frame before

  // y after the first turn, and the axis
  template <class V> IR_INLINE void tilt(const Frame<V>& f, Vec<V>& y, Vec<V>& axis) const {
    if (turn == parallel) {
      y = f.y, axis = f.z;
    } else if (turn == perpendicular) {
      y = f.z, axis = {-f.y.x, -f.y.y, -f.y.z};
    } else {
      const V c = splat<V>(Scalar<V>(cosine)), s = splat<V>(Scalar<V>(sine));
      y = c * f.y + s * f.z, axis = c * f.z - s * f.y;
    }
  }
};

struct Chain {
  int n = 0;
  bool first_slides = false;  // joint 1 moves along its axis by q[0] [m]
  double base_origin[3];
  Frame<Double8> base;
  std::vector<Joint> joints;
  std::vector<double> internal;  // (n + 1) x 9: internal frame in the link's own frame, row major

  // joint_origin (n, 4, 4), joint_axis (n, 3), base_pose (4, 4), all row major
  Chain(int joints, const double* joint_origin, const double* joint_axis, const double* base_pose, bool first_slides);

  // a point of a link's own frame in its internal frame
  void to_internal(int link, const double point[3], double result[3]) const;

  // frames[0..n] at q[0..n-1]
  void forward(const Double8* q, Frame<Double8>* frames) const;

 private:
  static constexpr int most_at_once = 16;  // joints whose sines are computed ahead
};

template <class V> IR_INLINE Vec<V> place(const Frame<V>& f, const Local& p) { return p.after(f.origin, f); }

}  // namespace ir
