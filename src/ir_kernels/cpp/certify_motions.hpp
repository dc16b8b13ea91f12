// Motions to be certified: joint values in the middle of an interval of time, and how far they can get from them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace ir {
// Included by one file; internal linkage lets the compiler inline it there as it likes (3 % of a proof).
namespace {

// One motion's joint values, and how far they can get from them.
class Motions {
 public:
  virtual ~Motions() = default;
  virtual void at(std::size_t motion, double low, double high, double* q, double* spread) const = 0;
};

class Edges final : public Motions {
 public:
  Edges(const double* q0, const double* q1, int n) : q0_(q0), q1_(q1), n_(n) {}
  void at(std::size_t motion, double low, double high, double* q, double* spread) const override {
    const double *from = q0_ + motion * n_, *to = q1_ + motion * n_, middle = 0.5 * (low + high);
    for (int j = 0; j < n_; ++j) {
      const double step = to[j] - from[j];
      q[j] = from[j] + middle * step;
      spread[j] = 0.5 * (high - low) * std::fabs(step);
    }
  }

 private:
  const double *q0_, *q1_;
  int n_;
};

class Polynomials final : public Motions {
 public:
  Polynomials(const double* coefficients, int n, int terms)
      : coefficients_(coefficients), n_(n), terms_(terms), shifted_(terms) {}
  void at(std::size_t motion, double low, double high, double* q, double* spread) const override {
    const double middle = 0.5 * (low + high), half = 0.5 * (high - low);
    for (int j = 0; j < n_; ++j) {
      const double* c = coefficients_ + (motion * n_ + j) * terms_;
      std::copy_n(c, terms_, shifted_.begin());
      for (int first = 0; first < terms_ - 1; ++first)
        for (int k = terms_ - 2; k >= first; --k) shifted_[k] += middle * shifted_[k + 1];
      q[j] = shifted_[0];
      double sum = 0.0;
      for (int k = terms_ - 1; k > 0; --k) sum = (sum + std::fabs(shifted_[k])) * half;
      spread[j] = sum;
    }
  }

 private:
  const double* coefficients_;
  int n_, terms_;
  mutable std::vector<double> shifted_;
};

}  // namespace
}  // namespace ir
