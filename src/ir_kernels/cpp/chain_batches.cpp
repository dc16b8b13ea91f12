#include "chain_batches.hpp"

#include <algorithm>
#include <vector>

namespace ir {
namespace {

// Joint values of `used` configurations from q on, joint by joint; lanes without one repeat the last.
void load_columns(const double* q, int n, int used, Double8* lanes) {
  for (int j = 0; j < n; ++j)
    for (int k = 0; k < 8; ++k) lanes[j][k] = q[std::min(k, used - 1) * n + j];
}

// The pose (4, 4) of one lane's frame; g: the own frame in the internal one, own frame = internal frame x transposed g.
void write_pose(const Frame<Double8>& f, int k, const double* g, const double* base_origin, double* pose) {
  const double turn[9] = {f.x.x[k], f.y.x[k], f.z.x[k], f.x.y[k], f.y.y[k], f.z.y[k], f.x.z[k], f.y.z[k], f.z.z[k]};
  const double origin[3] = {f.origin.x[k], f.origin.y[k], f.origin.z[k]};
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      pose[4 * i + j] = turn[3 * i] * g[3 * j] + turn[3 * i + 1] * g[3 * j + 1] + turn[3 * i + 2] * g[3 * j + 2];
    pose[4 * i + 3] = origin[i] + base_origin[i];
    pose[12 + i] = 0.0;
  }
  pose[15] = 1.0;
}

}  // namespace

void link_poses(const Chain& chain, const double* q, std::size_t count, double* result) {
  std::vector<Double8> lanes(chain.n);
  std::vector<Frame<Double8>> frames(chain.n + 1);
  for (std::size_t first = 0; first < count; first += 8) {
    const int used = static_cast<int>(std::min<std::size_t>(8, count - first));
    load_columns(q + first * chain.n, chain.n, used, lanes.data());
    chain.forward(lanes.data(), frames.data());
    for (int link = 0; link <= chain.n; ++link)
      for (int k = 0; k < used; ++k)
        write_pose(frames[link], k, &chain.internal[9 * link], chain.base_origin,
                   result + ((first + k) * (chain.n + 1) + link) * 16);
  }
}

void jacobians(const Chain& chain, const double* tcp, const double* q, std::size_t count, double* result) {
  std::vector<Double8> lanes(chain.n);
  std::vector<Frame<Double8>> frames(chain.n + 1);
  const double own[3] = {tcp[3], tcp[7], tcp[11]};
  double local[3];
  chain.to_internal(chain.n, own, local);
  const Local point(local);
  for (std::size_t first = 0; first < count; first += 8) {
    const int used = static_cast<int>(std::min<std::size_t>(8, count - first));
    load_columns(q + first * chain.n, chain.n, used, lanes.data());
    chain.forward(lanes.data(), frames.data());
    const auto at = place(frames[chain.n], point);
    for (int j = 0; j < chain.n; ++j) {
      const bool slides = j == 0 && chain.first_slides;
      const auto& along = frames[j + 1].z;
      const auto linear = slides ? along : cross(along, at - frames[j + 1].origin);
      const auto axis = slides ? Vec<Double8>{} : along;
      for (int k = 0; k < used; ++k) {
        double* column = result + (first + k) * 6 * chain.n + j;
        const double values[6] = {linear.x[k], linear.y[k], linear.z[k], axis.x[k], axis.y[k], axis.z[k]};
        for (int i = 0; i < 6; ++i) column[i * chain.n] = values[i];
      }
    }
  }
}

}  // namespace ir
