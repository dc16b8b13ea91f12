// Visits the pairs that may matter: whole lane groups are skipped by cheap lower bounds of the distance.
//
// A policy says how far is near enough: a pair z of capsule c may be skipped where its distance certainly exceeds
// outside(c) + shift.of[z] (self pair i: own(i) + shift.of[z]) in every lane; else take(z, c or i, distance) gets the exact
// values. farthest(first) is the highest lane of outside(c) +
// the highest shift, for sixteen capsules from `first`.
// shift.of[z] = -inf: the pair doesn't count.
#pragma once

#include <algorithm>
#include <limits>

#include "model.hpp"

namespace ir {

// What is taken off each pair's distance, and with it how near the middles of a self pair have to be to matter.
template <class S> struct Shifts {
  std::vector<S> of, self_reach;
  S highest = 0;

  Shifts(const Model& model, const double* values) : of(values, values + model.pairs()) {
    if (!of.empty()) highest = *std::max_element(of.begin(), of.end());
    for (std::size_t i = 0; i < model.self_pairs.size(); ++i)
      self_reach.push_back(of[model.environment.size() + i] + static_cast<S>(model.self_pairs[i].around));
  }
};

template <class V> IR_INLINE V square_beyond(const Vec<V>& p, const Scalar<V> half[3]) {
  const V zero{};
  const V x = max(abs(p.x) - half[0], zero), y = max(abs(p.y) - half[1], zero), z = max(abs(p.z) - half[2], zero);
  return x * x + y * y + z * z;
}

// Squared distance of the box around a segment from a box, both in the frame of the latter.
template <class V> IR_INLINE V square_apart(const Vec<V>& a, const Vec<V>& b, const Scalar<V> half[3]) {
  const V zero{};
  const V x = max(max(min(a.x, b.x), -max(a.x, b.x)) - half[0], zero);
  const V y = max(max(min(a.y, b.y), -max(a.y, b.y)) - half[1], zero);
  const V z = max(max(min(a.z, b.z), -max(a.z, b.z)) - half[2], zero);
  return x * x + y * y + z * z;
}

// Outside solids, signed distance >= distance of the enclosing volumes: a lane is skipped where that is positive and
// exceeds `need`.
template <class V> IR_INLINE bool may_matter(V square, V need) {
  const V positive = max(need, V{});
  return any_not_above<V>(square, positive * positive);
}

template <class V, class Policy>
IR_INLINE void visit_body(const Model& model, const State<V>& s, int c, int body, Policy& policy) {
  using S = Scalar<V>;
  const std::int32_t z = model.pair_of[c * model.kind.size() + body];
  if (z < 0) return;
  const S shift = policy.shift.of[z];
  if (shift == -std::numeric_limits<S>::infinity()) return;
  const Capsule& capsule = model.capsules[c];
  const S radius = static_cast<S>(capsule.radius);
  const Body<S>& f = model.bodies<S>()[body];
  const V need = policy.outside(c) + (shift + radius);
  if (!may_matter<V>(square_beyond(to_local<V>(f, s.middle[c]), f.half), need + static_cast<S>(capsule.half))) return;
  const Vec<V> a = to_local<V>(f, s.a[c]), b = to_local<V>(f, s.b[c]);
  if (!may_matter<V>(square_apart(a, b, f.half), need)) return;
  policy.take(z, c, axis_distance<V>(model, body, c, a, b) - radius);
}

template <class V, class Policy>
IR_INLINE void visit_planes(const Model& model, const State<V>& s, Policy& policy) {
  using S = Scalar<V>;
  for (const int body : model.planes) {
    const Body<S>& f = model.bodies<S>()[body];
    const auto height = [&](const Vec<V>& p) {
      return f.axis[2][0] * p.x + (f.axis[2][1] * p.y + (f.axis[2][2] * p.z - f.offset[2]));
    };
    for (int c = static_cast<int>(model.capsules.size()) - 1; c >= 0; --c) {
      const std::int32_t z = model.pair_of[c * model.kind.size() + body];
      if (z < 0 || policy.shift.of[z] == -std::numeric_limits<S>::infinity()) continue;
      const V distance = min(height(s.a[c]), height(s.b[c])) - static_cast<S>(model.capsules[c].radius);
      if (any_not_above<V>(distance, policy.outside(c) + policy.shift.of[z])) policy.take(z, c, distance);
    }
  }
}

// Balls around sixteen capsules, each in all configurations of the group: around the capsule's middle in one of them.
struct Balls {
  Float16 x, y, z, radius;
};

template <class V> IR_INLINE Balls balls_around(const Model& model, const State<V>& s, std::size_t first) {
  constexpr int lane = Lanes<V>::width / 2;
  Balls b;
  b.x = b.y = b.z = splat<Float16>(1e30f);  // link 0, and places without a capsule: nowhere
  Float16 spread{}, own{};
  const std::size_t count = std::min<std::size_t>(16, model.capsules.size() - first);
  for (std::size_t k = 0; k < count; ++k) {
    const Capsule& capsule = model.capsules[first + k];
    if (capsule.link == 0) continue;
    const Vec<V>& m = s.middle[first + k];
    const Scalar<V> x = m.x[lane], y = m.y[lane], z = m.z[lane];
    const V dx = m.x - x, dy = m.y - y, dz = m.z - z;
    spread[k] = static_cast<float>(highest<V>(dx * dx + dy * dy + dz * dz));
    own[k] = static_cast<float>(capsule.half + capsule.radius);
    b.x[k] = static_cast<float>(x);
    b.y[k] = static_cast<float>(y);
    b.z[k] = static_cast<float>(z);
  }
  b.radius = sqrt(spread) + own;
  return b;
}

// Which balls come nearer than `reach` to a box along the world's axes.
IR_INLINE std::uint32_t near(const Balls& b, const Float16& reach, const float low[3], const float high[3]) {
  const Float16 zero{}, limit = clamp(reach, zero, splat<Float16>(1e15f));  // finite: nowhere stays out
  const Float16 x = max(max(low[0] - b.x, b.x - high[0]), zero);
  const Float16 y = max(max(low[1] - b.y, b.y - high[1]), zero);
  const Float16 z = max(max(low[2] - b.z, b.z - high[2]), zero);
  return bits(x * x + y * y + z * z <= limit * limit);
}

template <class V, class Policy> IR_INLINE void visit_solids(const Model& model, const State<V>& s, Policy& policy) {
  for (std::size_t first = 0; first < model.capsules.size(); first += 16) {
    const Balls balls = balls_around(model, s, first);
    const auto reach = [&] { return (balls.radius + policy.farthest(first)) * 1.00001f + 1e-5f; };
    for (const Leaf& leaf : model.leaves) {
      if (model.leaves.size() > 1 && near(balls, reach(), leaf.low, leaf.high) == 0) continue;
      for (const Box& box : leaf.boxes) {
        for (std::uint32_t left = near(balls, reach(), box.low, box.high); left != 0; left &= left - 1)
          visit_body(model, s, static_cast<int>(first) + __builtin_ctz(left), box.body, policy);
      }
      if (policy.done()) return;
    }
  }
}

template <class V, class Policy> IR_INLINE void visit_self(const Model& model, const State<V>& s, Policy& policy) {
  using S = Scalar<V>;
  const int outside = static_cast<int>(model.environment.size()), count = static_cast<int>(model.self_pairs.size());
  for (int first = 0; first < count; first += 32) {
    std::uint32_t left = 0;  // all tests first, without a branch that could be mispredicted
    for (int i = first; i < std::min(first + 32, count); ++i) {
      const SelfPair& pair = model.self_pairs[i];
      const Vec<V> gap = s.middle[pair.a] - s.middle[pair.b];
      const bool near = may_matter<V>(dot(gap, gap), policy.own(i) + policy.shift.self_reach[i]);
      left |= static_cast<std::uint32_t>(near) << (i - first);
    }
    for (; left != 0; left &= left - 1) {
      const int i = first + __builtin_ctz(left);
      if (policy.shift.of[outside + i] == -std::numeric_limits<S>::infinity()) continue;
      policy.take(outside + i, i, self_distance(model, s, model.self_pairs[i]));
    }
  }
}

// All pairs: the robot's own first, they are near in most configurations.
template <class V, class Policy> IR_INLINE void visit(const Model& model, const State<V>& s, Policy& policy) {
  visit_self(model, s, policy);
  if (policy.done()) return;
  visit_planes(model, s, policy);
  if (policy.done()) return;
  visit_solids(model, s, policy);
}

}  // namespace ir
