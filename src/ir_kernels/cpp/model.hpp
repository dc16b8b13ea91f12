// The robot's capsules, the bodies of a scene and their pairs; and all of them at 16 (or 8) configurations at once.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "chain.hpp"
#include "hull.hpp"
#include "segments.hpp"

namespace ir {

enum Kind : int { box, cylinder, sphere, capsule, plane, mesh };  // the order of ir_kernels.scene.KINDS

// A body in the precision of the lanes. Local coordinate i of a world point p is axis[i] . p - offset[i]; the solid
// lies within +-half in them.
template <class S> struct Body {
  S axis[3][3], offset[3], half[3];
  S radius, half_length;  // cylinder, sphere, capsule
};

struct Capsule {
  int link;
  Local middle, axis;  // half an axis: from the middle to the second end
  double radius, half, inverse_square;
};

struct SelfPair {
  int a, b;          // capsules
  int outer, inner;  // the same, the outer one on the link that is farther from the base
  double radii;      // their sum
  double around;     // and the half lengths
  int longer, shorter;
  double longer_half;
};

// Boxes along the world's axes (relative to the base's origin), for culling: of a body, and of up to sixteen neighbours.
struct Box {
  float centre[3], half[3];
  int body;
};
struct Leaf {
  Box around;
  std::vector<Box> boxes;
};

class Model {
 public:
  Chain chain;
  std::vector<Capsule> capsules;
  std::vector<int> kind;
  std::vector<Body<float>> bodies_float;
  std::vector<Body<double>> bodies_double;
  std::vector<Hull> hulls;
  std::vector<std::array<int, 2>> environment;
  std::vector<SelfPair> self_pairs;
  std::vector<std::int32_t> pair_of;  // capsule x body -> pair, -1: not kept
  std::vector<int> planes;
  std::vector<std::vector<int>> capsules_of;  // each link
  std::vector<Leaf> leaves;
  std::vector<float> ball_radius;     // of each capsule, whole sixteens
  std::vector<std::uint32_t> moving;  // a bit per capsule that isn't part of the base, in sixteens
  double float_margin;  // [m] more than 16 lanes of floats lose
  bool wide;            // too large for floats: 8 lanes of doubles throughout

  explicit Model(Chain c) : chain(std::move(c)) {}
  int pairs() const { return static_cast<int>(environment.size() + self_pairs.size()); }
  int body_count() const { return static_cast<int>(kind.size()); }
  template <class S> const std::vector<Body<S>>& bodies() const {
    if constexpr (sizeof(S) == 4) return bodies_float;
    else return bodies_double;
  }
  // Fills what follows from capsules, bodies and pairs.
  void finish();
};

// In lanes: origins and axes of the joints (of 1..n, the link they move), middles of all capsules (and zeros up to whole
// sixteens) and half of their axes.
template <class V> struct State {
  std::vector<Vec<V>> origin, axis, middle, half;
  IR_INLINE Vec<V> start(int c) const { return middle[c] - half[c]; }
  IR_INLINE Vec<V> end(int c) const { return middle[c] + half[c]; }
};

// Evaluates configurations, Lanes<V>::width at a time, without allocating again. The kinematics is always computed in
// double.
template <class V> class Placement {
 public:
  explicit Placement(const Model& model);
  // rows: q of each lane (n values); fills the state. Lanes beyond `count` repeat the last one.
  void place(const double* const* rows, int count);
  State<V> state;
  std::vector<Frame<Double8>> exact[2];  // the frames in double, of lanes 0..7 and 8..15

 private:
  void put(int capsule, const Frame<V>& f);
  const Model& model_;
  std::vector<Double8> q_;
  Frame<V> base_;
};

template <class V> IR_INLINE Vec<V> to_local(const Body<Scalar<V>>& f, const Vec<V>& p) {
  return {f.axis[0][0] * p.x + (f.axis[0][1] * p.y + (f.axis[0][2] * p.z - f.offset[0])),
          f.axis[1][0] * p.x + (f.axis[1][1] * p.y + (f.axis[1][2] * p.z - f.offset[1])),
          f.axis[2][0] * p.x + (f.axis[2][1] * p.y + (f.axis[2][2] * p.z - f.offset[2]))};
}

template <class V> IR_INLINE Vec<V> turn_local(const Body<Scalar<V>>& f, const Vec<V>& v) {
  return {f.axis[0][0] * v.x + f.axis[0][1] * v.y + f.axis[0][2] * v.z,
          f.axis[1][0] * v.x + f.axis[1][1] * v.y + f.axis[1][2] * v.z,
          f.axis[2][0] * v.x + f.axis[2][1] * v.y + f.axis[2][2] * v.z};
}

template <class V> IR_INLINE Vec<V> splat3(const Scalar<V> v[3]) {
  return {splat<V>(v[0]), splat<V>(v[1]), splat<V>(v[2])};
}

// Signed distance of capsule axes from a body, both in the body's frame (surface of the body, axis of the capsule).
// Not inlined: one instance for all queries keeps the build short.
template <class V> V axis_distance(const Model& model, int body, int capsule_index, const Vec<V>& a, const Vec<V>& b);

// Squared distance of the axes.
template <class V> IR_INLINE V square_between(const Model& model, const State<V>& s, const SelfPair& pair) {
  using S = Scalar<V>;
  const Capsule &first = model.capsules[pair.a], &second = model.capsules[pair.b];
  const Vec<V>&a = s.half[pair.a], &b = s.half[pair.b];
  const auto p = segment_segment(s.start(pair.a), a + a, splat<V>(S(first.inverse_square)), s.start(pair.b), b + b,
                                 splat<V>(S(second.inverse_square)));
  return dot(p.gap, p.gap);
}

template <class V> IR_INLINE V environment_distance(const Model& model, const State<V>& s, int c, int body) {
  const auto& f = model.bodies<Scalar<V>>()[body];
  return axis_distance<V>(model, body, c, to_local<V>(f, s.start(c)), to_local<V>(f, s.end(c))) -
         Scalar<V>(model.capsules[c].radius);
}

template <class V> V pair_distance(const Model& model, const State<V>& s, int z) {
  const int outside = static_cast<int>(model.environment.size());
  if (z >= outside) {
    const SelfPair& pair = model.self_pairs[z - outside];
    return sqrt(square_between(model, s, pair)) - Scalar<V>(pair.radii);
  }
  return environment_distance(model, s, model.environment[z][0], model.environment[z][1]);
}

}  // namespace ir
