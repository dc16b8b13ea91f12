// Splines from rest to rest along given points: where descents start.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

namespace ir {

// How a spline is laid along a path: seconds between its knots where the path is at full speed, its control points
// between the ends, and by what factor it is slower than that; duration [s]: given, or 0.
struct StartSettings {
  double spacing, slower, duration;
  int fewest, most;
};

struct SplineStart {
  std::vector<double> control;  // (K, n)
  double interval;
};

// A guess of the shortest duration that is seldom too long: path (M, n) at full speed, or as its longest joint from rest
// to rest.
inline double fewest_seconds(const double* path, long M, int n, const std::vector<double>& velocity,
                             const std::vector<double>& acceleration) {
  double at_speed = 0.0, from_rest = 0.0;
  std::vector<double> travel(n, 0.0);
  for (long k = 1; k < M; ++k) {
    double slowest = 0.0;
    for (int j = 0; j < n; ++j) {
      const double step = std::fabs(path[k * n + j] - path[(k - 1) * n + j]);
      travel[j] += step;
      slowest = std::max(slowest, step / velocity[j]);
    }
    at_speed += slowest;
  }
  for (int j = 0; j < n; ++j) from_rest = std::max(from_rest, travel[j] / acceleration[j]);
  return std::max(at_speed, 2.0 * std::sqrt(from_rest));
}

// Along the path (M, n), by its length and slowly at both ends.
inline SplineStart spline_along(const double* path, long M, int n, const std::vector<double>& velocity,
                                const std::vector<double>& acceleration, const StartSettings& settings) {
  const double least = fewest_seconds(path, M, n, velocity, acceleration);
  const double wanted = std::ceil(least / settings.spacing);
  const int count = static_cast<int>(std::min<double>(std::max<double>(wanted, settings.fewest), settings.most));
  std::vector<double> passed(M, 0.0);
  for (long k = 1; k < M; ++k) {
    double square = 0.0;
    for (int j = 0; j < n; ++j) square += std::pow(path[k * n + j] - path[(k - 1) * n + j], 2);
    passed[k] = passed[k - 1] + std::sqrt(square);
  }
  SplineStart start{std::vector<double>(static_cast<std::size_t>(count + 6) * n), 0.0};
  long k = 0;
  for (int i = 0; i < count + 6; ++i) {
    const double share = std::min(std::max((i - 2.0) / (count + 1.0), 0.0), 1.0);
    const double at = share * share * (3.0 - 2.0 * share) * passed[M - 1];
    while (k + 2 < M && passed[k + 1] <= at) ++k;
    const double length = passed[k + 1] - passed[k];
    const double part = length > 0.0 ? (at - passed[k]) / length : 0.0;
    const double *from = path + k * n, *to = from + n;
    double* c = &start.control[static_cast<std::size_t>(i) * n];
    for (int j = 0; j < n; ++j) c[j] = i < 3 ? path[j] : i > count + 2 ? path[(M - 1) * n + j] : from[j] + part * (to[j] - from[j]);
  }
  start.interval = (settings.duration > 0.0 ? settings.duration : settings.slower * least) / (count + 3);
  return start;
}

}  // namespace ir
