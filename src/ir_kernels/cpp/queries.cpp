#include "queries.hpp"

#include <algorithm>
#include <limits>

#include "free_states.hpp"
#include "visit.hpp"
#include "witness.hpp"

namespace ir {
namespace {

constexpr float slack_of(Float16) { return 2e-5f; }
constexpr double slack_of(Double8) { return 1e-8; }

template <class V> struct Nearest {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  V best;  // least distance - offset so far
  Mask<V> pair;
  int hint;  // the pair that was taken first, or -1

  static constexpr bool one_bound = true;
  IR_INLINE V outside(int) const { return best + slack_of(V{}); }
  IR_INLINE V own(std::size_t) const { return best + slack_of(V{}); }
  IR_INLINE Float16 farthest(std::size_t, int part) const {
    return splat<Float16>(static_cast<float>(highest_of_eight(best, part) + shift.highest + slack_of(V{})));
  }
  IR_INLINE bool known(int z) const { return z == hint; }
  IR_INLINE bool done() const { return false; }
  IR_INLINE void take(int z, int, V distance) {
    const V excess = distance - shift.of[z];
    const Mask<V> index = Mask<V>{} + z;
    // of equals the first pair, so that the order of visits leaves no trace
    const Mask<V> better = (excess < best) | ((excess == best) & (index < pair));
    best = better ? excess : best;
    pair = better ? index : pair;
  }
};

// The rows of a batch, a lane group at a time.
template <int width> struct Rows {
  const double* row[width];
  int count;
  Rows(const double* q, std::size_t first, std::size_t total, int n)
      : count(static_cast<int>(std::min<std::size_t>(width, total - first))) {
    for (int k = 0; k < count; ++k) row[k] = q + (first + k) * n;
  }
};

template <class V>
void min_distance_in(const Model& model, const double* q, std::size_t count, const double* offset, std::int64_t* pair,
                     const WitnessArrays& result) {
  using S = Scalar<V>;
  constexpr int width = Lanes<V>::width;
  const Shifts<S> shift(model, offset);
  Placement<V> placement(model);
  Nearest<V> policy{shift, {}, {}, -1};
  for (std::size_t first = 0; first < count; first += width) {
    const Rows<width> rows(q, first, count, model.chain.n);
    placement.place(rows.row, rows.count);
    policy.best = V{} + std::numeric_limits<S>::infinity();
    policy.pair = Mask<V>{} + std::numeric_limits<std::int32_t>::max();
    if (policy.hint >= 0) policy.take(policy.hint, 0, pair_distance(model, placement.state, policy.hint));
    visit(model, placement.state, policy);
    const Mask<V> chosen = policy.best < std::numeric_limits<S>::infinity() ? policy.pair : Mask<V>{} - 1;
    std::int32_t nearest[width];
    for (int k = 0; k < width; ++k) nearest[k] = static_cast<std::int32_t>(chosen[k]);
    for (int k = 0; k < rows.count; ++k) pair[first + k] = nearest[k];
    if (nearest[0] < 0) {  // no pair that counts: the same for all
      for (int k = 0; k < rows.count; ++k) {
        result.distance[first + k] = std::numeric_limits<double>::infinity();
        for (double* to : {result.point_a, result.point_b, result.normal})
          std::fill_n(to + 3 * (first + k), 3, std::numeric_limits<double>::quiet_NaN());
      }
      continue;
    }
    policy.hint = nearest[rows.count - 1];
    for (int part = 0; 8 * part < rows.count; ++part) {
      const int lanes = std::min(8, rows.count - 8 * part);
      write(model, witness(model, placement.exact[part], nearest + 8 * part), lanes, first + 8 * part, result);
    }
  }
}

}  // namespace

void distances(const Model& model, const double* q, std::size_t count, double* result) {
  Placement<Double8> placement(model);
  const std::size_t pairs = model.pairs();
  for (std::size_t first = 0; first < count; first += 8) {
    const Rows<8> rows(q, first, count, model.chain.n);
    placement.place(rows.row, rows.count);
    for (std::size_t z = 0; z < pairs; ++z) {
      const Double8 d = pair_distance(model, placement.state, static_cast<int>(z));
      for (int k = 0; k < rows.count; ++k) result[(first + k) * pairs + z] = d[k];
    }
  }
}

void min_distance(const Model& model, const double* q, std::size_t count, const double* offset, std::int64_t* pair,
                  const WitnessArrays& result) {
  if (model.wide) min_distance_in<Double8>(model, q, count, offset, pair, result);
  else min_distance_in<Float16>(model, q, count, offset, pair, result);
}

void is_free(const Model& model, const double* q, std::size_t count, const double* threshold, bool* result) {
  FreeStates(model, threshold).look(q, count, result);
}

void witnesses(const Model& model, const double* q, std::size_t count, const std::int64_t* pair,
               const WitnessArrays& result, double* gradient) {
  Placement<Double8> placement(model);
  const int n = model.chain.n;
  std::vector<Double8> slope(n);
  for (std::size_t first = 0; first < count; first += 8) {
    const Rows<8> rows(q, first, count, n);
    placement.place(rows.row, rows.count);
    std::int32_t chosen[8];
    for (int k = 0; k < 8; ++k) chosen[k] = static_cast<std::int32_t>(pair[first + std::min(k, rows.count - 1)]);
    const WitnessLanes w = witness(model, placement.exact[0], chosen);
    write(model, w, rows.count, first, result);
    if (gradient == nullptr) continue;
    slopes(model, placement.exact[0], chosen, w, slope.data());
    for (int j = 0; j < n; ++j)
      for (int k = 0; k < rows.count; ++k) gradient[(first + k) * n + j] = slope[j][k];
  }
}

void pair_slopes(const Model& model, const std::vector<Frame<Double8>>& frames, const int pair[8], Double8& distance,
                 Double8* gradient) {
  const WitnessLanes w = witness(model, frames, pair);
  distance = w.distance;
  slopes(model, frames, pair, w, gradient);
}

}  // namespace ir
