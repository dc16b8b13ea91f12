// Chain and collision model as Python sees them: arrays in, arrays out, the GIL released around every loop.
#include <pybind11/stl.h>

#include "arrays.hpp"
#include "bindings.hpp"
#include "certify.hpp"
#include "chain_batches.hpp"
#include "geometry_model.hpp"
#include "queries.hpp"

namespace py = pybind11;
using ir::Array, ir::empty, ir::expect, ir::Indices;

namespace {

std::size_t rows_of(const Array& q, int n) {
  expect(q.ndim() == 2 && q.shape(1) == n, "q has to be (N, n)");
  return static_cast<std::size_t>(q.shape(0));
}

void expect_threshold(const ir::Model& model, const Array& threshold) {
  expect(threshold.size() == model.pairs(), "threshold has to be (Z,)");
}

Array link_poses(const Array& origin, const Array& axis, const Array& base, const Array& q, bool first_slides) {
  const ir::Chain chain = ir::chain_of(origin, axis, base, first_slides);
  const std::size_t count = rows_of(q, chain.n);
  Array result = empty({py::ssize_t(count), chain.n + 1, 4, 4});
  double* to = result.mutable_data();
  py::gil_scoped_release release;
  ir::link_poses(chain, q.data(), count, to);
  return result;
}

Array jacobian(const Array& origin, const Array& axis, const Array& base, const Array& tcp, const Array& q,
               bool first_slides) {
  const ir::Chain chain = ir::chain_of(origin, axis, base, first_slides);
  const std::size_t count = rows_of(q, chain.n);
  expect(tcp.size() == 16, "tcp has to be (4, 4)");
  Array result = empty({py::ssize_t(count), 6, chain.n});
  double* to = result.mutable_data();
  py::gil_scoped_release release;
  ir::jacobians(chain, tcp.data(), q.data(), count, to);
  return result;
}

Array distances(const ir::Model& model, const Array& q) {
  const std::size_t count = rows_of(q, model.chain.n);
  Array result = empty({py::ssize_t(count), model.pairs()});
  double* to = result.mutable_data();
  py::gil_scoped_release release;
  ir::distances(model, q.data(), count, to);
  return result;
}

struct WitnessResult {
  Array distance, point_a, point_b, normal;
  explicit WitnessResult(py::ssize_t n)
      : distance(n), point_a(empty({n, 3})), point_b(empty({n, 3})), normal(empty({n, 3})) {}
  ir::WitnessArrays arrays() {
    return {distance.mutable_data(), point_a.mutable_data(), point_b.mutable_data(), normal.mutable_data()};
  }
};

py::tuple min_distance(const ir::Model& model, const Array& q, const Array& offset) {
  const std::size_t count = rows_of(q, model.chain.n);
  expect(offset.size() == model.pairs(), "offset has to be (Z,)");
  WitnessResult result(count);
  Indices pair(static_cast<py::ssize_t>(count));
  const ir::WitnessArrays to = result.arrays();
  std::int64_t* chosen = pair.mutable_data();
  {
    py::gil_scoped_release release;
    ir::min_distance(model, q.data(), count, offset.data(), chosen, to);
  }
  return py::make_tuple(result.distance, pair, result.point_a, result.point_b, result.normal);
}

py::tuple witnesses(const ir::Model& model, const Array& q, const Indices& pair, bool gradient) {
  const std::size_t count = rows_of(q, model.chain.n);
  expect(std::size_t(pair.size()) == count, "pair has to be (N,)");
  for (std::size_t k = 0; k < count; ++k)
    expect(pair.data()[k] >= 0 && pair.data()[k] < model.pairs(), "pair is out of range");
  WitnessResult result(count);
  Array slope = empty({gradient ? py::ssize_t(count) : 0, model.chain.n});
  const ir::WitnessArrays to = result.arrays();
  double* slopes = gradient ? slope.mutable_data() : nullptr;
  {
    py::gil_scoped_release release;
    ir::witnesses(model, q.data(), count, pair.data(), to, slopes);
  }
  return py::make_tuple(result.distance, result.point_a, result.point_b, result.normal, slope);
}

py::array_t<bool> is_free(const ir::Model& model, const Array& q, const Array& threshold) {
  const std::size_t count = rows_of(q, model.chain.n);
  expect_threshold(model, threshold);
  py::array_t<bool> result(static_cast<py::ssize_t>(count));
  bool* to = result.mutable_data();
  py::gil_scoped_release release;
  ir::is_free(model, q.data(), count, threshold.data(), to);
  return result;
}

py::tuple certify_edges(const ir::Model& model, const Array& q0, const Array& q1, const Array& threshold) {
  const std::size_t count = rows_of(q0, model.chain.n);
  expect(rows_of(q1, model.chain.n) == count, "q1 has to be as long as q0");
  expect_threshold(model, threshold);
  std::vector<ir::Outcome> found(count);
  {
    py::gil_scoped_release release;
    ir::certify_edges(model, q0.data(), q1.data(), count, threshold.data(), found.data());
  }
  const auto rows = static_cast<py::ssize_t>(count);
  py::array_t<std::uint8_t> verdict(rows);
  Array t0(rows), t1(rows);
  Indices pair(rows);
  for (py::ssize_t k = 0; k < rows; ++k) {
    verdict.mutable_data()[k] = found[k].verdict;
    t0.mutable_data()[k] = found[k].t0;
    t1.mutable_data()[k] = found[k].t1;
    pair.mutable_data()[k] = found[k].pair;
  }
  return py::make_tuple(verdict, t0, t1, pair);
}

py::tuple certify_trajectory(const ir::Model& model, const Array& coefficients, const Array& durations,
                             const Array& threshold) {
  expect(coefficients.ndim() == 3 && coefficients.shape(1) == model.chain.n && coefficients.shape(2) > 0,
         "coefficients has to be (S, n, K)");
  expect(durations.size() == coefficients.shape(0), "durations has to be (S,)");
  expect_threshold(model, threshold);
  ir::Outcome o;
  {
    py::gil_scoped_release release;
    o = ir::certify_trajectory(model, coefficients.data(), static_cast<int>(coefficients.shape(2)), durations.data(),
                               static_cast<std::size_t>(durations.size()), threshold.data());
  }
  return py::make_tuple(static_cast<int>(o.verdict), o.t0, o.t1, o.pair, o.bound);
}

}  // namespace

void bind_geometry(py::module_& m) {
  m.def("link_poses", &link_poses);
  m.def("jacobian", &jacobian);
  py::class_<ir::Model>(m, "Model", py::module_local())
      .def(py::init(&ir::model_of))
      .def("distances", &distances)
      .def("min_distance", &min_distance)
      .def("witnesses", &witnesses)
      .def("is_free", &is_free)
      .def("certify_edges", &certify_edges)
      .def("certify_trajectory", &certify_trajectory);
}
