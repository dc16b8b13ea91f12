// The clearance's share of the cost of a spline: pairs that are nearer than their threshold and the margin.
#include <algorithm>
#include <cmath>
#include <limits>

#include "queries.hpp"
#include "spline_cost.hpp"

namespace ir {
namespace {

constexpr int P = SplineCost::samples;
constexpr double lasting = 2.0;   // times the last movement of its group that a list of near pairs holds for
constexpr double longest = 0.08;  // [m] a group that moves farther from one evaluation to the next gets no list

// Lists, lane by lane, the pairs nearer than their threshold and margin; and those that may be, within the rounding of lanes.
// Keeps those that come within `around` of it.
template <class V> struct Within {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  std::vector<int>* hits;
  S slack;  // [m] more than the lanes lose
  S around = 0;
  std::vector<std::array<int, 2>>* kept = nullptr;
  V least{};  // of all that were taken: distance beyond the threshold
  static constexpr bool one_bound = true;
  IR_INLINE V outside(int) const { return splat<V>(slack + around); }
  IR_INLINE V own(std::size_t) const { return splat<V>(slack + around); }
  IR_INLINE Float16 farthest(std::size_t, int) const {
    return splat<Float16>(static_cast<float>(shift.highest + slack + around));
  }
  IR_INLINE bool known(int) const { return false; }
  IR_INLINE bool done() const { return false; }
  IR_INLINE void take(int z, int index, V distance) {
    if (around > 0 && any(distance < shift.of[z] + slack + around)) kept->push_back({z, index});
    listed(z, distance);
  }
  IR_INLINE void listed(int z, V distance) {
    least = min(least, distance - shift.of[z]);
    for (std::uint32_t left = bits(distance < shift.of[z] + slack); left != 0; left &= left - 1)
      hits[__builtin_ctz(left)].push_back(z);
  }
};

// The distance of a kept pair, with the operations of visit.hpp.
template <class V> V kept_distance(const Model& model, const State<V>& s, int z, int index) {
  using S = Scalar<V>;
  const int outside = static_cast<int>(model.environment.size());
  if (z >= outside) {
    const SelfPair& pair = model.self_pairs[index];
    return sqrt(square_between(model, s, pair)) - static_cast<S>(pair.radii);
  }
  const int body = model.environment[z][1];
  const Body<S>& f = model.bodies<S>()[body];
  const S radius = static_cast<S>(model.capsules[index].radius);
  if (model.kind[body] == plane) {
    const auto height = [&](const Vec<V>& p) { return f.axis[2][0] * p.x + (f.axis[2][1] * p.y + f.axis[2][2] * p.z); };
    return height(s.middle[index]) - abs(height(s.half[index])) - (f.offset[2] + radius);
  }
  const Vec<V> middle = to_local<V>(f, s.middle[index]), half = turn_local<V>(f, s.half[index]);
  return axis_distance<V>(model, body, index, middle - half, middle + half) - radius;
}

}  // namespace

// How far any body may have got since the samples of a group were at `from` [m].
double SplineCost::moved(const std::vector<double>& from, const double* q, int used) const {
  constexpr double unknown = std::numeric_limits<double>::infinity();
  if (from.size() != static_cast<std::size_t>(used) * n_) return unknown;
  double most = 0.0;
  for (int l = 0; l < used; ++l) {
    double sum = 0.0;
    for (int j = 0; j < n_; ++j) sum += lever_[j] * std::fabs(q[l * n_ + j] - from[l * n_ + j]);
    if (!(sum < unknown)) return unknown;
    most = std::max(most, sum);
  }
  return most;
}

template <class V>
// long: value and derivative side by side
double SplineCost::clearance_in(Placement<V>& placement, const Shifts<Scalar<V>>& shift, const std::int32_t* row,
                                double step) {
  constexpr int width = Lanes<V>::width;
  const std::size_t pairs = model_.pairs();
  const double* rows[width];
  double cost = 0.0;
  Within<V> within{shift, hits_, static_cast<Scalar<V>>(width == 16 ? model_.float_margin : 1e-9)};
  near_.resize((count_ + width - 1) / width);
  for (int first = 0; first < count_; first += width) {
    const int used = std::min(width, count_ - first);
    for (int l = 0; l < used; ++l) rows[l] = &q_[static_cast<std::size_t>(first + l) * n_];
    Near& near = near_[first / width];
    const double* q = rows[0];  // samples follow one another
    if (moved(near.seen, q, used) < near.clear) continue;
    placement.place(rows, used);
    for (auto& list : hits_) list.clear();
    within.least = splat<V>(std::numeric_limits<Scalar<V>>::infinity());
    double movement = moved(near.listed, q, used);
    if (movement < near.around) {
      for (const auto& [z, index] : near.pairs) within.listed(z, kept_distance(model_, placement.state, z, index));
    } else {
      within.around = static_cast<Scalar<V>>(movement < longest ? lasting * movement : 0.0);
      within.kept = &near.pairs;
      near.pairs.clear();
      visit(model_, placement.state, within);
      near.around = within.around - 2.0 * within.slack;
      near.listed.assign(q, q + static_cast<std::size_t>(used) * n_);
      movement = 0.0;
    }
    near.clear = std::min<double>(-highest<V>(-within.least) - 2.0 * within.slack, near.around - movement);
    near.seen.assign(q, q + static_cast<std::size_t>(used) * n_);
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
