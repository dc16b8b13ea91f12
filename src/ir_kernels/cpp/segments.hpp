// Exact signed distance of a segment from a box and from another segment, lanes at a time; cylinder.hpp has the cylinder.
//
// Each function returns a Touch: signed distance of the segment (radius 0) from the solid, the place t on the segment,
// and the unit normal from the solid to the segment; the nearest point of the solid is a + t d - distance * normal.
#pragma once

#include "lanes.hpp"

namespace ir {

template <class V> struct Touch {
  V distance, t;
  Vec<V> normal;
};

template <class V> struct Limits;
template <> struct Limits<Float16> {
  static constexpr float tiny = 1e-30f, parallel = 1e-10f, nudge = 1e-6f, still = 1e-6f;
};
template <> struct Limits<Double8> {
  static constexpr double tiny = 1e-200, parallel = 1e-24, nudge = 1e-9, still = 1e-9;
};

template <class V> IR_INLINE V excess(V x, V e) { return x - clamp(x, -e, e); }

// Place of least distance from the box: the slope of the squared distance along the segment is piecewise linear and
// rises, with kinks where a coordinate passes a face. Three evaluations find the piece among the sorted kinks, a
// Newton step solves it. `crossing`: a part of the segment is inside (then any place is as good).
// long: cases of one closed form that share their lanes
template <class V> IR_INLINE V nearest_to_box(Vec<V> a, Vec<V> d, Vec<V> e, Mask<V>& crossing) {
  const V zero{}, one = splat<V>(1);
  V t[6];
  const V as[3] = {a.x, a.y, a.z}, ds[3] = {d.x, d.y, d.z}, es[3] = {e.x, e.y, e.z};
  for (int i = 0; i < 3; ++i) {
    const V flat = select<V>(abs(ds[i]) > Limits<V>::tiny, ds[i], splat<V>(Limits<V>::tiny));
    const V inverse = 1 / flat;
    t[2 * i] = (-es[i] - as[i]) * inverse;
    t[2 * i + 1] = (es[i] - as[i]) * inverse;
  }
  auto order = [&](int i, int j) {
    const V low = min(t[i], t[j]);
    t[j] = max(t[i], t[j]);
    t[i] = low;
  };
  // the sorting network for six; the pairs (0,1), (2,3), (4,5) come first
  order(0, 1), order(2, 3), order(4, 5);
  crossing = max(max(t[0], t[2]), max(t[4], zero)) < min(min(t[1], t[3]), min(t[5], one));
  order(0, 2), order(3, 5), order(1, 4);
  order(0, 1), order(2, 3), order(4, 5);
  order(1, 2), order(3, 4);
  order(2, 3);
  for (V& k : t) k = clamp(k, zero, one);
  auto slope = [&](V at) {
    return ds[0] * excess(as[0] + at * ds[0], es[0]) + ds[1] * excess(as[1] + at * ds[1], es[1]) +
           ds[2] * excess(as[2] + at * ds[2], es[2]);
  };
  V low = zero, high = one;
  Mask<V> rising = slope(t[3]) > 0;
  high = select<V>(rising, t[3], high);
  low = select<V>(rising, low, t[3]);
  V at = select<V>(rising, t[1], t[5]);
  const Mask<V> again = slope(at) > 0;
  high = select<V>(again, at, high);
  low = select<V>(again, low, at);
  // left: t0 or t2 below t3; t4 above it, or nothing above t5
  at = select<V>(rising, select<V>(again, t[0], t[2]), select<V>(again, t[4], one));
  const Mask<V> last = slope(at) > 0;
  high = select<V>(last, at, high);
  low = select<V>(last, low, at);
  const V middle = (low + high) * Scalar<V>(0.5);
  V first{}, second{};
  for (int i = 0; i < 3; ++i) {
    const V out = excess(as[i] + middle * ds[i], es[i]);
    first += ds[i] * out;
    second += select<V>(out != 0, ds[i] * ds[i], zero);
  }
  return clamp(middle - first / max(second, splat<V>(Limits<V>::tiny)), low, high);
}

template <class V> IR_INLINE V ahead(Vec<V> n, Vec<V> a, Vec<V> b) { return min(dot(n, a), dot(n, b)); }

// Keeps the direction of least overlap.
template <class V> IR_INLINE void shallower(V overlap, Vec<V> n, V& least, Vec<V>& direction) {
  const Mask<V> m = overlap < least;
  least = select<V>(m, overlap, least);
  direction = select(m, n, direction);
}

// Penetration of a segment that crosses the box: faces, and edges crossed with the segment.
template <class V> __attribute__((noinline)) void depth_in_box(const Vec<V>& a, const Vec<V>& b, const Vec<V>& e,
                                                               V& depth, Vec<V>& n) {
  const V zero{}, one = splat<V>(1);
  const Vec<V> d = b - a;
  depth = e.x - min(a.x, b.x);
  n = {one, zero, zero};
  shallower<V>(e.x + max(a.x, b.x), {-one, zero, zero}, depth, n);
  shallower<V>(e.y - min(a.y, b.y), {zero, one, zero}, depth, n);
  shallower<V>(e.y + max(a.y, b.y), {zero, -one, zero}, depth, n);
  shallower<V>(e.z - min(a.z, b.z), {zero, zero, one}, depth, n);
  shallower<V>(e.z + max(a.z, b.z), {zero, zero, -one}, depth, n);
  const V length = dot(d, d);
  const Vec<V> crossed[3] = {{zero, -d.z, d.y}, {d.z, zero, -d.x}, {-d.y, d.x, zero}};
  for (const Vec<V>& c : crossed) {
    const V square = dot(c, c);
    const V scale = 1 / sqrt(max(square, splat<V>(Limits<V>::tiny)));
    const Mask<V> usable = square > Limits<V>::parallel * length;
    const Vec<V> u = scale * c;
    const V reach = abs(u.x) * e.x + abs(u.y) * e.y + abs(u.z) * e.z, side = dot(u, a);
    // u is perpendicular to the segment: both ends are equally far along it
    const V overlap = reach - abs(side);
    const Mask<V> m = usable & (overlap < depth);
    depth = select<V>(m, overlap, depth);
    const Vec<V> outward = select(side < 0, Vec<V>{-u.x, -u.y, -u.z}, u);
    n = select(m, outward, n);
  }
}

template <class V> IR_INLINE Touch<V> segment_box(Vec<V> a, Vec<V> b, Vec<V> e) {
  const Vec<V> d = b - a;
  Touch<V> r;
  Mask<V> crossing, ignored;
  r.t = nearest_to_box(a, d, e, crossing);
  const Vec<V> gap = {excess(a.x + r.t * d.x, e.x), excess(a.y + r.t * d.y, e.y), excess(a.z + r.t * d.z, e.z)};
  r.distance = sqrt(dot(gap, gap));
  r.normal = (1 / max(r.distance, splat<V>(Limits<V>::tiny))) * gap;
  if (__builtin_expect(any(crossing), 0)) {
    V depth;
    Vec<V> n;
    depth_in_box(a, b, e, depth, n);
    // the witness is where the segment, moved out, touches
    const Vec<V> out = a + (depth + Limits<V>::nudge) * n;
    r.t = select<V>(crossing, nearest_to_box(out, d, e, ignored), r.t);
    r.distance = select<V>(crossing, -depth, r.distance);
    r.normal = select(crossing, n, r.normal);
  }
  return r;
}

// The same without witnesses.
template <class V> IR_INLINE V distance_box(Vec<V> a, Vec<V> b, Vec<V> e) {
  const Vec<V> d = b - a;
  Mask<V> crossing;
  const V t = nearest_to_box(a, d, e, crossing);
  const Vec<V> gap = {excess(a.x + t * d.x, e.x), excess(a.y + t * d.y, e.y), excess(a.z + t * d.z, e.z)};
  V distance = sqrt(dot(gap, gap));
  if (__builtin_expect(any(crossing), 0)) {
    V depth;
    Vec<V> n;
    depth_in_box(a, b, e, depth, n);
    distance = select<V>(crossing, -depth, distance);
  }
  return distance;
}

// Two segments a + s da and b + t db. With both lines' common perpendicular from cross products, which keep their
// precision for nearly parallel segments; then the ends in turn.
template <class V> struct SegmentPair {
  V s, t;
  Vec<V> gap;  // from b to a
};
template <class V> IR_INLINE SegmentPair<V> segment_segment(Vec<V> a, Vec<V> da, V inverse_aa, Vec<V> b, Vec<V> db,
                                                            V inverse_bb) {
  const V zero{}, one = splat<V>(1);
  const Vec<V> r = a - b, n = cross(da, db);
  const V nn = dot(n, n), ab = dot(da, db), ra = dot(r, da), rb = dot(r, db);
  SegmentPair<V> p;
  const V along = dot(cross(db, r), n);
  p.s = select<V>(nn > Limits<V>::tiny, along / max(nn, splat<V>(Limits<V>::tiny)), -ra * inverse_aa);
  p.s = clamp(p.s, zero, one);
  const V t = (rb + p.s * ab) * inverse_bb;
  p.t = clamp(t, zero, one);
  p.s = select<V>(t != p.t, clamp((p.t * ab - ra) * inverse_aa, zero, one), p.s);
  p.gap = r + p.s * da - p.t * db;
  return p;
}

}  // namespace ir
