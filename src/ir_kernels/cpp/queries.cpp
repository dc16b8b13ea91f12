#include "queries.hpp"

#include <algorithm>
#include <limits>

#include "visit.hpp"

namespace ir {
namespace {

constexpr float slack_of(Float16) { return 2e-5f; }
constexpr double slack_of(Double8) { return 1e-8; }

template <class V> struct Nearest {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  V best;  // least distance - offset so far
  Mask<V> pair;
  int hint;  // the pair that was taken first, or -1

  IR_INLINE V outside(int) const { return best + slack_of(V{}); }
  IR_INLINE V own(std::size_t) const { return best + slack_of(V{}); }
  IR_INLINE Float16 farthest(std::size_t) const {
    return splat<Float16>(static_cast<float>(highest(best) + shift.highest + slack_of(V{})));
  }
  IR_INLINE bool known(int z) const { return z == hint; }
  IR_INLINE bool done() const { return false; }
  IR_INLINE void take(int z, int, V distance) {
    const V excess = distance - shift.of[z];
    const Mask<V> index = Mask<V>{} + z;
    // of equals the first pair, so that the order of visits leaves no trace
    const Mask<V> better = (excess < best) | ((excess == best) & (index < pair));
    best = better ? excess : best;
    pair = better ? index : pair;
  }
};

template <class V> struct Above {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  Mask<V> free;

  IR_INLINE V outside(int) const {
    return free ? V{} + slack_of(V{}) : V{} - std::numeric_limits<S>::infinity();
  }
  IR_INLINE V own(std::size_t) const { return outside(0); }
  IR_INLINE Float16 farthest(std::size_t) const {
    return splat<Float16>(static_cast<float>(shift.highest + slack_of(V{})));
  }
  IR_INLINE bool known(int) const { return false; }
  IR_INLINE bool done() const { return !any(free); }
  IR_INLINE void take(int z, int, V distance) { free = free & (distance > shift.of[z]); }
};

// The rows of a batch, a lane group at a time.
template <int width> struct Rows {
  const double* row[width];
  int count;
  Rows(const double* q, std::size_t first, std::size_t total, int n)
      : count(static_cast<int>(std::min<std::size_t>(width, total - first))) {
    for (int k = 0; k < count; ++k) row[k] = q + (first + k) * n;
  }
};

// One capsule per lane, and one body per lane.
struct Gathered {
  Vec<Double8> a, b;
  Double8 inverse_square, radius;
};
struct GatheredBody {
  Vec<Double8> axis[3];
  Double8 offset[3], half[3], radius, half_length;
};

IR_INLINE void put(Gathered& to, Int8 where, const Capsule& c, const std::vector<Frame<Double8>>& frames) {
  const Frame<Double8>& f = frames[c.link];
  const Vec<Double8> middle = place(f, c.middle);
  to.a = select(where, c.axis.before(middle, f), to.a);
  to.b = select(where, c.axis.after(middle, f), to.b);
  to.inverse_square = where ? splat<Double8>(c.inverse_square) : to.inverse_square;
  to.radius = where ? splat<Double8>(c.radius) : to.radius;
}
IR_INLINE void put(GatheredBody& to, Int8 where, const Body<double>& body) {
  for (int i = 0; i < 3; ++i) {
    to.axis[i] = select(where, splat3<Double8>(body.axis[i]), to.axis[i]);
    to.offset[i] = where ? splat<Double8>(body.offset[i]) : to.offset[i];
    to.half[i] = where ? splat<Double8>(body.half[i]) : to.half[i];
  }
  to.radius = where ? splat<Double8>(body.radius) : to.radius;
  to.half_length = where ? splat<Double8>(body.half_length) : to.half_length;
}

struct WitnessLanes {
  Double8 distance;
  Vec<Double8> point_a, point_b, normal;
  Vec<Double8> centre_a, centre_b;  // the same on the axes: what the gradient turns with
};

// Unit normal for axes that cross each other.
IR_INLINE Vec<Double8> normal_of(const Vec<Double8>& gap, Double8 distance, const Vec<Double8>& da,
                                 const Vec<Double8>& db) {
  const Int8 apart = distance > 1e-12;
  Vec<Double8> n = (1 / max(distance, splat<Double8>(1e-12))) * gap;
  if (!any(~apart)) return n;
  Vec<Double8> other = cross(da, db);
  Double8 square = dot(other, other);
  // parallel: anything perpendicular to the longer one, and x for two points
  const Vec<Double8> d = select(dot(da, da) > dot(db, db), da, db);
  const Vec<Double8> ex{splat<Double8>(1), Double8{}, Double8{}}, ez{Double8{}, Double8{}, splat<Double8>(1)};
  const Vec<Double8> side = select(abs(d.x) > abs(d.z), cross(d, ez), cross(d, ex));
  const Int8 parallel = square <= 1e-24 * dot(da, da) * dot(db, db);
  other = select(parallel, side, other);
  square = dot(other, other);
  other = select(square > 0, (1 / sqrt(max(square, splat<Double8>(1e-200)))) * other, ex);
  return select(apart, n, other);
}

// Exact witness of one pair per lane, in double; lanes of the same kind of body are computed together.
WitnessLanes witness(const Model& model, const std::vector<Frame<Double8>>& frames, const int* pair, int count) {
  const int outside = static_cast<int>(model.environment.size());
  Gathered a{}, b{};
  GatheredBody f{};
  constexpr int own = 6;  // after the kinds of bodies
  std::uint32_t kinds = 0;
  Int8 index, kind{};
  for (int k = 0; k < 8; ++k) index[k] = pair[std::min(k, count - 1)];
  for (std::uint32_t left = 0xff; left != 0;) {  // lanes with the same pair together
    const int z = static_cast<int>(index[__builtin_ctz(left)]);
    const Int8 same = index == z;
    left &= ~bits(same);
    int now = own;
    if (z >= outside) {
      const SelfPair& p = model.self_pairs[z - outside];
      put(a, same, model.capsules[p.a], frames);
      put(b, same, model.capsules[p.b], frames);
    } else {
      const auto& [capsule_index, body] = model.environment[z];
      put(a, same, model.capsules[capsule_index], frames);
      put(f, same, model.bodies_double[body]);
      now = model.kind[body];
    }
    kind = same ? Int8{} + now : kind;
    kinds |= 1u << now;
  }
  const Vec<Double8> la{dot(f.axis[0], a.a) - f.offset[0], dot(f.axis[1], a.a) - f.offset[1],
                        dot(f.axis[2], a.a) - f.offset[2]};
  const Vec<Double8> lb{dot(f.axis[0], a.b) - f.offset[0], dot(f.axis[1], a.b) - f.offset[1],
                        dot(f.axis[2], a.b) - f.offset[2]};
  Touch<Double8> touch{};
  Double8 radius_b{};
  const auto keep = [&](int which, const Touch<Double8>& found) {
    const Int8 m = kind == which;
    touch.distance = m ? found.distance : touch.distance;
    touch.t = m ? found.t : touch.t;
    touch.normal = select(m, found.normal, touch.normal);
  };
  if (kinds >> box & 1) keep(box, segment_box(la, lb, {f.half[0], f.half[1], f.half[2]}));
  if (kinds >> cylinder & 1) keep(cylinder, segment_cylinder(la, lb, f.radius, f.half_length));
  if (kinds >> plane & 1) {
    const Int8 lower = lb.z < la.z;
    const Double8 zero{}, one = splat<Double8>(1);
    keep(plane, {min(la.z, lb.z), lower ? one : zero, {zero, zero, one}});
  }
  if (kinds >> mesh & 1) {
    Touch<Double8> found{};
    for (int k = 0; k < 8; ++k) {
      if (kind[k] != mesh) continue;
      const double from[3] = {la.x[k], la.y[k], la.z[k]}, to[3] = {lb.x[k], lb.y[k], lb.z[k]};
      double t = 0.0, n[3];
      const int body = model.environment[index[k]][1];
      found.distance[k] = segment_hull(model.hulls[body], from, to, t, n);
      found.t[k] = t;
      found.normal.x[k] = n[0], found.normal.y[k] = n[1], found.normal.z[k] = n[2];
    }
    keep(mesh, found);
  }
  if (kinds & (1u << sphere | 1u << capsule)) {
    const Double8 zero{}, length = f.half_length * 2;
    const Vec<Double8> along{zero, zero, length};
    const Double8 inverse = f.half_length > 0 ? 1 / (length * length) : zero;
    const auto p = segment_segment(la, lb - la, a.inverse_square, {zero, zero, -f.half_length}, along, inverse);
    const Double8 distance = sqrt(dot(p.gap, p.gap));
    const Touch<Double8> found{distance - f.radius, p.s, normal_of(p.gap, distance, lb - la, along)};
    keep(sphere, found);
    keep(capsule, found);
  }
  // back to the world
  const Vec<Double8> n = touch.normal;
  touch.normal = n.x * f.axis[0] + n.y * f.axis[1] + n.z * f.axis[2];
  if (kinds >> own & 1) {
    const auto p = segment_segment(a.a, a.b - a.a, a.inverse_square, b.a, b.b - b.a, b.inverse_square);
    const Double8 distance = sqrt(dot(p.gap, p.gap));
    keep(own, {distance, p.s, normal_of(p.gap, distance, a.b - a.a, b.b - b.a)});
    radius_b = kind == own ? b.radius : radius_b;
  }
  WitnessLanes w;
  w.normal = touch.normal;
  w.centre_a = a.a + touch.t * (a.b - a.a);
  w.centre_b = w.centre_a - touch.distance * touch.normal;
  w.point_a = w.centre_a - a.radius * touch.normal;
  w.point_b = w.centre_b + radius_b * touch.normal;
  w.distance = touch.distance - a.radius - radius_b;
  return w;
}

// Derivatives of the distances by the joint values: each joint turns what is farther from the base than itself.
void slopes(const Model& model, const std::vector<Frame<Double8>>& frames, const int* pair, int count,
            const WitnessLanes& w, Double8* gradient) {
  const int outside = static_cast<int>(model.environment.size());
  Int8 link_a{}, link_b{};
  for (int k = 0; k < count; ++k) {
    const bool own = pair[k] >= outside;
    const int a = own ? model.self_pairs[pair[k] - outside].a : model.environment[pair[k]][0];
    link_a[k] = model.capsules[a].link;
    link_b[k] = own ? model.capsules[model.self_pairs[pair[k] - outside].b].link : 0;
  }
  for (int j = 0; j < model.chain.n; ++j) {
    const Vec<Double8>&axis = frames[j + 1].z, &origin = frames[j + 1].origin;
    const Double8 a = dot(w.normal, cross(axis, w.centre_a - origin));
    const Double8 b = dot(w.normal, cross(axis, w.centre_b - origin));
    gradient[j] = (j < link_a ? a : Double8{}) - (j < link_b ? b : Double8{});
  }
}

void write(const Model& model, const WitnessLanes& w, int count, std::size_t first, const WitnessArrays& to) {
  const double* base = model.chain.base_origin;
  const Double8 columns[9] = {w.point_a.x + base[0], w.point_a.y + base[1], w.point_a.z + base[2],
                              w.point_b.x + base[0], w.point_b.y + base[1], w.point_b.z + base[2],
                              w.normal.x,            w.normal.y,            w.normal.z};
  double values[9][8], distance[8];
  std::memcpy(values, columns, sizeof values);
  std::memcpy(distance, &w.distance, sizeof distance);
  for (int k = 0; k < count; ++k) {
    const std::size_t row = first + k;
    to.distance[row] = distance[k];
    for (int i = 0; i < 3; ++i) {
      to.point_a[3 * row + i] = values[i][k];
      to.point_b[3 * row + i] = values[3 + i][k];
      to.normal[3 * row + i] = values[6 + i][k];
    }
  }
}

template <class V>
void min_distance_in(const Model& model, const double* q, std::size_t count, const double* offset, std::int64_t* pair,
                     const WitnessArrays& result) {
  using S = Scalar<V>;
  constexpr int width = Lanes<V>::width;
  const Shifts<S> shift(model, offset);
  Placement<V> placement(model);
  Nearest<V> policy{shift, {}, {}, -1};
  for (std::size_t first = 0; first < count; first += width) {
    const Rows<width> rows(q, first, count, model.chain.n);
    placement.place(rows.row, rows.count);
    policy.best = V{} + std::numeric_limits<S>::infinity();
    policy.pair = Mask<V>{} + std::numeric_limits<std::int32_t>::max();
    if (policy.hint >= 0) policy.take(policy.hint, 0, pair_distance(model, placement.state, policy.hint));
    visit(model, placement.state, policy);
    const Mask<V> chosen = policy.best < std::numeric_limits<S>::infinity() ? policy.pair : Mask<V>{} - 1;
    int nearest[width];
    for (int k = 0; k < width; ++k) nearest[k] = static_cast<int>(chosen[k]);
    for (int k = 0; k < rows.count; ++k) pair[first + k] = nearest[k];
    if (nearest[0] < 0) {  // no pair that counts: the same for all
      for (int k = 0; k < rows.count; ++k) {
        result.distance[first + k] = std::numeric_limits<double>::infinity();
        for (double* to : {result.point_a, result.point_b, result.normal})
          std::fill_n(to + 3 * (first + k), 3, std::numeric_limits<double>::quiet_NaN());
      }
      continue;
    }
    policy.hint = nearest[rows.count - 1];
    for (int part = 0; 8 * part < rows.count; ++part) {
      const int lanes = std::min(8, rows.count - 8 * part);
      write(model, witness(model, placement.exact[part], nearest + 8 * part, lanes), lanes, first + 8 * part, result);
    }
  }
}

template <class V>
void is_free_in(const Model& model, const double* q, std::size_t count, const double* threshold, bool* result) {
  using S = Scalar<V>;
  constexpr int width = Lanes<V>::width;
  const Shifts<S> shift(model, threshold);
  Placement<V> placement(model);
  Above<V> policy{shift, {}};
  for (std::size_t first = 0; first < count; first += width) {
    const Rows<width> rows(q, first, count, model.chain.n);
    placement.place(rows.row, rows.count);
    policy.free = Mask<V>{} - 1;
    visit(model, placement.state, policy);
    const std::uint32_t free = bits(policy.free);
    for (int k = 0; k < rows.count; ++k) result[first + k] = free >> k & 1;
  }
}

}  // namespace

void distances(const Model& model, const double* q, std::size_t count, double* result) {
  Placement<Double8> placement(model);
  const std::size_t pairs = model.pairs();
  for (std::size_t first = 0; first < count; first += 8) {
    const Rows<8> rows(q, first, count, model.chain.n);
    placement.place(rows.row, rows.count);
    for (std::size_t z = 0; z < pairs; ++z) {
      const Double8 d = pair_distance(model, placement.state, static_cast<int>(z));
      for (int k = 0; k < rows.count; ++k) result[(first + k) * pairs + z] = d[k];
    }
  }
}

void min_distance(const Model& model, const double* q, std::size_t count, const double* offset, std::int64_t* pair,
                  const WitnessArrays& result) {
  if (model.wide) min_distance_in<Double8>(model, q, count, offset, pair, result);
  else min_distance_in<Float16>(model, q, count, offset, pair, result);
}

void is_free(const Model& model, const double* q, std::size_t count, const double* threshold, bool* result) {
  if (model.wide) is_free_in<Double8>(model, q, count, threshold, result);
  else is_free_in<Float16>(model, q, count, threshold, result);
}

void witnesses(const Model& model, const double* q, std::size_t count, const std::int64_t* pair,
               const WitnessArrays& result, double* gradient) {
  Placement<Double8> placement(model);
  const int n = model.chain.n;
  std::vector<Double8> slope(n);
  for (std::size_t first = 0; first < count; first += 8) {
    const Rows<8> rows(q, first, count, n);
    placement.place(rows.row, rows.count);
    int chosen[8];
    for (int k = 0; k < rows.count; ++k) chosen[k] = static_cast<int>(pair[first + k]);
    const WitnessLanes w = witness(model, placement.exact[0], chosen, rows.count);
    write(model, w, rows.count, first, result);
    if (gradient == nullptr) continue;
    slopes(model, placement.exact[0], chosen, rows.count, w, slope.data());
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < rows.count; ++k) gradient[(first + k) * n + j] = slope[j][k];
  }
}

void pair_slopes(const Model& model, const std::vector<Frame<Double8>>& frames, const int pair[8], Double8& distance,
                 Double8* gradient) {
  const WitnessLanes w = witness(model, frames, pair, 8);
  distance = w.distance;
  slopes(model, frames, pair, 8, w, gradient);
}

}  // namespace ir
