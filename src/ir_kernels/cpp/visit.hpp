// Visits the pairs that may matter: whole lane groups are skipped by cheap lower bounds of the distance.
//
// A policy says how far is near enough: a pair z of capsule c may be skipped where its distance certainly exceeds
// outside(c) + shift[z] (self pair i: own(i) + shift[z]) in every lane; else take(z, c or i, distance) gets the exact
// values. farthest(c) is the highest lane of outside(c).
// shift[z] = -inf: the pair doesn't count.
#pragma once

#include "model.hpp"

namespace ir {

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
  const S shift = policy.shift[z];
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
IR_INLINE void visit_environment(const Model& model, const State<V>& s, int c, Policy& policy) {
  using S = Scalar<V>;
  const Capsule& capsule = model.capsules[c];
  const S radius = static_cast<S>(capsule.radius);
  for (const int body : model.planes) {
    const std::int32_t z = model.pair_of[c * model.kind.size() + body];
    if (z < 0 || policy.shift[z] == -std::numeric_limits<S>::infinity()) continue;
    const Body<S>& f = model.bodies<S>()[body];
    const auto height = [&](const Vec<V>& p) {
      return f.axis[2][0] * p.x + (f.axis[2][1] * p.y + (f.axis[2][2] * p.z - f.offset[2]));
    };
    const V distance = min(height(s.a[c]), height(s.b[c])) - radius;
    if (any_not_above<V>(distance, policy.outside(c) + policy.shift[z])) policy.take(z, c, distance);
  }
  if (model.leaves.empty()) return;
  // A ball about the capsule in all lanes: around the middle of one of them.
  const Vec<V>& m = s.middle[c];
  constexpr int lane = Lanes<V>::width / 2;
  const S x = m.x[lane], y = m.y[lane], z = m.z[lane];
  const V dx = m.x - x, dy = m.y - y, dz = m.z - z;
  const S spread = std::sqrt(highest<V>(dx * dx + dy * dy + dz * dz));
  const S around = spread + S(capsule.half) + radius;
  const Float16 zero{};
  for (const Leaf& leaf : model.leaves) {
    const float reach = static_cast<float>(around + policy.farthest(c) + policy.highest_shift) * 1.00001f + 1e-5f;
    const Float16 px = splat<Float16>(float(x)), py = splat<Float16>(float(y)), pz = splat<Float16>(float(z));
    const Float16 gx = max(max(leaf.low[0] - px, px - leaf.high[0]), zero);
    const Float16 gy = max(max(leaf.low[1] - py, py - leaf.high[1]), zero);
    const Float16 gz = max(max(leaf.low[2] - pz, pz - leaf.high[2]), zero);
    const float limit = reach > 0.0f ? reach * reach : 0.0f;
    std::uint32_t near = bits(gx * gx + gy * gy + gz * gz <= limit);
    for (; near != 0; near &= near - 1) {
      const int body = leaf.body[__builtin_ctz(near)];
      if (body >= 0) visit_body(model, s, c, body, policy);
    }
  }
}

template <class V, class Policy> IR_INLINE void visit_self(const Model& model, const State<V>& s, Policy& policy) {
  using S = Scalar<V>;
  const std::size_t outside = model.environment.size();
  for (std::size_t i = 0; i < model.self_pairs.size(); ++i) {
    const S shift = policy.shift[outside + i];
    if (shift == -std::numeric_limits<S>::infinity()) continue;
    const SelfPair& pair = model.self_pairs[i];
    const Vec<V> gap = s.middle[pair.a] - s.middle[pair.b];
    if (!may_matter<V>(dot(gap, gap), policy.own(i) + (shift + static_cast<S>(pair.around)))) continue;
    policy.take(static_cast<int>(outside + i), static_cast<int>(i), self_distance(model, s, pair));
  }
}

// All pairs: the robot's own first, they are near in most configurations; then from the tool to the base.
template <class V, class Policy> IR_INLINE void visit(const Model& model, const State<V>& s, Policy& policy) {
  visit_self(model, s, policy);
  for (int c = static_cast<int>(model.capsules.size()) - 1; c >= 0; --c) {
    if (policy.done()) return;
    if (model.capsules[c].link > 0) visit_environment(model, s, c, policy);
  }
}

}  // namespace ir
