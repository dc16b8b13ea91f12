#include "witness.hpp"

#include "cylinder.hpp"

namespace ir {
namespace {

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

// visit(lanes, pair) for each of the pairs among the lanes
template <class Visit> IR_INLINE void each_pair(Int8 pair, Visit visit) {
  for (std::uint32_t left = 0xff; left != 0;) {
    const int z = static_cast<int>(pair[__builtin_ctz(left)]);
    const Int8 same = pair == z;
    left &= ~bits(same);
    visit(same, z);
  }
}

constexpr int own = 6;  // after the kinds of bodies

// What each lane's axis finds at its body, in the world; `kinds` has a bit per kind among the lanes.
// long: one case per kind of body
__attribute__((noinline)) Touch<Double8> touch_bodies(const Model& model, const Gathered& a, Int8 pair, Int8 kind,
                                                      std::uint32_t kinds) {
  GatheredBody f{};
  each_pair(pair, [&](Int8 same, int z) {
    if (z < static_cast<int>(model.environment.size())) put(f, same, model.bodies_double[model.environment[z][1]]);
  });
  const Vec<Double8> la{dot(f.axis[0], a.a) - f.offset[0], dot(f.axis[1], a.a) - f.offset[1],
                        dot(f.axis[2], a.a) - f.offset[2]};
  const Vec<Double8> lb{dot(f.axis[0], a.b) - f.offset[0], dot(f.axis[1], a.b) - f.offset[1],
                        dot(f.axis[2], a.b) - f.offset[2]};
  Touch<Double8> touch{};
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
      const int body = model.environment[pair[k]][1];
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
  const Vec<Double8> n = touch.normal;
  touch.normal = n.x * f.axis[0] + n.y * f.axis[1] + n.z * f.axis[2];
  return touch;
}

}  // namespace

// long: one case per kind of pair
WitnessLanes witness(const Model& model, const std::vector<Frame<Double8>>& frames, const std::int32_t pair[8]) {
  const int outside = static_cast<int>(model.environment.size());
  typedef std::int32_t Short8 __attribute__((vector_size(32), aligned(4), may_alias));
  const Int8 index = __builtin_convertvector(*reinterpret_cast<const Short8*>(pair), Int8);
  Gathered a{}, b{};
  std::uint32_t kinds = 0;
  Int8 kind{};
  each_pair(index, [&](Int8 same, int z) {
    int now = own;
    if (z >= outside) {
      const SelfPair& p = model.self_pairs[z - outside];
      put(a, same, model.capsules[p.a], frames);
      put(b, same, model.capsules[p.b], frames);
    } else {
      put(a, same, model.capsules[model.environment[z][0]], frames);
      now = model.kind[model.environment[z][1]];
    }
    kind = same ? Int8{} + now : kind;
    kinds |= 1u << now;
  });
  Touch<Double8> touch{};
  Double8 radius_b{};
  if (kinds != 1u << own) touch = touch_bodies(model, a, index, kind, kinds);
  if (kinds >> own & 1) {
    const Vec<Double8> da = a.b - a.a, db = b.b - b.a;
    const auto p = segment_segment(a.a, da, a.inverse_square, b.a, db, b.inverse_square);
    const Double8 distance = sqrt(dot(p.gap, p.gap));
    const Int8 m = kind == own;
    touch.distance = m ? distance : touch.distance;
    touch.t = m ? p.s : touch.t;
    touch.normal = select(m, normal_of(p.gap, distance, da, db), touch.normal);
    radius_b = m ? b.radius : radius_b;
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

// Each joint turns what is farther from the base than itself.
void slopes(const Model& model, const std::vector<Frame<Double8>>& frames, const std::int32_t pair[8],
            const WitnessLanes& w, Double8* gradient) {
  const int outside = static_cast<int>(model.environment.size());
  Int8 link_a{}, link_b{};
  for (int k = 0; k < 8; ++k) {
    const bool own = pair[k] >= outside;
    const int a = own ? model.self_pairs[pair[k] - outside].a : model.environment[pair[k]][0];
    link_a[k] = model.capsules[a].link;
    link_b[k] = own ? model.capsules[model.self_pairs[pair[k] - outside].b].link : 0;
  }
  for (int j = 0; j < model.chain.n; ++j) {
    const Vec<Double8>&axis = frames[j + 1].z, &origin = frames[j + 1].origin;
    const bool slides = j == 0 && model.chain.first_slides;
    const Double8 a = dot(w.normal, slides ? axis : cross(axis, w.centre_a - origin));
    const Double8 b = dot(w.normal, slides ? axis : cross(axis, w.centre_b - origin));
    gradient[j] = (j < link_a ? a : Double8{}) - (j < link_b ? b : Double8{});
  }
}

// As rows of three.
IR_INLINE void store_rows(const Vec<Double8>& v, int count, double* to) {
  const Double8 first = __builtin_shufflevector(v.x, v.y, 0, 8, 0, 1, 9, 0, 2, 10);
  const Double8 second = __builtin_shufflevector(v.z, v.x, 2, 11, 0, 3, 12, 0, 4, 13);
  const Double8 third = __builtin_shufflevector(v.y, v.z, 5, 13, 0, 6, 14, 0, 7, 15);
  const Double8 rows[3] = {__builtin_shufflevector(first, v.z, 0, 1, 8, 3, 4, 9, 6, 7),
                           __builtin_shufflevector(second, v.y, 0, 1, 11, 3, 4, 12, 6, 7),
                           __builtin_shufflevector(third, v.x, 0, 1, 14, 3, 4, 15, 6, 7)};
  std::memcpy(to, rows, count == 8 ? sizeof rows : 3 * sizeof(double) * count);
}

void write(const Model& model, const WitnessLanes& w, int count, std::size_t first, const WitnessArrays& to) {
  const Vec<Double8> origin = splat3<Double8>(model.chain.base_origin);
  std::memcpy(to.distance + first, &w.distance, sizeof(double) * count);
  store_rows(w.point_a + origin, count, to.point_a + 3 * first);
  store_rows(w.point_b + origin, count, to.point_b + 3 * first);
  store_rows(w.normal, count, to.normal + 3 * first);
}

}  // namespace ir
