// Visits the pairs that may matter: whole lane groups are skipped by cheap lower bounds of the distance.
//
// A policy says how far is near enough: a pair z of capsule c may be skipped where its distance certainly exceeds
// outside(c) + shift.of[z] (self pair i: own(i) + shift.of[z]) in every lane; else take(z, c or i, distance) gets the
// exact values. one_bound: own(i) is the same for all i. known(z): the pair was taken before. farthest(first, part) is
// the highest of eight lanes of outside(c) + the highest shift, for sixteen capsules from `first`.
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

// Whether the pair was taken.
template <class V, class Policy>
IR_INLINE bool visit_body(const Model& model, const State<V>& s, int c, int body, Policy& policy) {
  using S = Scalar<V>;
  const std::int32_t z = model.pair_of[c * model.kind.size() + body];
  if (z < 0 || policy.known(z)) return false;
  const S shift = policy.shift.of[z];
  if (shift == -std::numeric_limits<S>::infinity()) return false;
  const Capsule& capsule = model.capsules[c];
  const S radius = static_cast<S>(capsule.radius);
  const Body<S>& f = model.bodies<S>()[body];
  const V need = policy.outside(c) + (shift + radius);
  const Vec<V> middle = to_local<V>(f, s.middle[c]);
  if (!may_matter<V>(square_beyond(middle, f.half), need + static_cast<S>(capsule.half))) return false;
  const Vec<V> half = turn_local<V>(f, s.half[c]), a = middle - half, b = middle + half;
  if (!may_matter<V>(square_apart(a, b, f.half), need)) return false;
  policy.take(z, c, axis_distance<V>(model, body, c, a, b) - radius);
  return true;
}

template <class V, class Policy>
IR_INLINE bool visit_plane(const Model& model, const State<V>& s, int c, int body, Policy& policy) {
  using S = Scalar<V>;
  const std::int32_t z = model.pair_of[c * model.kind.size() + body];
  if (z < 0 || policy.known(z) || policy.shift.of[z] == -std::numeric_limits<S>::infinity()) return false;
  const Body<S>& f = model.bodies<S>()[body];
  const auto height = [&](const Vec<V>& p) { return f.axis[2][0] * p.x + (f.axis[2][1] * p.y + f.axis[2][2] * p.z); };
  const S surface = f.offset[2] + static_cast<S>(model.capsules[c].radius);
  const V distance = height(s.middle[c]) - abs(height(s.half[c])) - surface;
  if (!any_not_above<V>(distance, policy.outside(c) + policy.shift.of[z])) return false;
  policy.take(z, c, distance);
  return true;
}

// Balls around sixteen capsules, each in eight configurations: around the capsule's middle in the fifth of them.
struct Balls {
  Float16 x, y, z, radius;
};
template <class V> constexpr int eights = Lanes<V>::width / 8;

// In all lanes what is in the fifth of their eight.
IR_INLINE Float16 fifth(Float16 v) {
  return __builtin_shufflevector(v, v, 4, 4, 4, 4, 4, 4, 4, 4, 12, 12, 12, 12, 12, 12, 12, 12);
}
IR_INLINE Double8 fifth(Double8 v) { return splat<Double8>(v[4]); }

// Of sixteen registers, of(0) to of(15), one number per eight lanes: to[0] has the first eight's, to[1] the second's.
// In three steps, lanes are merged with those two, one and four places further.
template <class Of, class Merge> IR_INLINE void across(Of of, Merge merge, Float16 to[2]) {
  Float16 pairs[8], fours[4], both[2];
  for (int i = 0; i < 8; ++i) {
    const Float16 a = of(2 * i), b = of(2 * i + 1);
    pairs[i] = merge(0, __builtin_shufflevector(a, b, 0, 16, 1, 17, 4, 20, 5, 21, 8, 24, 9, 25, 12, 28, 13, 29),
                     __builtin_shufflevector(a, b, 2, 18, 3, 19, 6, 22, 7, 23, 10, 26, 11, 27, 14, 30, 15, 31));
  }
  for (int i = 0; i < 4; ++i) {
    const Float16 a = pairs[2 * i], b = pairs[2 * i + 1];
    fours[i] = merge(1, __builtin_shufflevector(a, b, 0, 1, 16, 17, 4, 5, 20, 21, 8, 9, 24, 25, 12, 13, 28, 29),
                     __builtin_shufflevector(a, b, 2, 3, 18, 19, 6, 7, 22, 23, 10, 11, 26, 27, 14, 15, 30, 31));
  }
  const auto even = [](Float16 a, Float16 b) {
    return __builtin_shufflevector(a, b, 0, 1, 2, 3, 8, 9, 10, 11, 16, 17, 18, 19, 24, 25, 26, 27);
  };
  const auto odd = [](Float16 a, Float16 b) {
    return __builtin_shufflevector(a, b, 4, 5, 6, 7, 12, 13, 14, 15, 20, 21, 22, 23, 28, 29, 30, 31);
  };
  for (int i = 0; i < 2; ++i) {
    const Float16 a = fours[2 * i], b = fours[2 * i + 1];
    both[i] = merge(2, even(a, b), odd(a, b));  // four registers' first eight, their second eight, the next four's
  }
  to[0] = even(both[0], both[1]);
  to[1] = odd(both[0], both[1]);
}
template <class V, class Of> IR_INLINE void highest_across(Of of, Float16 to[eights<V>]) {
  if constexpr (eights<V> == 2) across(of, [](int, Float16 a, Float16 b) { return max(a, b); }, to);
  else
    for (int k = 0; k < 16; ++k) to[0][k] = static_cast<float>(highest(of(k)));
}
template <class V, class Of> IR_INLINE void fifth_across(Of of, Float16 to[eights<V>]) {
  if constexpr (eights<V> == 2) across(of, [](int step, Float16 a, Float16 b) { return step == 2 ? b : a; }, to);
  else
    for (int k = 0; k < 16; ++k) to[0][k] = static_cast<float>(of(k)[4]);
}

template <class V> IR_INLINE void put_balls(const Vec<V> middle[16], const float own[16],
                                            Balls balls[eights<V>]) {
  V square[16];
  for (int k = 0; k < 16; ++k) {
    const Vec<V> away = middle[k] - Vec<V>{fifth(middle[k].x), fifth(middle[k].y), fifth(middle[k].z)};
    square[k] = dot(away, away);
  }
  Float16 x[eights<V>], y[eights<V>], z[eights<V>], spread[eights<V>];
  fifth_across<V>([&](int k) { return middle[k].x; }, x);
  fifth_across<V>([&](int k) { return middle[k].y; }, y);
  fifth_across<V>([&](int k) { return middle[k].z; }, z);
  highest_across<V>([&](int k) { return square[k]; }, spread);
  for (int part = 0; part < eights<V>; ++part)
    balls[part] = {x[part], y[part], z[part], sqrt(spread[part]) + load<Float16>(own)};
}

// Which balls come nearer than `reach` (`square` of what is positive of it) to a box along the world's axes, or to a
// plane.
IR_INLINE std::uint32_t near(const Balls& b, const Float16&, const Float16& square, const Box& box) {
  const Float16 zero{};
  const Float16 x = max(abs(b.x - box.centre[0]) - box.half[0], zero);
  const Float16 y = max(abs(b.y - box.centre[1]) - box.half[1], zero);
  const Float16 z = max(abs(b.z - box.centre[2]) - box.half[2], zero);
  return bits_not_above(x * x + y * y + z * z, square);
}
IR_INLINE std::uint32_t near(const Balls& b, const Float16& reach, const Float16&, const Body<float>& plane) {
  const float* axis = plane.axis[2];
  const float offset = plane.offset[2], slack = 1e-6f * (1.0f + std::fabs(offset));
  return bits_not_above(axis[0] * b.x + axis[1] * b.y + axis[2] * b.z, reach + (offset + slack));
}

// The planes and solids, beside sixteen capsules at a time.
template <class V, class Policy> IR_INLINE void visit_bodies(const Model& model, const State<V>& s, Policy& policy) {
  for (std::size_t first = 0; first < model.capsules.size(); first += 16) {
    Balls balls[eights<V>];
    Float16 reach[eights<V>], square[eights<V>];
    put_balls<V>(&s.middle[first], &model.ball_radius[first], balls);
    const std::uint32_t moving = model.moving[first / 16];
    const auto update = [&] {
      for (int part = 0; part < eights<V>; ++part) {
        reach[part] = (balls[part].radius + policy.farthest(first, part)) * 1.00001f + 1e-5f;
        const Float16 positive = clamp(reach[part], Float16{}, splat<Float16>(1e15f));
        square[part] = positive * positive;
      }
    };
    update();
    const auto some = [&](const auto& body) {
      std::uint32_t found = near(balls[0], reach[0], square[0], body);
      if constexpr (eights<V> == 2) found |= near(balls[1], reach[1], square[1], body);
      return found & moving;
    };
    const auto each = [&](std::uint32_t left, auto visit_one) {
      for (; left != 0; left &= left - 1)
        if (visit_one(static_cast<int>(first) + __builtin_ctz(left))) update();
    };
    for (const int body : model.planes)
      each(some(model.bodies_float[body]), [&](int c) { return visit_plane(model, s, c, body, policy); });
    for (const Leaf& leaf : model.leaves) {
      if (policy.done()) return;
      if (model.leaves.size() > 1 && some(leaf.around) == 0) continue;
      for (const Box& box : leaf.boxes)
        each(some(box), [&](int c) { return visit_body(model, s, c, box.body, policy); });
    }
  }
}

// Whether the longer axis and the ball around the other one may come near enough.
template <class V, class Policy>
IR_INLINE bool ball_may_matter(const Model& model, const State<V>& s, int i, const Policy& policy) {
  using S = Scalar<V>;
  const SelfPair& pair = model.self_pairs[i];
  const Vec<V>& axis = s.half[pair.longer];
  const Vec<V> gap = s.middle[pair.shorter] - s.middle[pair.longer];
  const V along = dot(gap, axis) * static_cast<S>(4 * model.capsules[pair.longer].inverse_square);
  const Vec<V> apart = gap - clamp(along, splat<V>(-1), splat<V>(1)) * axis;
  const S reach = policy.shift.self_reach[i] - static_cast<S>(pair.longer_half);
  return may_matter<V>(dot(apart, apart), policy.own(i) + reach);
}

template <class V, class Policy> IR_INLINE void visit_self(const Model& model, const State<V>& s, Policy& policy) {
  using S = Scalar<V>;
  const int outside = static_cast<int>(model.environment.size()), count = static_cast<int>(model.self_pairs.size());
  for (int first = 0; first < count; first += 32) {
    const int last = std::min(first + 32, count);
    std::uint32_t left = 0;  // all balls first, without a branch that could be mispredicted
    S limit[32];             // square of how near the middles may come
    if constexpr (Policy::one_bound) {
      const S bound = highest<V>(policy.own(0));
      for (int i = first; i < last; ++i) {
        const S need = std::max(bound + policy.shift.self_reach[i], S(0));
        limit[i - first] = need * need;
      }
    }
    for (int i = first; i < last; ++i) {
      const SelfPair& pair = model.self_pairs[i];
      const Vec<V> gap = s.middle[pair.a] - s.middle[pair.b];
      bool near;
      if constexpr (Policy::one_bound) near = any_not_above<V>(dot(gap, gap), splat<V>(limit[i - first]));
      else near = may_matter<V>(dot(gap, gap), policy.own(i) + policy.shift.self_reach[i]);
      left |= static_cast<std::uint32_t>(near) << (i - first);
    }
    for (; left != 0; left &= left - 1) {
      const int i = first + __builtin_ctz(left);
      const S shift = policy.shift.of[outside + i];
      if (policy.known(outside + i) || shift == -std::numeric_limits<S>::infinity()) continue;
      if (!ball_may_matter(model, s, i, policy)) continue;
      const SelfPair& pair = model.self_pairs[i];
      const V square = square_between(model, s, pair);
      const S radii = static_cast<S>(pair.radii);
      if (may_matter<V>(square, policy.own(i) + (shift + radii))) policy.take(outside + i, i, sqrt(square) - radii);
    }
  }
}

// All pairs: the robot's own first, they are near in most configurations.
template <class V, class Policy> IR_INLINE void visit(const Model& model, const State<V>& s, Policy& policy) {
  visit_self(model, s, policy);
  if (policy.done()) return;
  visit_bodies(model, s, policy);
}

}  // namespace ir
