// Exact witnesses in double: distance, nearest points and normal of one pair per lane.
#pragma once

#include "queries.hpp"

namespace ir {

struct WitnessLanes {
  Double8 distance;
  Vec<Double8> point_a, point_b, normal;
  Vec<Double8> centre_a, centre_b;  // the same on the axes: what the gradient turns with
};

// Lanes of the same kind of body are computed together.
WitnessLanes witness(const Model& model, const std::vector<Frame<Double8>>& frames, const std::int32_t pair[8]);
// Derivatives of the distances by the joint values.
void slopes(const Model& model, const std::vector<Frame<Double8>>& frames, const std::int32_t pair[8],
            const WitnessLanes& w, Double8* gradient);
void write(const Model& model, const WitnessLanes& w, int count, std::size_t first, const WitnessArrays& to);

}  // namespace ir
