// Lower bounds of the clearance over intervals of motions, a lane group at a time.
#pragma once

#include <limits>
#include <vector>

#include "certify_motions.hpp"
#include "visit.hpp"

namespace ir {
// Included by one file; internal linkage lets the compiler inline it there as it likes (3 % of a proof).
namespace {

constexpr double double_margin = 1e-9;  // [m] more than doubles lose on lengths of some ten metres

struct Interval {
  double low, high;
  bool fine;  // too short for floats to decide
};

// What a lane found at the middle of its interval.
struct Finding {
  double above, proved, moved;  // least distance - threshold; least of that - movement, and that movement
  int nearest, doubtful;
};

template <class V> struct Proof {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  const Model& model;
  S margin;
  bool tight;            // the bound is wanted: nothing may be skipped that could lower it
  std::vector<V> moved;  // capsule x (n + 1): how far it moves, seen from each link up to its own
  std::vector<Float16> far;
  V above, proved, doubtful_moved;
  Mask<V> nearest, doubtful;

  Proof(const Model& m, const Shifts<S>& threshold, S rounding, bool with_bound)
      : shift(threshold), model(m), margin(rounding), tight(with_bound),
        moved(m.capsules.size() * (m.chain.n + 1)), far(m.capsules.size() / 16 + 1) {}

  static constexpr bool one_bound = false;
  IR_INLINE V outside(int c) const { return allowed(moved[c * (model.chain.n + 1)]); }
  IR_INLINE V own(std::size_t i) const {
    const SelfPair& pair = model.self_pairs[i];
    return allowed(moved[pair.outer * (model.chain.n + 1) + model.capsules[pair.inner].link]);
  }
  IR_INLINE Float16 farthest(std::size_t first, int) const { return tight ? splat<Float16>(1e15f) : far[first / 16]; }
  IR_INLINE V allowed(V m) const { return m + margin + (tight ? max(proved, V{}) : V{}); }
  IR_INLINE bool known(int) const { return false; }
  IR_INLINE bool done() const { return false; }

  IR_INLINE void take(int z, int index, V distance) {
    const bool outside_pair = z < static_cast<int>(model.environment.size());
    V movement;
    if (outside_pair) {
      movement = moved[index * (model.chain.n + 1)];
    } else {
      const SelfPair& pair = model.self_pairs[index];
      movement = moved[pair.outer * (model.chain.n + 1) + model.capsules[pair.inner].link];
    }
    movement += margin;
    const V over = distance - shift.of[z], left = over - movement;
    const Mask<V> number = Mask<V>{} + z;
    const Mask<V> nearer = over < above, worse = left < proved;
    above = nearer ? over : above;
    nearest = nearer ? number : nearest;
    proved = worse ? left : proved;
    doubtful = worse ? number : doubtful;
    doubtful_moved = worse ? movement : doubtful_moved;
  }

  // The sum of reference/certify.py, rounded up.
  void movements(const State<V>& s, const V* spread) {
    const int n = model.chain.n;
    for (std::size_t c = 0; c < model.capsules.size(); ++c) {
      V* to = &moved[c * (n + 1)];
      const int link = model.capsules[c].link;
      const Vec<V> start = s.start(c), end = s.end(c);
      V m{};
      to[link] = m;
      const int turning = model.chain.first_slides ? 1 : 0;
      for (int j = link - 1; j >= turning; --j) {
        const Vec<V>&origin = s.origin[j + 1], &axis = s.axis[j + 1];
        const Vec<V> a = cross(start - origin, axis), b = cross(end - origin, axis);
        const V reach = sqrt(max(dot(a, a), dot(b, b)));
        m = m + spread[j] * (reach + m + margin);
        to[j] = m;
      }
      if (turning == 1 && link > 0) {  // a rail moves every point by as much as itself
        m = m + spread[0] * (S(1) + margin);
        to[0] = m;
      }
      far[c / 16][c % 16] = static_cast<float>(highest<V>(m)) * 1.00001f + static_cast<float>(margin + shift.highest);
    }
  }

  void start() {
    above = proved = V{} + std::numeric_limits<S>::infinity();
    doubtful_moved = V{};
    nearest = doubtful = Mask<V>{} - 1;
  }
};

// Looks at intervals, a lane group at a time.
template <class V> class Examiner {
  using S = Scalar<V>;
  static constexpr int width = Lanes<V>::width;

 public:
  Examiner(const Model& model, const double* threshold, bool with_bound)
      : n_(model.chain.n), model_(model), threshold_(model, threshold), placement_(model),
        proof_(model, threshold_, static_cast<S>(width == 16 ? model.float_margin : double_margin), with_bound),
        q_(width * n_), spread_(n_), one_(n_) {}

  double margin() const { return proof_.margin; }

  // motion and interval of each lane, up to `width`
  void examine(const Motions& motions, const std::size_t* motion, const Interval* interval, int count, Finding* to) {
    const double* rows[width];
    for (int k = 0; k < count; ++k) {
      rows[k] = &q_[k * n_];
      motions.at(motion[k], interval[k].low, interval[k].high, &q_[k * n_], one_.data());
      for (int j = 0; j < n_; ++j) spread_[j][k] = static_cast<S>(one_[j] * (1.0 + 1e-6));
    }
    for (int k = count; k < width; ++k)
      for (int j = 0; j < n_; ++j) spread_[j][k] = spread_[j][count - 1];
    placement_.place(rows, count);
    proof_.movements(placement_.state, spread_.data());
    proof_.start();
    visit(model_, placement_.state, proof_);
    for (int k = 0; k < count; ++k)
      to[k] = {double(proof_.above[k]), double(proof_.proved[k]), double(proof_.doubtful_moved[k]),
               static_cast<int>(proof_.nearest[k]), static_cast<int>(proof_.doubtful[k])};
  }

 private:
  int n_;
  const Model& model_;
  Shifts<S> threshold_;
  Placement<V> placement_;
  Proof<V> proof_;
  std::vector<double> q_;
  std::vector<V> spread_;
  std::vector<double> one_;
};

}  // namespace
}  // namespace ir
