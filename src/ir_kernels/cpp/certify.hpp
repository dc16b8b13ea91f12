// Proof of motion: see ir_kernels/reference/certify.py, whose rules this follows.
#pragma once

#include "model.hpp"

namespace ir {

enum Verdict : std::uint8_t { free_verdict, collides, undecided };

struct Outcome {
  Verdict verdict;
  double t0, t1;
  int pair;
  double bound;  // least distance - threshold - movement over the proved intervals; only where it was asked for
};

// The same thresholds (Z,) for many batches of edges: what is set up per model and threshold is set up once. The model
// has to outlive it. Outcomes don't depend on how edges are divided into batches.
class EdgeCertifier {
 public:
  EdgeCertifier(const Model& model, const double* threshold);
  ~EdgeCertifier();
  void certify(const double* q0, const double* q1, std::size_t count, Outcome* result);

 private:
  struct Parts;
  int n_;
  std::unique_ptr<Parts> parts_;
};

// Straight segments from q0 to q1 (count, n).
void certify_edges(const Model& model, const double* q0, const double* q1, std::size_t count, const double* threshold,
                   Outcome* result);

// One trajectory of polynomials (count, n, terms) over durations (count); times from its start.
Outcome certify_trajectory(const Model& model, const double* coefficients, int terms, const double* durations,
                           std::size_t count, const double* threshold);

}  // namespace ir
