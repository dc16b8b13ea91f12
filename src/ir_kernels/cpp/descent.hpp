// L-BFGS (Nocedal, Updating quasi-Newton matrices with limited storage, 1980) with the bisecting line search for weak
// Wolfe conditions of Lewis and Overton (Nonsmooth optimization via quasi-Newton methods, 2013), which stays sound
// where the function has kinks.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace ir {

struct Descent {
  int iterations, evaluations;
  double value;
};

inline double inner(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t k = 0; k < a.size(); ++k) sum += a[k] * b[k];
  return sum;
}

// function(x, gradient) -> value; precondition(v): v <- M^-1 v for a positive definite M near the Hessian. Ends after
// `most` evaluations, or when ten iterations gain less than `tolerance` of the value.
template <class Function, class Precondition>
Descent descend(std::vector<double>& x, Function&& function, Precondition&& precondition, int most, double tolerance) {
  constexpr std::size_t memory = 16;
  constexpr int patience = 10;
  const std::size_t size = x.size();
  struct Pair {
    std::vector<double> s, y;
    double inverse;
  };
  std::vector<Pair> pairs;
  std::vector<double> g(size), direction(size), next(size), next_g(size), kept, kept_g, scaled(size), alpha(memory), history;
  double value = function(x, g);
  Descent done{0, 1, value};
  history.push_back(value);
  while (done.evaluations < most) {
    direction = g;
    for (std::size_t k = pairs.size(); k-- > 0;) {
      alpha[k] = inner(pairs[k].s, direction) * pairs[k].inverse;
      for (std::size_t i = 0; i < size; ++i) direction[i] -= alpha[k] * pairs[k].y[i];
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
      for (std::size_t i = 0; i < size; ++i) direction[i] += (alpha[k] - beta) * pairs[k].s[i];
    }
    double slope = -inner(g, direction);
    if (!(slope < 0.0)) {  // only rounding can lead here: start again from the steepest way
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
      step = std::isinf(high) ? 2.0 * low : 0.5 * (low + high);
    }
    if (!found) {
      if (pairs.empty()) break;
      pairs.clear();
      continue;
    }
    Pair pair{kept, kept_g, 0.0};
    for (std::size_t i = 0; i < size; ++i) pair.s[i] -= x[i], pair.y[i] -= g[i];
    x.swap(kept);
    g.swap(kept_g);
    value = kept_value;
    const double sy = inner(pair.s, pair.y);
    if (sy > 1e-12 * std::sqrt(inner(pair.s, pair.s) * inner(pair.y, pair.y))) {
      pair.inverse = 1.0 / sy;
      if (pairs.size() == memory) pairs.erase(pairs.begin());
      pairs.push_back(std::move(pair));
    }
    ++done.iterations;
    history.push_back(value);
    if (history.size() > patience && history[history.size() - 1 - patience] - value < tolerance * std::fabs(value)) break;
  }
  done.value = value;
  return done;
}

}  // namespace ir
