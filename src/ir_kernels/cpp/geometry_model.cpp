#include "geometry_model.hpp"

#include <algorithm>
#include <cmath>

namespace ir {
namespace {

// ends: both end points in the link's own frame.
Capsule capsule_of(const Chain& chain, int link, const double* ends, double radius) {
  expect(link >= 0 && link <= chain.n, "a capsule's link is out of range");
  double p0[3], p1[3];
  chain.to_internal(link, ends, p0);
  chain.to_internal(link, ends + 3, p1);
  double middle[3], axis[3], square = 0.0;
  for (int i = 0; i < 3; ++i) {
    middle[i] = 0.5 * (p0[i] + p1[i]);
    axis[i] = 0.5 * (p1[i] - p0[i]);
    square += axis[i] * axis[i];
  }
  Capsule capsule;
  capsule.link = link;
  capsule.middle = Local(middle);
  capsule.axis = Local(axis);
  capsule.radius = radius;
  capsule.half = std::sqrt(square);
  capsule.inverse_square = square > 0.0 ? 0.25 / square : 0.0;
  return capsule;
}

// A hull about the middle of its box, which goes to `centre`, and half the edges of that box.
Hull centred_hull(const std::array<Array, 4>& arrays, double centre[3], double half[3]) {
  const auto& [vertices, edges, normals, offsets] = arrays;
  const auto copied = [](const Array& a) { return std::vector<double>(a.data(), a.data() + a.size()); };
  Hull hull = {copied(vertices), copied(normals), copied(edges), copied(offsets)};
  expect(!hull.vertices.empty() && hull.normals.size() == 3 * hull.offsets.size(), "a hull is incomplete");
  for (int i = 0; i < 3; ++i) {
    double low = hull.vertices[i], high = low;
    for (std::size_t v = i; v < hull.vertices.size(); v += 3) {
      low = std::min(low, hull.vertices[v]);
      high = std::max(high, hull.vertices[v]);
    }
    centre[i] = 0.5 * (low + high);
    half[i] = 0.5 * (high - low);
  }
  for (std::size_t v = 0; v < hull.vertices.size(); ++v) hull.vertices[v] -= centre[v % 3];
  for (std::size_t f = 0; f < hull.offsets.size(); ++f)
    for (int i = 0; i < 3; ++i) hull.offsets[f] -= hull.normals[3 * f + i] * centre[i];
  return hull;
}

// Lengths of a body that is no hull; s: its size, as ir_kernels.data.BodyLike has it.
void set_lengths(Body<double>& body, int kind, const double* s) {
  switch (kind) {
    case box:
      for (int i = 0; i < 3; ++i) body.half[i] = 0.5 * s[i];
      break;
    case cylinder:
      body.radius = s[0], body.half_length = 0.5 * s[1];
      body.half[0] = body.half[1] = s[0], body.half[2] = 0.5 * s[1];
      break;
    case sphere:
      body.radius = body.half[0] = body.half[1] = body.half[2] = s[0];
      break;
    case capsule:
      body.radius = s[0], body.half_length = 0.5 * s[1];
      body.half[0] = body.half[1] = s[0], body.half[2] = 0.5 * s[1] + s[0];
      break;
    case plane:
      break;
    default:
      expect(false, "a body's kind is unknown");
  }
}

void add_body(Model& m, int kind, const double* pose, const double* size, const std::array<Array, 4>& hull_arrays) {
  Body<double> body{};
  Hull hull;
  double centre[3] = {0, 0, 0};
  if (kind == mesh) hull = centred_hull(hull_arrays, centre, body.half);
  else set_lengths(body, kind, size);
  double world[3];
  for (int i = 0; i < 3; ++i)
    world[i] = pose[4 * i] * centre[0] + pose[4 * i + 1] * centre[1] + pose[4 * i + 2] * centre[2] + pose[4 * i + 3] -
               m.chain.base_origin[i];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) body.axis[i][j] = pose[4 * j + i];
    body.offset[i] = body.axis[i][0] * world[0] + body.axis[i][1] * world[1] + body.axis[i][2] * world[2];
  }
  m.kind.push_back(kind);
  m.bodies_double.push_back(body);
  m.hulls.push_back(std::move(hull));
}

// first, second: how many there are to be paired.
std::vector<std::array<int, 2>> pairs_of(const Indices& pairs, pybind11::ssize_t first, pybind11::ssize_t second) {
  std::vector<std::array<int, 2>> result;
  for (pybind11::ssize_t z = 0; 2 * z < pairs.size(); ++z) {
    const std::int64_t a = pairs.data()[2 * z], b = pairs.data()[2 * z + 1];
    expect(a >= 0 && a < first && b >= 0 && b < second, "a pair is out of range");
    result.push_back({static_cast<int>(a), static_cast<int>(b)});
  }
  return result;
}

}  // namespace

Chain chain_of(const Array& joint_origin, const Array& joint_axis, const Array& base_pose, bool first_slides) {
  const int n = static_cast<int>(joint_axis.shape(0));
  expect(joint_axis.size() == 3 * n && joint_origin.size() == 16 * n && base_pose.size() == 16, "not a chain");
  return Chain(n, joint_origin.data(), joint_axis.data(), base_pose.data(), first_slides);
}

Model model_of(const Array& joint_origin, const Array& joint_axis, const Array& base_pose, bool first_slides,
               const Indices& link, const Array& ends, const Array& radius, const Indices& kind, const Array& pose, const Array& size,
               const std::vector<std::array<Array, 4>>& hulls, const Indices& environment, const Indices& self_pairs) {
  Model m(chain_of(joint_origin, joint_axis, base_pose, first_slides));
  const pybind11::ssize_t capsules = link.size(), bodies = kind.size();
  expect(ends.size() == 6 * capsules && radius.size() == capsules, "capsules don't fit together");
  expect(pose.size() == 16 * bodies && size.size() == 3 * bodies && pybind11::ssize_t(hulls.size()) == bodies,
         "bodies don't fit together");
  for (pybind11::ssize_t c = 0; c < capsules; ++c)
    m.capsules.push_back(
        capsule_of(m.chain, static_cast<int>(link.data()[c]), ends.data() + 6 * c, radius.data()[c]));
  for (pybind11::ssize_t b = 0; b < bodies; ++b)
    add_body(m, static_cast<int>(kind.data()[b]), pose.data() + 16 * b, size.data() + 3 * b, hulls[b]);
  m.environment = pairs_of(environment, capsules, bodies);
  for (const auto& pair : pairs_of(self_pairs, capsules, capsules)) {
    SelfPair self{};  // finish() has the rest
    self.a = pair[0], self.b = pair[1];
    m.self_pairs.push_back(self);
  }
  m.finish();
  return m;
}

}  // namespace ir
