// Chain and collision model from arrays that ir_kernels.geometry has checked: here they only change their form.
#pragma once

#include <array>
#include <vector>

#include "arrays.hpp"
#include "model.hpp"

namespace ir {

// joint_origin (n, 4, 4), joint_axis (n, 3), base_pose (4, 4); first_slides: joint 1 is a rail.
Chain chain_of(const Array& joint_origin, const Array& joint_axis, const Array& base_pose, bool first_slides);

// Capsules: link (C,), ends (C, 2, 3), radius (C,). Bodies: kind (B,), pose (B, 4, 4), size (B, 3), hulls: vertices,
// edges, normals, offsets of each. Pairs (Z, 2): capsule and body, capsule and capsule.
Model model_of(const Array& joint_origin, const Array& joint_axis, const Array& base_pose, bool first_slides,
               const Indices& link, const Array& ends, const Array& radius, const Indices& kind, const Array& pose, const Array& size,
               const std::vector<std::array<Array, 4>>& hulls, const Indices& environment, const Indices& self_pairs);

}  // namespace ir
