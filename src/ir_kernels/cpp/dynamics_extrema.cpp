// Between two neighbouring roots of p' a polynomial p is monotonic: from the linear derivative upwards every bracket is safe.
#include "dynamics_extrema.hpp"

#include <algorithm>
#include <cmath>

namespace ir::dynamics {
namespace {

constexpr int kIterations = 80;  // of bisection at most; Newton ends after a handful

double evaluate(const double* c, int terms, double x) {
  double value = c[terms - 1];
  for (int k = terms - 2; k >= 0; --k) value = value * x + c[k];
  return value;
}

// Root of p in a bracket on which it is monotonic, or the better end.
double root(const double* p, const double* slope, int terms, double low, double high) {
  const double at_low = evaluate(p, terms, low), at_high = evaluate(p, terms, high);
  if (!(at_low * at_high < 0.0)) return std::abs(at_low) <= std::abs(at_high) ? low : high;
  double x = 0.5 * (low + high);
  for (int i = 0; i < kIterations; ++i) {
    const double value = evaluate(p, terms, x);
    if (value == 0.0) break;
    (value * at_low > 0.0 ? low : high) = x;
    const double steep = evaluate(slope, terms - 1, x);
    const double newton = x - value / steep;
    const double following = steep != 0.0 && newton >= low && newton <= high ? newton : 0.5 * (low + high);
    const bool settled = std::abs(following - x) <= 1e-16;
    x = following;
    if (settled) break;
  }
  return x;
}

}  // namespace

void polynomial_extrema(const double* coefficients, const double* durations, long count, int per_segment, int terms,
                        double* minimum, double* maximum, double* time_of_minimum, double* time_of_maximum) {
  for (long s = 0; s < count; ++s) {
    const double T = durations[s / per_segment];
    double chain[kMaxDegree + 1][kMaxDegree + 1];  // p in time scaled to [0, 1], p', p'', ..
    double scale = 1.0;
    for (int k = 0; k < terms; ++k, scale *= T) chain[0][k] = coefficients[s * terms + k] * scale;
    for (int d = 1; d < terms; ++d)
      for (int k = 0; k < terms - d; ++k) chain[d][k] = chain[d - 1][k + 1] * (k + 1);
    double points[kMaxDegree + 2] = {0.0, 1.0}, next[kMaxDegree + 2];
    int m = 2;
    double bent = 0.0;  // the slope changes by no more
    for (int k = 2; k < terms; ++k) bent += k * std::abs(chain[0][k]);
    const bool monotonic = terms > 1 && std::abs(chain[0][1]) > bent;
    for (int d = monotonic ? 0 : terms - 2; d >= 1; --d) {  // roots of the d-th derivative, between those of the next one
      next[0] = 0.0;
      for (int k = 0; k + 1 < m; ++k) next[k + 1] = root(chain[d], chain[d + 1], terms - d, points[k], points[k + 1]);
      next[m] = 1.0;
      ++m;
      std::sort(next, next + m);
      std::copy(next, next + m, points);
    }
    minimum[s] = maximum[s] = evaluate(chain[0], terms, 0.0);
    time_of_minimum[s] = time_of_maximum[s] = 0.0;
    for (int k = 1; k < m; ++k) {
      const double value = evaluate(chain[0], terms, points[k]);
      if (value < minimum[s]) {
        minimum[s] = value;
        time_of_minimum[s] = points[k] * T;
      }
      if (value > maximum[s]) {
        maximum[s] = value;
        time_of_maximum[s] = points[k] * T;
      }
    }
  }
}

// long: three polynomials side by side
void polynomial_samples(const double* coefficients, const double* durations, const double* begins, long S, int n, int terms,
                        const double* times, long M, double* q, double* qd, double* qdd) {
  for (long k = 0, s = 0; k < M; ++k) {
    const double t = times[k];
    if (t < begins[s] || (s + 1 < S && t >= begins[s + 1]))  // mostly the next one, or the same
      s = std::max<long>(std::upper_bound(begins, begins + S, t) - begins - 1, 0);
    const double u = std::min(std::max(t - begins[s], 0.0), durations[s]);
    for (int j = 0; j < n; ++j) {
      const double* c = coefficients + (s * n + j) * terms;
      double place = 0.0, speed = 0.0, change = 0.0;
      for (int i = terms - 1; i >= 0; --i) {
        change = change * u + speed;
        speed = speed * u + place;
        place = place * u + c[i];
      }
      q[k * n + j] = place, qd[k * n + j] = speed, qdd[k * n + j] = 2.0 * change;
    }
  }
}

}  // namespace ir::dynamics
