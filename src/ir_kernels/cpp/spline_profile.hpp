// A path that stays as it is, and what a spline that passes it at its knots owes to where it does so: the descent on the
// speed profile along a fixed path.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace ir {

// p(s), s in [0, 1]: cubics (4, B, n), lowest power first, in s from the break before; breaks (B + 1).
struct CubicPath {
  const double *breaks, *cubics;
  long count;
  int n;

  // p and its derivative, both (n)
  void at(double s, double* p, double* slope) const {
    const double* after = std::upper_bound(breaks + 1, breaks + count, s);
    const long k = after - breaks - 1;
    const double u = s - breaks[k];
    const double *a = cubics + k * n, *b = a + count * n, *c = b + count * n, *d = c + count * n;
    for (int j = 0; j < n; ++j) {
      p[j] = a[j] + u * (b[j] + u * (c[j] + u * d[j]));
      slope[j] = b[j] + u * (2.0 * c[j] + 3.0 * u * d[j]);
    }
  }
};

// Cholesky factor of a symmetric positive definite band matrix with `width` bands beside the diagonal.
class Banded {
 public:
  // entry(i, k): row i, column i - k
  template <class Entry> Banded(int size, int width, Entry entry) : size_(size), width_(width), of_(size * (width + 1)) {
    for (int i = 0; i < size; ++i)
      for (int k = std::min(i, width); k >= 0; --k) {
        double sum = entry(i, k);
        for (int r = k + 1; r <= std::min(i, width); ++r) sum -= at(i, r) * at(i - k, r - k);
        at(i, k) = k > 0 ? sum / at(i - k, 0) : std::sqrt(sum);
      }
  }
  // v (size, n) <- M^-1 v
  void solve(double* v, int n) const {
    for (int i = 0; i < size_; ++i) {
      for (int k = 1; k <= std::min(i, width_); ++k) subtract(v + i * n, v + (i - k) * n, at(i, k), n);
      for (int j = 0; j < n; ++j) v[i * n + j] /= at(i, 0);
    }
    for (int i = size_ - 1; i >= 0; --i) {
      for (int k = 1; k <= std::min(size_ - 1 - i, width_); ++k) subtract(v + i * n, v + (i + k) * n, at(i + k, k), n);
      for (int j = 0; j < n; ++j) v[i * n + j] /= at(i, 0);
    }
  }

 private:
  double& at(int i, int k) { return of_[i * (width_ + 1) + k]; }
  double at(int i, int k) const { return of_[i * (width_ + 1) + k]; }
  static void subtract(double* to, const double* from, double weight, int n) {
    for (int j = 0; j < n; ++j) to[j] -= weight * from[j];
  }
  int size_, width_;
  std::vector<double> of_;
};

// From control points to knots, times 6.
inline Banded knots_of(int count) {
  return Banded(count, 1, [](int, int k) { return k == 0 ? 4.0 : 1.0; });
}

// 1 + weight D'D, D the third differences of `count` values.
inline Banded jerk_metric(int count, double weight) {
  static constexpr double third[4] = {-1.0, 3.0, -3.0, 1.0};
  return Banded(count, 3, [=](int i, int k) {
    double sum = k == 0 ? 1.0 : 0.0;
    for (int r = std::max(0, i - 3); r <= std::min(i - k, count - 4); ++r) sum += weight * third[i - r] * third[i - k - r];
    return sum;
  });
}

}  // namespace ir
