// Exact signed distance of a segment from a cylinder about z, lanes at a time; as in segments.hpp.
#pragma once

#include "segments.hpp"

namespace ir {

// Place of least distance from the cylinder about z: the slope along the segment rises; Newton steps kept between the
// last places before and behind the minimum, until no lane moves. Low and high start outside 0..1: ends not yet tried.
template <class V> IR_INLINE V nearest_to_cylinder(Vec<V> a, Vec<V> d, V radius, V half, Mask<V>& crossing) {
  const V zero{}, one = splat<V>(1), tiny = splat<V>(Limits<V>::tiny);
  const V flat = d.x * d.x + d.y * d.y;
  const V closest = -(a.x * d.x + a.y * d.y) / max(flat, tiny);
  const V cx = a.x + closest * d.x, cy = a.y + closest * d.y;
  const V room = radius * radius - (cx * cx + cy * cy);
  const V width = sqrt(max(room, zero) / max(flat, tiny));
  const V rise = 1 / select<V>(abs(d.z) > tiny, d.z, tiny);
  const V bottom = (-half - a.z) * rise, top = (half - a.z) * rise;
  const V enter = max(max(min(bottom, top), closest - width), zero);
  const V leave = min(min(max(bottom, top), closest + width), one);
  crossing = (room > 0) & (enter < leave);
  V low = splat<V>(-1), high = splat<V>(2), t = clamp(closest, zero, one);
  Mask<V> moving = ~crossing;
  for (int k = 0; k < 64 && any(moving); ++k) {  // a lane that has arrived doesn't wait for the others
    const Vec<V> p = a + t * d;
    const V rho = sqrt(max(p.x * p.x + p.y * p.y, tiny)), inverse = 1 / rho;
    const V radial = (p.x * d.x + p.y * d.y) * inverse;  // slope of rho
    const V out = max(rho - radius, zero), up = excess(p.z, half);
    const V slope = out * radial + up * d.z;
    const V bend = select<V>(out > 0, radial * radial + out * (flat - radial * radial) * inverse, zero) +
                   select<V>(up != 0, d.z * d.z, zero);
    const Mask<V> rising = slope > 0, falling = slope < 0;
    high = select<V>(rising, t, high);
    low = select<V>(falling, t, low);
    V next = t - slope / max(bend, tiny);
    const V middle = (low + high) * Scalar<V>(0.5);
    const V beyond = select<V>(rising, select<V>(low < 0, zero, middle), select<V>(high > 1, one, middle));
    next = select<V>((next <= max(low, zero)) | (next >= min(high, one)), beyond, next);
    next = select<V>((rising | falling) & moving, next, t);
    moving = moving & (abs(next - t) > Limits<V>::still);
    t = next;
  }
  return t;
}

template <class V> IR_INLINE Touch<V> outside_cylinder(Vec<V> a, Vec<V> d, V radius, V half, Mask<V>& crossing) {
  Touch<V> r;
  r.t = nearest_to_cylinder(a, d, radius, half, crossing);
  const Vec<V> p = a + r.t * d;
  const V rho = sqrt(max(p.x * p.x + p.y * p.y, splat<V>(Limits<V>::tiny)));
  const V out = max(rho - radius, V{}) / rho;
  const Vec<V> gap = {out * p.x, out * p.y, excess(p.z, half)};
  r.distance = sqrt(dot(gap, gap));
  r.normal = (1 / max(r.distance, splat<V>(Limits<V>::tiny))) * gap;
  return r;
}

// Cosine and sine of k / 64 turns, a quarter of the circle.
struct Quarter {
  double c[17], s[17];
};
extern const Quarter quarter;

// How far a segment overlaps a cylinder in the directions c u + s v, u horizontal, both perpendicular to the segment and
// on its side of the cylinder's centre: then c, s >= 0 wherever the overlap is least.
template <class V> struct Rim {
  V radius, half, p, r, w;  // p, r: how far the segment is along u and v; w: the height of v

  IR_INLINE V side(V s) const { return sqrt(max(1 - s * s * w * w, splat<V>(Limits<V>::tiny))); }
  IR_INLINE V overlap(V c, V s) const { return radius * side(s) + s * (half * w - r) - c * p; }
  // derivatives by the angle
  IR_INLINE void slope(V c, V s, V& first, V& second) const {
    const V inverse = 1 / side(s), cross = s * c * w * inverse, k = half * w - r;
    first = p * s + k * c - radius * w * cross;
    second = p * c - k * s - radius * w * ((c * c - s * s) * w * inverse + cross * cross * w * inverse);
  }
};

// Penetration of a segment that crosses the cylinder: caps, side, and the rims swept along the segment: the best of 17
// directions, then Newton steps kept between its neighbours.
// long: cases of one closed form that share their lanes
template <class V> __attribute__((noinline)) void depth_in_cylinder(const Vec<V>& a, const Vec<V>& b, V radius, V half,
                                                                    V& depth, Vec<V>& n) {
  using S = Scalar<V>;
  const V zero{}, one = splat<V>(1), tiny = splat<V>(Limits<V>::tiny);
  const Vec<V> d = b - a;
  depth = half - min(a.z, b.z);
  n = {zero, zero, one};
  shallower<V>(half + max(a.z, b.z), {zero, zero, -one}, depth, n);
  const auto normalised = [&](const Vec<V>& v) { return (1 / sqrt(max(dot(v, v), tiny))) * v; };
  const V flat = d.x * d.x + d.y * d.y;
  const V t = clamp(-(a.x * d.x + a.y * d.y) / max(flat, tiny), zero, one);
  Vec<V> radial{a.x + t * d.x, a.y + t * d.y, zero};
  const V away = dot(radial, radial);
  const Vec<V> across = select(flat > tiny, Vec<V>{-d.y, d.x, zero}, Vec<V>{one, zero, zero});
  radial = normalised(select(away > flat * Limits<V>::parallel + tiny, radial, across));
  shallower(radius - ahead(radial, a, b), radial, depth, n);
  const Vec<V> opposite{-radial.x, -radial.y, zero};
  shallower(radius - ahead(opposite, a, b), opposite, depth, n);
  const auto facing = [&](const Vec<V>& v) { return select(dot(v, a) < 0, Vec<V>{-v.x, -v.y, -v.z}, v); };
  const Vec<V> u = facing(normalised(across)), v = facing(normalised(cross(d, u)));
  const Rim<V> rim{radius, half, dot(u, a), dot(v, a), abs(v.z)};
  V least = splat<V>(S(1e30)), bc = one, bs = zero, low = zero, high = zero;
  constexpr S step = S(0.0985);  // more than the tangent of 1/64 turn
  for (int k = 0; k <= 16; ++k) {
    const V c = splat<V>(S(quarter.c[k])), s = splat<V>(S(quarter.s[k])), now = rim.overlap(c, s);
    const Mask<V> m = now < least;
    least = min(now, least);
    bc = select<V>(m, c, bc);
    bs = select<V>(m, s, bs);
    low = select<V>(m, splat<V>(k == 0 ? S(0) : -step), low);
    high = select<V>(m, splat<V>(k == 16 ? S(0) : step), high);
  }
  // from there by the angle whose tangent is x
  V x = zero, c = bc, s = bs;
  Mask<V> moving = d.x == d.x;
  for (int k = 0; k < 64 && any(moving); ++k) {
    V slope, bend;
    rim.slope(c, s, slope, bend);
    high = select<V>(slope > 0, x, high);
    low = select<V>(slope > 0, low, x);
    V next = x - slope * (1 + x * x) / max(bend, tiny);
    next = select<V>((next > low) & (next < high), next, (low + high) * S(0.5));
    next = select<V>(moving, next, x);
    moving = moving & (abs(next - x) > Limits<V>::still);
    x = next;
    const V scale = 1 / sqrt(1 + x * x);
    c = scale * (bc - x * bs);
    s = scale * (bs + x * bc);
  }
  const Vec<V> direction = c * u + s * v;
  const V rim_depth = rim.overlap(c, s);
  const Mask<V> m = (dot(d, d) > S(1e-12)) & (rim_depth < depth);
  depth = select<V>(m, rim_depth, depth);
  n = select(m, direction, n);
}

template <class V> __attribute__((noinline)) Touch<V> segment_cylinder(const Vec<V>& a, const Vec<V>& b, V radius,
                                                                       V half) {
  const Vec<V> d = b - a;
  Mask<V> crossing, ignored;
  Touch<V> r = outside_cylinder(a, d, radius, half, crossing);
  if (__builtin_expect(any(crossing), 0)) {
    V depth;
    Vec<V> n;
    depth_in_cylinder(a, b, radius, half, depth, n);
    const Vec<V> out = a + (depth + Limits<V>::nudge) * n;
    r.t = select<V>(crossing, nearest_to_cylinder(out, d, radius, half, ignored), r.t);
    r.distance = select<V>(crossing, -depth, r.distance);
    r.normal = select(crossing, n, r.normal);
  }
  return r;
}

}  // namespace ir
