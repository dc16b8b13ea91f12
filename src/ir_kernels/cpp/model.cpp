#include "model.hpp"

#include <algorithm>
#include <limits>
#include <numeric>

namespace ir {
namespace {

// Farthest that any capsule gets from the base's origin, whatever the joint values.
double reach_of(const Model& m) {
  std::vector<double> to_joint(m.chain.n + 1, 0.0);
  for (int k = 0; k < m.chain.n; ++k) {
    const Local& s = m.chain.joints[k].shift;
    to_joint[k + 1] = to_joint[k] + std::sqrt(s[0] * s[0] + s[1] * s[1] + s[2] * s[2]);
  }
  double reach = 0.0;
  for (const Capsule& c : m.capsules) {
    for (const double sign : {-1.0, 1.0}) {
      double square = 0.0;
      for (int i = 0; i < 3; ++i) square += std::pow(c.middle[i] + sign * c.axis[i], 2);
      reach = std::max(reach, to_joint[c.link] + std::sqrt(square) + c.radius);
    }
  }
  return reach;
}

// Orders bodies so that neighbours share a leaf: halved along the longest side, down to sixteen.
void split(std::vector<int>& order, int begin, int end, const std::vector<std::array<double, 3>>& centre) {
  if (end - begin <= 16) return;
  int longest = 0;
  double extent = -1.0;
  for (int i = 0; i < 3; ++i) {
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (int k = begin; k < end; ++k) {
      low = std::min(low, centre[order[k]][i]);
      high = std::max(high, centre[order[k]][i]);
    }
    if (high - low > extent) extent = high - low, longest = i;
  }
  const int leaves = (end - begin + 15) / 16, middle = begin + (leaves + 1) / 2 * 16;
  std::nth_element(order.begin() + begin, order.begin() + middle, order.begin() + end, [&](int i, int j) {
    return centre[i][longest] != centre[j][longest] ? centre[i][longest] < centre[j][longest] : i < j;
  });
  split(order, begin, middle, centre);
  split(order, middle, end, centre);
}

}  // namespace

void Model::finish() {  // long: one layout of lanes per kind of body, filled side by side
  const double reach = reach_of(*this);
  double extent = reach;
  bodies_float.resize(kind.size());
  std::vector<int> order;
  std::vector<std::array<double, 3>> centre(kind.size()), radius(kind.size());
  for (int k = 0; k < body_count(); ++k) {
    const Body<double>& d = bodies_double[k];
    Body<float>& f = bodies_float[k];
    double largest = 0.0;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) f.axis[i][j] = static_cast<float>(d.axis[i][j]);
      f.offset[i] = static_cast<float>(d.offset[i]);
      f.half[i] = static_cast<float>(d.half[i]);
      largest = std::max(largest, d.half[i]);
      centre[k][i] = radius[k][i] = 0.0;
      for (int j = 0; j < 3; ++j) {
        centre[k][i] += d.axis[j][i] * d.offset[j];
        radius[k][i] += std::fabs(d.axis[j][i]) * d.half[j];
      }
    }
    f.radius = static_cast<float>(d.radius);
    f.half_length = static_cast<float>(d.half_length);
    if (kind[k] == plane) {
      planes.push_back(k);
      extent = std::max(extent, std::fabs(d.offset[2]));
      continue;
    }
    order.push_back(k);
    double away = 0.0;
    for (double c : centre[k]) away += c * c;
    // what is out of reach is never nearer than the rest by less than its rounding
    extent = std::max(extent, std::min(std::sqrt(away), 3.0 * reach + largest) + largest);
  }
  float_margin = 32.0 * std::ldexp(1.0, -24) * extent;
  wide = extent > 12.0 || chain.first_slides;  // how far a rail reaches isn't known here
  split(order, 0, static_cast<int>(order.size()), centre);
  const auto box_of = [](const double low[3], const double high[3], int body) {
    Box box{};
    for (int i = 0; i < 3; ++i) {
      const double c = 0.5 * (low[i] + high[i]), h = 0.5 * (high[i] - low[i]);
      box.centre[i] = static_cast<float>(c);
      box.half[i] = static_cast<float>(h + 1e-6 * (1.0 + std::fabs(c) + h));
    }
    box.body = body;
    return box;
  };
  for (std::size_t first = 0; first < order.size(); first += 16) {
    Leaf leaf;
    double low[3], high[3];
    for (std::size_t at = first; at < std::min(first + 16, order.size()); ++at) {
      const int k = order[at];
      double l[3], h[3];
      for (int i = 0; i < 3; ++i) {
        l[i] = centre[k][i] - radius[k][i], h[i] = centre[k][i] + radius[k][i];
        low[i] = at == first ? l[i] : std::min(low[i], l[i]);
        high[i] = at == first ? h[i] : std::max(high[i], h[i]);
      }
      leaf.boxes.push_back(box_of(l, h, k));
    }
    leaf.around = box_of(low, high, -1);
    leaves.push_back(leaf);
  }
  const std::size_t sixteens = (capsules.size() + 15) / 16;
  ball_radius.assign(16 * sixteens, 0.0f);
  moving.assign(sixteens, 0);
  for (std::size_t c = 0; c < capsules.size(); ++c) {
    ball_radius[c] = static_cast<float>(capsules[c].half + capsules[c].radius);
    if (capsules[c].link > 0) moving[c / 16] |= 1u << (c % 16);
  }
  pair_of.assign(capsules.size() * kind.size(), -1);
  for (std::size_t z = 0; z < environment.size(); ++z)
    pair_of[environment[z][0] * kind.size() + environment[z][1]] = static_cast<std::int32_t>(z);
  capsules_of.assign(chain.n + 1, {});
  for (std::size_t c = 0; c < capsules.size(); ++c) capsules_of[capsules[c].link].push_back(static_cast<int>(c));
  for (SelfPair& pair : self_pairs) {
    const bool first = capsules[pair.a].link >= capsules[pair.b].link;
    const Capsule &a = capsules[pair.a], &b = capsules[pair.b];
    pair.radii = a.radius + b.radius;
    pair.around = pair.radii + a.half + b.half;
    pair.longer = a.half > b.half ? pair.a : pair.b;
    pair.shorter = a.half > b.half ? pair.b : pair.a;
    pair.longer_half = std::max(a.half, b.half);
    pair.outer = first ? pair.a : pair.b;
    pair.inner = first ? pair.b : pair.a;
  }
}

namespace {

typedef float Float8 __attribute__((vector_size(32)));

IR_INLINE void narrow(const Double8& low, const Double8& high, Float16& to) {
  const Float8 first = __builtin_convertvector(low, Float8), second = __builtin_convertvector(high, Float8);
#if defined(__AVX512DQ__)
  to = (Float16)_mm512_insertf32x8(_mm512_castps256_ps512((__m256)first), (__m256)second, 1);
#else
  std::memcpy(&to, &first, 32);
  std::memcpy(reinterpret_cast<char*>(&to) + 32, &second, 32);
#endif
}
IR_INLINE void narrow(const Double8& low, const Double8&, Double8& to) { to = low; }
template <class V> IR_INLINE void narrow(const Vec<Double8>& low, const Vec<Double8>& high, Vec<V>& to) {
  narrow(low.x, high.x, to.x);
  narrow(low.y, high.y, to.y);
  narrow(low.z, high.z, to.z);
}

}  // namespace

template <class V> Placement<V>::Placement(const Model& model) : model_(model), q_(model.chain.n) {
  for (auto* joints : {&state.origin, &state.axis}) joints->resize(model.chain.n + 1);
  for (auto* capsules : {&state.middle, &state.half}) capsules->resize((model.capsules.size() + 15) / 16 * 16);
  for (auto& frames : exact) frames.resize(model.chain.n + 1);
  const Frame<Double8>& f = model.chain.base;
  narrow(f.x, f.x, base_.x);
  narrow(f.y, f.y, base_.y);
  narrow(f.z, f.z, base_.z);
  base_.origin = Vec<V>{};
  for (const int c : model.capsules_of[0]) put(c, base_);
}

template <class V> IR_INLINE void Placement<V>::put(int capsule, const Frame<V>& f) {
  const Capsule& c = model_.capsules[capsule];
  state.middle[capsule] = ir::place(f, c.middle);
  state.half[capsule] = c.axis.after(Vec<V>{}, f);
}

template <class V> void Placement<V>::place(const double* const* rows, int count) {
  const int n = model_.chain.n;
  for (int part = 0; part < Lanes<V>::width / 8; ++part) {
    const double* row[8];
    for (int k = 0; k < 8; ++k) row[k] = rows[std::min(8 * part + k, count - 1)];
    load_columns(row, n, q_.data());
    model_.chain.forward(q_.data(), exact[part].data());
  }
  Frame<V> before = base_;
  for (int link = 1; link <= n; ++link) {
    const Frame<Double8>&low = exact[0][link], &high = exact[Lanes<V>::width / 8 - 1][link];
    const Joint& joint = model_.chain.joints[link - 1];
    Frame<V> f;
    narrow(low.x, high.x, f.x);
    narrow(low.y, high.y, f.y);
    Vec<V> ignored;
    if (joint.turn == Joint::oblique) narrow(low.z, high.z, f.z);
    else joint.tilt(before, ignored, f.z);
    const bool slides = link == 1 && model_.chain.first_slides;
    if (joint.shift.is_zero() && !slides) f.origin = before.origin;
    else narrow(low.origin, high.origin, f.origin);
    state.origin[link] = f.origin;
    state.axis[link] = f.z;
    for (const int c : model_.capsules_of[link]) put(c, f);
    before = f;
  }
}

template class Placement<Float16>;
template class Placement<Double8>;

}  // namespace ir
