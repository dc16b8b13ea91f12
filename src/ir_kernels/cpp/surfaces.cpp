// Surfaces of triangles in trees of boxes: whether one comes near another one, and which of its triangles do.
//
// A box is along the axes of its own surface and holds the triangles with what they stand for; a ball around it is what
// the other surface sees of it when it is turned. Two triangles are near when a corner is near the other's inside, an
// edge near an edge, or an edge goes through the other one; planes that tell them apart are tried first.
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "arrays.hpp"
#include "bindings.hpp"

namespace py = pybind11;
using ir::Array, ir::expect;

namespace {

struct P {
  double x, y, z;
};
P operator-(P a, P b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
P operator+(P a, P b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
P operator*(double s, P a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(P a, P b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
P cross(P a, P b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
P least(P a, P b) { return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)}; }
P most(P a, P b) { return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)}; }
double clipped(double x) { return std::min(std::max(x, 0.0), 1.0); }
double of(P a, int axis) { return axis == 0 ? a.x : axis == 1 ? a.y : a.z; }

struct Triangle {
  P corner[3];
  double beside;  // stands for what is within that
  std::int64_t row;
};

struct Node {
  P low, high, centre;
  double radius;
  int begin, end;  // of its triangles
  int right;       // its second half; the first one follows; 0: a leaf
};

struct Pose {
  P row[3], to;
  P operator()(P a) const { return P{dot(row[0], a), dot(row[1], a), dot(row[2], a)} + to; }
};

Pose pose_at(const double* p) {
  return {{{p[0], p[1], p[2]}, {p[4], p[5], p[6]}, {p[8], p[9], p[10]}}, {p[3], p[7], p[11]}};
}

double square_from_segment(P at, P a, P b) {
  const P along = b - a;
  const double length = dot(along, along);
  const P apart = at - a - (length > 0.0 ? clipped(dot(at - a, along) / length) : 0.0) * along;
  return dot(apart, apart);
}

// Of the inside of two segments; near their ends a corner is nearest.
double square_between(P a, P b, P c, P d) {
  const P u = b - a, v = d - c, w = a - c;
  const double uu = dot(u, u), uv = dot(u, v), vv = dot(v, v), uw = dot(u, w), vw = dot(v, w);
  const double square = uu * vv - uv * uv;
  if (!(square > 1e-14 * uu * vv)) return std::numeric_limits<double>::infinity();  // parallel
  const double s = (uv * vw - vv * uw) / square, t = (uu * vw - uv * uw) / square;
  if (s < 0.0 || s > 1.0 || t < 0.0 || t > 1.0) return std::numeric_limits<double>::infinity();
  const P apart = w + s * u - t * v;
  return dot(apart, apart);
}

// Whether all corners are on one side of the other's plane and farther than that from it.
bool plane_apart(const P* plane, const P* corners, double near) {
  const P normal = cross(plane[1] - plane[0], plane[2] - plane[0]);
  double height[3];
  for (int i = 0; i < 3; ++i) height[i] = dot(corners[i] - plane[0], normal);
  const double low = std::min({height[0], height[1], height[2]}), high = std::max({height[0], height[1], height[2]});
  const double beside = low > 0.0 ? low : high < 0.0 ? -high : 0.0;
  return beside * beside > near * near * dot(normal, normal);
}

// Above its inside alone: beside it an edge is nearest.
bool corner_near(P at, const P* t, double square) {
  const P normal = cross(t[1] - t[0], t[2] - t[0]);
  const double height = dot(at - t[0], normal), area = dot(normal, normal);
  if (!(area > 0.0) || height * height > square * area) return false;
  for (int i = 0; i < 3; ++i)
    if (dot(cross(t[(i + 1) % 3] - t[i], at - t[i]), normal) < 0.0) return false;
  return true;
}

bool pierces(P a, P b, const P* t) {
  const P normal = cross(t[1] - t[0], t[2] - t[0]);
  const double from = dot(a - t[0], normal), to = dot(b - t[0], normal);
  if ((from > 0.0) == (to > 0.0) || from == to) return false;
  return corner_near(a + from / (from - to) * (b - a), t, std::numeric_limits<double>::infinity());
}

bool near(const P* a, const P* b, double distance) {
  if (plane_apart(a, b, distance) || plane_apart(b, a, distance)) return false;
  const double square = distance * distance;
  for (int i = 0; i < 3; ++i) {
    if (corner_near(a[i], b, square) || corner_near(b[i], a, square)) return true;
    for (int j = 0; j < 3; ++j) {
      const P from = a[i], to = a[(i + 1) % 3], begin = b[j], end = b[(j + 1) % 3];
      if (square_between(from, to, begin, end) <= square || square_from_segment(from, begin, end) <= square ||
          square_from_segment(begin, from, to) <= square)
        return true;
    }
  }
  for (int i = 0; i < 3; ++i)
    if (pierces(a[i], a[(i + 1) % 3], b) || pierces(b[i], b[(i + 1) % 3], a)) return true;
  return false;
}

double from_box(P at, const Node& node) {
  const P out = most(most(node.low - at, at - node.high), {0.0, 0.0, 0.0});
  return dot(out, out);
}

constexpr int LEAF = 2;  // triangles, at most

class Surface {
 public:
  Surface(const Array& triangles, const Array& beside) {
    expect(triangles.ndim() == 3 && triangles.size() == 9 * triangles.shape(0), "triangles has to be (T, 3, 3)");
    expect(beside.size() == triangles.shape(0), "beside has to be (T,)");
    const double* x = triangles.data();
    for (py::ssize_t k = 0; k < beside.size(); ++k, x += 9)
      triangles_.push_back({{{x[0], x[1], x[2]}, {x[3], x[4], x[5]}, {x[6], x[7], x[8]}}, beside.data()[k], k});
    if (!triangles_.empty()) build(0, static_cast<int>(triangles_.size()));
  }

  std::size_t size() const { return triangles_.size(); }

  // Whether any triangle is nearer to the other surface; looked_at counts pairs of boxes, and where they are more than
  // `enough` it is taken to be.
  bool meets(const Surface& other, const Pose& pose, double within, std::int64_t enough,
             std::int64_t& looked_at) const {
    return size() && other.size() && meets(0, other, 0, pose, within, enough, looked_at);
  }

  // The rows of the triangles that are nearer to the other surface.
  void touching(const Surface& other, const Pose& pose, double within, bool* rows) const {
    if (size() && other.size()) touching(0, other, pose, within, rows);
  }

 private:
  int build(int begin, int end) {
    const double far = std::numeric_limits<double>::infinity();
    Node node{{far, far, far}, {-far, -far, -far}, {}, 0.0, begin, end, 0};
    for (int k = begin; k < end; ++k)
      for (const P& at : triangles_[k].corner) {
        const P wider = triangles_[k].beside * P{1.0, 1.0, 1.0};
        node.low = least(node.low, at - wider);
        node.high = most(node.high, at + wider);
      }
    node.centre = 0.5 * (node.low + node.high);
    for (int k = begin; k < end; ++k)
      for (const P& at : triangles_[k].corner) {
        const P out = at - node.centre;
        node.radius = std::max(node.radius, std::sqrt(dot(out, out)) + triangles_[k].beside);
      }
    const int here = static_cast<int>(nodes_.size());
    nodes_.push_back(node);
    if (end - begin <= LEAF) return here;
    const P size = node.high - node.low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const auto along = [axis](const Triangle& t) { return of(t.corner[0] + t.corner[1] + t.corner[2], axis); };
    const int middle = (begin + end) / 2;
    std::nth_element(triangles_.begin() + begin, triangles_.begin() + middle, triangles_.begin() + end,
                     [&](const Triangle& a, const Triangle& b) {
                       return along(a) < along(b) || (along(a) == along(b) && a.row < b.row);
                     });
    build(begin, middle);
    const int right = build(middle, end);
    nodes_[here].right = right;
    return here;
  }

  bool meets(int here, const Surface& other, int there, const Pose& pose, double within, std::int64_t enough,
             std::int64_t& looked_at) const {
    if (++looked_at > enough) return true;
    const Node &a = nodes_[here], &b = other.nodes_[there];
    const double reach = a.radius + within;
    if (from_box(pose(a.centre), b) > reach * reach) return false;
    if (a.right && (a.radius >= b.radius || !b.right))
      return meets(here + 1, other, there, pose, within, enough, looked_at) ||
             meets(a.right, other, there, pose, within, enough, looked_at);
    if (b.right)
      return meets(here, other, there + 1, pose, within, enough, looked_at) ||
             meets(here, other, b.right, pose, within, enough, looked_at);
    for (int i = a.begin; i < a.end; ++i) {
      const Triangle& own = triangles_[i];
      const P corners[3] = {pose(own.corner[0]), pose(own.corner[1]), pose(own.corner[2])};
      for (int j = b.begin; j < b.end; ++j) {
        const Triangle& one = other.triangles_[j];
        if (near(corners, one.corner, own.beside + one.beside + within)) return true;
      }
    }
    return false;
  }

  void touching(int here, const Surface& other, const Pose& pose, double within, bool* rows) const {
    const Node& a = nodes_[here];
    if (a.right) {
      if (!other.reached(0, pose(a.centre), a.radius + within)) return;
      touching(here + 1, other, pose, within, rows);
      touching(a.right, other, pose, within, rows);
      return;
    }
    for (int i = a.begin; i < a.end; ++i) {
      const Triangle& own = triangles_[i];
      const P corners[3] = {pose(own.corner[0]), pose(own.corner[1]), pose(own.corner[2])};
      rows[own.row] = other.any_near(0, corners, own.beside + within);
    }
  }

  // Whether a ball reaches the box of a leaf.
  bool reached(int there, P centre, double radius) const {
    const Node& b = nodes_[there];
    if (from_box(centre, b) > radius * radius) return false;
    return !b.right || reached(there + 1, centre, radius) || reached(b.right, centre, radius);
  }

  bool any_near(int there, const P* corners, double within) const {
    const Node& b = nodes_[there];
    const P wider = within * P{1.0, 1.0, 1.0};
    const P low = least(least(corners[0], corners[1]), corners[2]) - wider;
    const P high = most(most(corners[0], corners[1]), corners[2]) + wider;
    const P out = most(low - b.high, b.low - high);
    if (std::max({out.x, out.y, out.z}) > 0.0) return false;
    if (b.right) return any_near(there + 1, corners, within) || any_near(b.right, corners, within);
    for (int j = b.begin; j < b.end; ++j)
      if (near(corners, triangles_[j].corner, within + triangles_[j].beside)) return true;
    return false;
  }

  std::vector<Triangle> triangles_;
  std::vector<Node> nodes_;
};

py::tuple meets(const Surface& one, const Surface& other, const Array& poses, double within, std::int64_t enough) {
  expect(poses.ndim() == 3 && poses.shape(1) == 4 && poses.shape(2) == 4, "poses has to be (N, 4, 4)");
  py::array_t<bool> met(poses.shape(0));
  bool* to = met.mutable_data();
  std::int64_t looked_at = 0;
  {
    py::gil_scoped_release release;
    for (py::ssize_t k = 0; k < poses.shape(0); ++k)
      to[k] = one.meets(other, pose_at(poses.data() + 16 * k), within, enough, looked_at);
  }
  return py::make_tuple(met, looked_at);
}

py::array_t<bool> touching(const Surface& one, const Surface& other, const Array& pose, double within) {
  expect(pose.ndim() == 2 && pose.shape(0) == 4 && pose.shape(1) == 4, "pose has to be (4, 4)");
  py::array_t<bool> rows(static_cast<py::ssize_t>(one.size()));
  bool* to = rows.mutable_data();
  std::fill(to, to + one.size(), false);
  py::gil_scoped_release release;
  one.touching(other, pose_at(pose.data()), within, to);
  return rows;
}

}  // namespace

void bind_surfaces(py::module_& m) {
  py::class_<Surface>(m, "Surface", py::module_local())
      .def(py::init<const Array&, const Array&>())
      .def("meets", &meets)
      .def("touching", &touching);
}
