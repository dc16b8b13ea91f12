// L-BFGS (Nocedal, Updating quasi-Newton matrices with limited storage, 1980) with the bisecting line search for weak
// Wolfe conditions of Lewis and Overton (Nonsmooth optimization via quasi-Newton methods, 2013), which stays sound
// where the function has kinks.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "lanes.hpp"

namespace ir {

struct Descent {
  int evaluations;
  double value;
};

inline double inner(const std::vector<double>& a, const std::vector<double>& b) {
  Double8 part[4] = {};  // four, that don't wait for each other
  std::size_t k = 0;
  for (; k + 32 <= a.size(); k += 32)
    for (int i = 0; i < 4; ++i) part[i] += load<Double8>(&a[k + 8 * i]) * load<Double8>(&b[k + 8 * i]);
  for (; k + 8 <= a.size(); k += 8) part[0] += load<Double8>(&a[k]) * load<Double8>(&b[k]);
  const Double8 sums = (part[0] + part[1]) + (part[2] + part[3]);
  double sum = ((sums[0] + sums[1]) + (sums[2] + sums[3])) + ((sums[4] + sums[5]) + (sums[6] + sums[7]));
  for (; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

// a += k b
inline void add_scaled(std::vector<double>& a, double k, const std::vector<double>& b) {
  std::size_t i = 0;
  for (; i + 8 <= a.size(); i += 8) store(&a[i], load<Double8>(&a[i]) + k * load<Double8>(&b[i]));
  for (; i < a.size(); ++i) a[i] += k * b[i];
}

// function(x, gradient) -> value; precondition(v): v <- M^-1 v for a positive definite M near the Hessian. Ends after
// `most` evaluations, when ten iterations gain less than `tolerance` of the value, or where no direction leads down (nor
// where the function is not finite).
template <class Function, class Precondition>
// long: the iteration as it is written in the sources it names
Descent descend(std::vector<double>& x, Function&& function, Precondition&& precondition, int most, double tolerance) {
  constexpr std::size_t memory = 16;
  constexpr int patience = 10;
  const std::size_t size = x.size();
  struct Pair {
    std::vector<double> s, y;
    double inverse;
  };
  std::vector<Pair> pairs;
  pairs.reserve(memory);
  std::vector<double> g(size), direction(size), next(size), next_g(size), kept, kept_g, scaled(size), alpha(memory), history;
  double value = function(x, g);
  Descent done{1, value};
  history.push_back(value);
  while (done.evaluations < most) {
    direction = g;
    for (std::size_t k = pairs.size(); k-- > 0;) {
      alpha[k] = inner(pairs[k].s, direction) * pairs[k].inverse;
      add_scaled(direction, -alpha[k], pairs[k].y);
    }
    precondition(direction);
    if (!pairs.empty()) {  // the scale of M from the last step
      scaled = pairs.back().y;
      precondition(scaled);
      const double factor = 1.0 / (pairs.back().inverse * inner(pairs.back().y, scaled));
      for (double& d : direction) d *= factor;
    }
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const double beta = inner(pairs[k].y, direction) * pairs[k].inverse;
      add_scaled(direction, alpha[k] - beta, pairs[k].s);
    }
    double slope = -inner(g, direction);
    if (!(slope < 0.0)) {  // only rounding can lead here: start again from the steepest direction
      if (pairs.empty()) break;
      pairs.clear();
      continue;
    }
    double low = 0.0, high = std::numeric_limits<double>::infinity(), step = 1.0, kept_value = value;
    if (pairs.empty()) {
      double longest = 0.0;
      for (double d : direction) longest = std::max(longest, std::fabs(d));
      step = std::min(1.0, 0.3 / std::max(longest, 1e-12));
    }
    bool found = false;  // kept: a step that gains enough
    for (int tries = 0; tries < 12 && done.evaluations < most; ++tries) {
      for (std::size_t i = 0; i < size; ++i) next[i] = x[i] - step * direction[i];
      const double there = function(next, next_g);
      ++done.evaluations;
      if (!(there <= value + 1e-4 * step * slope)) {
        high = step;
        if (found) break;
      } else {
        found = true;
        low = step;
        kept = next, kept_g = next_g, kept_value = there;
        if (-inner(next_g, direction) >= 0.9 * slope) break;
      }
      const bool blind = pairs.empty() && !found;  // nothing is known of the scale yet
      step = std::isinf(high) ? 2.0 * low : blind ? 0.1 * high : 0.5 * (low + high);
    }
    if (!found) {
      if (pairs.empty()) break;
      pairs.clear();
      continue;
    }
    for (std::size_t i = 0; i < size; ++i) next[i] = kept[i] - x[i], next_g[i] = kept_g[i] - g[i];
    x.swap(kept);
    g.swap(kept_g);
    value = kept_value;
    const double sy = inner(next, next_g);
    if (sy > 1e-12 * std::sqrt(inner(next, next) * inner(next_g, next_g))) {
      if (pairs.size() < memory) pairs.push_back({std::vector<double>(size), std::vector<double>(size), 0.0});
      else std::rotate(pairs.begin(), pairs.begin() + 1, pairs.end());  // the oldest becomes the newest
      pairs.back().s.swap(next);
      pairs.back().y.swap(next_g);
      pairs.back().inverse = 1.0 / sy;
    }
    history.push_back(value);
    if (history.size() > patience && history[history.size() - 1 - patience] - value < tolerance * std::fabs(value)) break;
  }
  done.value = value;
  return done;
}

}  // namespace ir
