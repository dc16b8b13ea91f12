// How a change of a spline's control points counts in the descent: bending costs most, and each joint counts in parts of
// its speed limit.
#pragma once

#include <cmath>
#include <vector>

namespace ir {

// M = (D'D + holding) / scale^2 for each joint, D the second differences of the m inner control points between fixed ends;
// a Cholesky factor L of its band solves with it.
class BendingMetric {
 public:
  BendingMetric(int m, const std::vector<double>& scale, double holding)
      : m_(m), inverse_(m), first_(m + 1), second_(m + 2) {
    for (const double s : scale) square_.push_back(s * s);
    for (int i = 0; i < m; ++i) {
      if (i > 1) second_[i] = inverse_[i - 2];
      if (i > 0) first_[i] = (-4.0 - (i > 1 ? second_[i] * first_[i - 1] : 0.0)) * inverse_[i - 1];
      const double diagonal = 6.0 + holding - (i == 0) - (i == m - 1);
      inverse_[i] = 1.0 / std::sqrt(diagonal - first_[i] * first_[i] - second_[i] * second_[i]);
    }
  }

  // v (m, n) <- M^-1 v
  void solve(double* v) const {
    const int n = static_cast<int>(square_.size());
    const auto row = [v, n](int i) { return v + static_cast<std::size_t>(i) * n; };
    for (int i = 0; i < m_; ++i)
      eliminate(row(i), row(i > 0 ? i - 1 : i), row(i > 1 ? i - 2 : i), first_[i], second_[i], inverse_[i]);
    for (int i = m_ - 1; i >= 0; --i) {
      const int next = i + 1 < m_ ? i + 1 : i, after = i + 2 < m_ ? i + 2 : i;
      eliminate(row(i), row(next), row(after), first_[i + 1], second_[i + 2], inverse_[i]);
    }
    for (int i = 0; i < m_; ++i)
      for (int j = 0; j < n; ++j) row(i)[j] *= square_[j];
  }

 private:
  void eliminate(double* at, const double* near, const double* far, double of_near, double of_far, double inverse) const {
    for (std::size_t j = 0; j < square_.size(); ++j) at[j] = (at[j] - of_near * near[j] - of_far * far[j]) * inverse;
  }
  int m_;
  // of L: reciprocals of the diagonal, first and second subdiagonal; zero beyond the last row
  std::vector<double> inverse_, first_, second_, square_;
};

}  // namespace ir
