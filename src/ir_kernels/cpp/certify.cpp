#include "certify.hpp"

#include <algorithm>
#include <limits>

#include "visit.hpp"

namespace ir {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double double_margin = 1e-9;  // [m] more than doubles lose on lengths of some ten metres
constexpr double resolution = 1e-6;     // [m] an interval whose bodies move less isn't halved any more
constexpr double locate = 1.0 / 256;    // the first collision is located to this part of the motion
constexpr std::size_t front = 16;       // intervals of a motion that are looked at together, the earliest first
constexpr std::size_t window = 32;      // motions that share lane groups

struct Interval {
  double low, high;
  bool fine;  // too short for floats to decide
};

// What a lane found at the middle of its interval.
struct Finding {
  double above, proved, moved;  // least distance - threshold; least of that - movement, and that movement
  int nearest, doubtful;
};

struct Progress {
  double span;
  std::vector<Interval> open;  // in order of time
  double hit_at = infinity, stuck_from = infinity, stuck_to = infinity, bound = infinity;
  int hit_pair = -1, stuck_pair = -1;
};

// One motion's joint values, and how far they can get from them.
class Motions {
 public:
  virtual ~Motions() = default;
  virtual void at(std::size_t motion, double low, double high, double* q, double* spread) const = 0;
};

class Edges final : public Motions {
 public:
  Edges(const double* q0, const double* q1, int n) : q0_(q0), q1_(q1), n_(n) {}
  void at(std::size_t motion, double low, double high, double* q, double* spread) const override {
    const double *from = q0_ + motion * n_, *to = q1_ + motion * n_, middle = 0.5 * (low + high);
    for (int j = 0; j < n_; ++j) {
      const double step = to[j] - from[j];
      q[j] = from[j] + middle * step;
      spread[j] = 0.5 * (high - low) * std::fabs(step);
    }
  }

 private:
  const double *q0_, *q1_;
  int n_;
};

class Polynomials final : public Motions {
 public:
  Polynomials(const double* coefficients, int n, int terms)
      : coefficients_(coefficients), n_(n), terms_(terms), shifted_(terms) {}
  void at(std::size_t motion, double low, double high, double* q, double* spread) const override {
    const double middle = 0.5 * (low + high), half = 0.5 * (high - low);
    for (int j = 0; j < n_; ++j) {
      const double* c = coefficients_ + (motion * n_ + j) * terms_;
      std::copy_n(c, terms_, shifted_.begin());
      for (int first = 0; first < terms_ - 1; ++first)
        for (int k = terms_ - 2; k >= first; --k) shifted_[k] += middle * shifted_[k + 1];
      q[j] = shifted_[0];
      double sum = 0.0;
      for (int k = terms_ - 1; k > 0; --k) sum = (sum + std::fabs(shifted_[k])) * half;
      spread[j] = sum;
    }
  }

 private:
  const double* coefficients_;
  int n_, terms_;
  mutable std::vector<double> shifted_;
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
      for (int j = link - 1; j >= 0; --j) {
        const Vec<V>&origin = s.origin[j + 1], &axis = s.axis[j + 1];
        const Vec<V> a = cross(start - origin, axis), b = cross(end - origin, axis);
        const V reach = sqrt(max(dot(a, a), dot(b, b)));
        m = m + spread[j] * (reach + m + margin);
        to[j] = m;
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

class Certifier {
 public:
  Certifier(const Model& model, const double* threshold, bool with_bound)
      : model_(model), coarse_(model, threshold, with_bound), fine_(model, threshold, with_bound) {}

  // Rounds over some motions until all are decided; `first` is the number of the first of them.
  void decide(const Motions& motions, std::vector<Progress>& all, std::size_t first) {
    motions_ = &motions;
    for (;;) {
      items_.clear();
      for (std::size_t m = 0; m < all.size(); ++m)
        for (std::size_t k = 0; k < std::min(front, all[m].open.size()); ++k)
          items_.push_back({first + m, all[m].open[k], {}});
      if (items_.empty()) return;
      look<Float16>(coarse_, false);
      look<Double8>(fine_, true);
      std::size_t item = 0;
      for (Progress& p : all) {
        const std::size_t count = std::min(front, p.open.size());
        if (count > 0) advance(p, &items_[item], count);
        item += count;
      }
    }
  }

 private:
  struct Item {
    std::size_t motion;
    Interval interval;
    Finding finding;
  };

  bool is_fine(const Interval& i) const { return i.fine || model_.wide; }

  template <class V> void look(Examiner<V>& examiner, bool fine) {
    constexpr int width = Lanes<V>::width;
    std::size_t motion[width], at[width];
    Interval interval[width];
    Finding finding[width];
    int count = 0;
    const auto flush = [&] {
      if (count == 0) return;
      examiner.examine(*motions_, motion, interval, count, finding);
      for (int k = 0; k < count; ++k) items_[at[k]].finding = finding[k];
      count = 0;
    };
    for (std::size_t i = 0; i < items_.size(); ++i) {
      if (is_fine(items_[i].interval) != fine) continue;
      motion[count] = items_[i].motion;
      interval[count] = items_[i].interval;
      at[count++] = i;
      if (count == width) flush();
    }
    flush();
  }

  void advance(Progress& p, const Item* items, std::size_t count) {
    next_.clear();
    const auto margin_of = [&](const Interval& i) { return is_fine(i) ? fine_.margin() : coarse_.margin(); };
    for (std::size_t k = 0; k < count; ++k) {
      const Finding& f = items[k].finding;
      const Interval& i = items[k].interval;
      const double middle = 0.5 * (i.low + i.high);
      if (f.above <= -margin_of(i) && middle < p.hit_at) p.hit_at = middle, p.hit_pair = f.nearest;
    }
    for (std::size_t k = 0; k < count; ++k) {
      const Finding& f = items[k].finding;
      const Interval& i = items[k].interval;
      const double middle = 0.5 * (i.low + i.high), width = i.high - i.low;
      const bool hit = f.above <= -margin_of(i);
      if (!hit && f.proved > 0.0) {
        p.bound = std::min(p.bound, f.proved);
        continue;
      }
      const bool located = p.hit_at < infinity && width < locate * p.span;
      const bool too_short = !hit && is_fine(i) && f.moved < resolution;
      if (located || too_short) {
        if (i.low < p.stuck_from) p.stuck_from = i.low, p.stuck_to = i.high, p.stuck_pair = f.doubtful;
      } else if (hit) {
        next_.push_back({i.low, middle, i.fine});
      } else if (!is_fine(i) && f.moved < 8.0 * coarse_.margin()) {
        next_.push_back({i.low, i.high, true});
      } else {
        next_.push_back({i.low, middle, i.fine});
        next_.push_back({middle, i.high, i.fine});
      }
    }
    next_.insert(next_.end(), p.open.begin() + count, p.open.end());
    const double until = std::min(p.hit_at, p.stuck_from);
    while (!next_.empty() && next_.back().low >= until) next_.pop_back();
    p.open.swap(next_);
  }

  const Model& model_;
  const Motions* motions_ = nullptr;
  Examiner<Float16> coarse_;
  Examiner<Double8> fine_;
  std::vector<Item> items_;
  std::vector<Interval> next_;
};

Progress begin(double span, int pieces) {
  Progress p;
  p.span = span;
  for (int k = 0; k < pieces; ++k) p.open.push_back({span * k / pieces, span * (k + 1) / pieces, false});
  return p;
}

Outcome outcome(const Progress& p) {
  if (p.hit_at < infinity) return {collides, std::min(p.stuck_from, p.hit_at), p.hit_at, p.hit_pair, -infinity};
  if (p.stuck_from < infinity) return {undecided, p.stuck_from, p.stuck_to, p.stuck_pair, -infinity};
  return {free_verdict, p.span, p.span, -1, p.bound};
}

}  // namespace

struct EdgeCertifier::Parts {
  Certifier certifier;
  std::vector<Progress> all;
};

EdgeCertifier::EdgeCertifier(const Model& model, const double* threshold)
    : n_(model.chain.n), parts_(new Parts{Certifier(model, threshold, false), {}}) {}
EdgeCertifier::~EdgeCertifier() = default;

void EdgeCertifier::certify(const double* q0, const double* q1, std::size_t count, Outcome* result) {
  const Edges edges(q0, q1, n_);
  std::vector<Progress>& all = parts_->all;
  for (std::size_t first = 0; first < count; first += window) {
    all.assign(std::min(window, count - first), begin(1.0, 4));
    parts_->certifier.decide(edges, all, first);
    for (std::size_t k = 0; k < all.size(); ++k) result[first + k] = outcome(all[k]);
  }
}

void certify_edges(const Model& model, const double* q0, const double* q1, std::size_t count, const double* threshold,
                   Outcome* result) {
  EdgeCertifier(model, threshold).certify(q0, q1, count, result);
}

Outcome certify_trajectory(const Model& model, const double* coefficients, int terms, const double* durations,
                           std::size_t count, const double* threshold) {
  const Polynomials motions(coefficients, model.chain.n, terms);
  Certifier certifier(model, threshold, true);
  std::vector<Progress> all;
  double time = 0.0, bound = infinity;
  for (std::size_t first = 0; first < count; first += window) {
    all.clear();
    for (std::size_t k = first; k < std::min(first + window, count); ++k) all.push_back(begin(durations[k], 1));
    certifier.decide(motions, all, first);
    for (const Progress& p : all) {
      Outcome o = outcome(p);
      if (o.verdict != free_verdict) {
        o.t0 += time;
        o.t1 += time;
        return o;
      }
      bound = std::min(bound, o.bound);
      time += p.span;
    }
  }
  return {free_verdict, time, time, -1, bound};
}

}  // namespace ir
