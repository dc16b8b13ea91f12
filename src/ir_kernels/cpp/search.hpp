// Two trees that grow from start and goals towards each other over certified edges.
//
// J. Kuffner, S. LaValle, "RRT-Connect", ICRA 2000, in batches of one register of lanes: the smaller tree draws
// targets, goes one step towards each of them, and new nodes are joined with the nearest of the other tree, as far as
// the path is proved, unless a few configurations in between already say that it is blocked. Most targets lie near nodes
// or between start and goal, which is what finds narrow passages.
//
// Work is counted in certified edges, and sixteen configurations that are only looked at count as one. What is found
// does not depend on how the work is divided into calls.
#pragma once

#include <cstdint>
#include <vector>

#include "certify.hpp"
#include "free_states.hpp"
#include "random.hpp"
#include "search_tree.hpp"

namespace ir {

// Checked in Python (ir_kernels.search). Lines: configurations that follow start or goal g, tried as a first branch.
struct SearchProblem {
  int goals;
  const double *start, *goal;           // (n), (goals, n)
  const double *low, *high, *scale;     // (n)
  const double* threshold;              // (Z)
  const double* start_line;             // (start_line_size, n)
  int start_line_size;
  std::vector<const double*> goal_line;  // of each goal, (goal_line_size[g], n)
  std::vector<int> goal_line_size;
};

class BidirectionalSearch {
 public:
  // The model has to outlive it; all else is copied.
  BidirectionalSearch(const Model& model, const SearchProblem& problem, std::uint64_t seed);

  // Spends at most that much; true when a path has been found.
  bool grow(std::int64_t max_edges);

  std::int64_t edges() const { return spent_; }
  bool found() const { return found_; }
  int goal() const { return found_ ? trees_[1].root(meet_[1]) : -1; }
  int nodes(int side) const { return trees_[side].size(); }
  const std::vector<double>& path() const { return path_; }  // (M, n), empty until it is found
  // Weighted distance of the trees' nearest nodes that were compared, and these (2, n).
  double gap() const { return gap_; }
  std::vector<double> nearest() const;

 private:
  enum class Phase { direct, lines, extend, join, confirm };
  // An edge that waits for its certificate: between a node of the tree that grows and a place, or another tree's node.
  struct Candidate {
    int from, to;
    double length;
  };

  void prepare(Phase phase);
  void push(const double* q0, const double* q1, Candidate candidate);
  void proceed();
  void push_lines(const SearchProblem& problem);
  void take_lines();
  void draw();
  void target(double* q);
  void extend();
  void push_joins();
  void join();
  void confirm(int at_start, int at_goal);
  bool confirmed();

  int n_;
  std::vector<double> low_, high_;
  Random random_;
  EdgeCertifier certifier_;
  FreeStates states_;
  SearchTree trees_[2];
  int roots_;       // of the second tree: goals
  int growing_ = 0;  // which tree
  Phase phase_ = Phase::direct;
  std::vector<double> q0_, q1_;  // of the edges that wait
  std::vector<Candidate> waiting_;
  std::vector<Outcome> outcome_;
  std::size_t done_ = 0;  // of the waiting edges
  std::int64_t spent_ = 0, owed_ = 0;
  std::vector<double> line_q0_, line_q1_;
  std::vector<int> line_side_, line_root_;
  std::vector<double> path_, drawn_, ends_, one_;
  std::vector<Candidate> tried_;
  bool found_ = false;
  int meet_[2] = {-1, -1}, closest_[2] = {0, 0};
  double gap_;
};

}  // namespace ir
