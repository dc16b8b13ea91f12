// Whether configurations are free, for many small batches with the same thresholds.
#pragma once

#include <memory>

#include "model.hpp"

namespace ir {

// What is set up per model and threshold (Z,) is set up once. The model has to outlive it.
class FreeStates {
 public:
  FreeStates(const Model& model, const double* threshold);
  ~FreeStates();
  // q (count, n); the answer of is_free
  void look(const double* q, std::size_t count, bool* result);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace ir
