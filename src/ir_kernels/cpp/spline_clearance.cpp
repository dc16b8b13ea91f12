// The clearance's share of the cost of a spline: pairs that are nearer than their threshold and the margin.
#include <algorithm>

#include "queries.hpp"
#include "spline_cost.hpp"

namespace ir {
namespace {

constexpr int P = SplineCost::samples;

// Lists, lane by lane, the pairs nearer than their threshold and margin; and those that may be, within the rounding of lanes.
template <class V> struct Within {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  std::vector<int>* hits;
  S slack;  // [m] more than the lanes lose
  static constexpr bool one_bound = true;
  IR_INLINE V outside(int) const { return splat<V>(slack); }
  IR_INLINE V own(std::size_t) const { return splat<V>(slack); }
  IR_INLINE Float16 farthest(std::size_t, int) const { return splat<Float16>(static_cast<float>(shift.highest + slack)); }
  IR_INLINE bool known(int) const { return false; }
  IR_INLINE bool done() const { return false; }
  IR_INLINE void take(int z, int, V distance) {
    for (std::uint32_t left = bits(distance < shift.of[z] + slack); left != 0; left &= left - 1)
      hits[__builtin_ctz(left)].push_back(z);
  }
};

}  // namespace

template <class V>
// long: value and derivative side by side
double SplineCost::clearance_in(Placement<V>& placement, const Shifts<Scalar<V>>& shift, const std::int32_t* row,
                                double step) {
  constexpr int width = Lanes<V>::width;
  const std::size_t pairs = model_.pairs();
  const double* rows[width];
  double cost = 0.0;
  Within<V> within{shift, hits_, static_cast<Scalar<V>>(width == 16 ? model_.float_margin : 1e-9)};
  for (int first = 0; first < count_; first += width) {
    const int used = std::min(width, count_ - first);
    for (int l = 0; l < used; ++l) rows[l] = &q_[static_cast<std::size_t>(first + l) * n_];
    placement.place(rows, used);
    for (auto& list : hits_) list.clear();
    visit(model_, placement.state, within);
    for (int part = 0; 8 * part < used; ++part) {
      for (std::size_t round = 0;; ++round) {
        int pair[8], any = -1;
        for (int l = 0; l < 8; ++l) {
          const bool there = 8 * part + l < used && round < hits_[8 * part + l].size();
          pair[l] = there ? hits_[8 * part + l][round] : -1;
          if (there) any = pair[l];
        }
        if (any < 0) break;
        int asked[8];
        for (int l = 0; l < 8; ++l) asked[l] = pair[l] < 0 ? any : pair[l];
        Double8 distance;
        pair_slopes(model_, placement.exact[part], asked, distance, slope_.data());
        for (int l = 0; l < 8; ++l) {
          if (pair[l] < 0) continue;
          const int k = first + 8 * part + l;
          const double kept = terms_.threshold[row[k / P] * pairs + pair[l]] + terms_.clearance_margin;
          const double lacks = (kept - distance[l]) / terms_.clearance_scale;
          if (!(lacks > 0.0)) continue;
          const double penalty = terms_.clearance_penalty * lacks * lacks;
          cost += penalty * step;
          of_step_ += penalty;
          const double weight = 2.0 * terms_.clearance_penalty * step * lacks / terms_.clearance_scale;
          for (int j = 0; j < n_; ++j) groups_[k / 8].of_q[j][k % 8] -= weight * slope_[j][l];
        }
      }
    }
  }
  return cost;
}

double SplineCost::clearance(const std::int32_t* row, double step) {
  if (model_.pairs() == 0) return 0.0;
  if (model_.wide) return clearance_in(placement_double_, shift_double_, row, step);
  return clearance_in(placement_float_, shift_float_, row, step);
}

}  // namespace ir
