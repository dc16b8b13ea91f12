// The bidirectional search as Python sees it: an object that is grown in slices, the GIL released meanwhile.
#include <pybind11/stl.h>

#include <mutex>

#include "arrays.hpp"
#include "bindings.hpp"
#include "search.hpp"

namespace py = pybind11;
using ir::Array, ir::expect;

namespace {

ir::BidirectionalSearch search_of(const ir::Model& model, const Array& start, const Array& goals,
                                  const Array& threshold, const Array& low, const Array& high, const Array& scale,
                                  std::uint64_t seed, const Array& start_line, const std::vector<Array>& goal_lines) {
  const int n = model.chain.n;
  const auto is_rows = [n](const Array& a) { return a.ndim() == 2 && a.shape(1) == n; };
  expect(is_rows(goals) && goals.shape(0) > 0, "goals has to be (G, n)");
  for (const Array* one : {&start, &low, &high, &scale}) expect(one->size() == n, "a configuration has to be (n,)");
  expect(threshold.size() == model.pairs(), "threshold has to be (Z,)");
  expect(is_rows(start_line), "start_line has to be (M, n)");
  expect(py::ssize_t(goal_lines.size()) == goals.shape(0), "goal_lines has to have a line per goal");
  ir::SearchProblem p{static_cast<int>(goals.shape(0)), start.data(), goals.data(), low.data(), high.data(),
                      scale.data(), threshold.data(), start_line.data(), static_cast<int>(start_line.shape(0)), {}, {}};
  for (const Array& line : goal_lines) {
    expect(is_rows(line), "a goal's line has to be (M, n)");
    p.goal_line.push_back(line.data());
    p.goal_line_size.push_back(static_cast<int>(line.shape(0)));
  }
  return {model, p, seed};
}

// One thread at a time grows or reads it; the others wait without the GIL.
class Guarded {
 public:
  template <class... A> explicit Guarded(const A&... arguments) : search_(search_of(arguments...)) {}
  template <class F> auto with(const F& f) {
    py::gil_scoped_release release;
    const std::lock_guard<std::mutex> lock(busy_);
    return f(search_);
  }

 private:
  std::mutex busy_;
  ir::BidirectionalSearch search_;
};

}  // namespace

void bind_search(py::module_& m) {
  using Search = ir::BidirectionalSearch;
  py::class_<Guarded>(m, "BidirectionalSearch", py::module_local())
      .def(py::init<const ir::Model&, const Array&, const Array&, const Array&, const Array&, const Array&,
                    const Array&, const std::uint64_t&, const Array&, const std::vector<Array>&>(),
           py::keep_alive<1, 2>())
      .def("grow", [](Guarded& g, std::int64_t edges) { return g.with([&](Search& s) { return s.grow(edges); }); })
      .def("path", [](Guarded& g) { return g.with([](Search& s) { return s.path(); }); })
      .def("found", [](Guarded& g) { return g.with([](Search& s) { return s.found(); }); })
      .def("goal", [](Guarded& g) { return g.with([](Search& s) { return s.goal(); }); })
      .def("edges", [](Guarded& g) { return g.with([](Search& s) { return s.edges(); }); })
      .def("nodes", [](Guarded& g) { return g.with([](Search& s) { return std::pair(s.nodes(0), s.nodes(1)); }); })
      .def("gap", [](Guarded& g) { return g.with([](Search& s) { return std::pair(s.gap(), s.nearest()); }); });
}
