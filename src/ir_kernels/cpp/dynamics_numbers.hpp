// Numbers that the recursions take instead of plain lanes: dual numbers for derivatives, intervals for guarantees.
#pragma once

#include "dynamics_lanes.hpp"

namespace ir::dynamics {

// Value and derivative along one direction.
template <class S>
struct Dual {
  S v, d;
};
template <class S>
inline Dual<S> operator+(const Dual<S>& a, const Dual<S>& b) { return {a.v + b.v, a.d + b.d}; }
template <class S>
inline Dual<S> operator-(const Dual<S>& a, const Dual<S>& b) { return {a.v - b.v, a.d - b.d}; }
template <class S>
inline Dual<S> operator-(const Dual<S>& a) { return {-a.v, -a.d}; }
template <class S>
inline Dual<S> operator*(const Dual<S>& a, const Dual<S>& b) { return {a.v * b.v, a.d * b.v + a.v * b.d}; }
template <class S>
inline Dual<S> operator*(const Dual<S>& a, double k) { return {a.v * k, a.d * k}; }
template <class S>
inline Dual<S> operator+(const Dual<S>& a, double k) { return {a.v + k, a.d}; }

// Lanes of closed intervals. Every operation rounds outwards by two units in the last place, so the true value of the
// expression for any point of the arguments lies inside, whatever the rounding of the processor.
struct Interval {
  Doubles lo, hi;
};

constexpr double kOutward = 4.5e-16;  // two units in the last place
constexpr double kTiny = 1e-140;      // where these underflow; products of two stay far from denormal numbers, which are slow

inline Interval outward(Doubles lo, Doubles hi) {
  return {lo - (abs(lo) * kOutward + kTiny), hi + (abs(hi) * kOutward + kTiny)};
}
inline Interval point(Doubles x) { return {x, x}; }
inline Interval operator-(const Interval& a) { return {-a.hi, -a.lo}; }
inline Interval operator+(const Interval& a, const Interval& b) { return outward(a.lo + b.lo, a.hi + b.hi); }
inline Interval operator-(const Interval& a, const Interval& b) { return outward(a.lo - b.hi, a.hi - b.lo); }
inline Interval operator+(const Interval& a, double k) { return outward(a.lo + k, a.hi + k); }
inline Interval operator*(const Interval& a, double k) {
  const Doubles p = a.lo * k, q = a.hi * k;
  return outward(min(p, q), max(p, q));
}
inline Interval operator*(const Interval& a, const Interval& b) {
  const Doubles p = a.lo * b.lo, q = a.lo * b.hi, r = a.hi * b.lo, s = a.hi * b.hi;
  return outward(min(min(p, q), min(r, s)), max(max(p, q), max(r, s)));
}

inline Interval intersect(const Interval& a, const Interval& b) { return {max(a.lo, b.lo), min(a.hi, b.hi)}; }

// Sines and cosines of all angles of an interval; its ends' values and, where the slope changes sign between them, +-1.
inline void sincos(const Interval& x, Interval& s, Interval& c) {
  Doubles ends[2] = {x.lo, x.hi}, sine[2]{}, cosine[2]{};
  sincos(2, ends, sine, cosine);
  const Integers wide = x.hi - x.lo > 3.0;  // more than one turning point may hide between the ends
  const auto range = [&](Doubles a, Doubles b, Doubles slope_a, Doubles slope_b) {
    Doubles lo = min(a, b) - 1e-15, hi = max(a, b) + 1e-15;
    const Doubles one = splat<Doubles>(1.0);
    // a turning point within rounding of an end is no higher than the end, to rounding squared
    hi = ((slope_a > 0.0) & (slope_b < 0.0)) | wide ? one : hi;
    lo = ((slope_a < 0.0) & (slope_b > 0.0)) | wide ? -one : lo;
    return Interval{max(lo, -one), min(hi, one)};
  };
  s = range(sine[0], sine[1], cosine[0], cosine[1]);
  c = range(cosine[0], cosine[1], -sine[0], -sine[1]);
}

}  // namespace ir::dynamics
