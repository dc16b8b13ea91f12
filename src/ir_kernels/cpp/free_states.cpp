#include "free_states.hpp"

#include <algorithm>
#include <limits>

#include "visit.hpp"

namespace ir {
namespace {

// Of a lane group: which lanes are free still.
template <class V> struct Free {
  using S = Scalar<V>;
  const Shifts<S>& shift;
  S slack;  // [m] more than the lower bounds of visit.hpp lose
  Mask<V> free;

  static constexpr bool one_bound = true;
  IR_INLINE V outside(int) const { return free ? V{} + slack : V{} - std::numeric_limits<S>::infinity(); }
  IR_INLINE V own(std::size_t) const { return outside(0); }
  IR_INLINE Float16 farthest(std::size_t, int) const { return splat<Float16>(static_cast<float>(shift.highest + slack)); }
  IR_INLINE bool known(int) const { return false; }
  IR_INLINE bool done() const { return !any(free); }
  IR_INLINE void take(int z, int, V distance) { free = free & (distance > shift.of[z]); }
};

template <class V> class Lookout {
  using S = Scalar<V>;
  static constexpr int width = Lanes<V>::width;

 public:
  Lookout(const Model& model, const double* threshold)
      : model_(model), shift_(model, threshold), placement_(model), policy_{shift_, width == 16 ? S(2e-5) : S(1e-8), {}} {}

  void look(const double* q, std::size_t count, bool* result) {
    const double* rows[width];
    for (std::size_t first = 0; first < count; first += width) {
      const int used = static_cast<int>(std::min<std::size_t>(width, count - first));
      for (int k = 0; k < used; ++k) rows[k] = q + (first + k) * model_.chain.n;
      placement_.place(rows, used);
      policy_.free = Mask<V>{} - 1;
      visit(model_, placement_.state, policy_);
      const std::uint32_t free = bits(policy_.free);
      for (int k = 0; k < used; ++k) result[first + k] = free >> k & 1;
    }
  }

 private:
  const Model& model_;
  Shifts<S> shift_;
  Placement<V> placement_;
  Free<V> policy_;
};

}  // namespace

struct FreeStates::Parts {
  std::unique_ptr<Lookout<Float16>> coarse;
  std::unique_ptr<Lookout<Double8>> fine;
};

FreeStates::FreeStates(const Model& model, const double* threshold) : parts_(new Parts) {
  if (model.wide) parts_->fine.reset(new Lookout<Double8>(model, threshold));
  else parts_->coarse.reset(new Lookout<Float16>(model, threshold));
}
FreeStates::~FreeStates() = default;

void FreeStates::look(const double* q, std::size_t count, bool* result) {
  if (parts_->fine) parts_->fine->look(q, count, result);
  else parts_->coarse->look(q, count, result);
}

}  // namespace ir
