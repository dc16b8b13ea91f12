// Sine, arc tangent, exponential and their relatives with the same bits on every processor: only additions, products,
// quotients and square roots, which IEEE 754 defines, in an order that is written here. The C library chooses its
// functions by the processor (with or without FMA), and their last bits differ.
//
// Errors are about one unit in the last place (power: |y log x| units), for finite arguments.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "lanes.hpp"

namespace ir {

constexpr double kPi = 3.14159265358979323846, kPiRest = 1.2246467991473532e-16;

typedef double Double2Lanes __attribute__((vector_size(16)));

inline void sine_cosine(double x, double& s, double& c) {
  if (!(std::fabs(x) <= reducible<Double8>)) x = without_turns(x);
  Double2Lanes sine, cosine;
  sincos_reducible(Double2Lanes{x, 0.0}, sine, cosine);
  s = sine[0];
  c = cosine[0];
}
inline double sine(double x) {
  double s, c;
  sine_cosine(x, s, c);
  return s;
}
inline double cosine(double x) {
  double s, c;
  sine_cosine(x, s, c);
  return c;
}

// atan t for 0 <= t <= 1: from the nearest eighth, whose arc tangent is known, by the series of what is left (<= 1/16).
inline double arc_tangent_of_share(double t) {
  constexpr double high[9] = {0.0,
                              0.12435499454676144,
                              0.24497866312686414,
                              0.35877067027057225,
                              0.4636476090008061,
                              0.5585993153435624,
                              0.6435011087932844,
                              0.7188299996216245,
                              0.7853981633974483};
  constexpr double low[9] = {0.0,
                             -3.1253241424539383e-18,
                             1.0698755618734451e-17,
                             -2.4623815582638635e-17,
                             2.2698777452961687e-17,
                             -5.4556305485916264e-18,
                             1.5834785051444286e-17,
                             -2.1478388444456983e-17,
                             3.061616997868383e-17};
  const int k = static_cast<int>(8.0 * t + 0.5);
  const double near = 0.125 * k, r = (t - near) / (1.0 + t * near), z = r * r;
  const double series =
      z * (-1.0 / 3 + z * (1.0 / 5 + z * (-1.0 / 7 + z * (1.0 / 9 + z * (-1.0 / 11 + z * (1.0 / 13 + z * (-1.0 / 15)))))));
  return high[k] + (r + (r * series + low[k]));
}

// The angle of (x, y), from -pi to pi; signs of zeros as IEEE 754 has them.
inline double arc_tangent(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return x + y;
  const double across = std::fabs(y), along = std::fabs(x);
  const double larger = std::max(across, along), smaller = std::min(across, along);
  const double share = larger == 0.0 ? 0.0 : std::isinf(larger) ? (smaller == larger ? 1.0 : 0.0) : smaller / larger;
  double angle = arc_tangent_of_share(share);
  if (across > along) angle = 0.5 * kPi - (angle - 0.5 * kPiRest);
  if (std::signbit(x)) angle = kPi - (angle - kPiRest);
  return std::copysign(angle, y);
}
inline double arc_sine(double x) { return arc_tangent(x, std::sqrt((1.0 - x) * (1.0 + x))); }
inline double arc_cosine(double x) { return arc_tangent(std::sqrt((1.0 - x) * (1.0 + x)), x); }

constexpr double kLog2High = 0.6931471804855391, kLog2Low = 7.440617110012397e-11;  // log 2, its first 33 bits and the rest

// e^x: x = k log 2 + r with |r| <= log(2) / 2, and the series of e^r.
inline double exponential(double x) {
  if (std::isnan(x)) return x;
  if (x > 709.782712893384) return std::numeric_limits<double>::infinity();
  if (x < -745.2) return 0.0;
  const double k = std::floor(x * 1.4426950408889634 + 0.5);
  const double rough = x - k * kLog2High, rest = k * kLog2Low, r = rough - rest;
  double sum = 1.0 / 6227020800.0;  // 1 / 13!
  for (const double factorial : {479001600.0, 39916800.0, 3628800.0, 362880.0, 40320.0, 5040.0, 720.0, 120.0, 24.0, 6.0, 2.0})
    sum = 1.0 / factorial + r * sum;
  const double rounded = (rough - r) - rest;  // what the subtraction lost
  return std::ldexp(1.0 + (r + (r * r * sum + rounded)), static_cast<int>(k));
}

// log x: x = 2^k m with m within sqrt(1/2) and sqrt(2), and log m = 2 artanh((m - 1) / (m + 1)).
inline double logarithm(double x) {
  if (x < 0.0 || std::isnan(x)) return std::numeric_limits<double>::quiet_NaN();
  if (x == 0.0) return -std::numeric_limits<double>::infinity();
  if (std::isinf(x)) return x;
  int k;
  double m = std::frexp(x, &k);
  if (m < 0.7071067811865476) m *= 2.0, --k;
  const double f = m - 1.0, s = f / (2.0 + f), z = s * s;
  double sum = 2.0 / 23;
  for (const double odd : {21.0, 19.0, 17.0, 15.0, 13.0, 11.0, 9.0, 7.0, 5.0, 3.0}) sum = 2.0 / odd + z * sum;
  const double half = 0.5 * f * f;  // log m = f - half + s (half + z sum)
  return k * kLog2High - ((half - (s * (half + z * sum) + k * kLog2Low)) - f);
}

// x^y for x >= 0; whole exponents up to 64 by products.
inline double power(double x, double y) {
  const double whole = std::fabs(y);
  if (whole <= 64.0 && whole == std::floor(whole)) {
    double result = 1.0, square = x;
    for (int n = static_cast<int>(whole); n > 0; n >>= 1, square *= square)
      if (n & 1) result *= square;
    return y < 0.0 ? 1.0 / result : result;
  }
  if (x == 0.0) return y > 0.0 ? 0.0 : std::numeric_limits<double>::infinity();
  return exponential(y * logarithm(x));
}
inline double cube_root(double x) {
  if (x == 0.0 || !std::isfinite(x)) return x;
  const double size = std::fabs(x);
  double root = exponential(logarithm(size) / 3.0);
  root -= (root * root * root - size) / (3.0 * root * root);
  return std::copysign(root, x);
}
inline double length(double x, double y) {
  const double larger = std::max(std::fabs(x), std::fabs(y));
  if (larger == 0.0 || !std::isfinite(larger)) return larger;
  int k;
  std::frexp(larger, &k);  // no overflow of the squares, and a scale that is exact
  const double a = std::ldexp(x, -k), b = std::ldexp(y, -k);
  return std::ldexp(std::sqrt(a * a + b * b), k);
}

}  // namespace ir
