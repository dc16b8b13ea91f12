// The exact distance of a capsule's axis from each kind of body.
#include "cylinder.hpp"
#include "elementary.hpp"
#include "model.hpp"

namespace ir {

const Quarter quarter = [] {
  Quarter table;
  for (int k = 0; k <= 16; ++k) {
    table.c[k] = ir::cosine(k * (3.14159265358979323846 / 32));
    table.s[k] = ir::sine(k * (3.14159265358979323846 / 32));
  }
  table.c[16] = 0.0;
  return table;
}();

template <class V>
V axis_distance(const Model& model, int body, int capsule_index, const Vec<V>& a, const Vec<V>& b) {
  using S = Scalar<V>;
  const Body<S>& f = model.bodies<S>()[body];
  switch (model.kind[body]) {
    case box:
      return distance_box(a, b, splat3<V>(f.half));
    case cylinder:
      return segment_cylinder(a, b, splat<V>(f.radius), splat<V>(f.half_length)).distance;
    case plane:
      return min(a.z, b.z);
    case sphere:
    case capsule: {
      const V zero{};
      const Vec<V> from{zero, zero, splat<V>(-f.half_length)}, along{zero, zero, splat<V>(2 * f.half_length)};
      const S inverse = f.half_length > 0 ? 1 / (4 * f.half_length * f.half_length) : 0;
      const V own = splat<V>(static_cast<S>(model.capsules[capsule_index].inverse_square));
      const auto p = segment_segment(a, b - a, own, from, along, splat<V>(inverse));
      return sqrt(dot(p.gap, p.gap)) - f.radius;
    }
    default: {
      V r;
      for (int k = 0; k < Lanes<V>::width; ++k) {
        const double from[3] = {double(a.x[k]), double(a.y[k]), double(a.z[k])};
        const double to[3] = {double(b.x[k]), double(b.y[k]), double(b.z[k])};
        double t = 0.0, n[3];
        r[k] = static_cast<S>(segment_hull(model.hulls[body], from, to, t, n));
      }
      return r;
    }
  }
}

template Float16 axis_distance<Float16>(const Model&, int, int, const Vec<Float16>&, const Vec<Float16>&);
template Double8 axis_distance<Double8>(const Model&, int, int, const Vec<Double8>&, const Vec<Double8>&);

}  // namespace ir
