#include "hull.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ir {
namespace {

struct P {
  double x, y, z;
};
P operator-(P a, P b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
P operator+(P a, P b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
P operator*(double s, P a) { return {s * a.x, s * a.y, s * a.z}; }
double dot(P a, P b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
P cross(P a, P b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
P at(const std::vector<double>& v, std::size_t i) { return {v[3 * i], v[3 * i + 1], v[3 * i + 2]}; }

// A point of segment minus hull, and which end of the segment it came from.
struct Corner {
  P w;
  double end;
};

struct Simplex {
  Corner corner[4];
  int size = 0;
};

// The point of a corner set's affine hull nearest to the origin, if it lies inside the set: weights, else false.
bool inside_weights(const Corner* c[4], int size, double weight[4]) {
  if (size == 1) {
    weight[0] = 1.0;
    return true;
  }
  // Gram system of the edges from corner 0, by Gaussian elimination with pivoting (at most 3 x 3)
  double m[3][4];
  const int k = size - 1;
  P edge[3];
  for (int i = 0; i < k; ++i) edge[i] = c[i + 1]->w - c[0]->w;
  for (int i = 0; i < k; ++i) {
    for (int j = 0; j < k; ++j) m[i][j] = dot(edge[i], edge[j]);
    m[i][k] = -dot(edge[i], c[0]->w);
  }
  for (int i = 0; i < k; ++i) {
    int pivot = i;
    for (int r = i + 1; r < k; ++r)
      if (std::fabs(m[r][i]) > std::fabs(m[pivot][i])) pivot = r;
    if (std::fabs(m[pivot][i]) < 1e-28) return false;
    for (int j = 0; j <= k; ++j) std::swap(m[i][j], m[pivot][j]);
    for (int r = 0; r < k; ++r) {
      if (r == i) continue;
      const double f = m[r][i] / m[i][i];
      for (int j = i; j <= k; ++j) m[r][j] -= f * m[i][j];
    }
  }
  weight[0] = 1.0;
  for (int i = 0; i < k; ++i) {
    weight[i + 1] = m[i][k] / m[i][i];
    weight[0] -= weight[i + 1];
  }
  for (int i = 0; i < size; ++i)
    if (weight[i] < 0.0) return false;
  return true;
}

// Reduces the simplex to the corners that carry its point nearest to the origin; that point and its place t.
P nearest(Simplex& s, double& t) {
  double best = std::numeric_limits<double>::infinity();
  P point{};
  Simplex kept;
  for (int set = 1; set < 1 << s.size; ++set) {
    const Corner* chosen[4];
    int size = 0;
    for (int i = 0; i < s.size; ++i)
      if (set >> i & 1) chosen[size++] = &s.corner[i];
    double weight[4];
    if (!inside_weights(chosen, size, weight)) continue;
    P v{};
    double end = 0.0;
    for (int i = 0; i < size; ++i) {
      v = v + weight[i] * chosen[i]->w;
      end += weight[i] * chosen[i]->end;
    }
    if (dot(v, v) >= best) continue;
    best = dot(v, v);
    point = v;
    t = end;
    kept.size = size;
    for (int i = 0; i < size; ++i) kept.corner[i] = *chosen[i];
  }
  s = kept;
  return point;
}

std::size_t farthest(const Hull& hull, P n) {
  std::size_t best = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < hull.vertices.size() / 3; ++i) {
    const double along = dot(n, at(hull.vertices, i));
    if (along > most) most = along, best = i;
  }
  return best;
}

// Distance of a segment that is apart from the hull. Stops when the lower bound v.w / |v| meets |v|.
double apart(const Hull& hull, P a, P b, double& t, P& normal) {
  Simplex s;
  s.corner[s.size++] = {a - at(hull.vertices, 0), 0.0};
  P v = nearest(s, t);
  for (int step = 0; step < 100; ++step) {
    const double square = dot(v, v);
    if (square < 1e-24 || s.size == 4) break;
    const double end = dot(v, b) < dot(v, a) ? 1.0 : 0.0;
    const P w = (end > 0.0 ? b : a) - at(hull.vertices, farthest(hull, v));
    if (square - dot(v, w) <= 1e-13 * square) break;
    Simplex larger = s;
    larger.corner[larger.size++] = {w, end};
    double place = t;
    const P closer = nearest(larger, place);
    if (dot(closer, closer) >= square) break;  // rounding: no progress
    s = larger, v = closer, t = place;
  }
  const double distance = std::sqrt(dot(v, v));
  if (distance > 1e-12) normal = (1.0 / distance) * v;
  return distance;
}

bool crosses(const Hull& hull, P a, P b) {
  double enter = 0.0, leave = 1.0;
  for (std::size_t f = 0; f < hull.offsets.size(); ++f) {
    const P n = at(hull.normals, f);
    const double from = dot(n, a) - hull.offsets[f], to = dot(n, b) - hull.offsets[f];
    if (from > 0.0 && to > 0.0) return false;
    if (from > 0.0) enter = std::max(enter, from / (from - to));
    if (to > 0.0) leave = std::min(leave, from / (from - to));
  }
  return enter < leave || (enter == leave && dot(b - a, b - a) == 0.0);
}

double depth_in_hull(const Hull& hull, P a, P b, P& normal) {
  double least = std::numeric_limits<double>::infinity();
  for (std::size_t f = 0; f < hull.offsets.size(); ++f) {
    const P n = at(hull.normals, f);
    const double overlap = hull.offsets[f] - std::min(dot(n, a), dot(n, b));
    if (overlap < least) least = overlap, normal = n;
  }
  const P d = b - a;
  for (std::size_t e = 0; e < hull.edges.size() / 3; ++e) {
    const P edge = at(hull.edges, e);
    P c = cross(edge, d);
    const double square = dot(c, c);
    if (square <= 1e-18 * dot(d, d) * dot(edge, edge)) continue;
    c = (1.0 / std::sqrt(square)) * c;
    for (const double sign : {1.0, -1.0}) {
      const P n = sign * c;
      const double overlap = dot(n, at(hull.vertices, farthest(hull, n))) - std::min(dot(n, a), dot(n, b));
      if (overlap < least) least = overlap, normal = n;
    }
  }
  return least;
}

}  // namespace

double segment_hull(const Hull& hull, const double from[3], const double to[3], double& t, double normal[3]) {
  const P a{from[0], from[1], from[2]}, b{to[0], to[1], to[2]};
  P n = at(hull.normals, 0);
  double distance;
  if (crosses(hull, a, b)) {
    const double depth = depth_in_hull(hull, a, b, n);
    const P out = (depth + 1e-9) * n;
    P ignored = n;
    apart(hull, a + out, b + out, t, ignored);
    distance = -depth;
  } else {
    distance = apart(hull, a, b, t, n);
  }
  normal[0] = n.x, normal[1] = n.y, normal[2] = n.z;
  return distance;
}

}  // namespace ir
