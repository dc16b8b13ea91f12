// A convex polytope and its signed distance from a segment: Gilbert, Johnson and Keerthi's algorithm when apart.
#pragma once

#include <vector>

namespace ir {

struct Hull {
  std::vector<double> vertices, normals, edges;  // 3 each; edges as directions
  std::vector<double> offsets;                   // inside: normal . x <= offset
};

// Signed distance of the segment a b, the place t on it, and the unit normal from the hull to the segment.
double segment_hull(const Hull& hull, const double a[3], const double b[3], double& t, double normal[3]);

}  // namespace ir
