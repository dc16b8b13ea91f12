#include "search.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace ir {
namespace {

// Chosen by benchmarks/search.py on the bundled cells.
constexpr int batch = 16;            // targets of a round
constexpr int joined = 8;            // new nodes of a round that are joined, the nearest to the other tree
constexpr int between_joined = 4;    // configurations of a join that are looked at before it is certified
constexpr double step = 0.7;         // longest extension, weighted rad
constexpr double kept = 0.9;         // how much of the proved part of a blocked edge is used
constexpr double shortest = 0.02;    // weighted rad: parts that are shorter aren't worth a node
constexpr double around_node = 0.62;  // share of targets scattered around a node of the tree that grows
constexpr double other_tree = 0.08;   // share of targets that are nodes of the other tree; the rest: anywhere
constexpr double between = 0.85;     // of the latter, within `margin` rad of the box around start and a goal
constexpr double margin = 1.0;
constexpr double spread[4] = {0.1, 0.2, 0.4, 0.8};  // rad, of what is scattered

}  // namespace

BidirectionalSearch::BidirectionalSearch(const Model& model, const SearchProblem& problem, std::uint64_t seed)
    : n_(model.chain.n), low_(problem.low, problem.low + n_), high_(problem.high, problem.high + n_), random_(seed),
      certifier_(model, problem.threshold), states_(model, problem.threshold),
      trees_{{n_, problem.scale}, {n_, problem.scale}}, roots_(problem.goals), one_(n_),
      gap_(std::numeric_limits<double>::infinity()) {
  trees_[0].add(problem.start, -1);
  push_lines(problem);
  prepare(Phase::direct);
  for (int g = 0; g < roots_; ++g) {
    trees_[1].add(problem.goal + g * n_, -1);
    push(problem.start, problem.goal + g * n_, {0, g, 0.0});
  }
  float square;
  closest_[1] = trees_[1].nearest(problem.start, square);
  gap_ = std::sqrt(static_cast<double>(square));
}

std::vector<double> BidirectionalSearch::nearest() const {
  std::vector<double> result;
  for (int side = 0; side < 2; ++side) {
    const double* q = trees_[side].node(closest_[side]);
    result.insert(result.end(), q, q + n_);
  }
  return result;
}

bool BidirectionalSearch::grow(std::int64_t max_edges) {
  std::int64_t left = max_edges;
  while (!found_) {
    const std::int64_t paid = std::min(left, owed_);
    owed_ -= paid, left -= paid, spent_ += paid;
    if (owed_ > 0) return false;
    const std::size_t now = std::min<std::size_t>(left, waiting_.size() - done_);
    if (now > 0) certifier_.certify(&q0_[done_ * n_], &q1_[done_ * n_], now, &outcome_[done_]);
    done_ += now, left -= now, spent_ += now;
    if (done_ < waiting_.size()) return false;
    proceed();
  }
  return true;
}

void BidirectionalSearch::prepare(Phase phase) {
  phase_ = phase;
  q0_.clear(), q1_.clear(), waiting_.clear();
  done_ = 0;
}

void BidirectionalSearch::push(const double* q0, const double* q1, Candidate candidate) {
  q0_.insert(q0_.end(), q0, q0 + n_);
  q1_.insert(q1_.end(), q1, q1 + n_);
  waiting_.push_back(candidate);
  outcome_.resize(std::max(outcome_.size(), waiting_.size()));
}

// All that waited is certified: what follows from it.
void BidirectionalSearch::proceed() {
  switch (phase_) {
    case Phase::direct:
      for (std::size_t k = 0; k < waiting_.size(); ++k)
        if (outcome_[k].verdict == free_verdict) return confirm(0, waiting_[k].to);
      prepare(Phase::lines);
      for (std::size_t k = 0; k < line_side_.size(); ++k)
        push(&line_q0_[k * n_], &line_q1_[k * n_], {line_root_[k], -1, 0.0});
      return;
    case Phase::lines:
      take_lines();
      return draw();
    case Phase::extend:
      return extend();
    case Phase::join:
      return join();
    case Phase::confirm:
      if (!confirmed()) draw();
  }
}

void BidirectionalSearch::push_lines(const SearchProblem& problem) {
  const auto add = [&](int side, int root, const double* from, const double* line, int size) {
    for (int k = 0; k < size; ++k, from = line, line += n_) {
      line_q0_.insert(line_q0_.end(), from, from + n_);
      line_q1_.insert(line_q1_.end(), line, line + n_);
      line_side_.push_back(side);
      line_root_.push_back(root);
    }
  };
  add(0, 0, problem.start, problem.start_line, problem.start_line_size);
  for (int g = 0; g < roots_; ++g)
    add(1, g, problem.goal + g * n_, problem.goal_line[g], problem.goal_line_size[g]);
}

// Each line as far as it is proved.
void BidirectionalSearch::take_lines() {
  int last = -1;
  for (std::size_t k = 0; k < line_side_.size(); ++k) {
    const bool first = k == 0 || line_side_[k] != line_side_[k - 1] || line_root_[k] != line_root_[k - 1];
    if (first) last = line_root_[k];
    if (last >= 0 && outcome_[k].verdict == free_verdict) last = trees_[line_side_[k]].add(&line_q1_[k * n_], last);
    else last = -1;
  }
}

// A place to grow to.
void BidirectionalSearch::target(double* q) {
  SearchTree &here = trees_[growing_], &there = trees_[1 - growing_];
  const double which = random_.uniform();
  if (which < other_tree) {
    const double* node = there.node(random_.below(there.size()));
    std::copy(node, node + n_, q);
  } else if (which < other_tree + around_node) {
    const double* node = here.node(random_.below(here.size()));
    const double wide = spread[random_.below(4)];
    for (int j = 0; j < n_; ++j) q[j] = std::min(std::max(node[j] + wide * random_.bell(), low_[j]), high_[j]);
  } else {
    const bool boxed = random_.uniform() < between;
    const double *a = trees_[0].node(0), *b = trees_[1].node(random_.below(roots_));
    for (int j = 0; j < n_; ++j) {
      const double low = boxed ? std::max(low_[j], std::min(a[j], b[j]) - margin) : low_[j];
      const double high = boxed ? std::min(high_[j], std::max(a[j], b[j]) + margin) : high_[j];
      q[j] = low + random_.uniform() * (high - low);
    }
  }
}

// The smaller tree's next extensions; those whose ends aren't free are dropped at once, that is cheaper than proofs.
void BidirectionalSearch::draw() {
  growing_ = trees_[0].size() <= trees_[1].size() ? 0 : 1;
  SearchTree& here = trees_[growing_];
  tried_.clear(), ends_.clear();
  for (int k = 0; k < batch; ++k) {
    target(one_.data());
    float square;
    const int from = here.nearest(one_.data(), square);
    const double length = std::sqrt(static_cast<double>(square));
    if (length < shortest) continue;
    const double share = std::min(1.0, step / length), *node = here.node(from);
    for (int j = 0; j < n_; ++j) ends_.push_back(share < 1.0 ? node[j] + share * (one_[j] - node[j]) : one_[j]);
    tried_.push_back({from, -1, std::min(length, step)});
  }
  bool free[batch];
  states_.look(ends_.data(), tried_.size(), free);
  ++owed_;
  prepare(Phase::extend);
  for (std::size_t k = 0; k < tried_.size(); ++k)
    if (free[k]) push(here.node(tried_[k].from), &ends_[k * n_], tried_[k]);
}

void BidirectionalSearch::extend() {
  SearchTree &here = trees_[growing_], &there = trees_[1 - growing_];
  tried_.clear();
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    const double share = outcome_[k].verdict == free_verdict ? 1.0 : kept * outcome_[k].t0;
    if (share * waiting_[k].length < shortest) continue;
    const double *a = &q0_[k * n_], *b = &q1_[k * n_];
    for (int j = 0; j < n_; ++j) one_[j] = share < 1.0 ? a[j] + share * (b[j] - a[j]) : b[j];
    const int node = here.add(one_.data(), waiting_[k].from);
    float square;
    const int other = there.nearest(one_.data(), square);
    tried_.push_back({other, node, std::sqrt(static_cast<double>(square))});
    if (tried_.back().length < gap_) {
      gap_ = tried_.back().length;
      closest_[growing_] = node, closest_[1 - growing_] = other;
    }
  }
  std::stable_sort(tried_.begin(), tried_.end(),
                   [](const Candidate& a, const Candidate& b) { return a.length < b.length; });
  if (tried_.size() > joined) tried_.resize(joined);
  push_joins();
}

// What waits to be joined; where a configuration in between isn't free it is dropped at once, like an extension.
void BidirectionalSearch::push_joins() {
  SearchTree &here = trees_[growing_], &there = trees_[1 - growing_];
  ends_.clear();
  for (const Candidate& c : tried_) {
    const double *a = there.node(c.from), *b = here.node(c.to);
    for (int k = 1; k <= between_joined; ++k)
      for (int j = 0; j < n_; ++j) ends_.push_back(a[j] + k / (between_joined + 1.0) * (b[j] - a[j]));
  }
  bool free[joined * between_joined];
  const std::size_t looked = tried_.size() * between_joined;
  states_.look(ends_.data(), looked, free);
  owed_ += (looked + batch - 1) / batch;
  prepare(Phase::join);
  for (std::size_t k = 0; k < tried_.size(); ++k)
    if (std::all_of(free + k * between_joined, free + (k + 1) * between_joined, [](bool is_free) { return is_free; }))
      push(there.node(tried_[k].from), here.node(tried_[k].to), tried_[k]);
}

void BidirectionalSearch::join() {
  SearchTree& there = trees_[1 - growing_];
  for (std::size_t k = 0; k < waiting_.size(); ++k)
    if (outcome_[k].verdict == free_verdict)
      return growing_ == 0 ? confirm(waiting_[k].to, waiting_[k].from) : confirm(waiting_[k].from, waiting_[k].to);
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    const double share = kept * outcome_[k].t0;
    if (share * waiting_[k].length < shortest) continue;
    const double *a = &q0_[k * n_], *b = &q1_[k * n_];
    for (int j = 0; j < n_; ++j) one_[j] = a[j] + share * (b[j] - a[j]);
    there.add(one_.data(), waiting_[k].from);
  }
  draw();
}

// Every step of the path once more, as it will be driven: a part of a certified edge, or an edge turned round, is
// certified with other intervals, and where a distance is within the rounding of its threshold with another verdict.
void BidirectionalSearch::confirm(int at_start, int at_goal) {
  prepare(Phase::confirm);
  meet_[0] = at_start, meet_[1] = at_goal;
  std::vector<int> branch;
  for (int k = at_start; k >= 0; k = trees_[0].parent(k)) branch.push_back(k);
  std::reverse(branch.begin(), branch.end());
  for (std::size_t k = 1; k < branch.size(); ++k)
    push(trees_[0].node(branch[k - 1]), trees_[0].node(branch[k]), {0, branch[k], 0.0});
  push(trees_[0].node(at_start), trees_[1].node(at_goal), {-1, -1, 0.0});
  for (int k = at_goal; trees_[1].parent(k) >= 0; k = trees_[1].parent(k))
    push(trees_[1].node(k), trees_[1].node(trees_[1].parent(k)), {1, k, 0.0});
}

bool BidirectionalSearch::confirmed() {
  found_ = true;
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    if (outcome_[k].verdict == free_verdict) continue;
    found_ = false;
    if (waiting_[k].from >= 0) trees_[waiting_[k].from].cut(waiting_[k].to);
  }
  if (!found_) return false;
  path_.assign(q0_.begin(), q0_.begin() + n_);
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    const double* to = &q1_[k * n_];
    const bool stays = std::equal(to, to + n_, &q0_[k * n_]);  // the trees met in a node of both
    if (!stays || waiting_.size() == 1) path_.insert(path_.end(), to, to + n_);
  }
  return true;
}

}  // namespace ir
