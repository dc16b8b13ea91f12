// A tree of configurations with the nearest node by a weighted metric: all of them are looked at, sixteen at a time,
// which for the few thousand nodes of a search is faster than any structure over them.
#pragma once

#include <limits>
#include <vector>

#include "lanes.hpp"

namespace ir {

class SearchTree {
 public:
  // scale (n): how much each joint counts
  SearchTree(int n, const double* scale) : n_(n), scale_(scale, scale + n), target_(n) {}

  int size() const { return static_cast<int>(parent_.size()); }
  // valid until the next one is added
  const double* node(int k) const { return &nodes_[static_cast<std::size_t>(k) * n_]; }
  int parent(int k) const { return parent_[k]; }  // -1: a root
  int root(int k) const { return root_[k]; }

  int add(const double* q, int parent) {
    const int k = size();
    if (k % 16 == 0) lanes_.resize(lanes_.size() + n_, splat<Float16>(nowhere));
    for (int j = 0; j < n_; ++j) lanes_[lanes_.size() - n_ + j][k % 16] = static_cast<float>(scale_[j] * q[j]);
    nodes_.insert(nodes_.end(), q, q + n_);
    parent_.push_back(parent);
    root_.push_back(parent < 0 ? k : root_[parent]);
    return k;
  }

  // A node that isn't a root, and all that hang on it, are nobody's nearest from now on.
  void cut(int node) {
    std::vector<bool> off(size());
    off[node] = true;
    for (int k = node; k < size(); ++k) {
      if (parent_[k] >= 0 && off[parent_[k]]) off[k] = true;
      if (!off[k]) continue;
      for (int j = 0; j < n_; ++j) lanes_[static_cast<std::size_t>(k / 16) * n_ + j][k % 16] = nowhere;
    }
  }

  // The node nearest to q, of equally near ones the first; the square of its weighted distance.
  int nearest(const double* q, float& square) {
    for (int j = 0; j < n_; ++j) target_[j] = splat<Float16>(static_cast<float>(scale_[j] * q[j]));
    Float16 best = splat<Float16>(std::numeric_limits<float>::infinity());
    Int16 where{}, at{};
    for (const Float16 *block = lanes_.data(), *end = block + lanes_.size(); block != end; block += n_, at += 1) {
      Float16 sum{};
      for (int j = 0; j < n_; ++j) {
        const Float16 d = block[j] - target_[j];
        sum += d * d;
      }
      const Int16 nearer = sum < best;
      best = nearer ? sum : best;
      where = nearer ? at : where;
    }
    int found = 0;
    square = std::numeric_limits<float>::infinity();
    for (int k = 0; k < 16; ++k) {
      const int node = where[k] * 16 + k;
      if (best[k] < square || (best[k] == square && node < found)) square = best[k], found = node;
    }
    return found;
  }

 private:
  static constexpr float nowhere = 1e15f;
  int n_;
  std::vector<double> scale_, nodes_;
  std::vector<int> parent_, root_;
  std::vector<Float16> lanes_, target_;  // blocks of sixteen nodes, scaled: n registers each
};

}  // namespace ir
