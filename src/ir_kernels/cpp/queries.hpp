// Batch queries on a model: distances, the nearest pair, checks against thresholds, witnesses and gradients.
#pragma once

#include "model.hpp"

namespace ir {

// Of one pair: distance, points on both surfaces and the normal from b to a, in the world (3 each).
struct WitnessArrays {
  double *distance, *point_a, *point_b, *normal;
};

void distances(const Model& model, const double* q, std::size_t count, double* result);
void min_distance(const Model& model, const double* q, std::size_t count, const double* offset, std::int64_t* pair,
                  const WitnessArrays& result);
void is_free(const Model& model, const double* q, std::size_t count, const double* threshold, bool* result);
// gradient: (count, n), or null
void witnesses(const Model& model, const double* q, std::size_t count, const std::int64_t* pair,
               const WitnessArrays& result, double* gradient);
// One pair in each of eight configurations with the frames of their links: distance, and its n derivatives by the joints.
void pair_slopes(const Model& model, const std::vector<Frame<Double8>>& frames, const int pair[8], Double8& distance,
                 Double8* gradient);

}  // namespace ir
