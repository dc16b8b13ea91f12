#include "certify.hpp"

#include <algorithm>
#include <limits>

#include "certify_proof.hpp"

namespace ir {
namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double resolution = 1e-6;     // [m] an interval whose bodies move less isn't halved any more
constexpr double locate = 1.0 / 256;    // the first collision is located to this part of the motion
constexpr std::size_t front = 16;       // intervals of a motion that are looked at together, the earliest first
constexpr std::size_t window = 32;      // motions that share lane groups

struct Progress {
  double span;
  std::vector<Interval> open;  // in order of time
  double hit_at = infinity, stuck_from = infinity, stuck_to = infinity, bound = infinity;
  int hit_pair = -1, stuck_pair = -1;
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
