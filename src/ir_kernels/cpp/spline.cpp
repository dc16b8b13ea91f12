// Binds the refinement of a motion along a uniform cubic B-spline: see ir_kernels/spline.py.
#include <pybind11/numpy.h>

#include <stdexcept>

#include "bindings.hpp"
#include "descent.hpp"
#include "spline_cost.hpp"

namespace py = pybind11;

namespace {

using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Rows = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;
namespace dynamics = ir::dynamics;

std::vector<double> flat(const py::object& data, const char* name) {
  const Array array = data.attr(name).cast<Array>();
  return {array.data(), array.data() + array.size()};
}

ir::SplineTerms terms_of(const py::object& data) {
  ir::SplineTerms t;
  t.velocity = flat(data, "velocity");
  t.acceleration = flat(data, "acceleration");
  t.jerk = flat(data, "jerk");
  t.low = flat(data, "low");
  t.high = flat(data, "high");
  t.travel = flat(data, "travel");
  t.threshold = flat(data, "threshold");
  t.torque_share = data.attr("torque_share").cast<double>();
  t.energy_value = data.attr("energy_value").cast<double>();
  t.time_value = data.attr("time_value").cast<double>();
  t.capacity = data.attr("capacity_energy").cast<double>();
  const auto name = data.attr("regeneration").cast<std::string>();
  t.regeneration = name == "shared" ? dynamics::Regeneration::kShared
                 : name == "none"   ? dynamics::Regeneration::kNone
                                    : dynamics::Regeneration::kFedBack;
  t.clearance_margin = data.attr("clearance_margin").cast<double>();
  t.clearance_scale = data.attr("clearance_scale").cast<double>();
  t.penalty = data.attr("penalty").cast<double>();
  t.clearance_penalty = data.attr("clearance_penalty").cast<double>();
  return t;
}

// How a change of the control points counts: bending costs most, and each joint counts in parts of its speed limit.
// M = (D'D bending + I holding) / scale^2 for each joint, D the second differences of the m inner control points between
// fixed ends; a banded Cholesky factor solves with it.
class Metric {
 public:
  Metric(int m, std::vector<double> scale, double holding) : m_(m), scale_(std::move(scale)), band_(3 * m) {
    for (int i = 0; i < m; ++i) {
      band_[3 * i] = 6.0 + holding - (i == 0) - (i == m - 1);
      band_[3 * i + 1] = i > 0 ? -4.0 : 0.0;
      band_[3 * i + 2] = i > 1 ? 1.0 : 0.0;
    }
    for (int i = 0; i < m; ++i) {  // in place: diagonal, first and second subdiagonal of the factor
      double* b = &band_[3 * i];
      if (i > 1) b[2] /= band_[3 * (i - 2)];
      if (i > 0) b[1] = (b[1] - (i > 1 ? b[2] * band_[3 * (i - 1) + 1] : 0.0)) / band_[3 * (i - 1)];
      b[0] = std::sqrt(b[0] - b[1] * b[1] - b[2] * b[2]);
    }
  }
  void solve(std::vector<double>& v) const {
    const int n = static_cast<int>(scale_.size());
    for (int j = 0; j < n; ++j) {
      const auto at = [&](int i) -> double& { return v[static_cast<std::size_t>(i) * n + j]; };
      for (int i = 0; i < m_; ++i) {
        if (i > 0) at(i) -= band_[3 * i + 1] * at(i - 1);
        if (i > 1) at(i) -= band_[3 * i + 2] * at(i - 2);
        at(i) /= band_[3 * i];
      }
      for (int i = m_ - 1; i >= 0; --i) {
        if (i + 1 < m_) at(i) -= band_[3 * (i + 1) + 1] * at(i + 1);
        if (i + 2 < m_) at(i) -= band_[3 * (i + 2) + 2] * at(i + 2);
        at(i) /= band_[3 * i];
      }
      for (int i = 0; i < m_; ++i) at(i) *= scale_[j] * scale_[j];
    }
  }

 private:
  int m_;
  std::vector<double> scale_, band_;
};

class SplineCost {
 public:
  SplineCost(const ir::Model& geometry, const dynamics::Core& drives, const py::object& data)
      : pairs_(geometry.pairs()), n_(drives.model.n), terms_(terms_of(data)), geometry_(geometry), drives_(drives) {
    for (const auto* of : {&terms_.velocity, &terms_.acceleration, &terms_.jerk, &terms_.low, &terms_.high, &terms_.travel})
      if (of->size() != static_cast<std::size_t>(n_)) throw std::invalid_argument("terms have to be (n,)");
    if (geometry.chain.n != n_ || (pairs_ > 0 && (terms_.threshold.empty() || terms_.threshold.size() % pairs_ != 0)))
      throw std::invalid_argument("chain, drives and thresholds don't fit together");
  }

  // value, gradient (K, n), derivative by the interval, energy
  py::tuple value(const Array& control, const Rows& row, double interval) const {
    check(control, row);
    Array gradient({control.shape(0), control.shape(1)});
    double* to = gradient.mutable_data();
    double value, of_interval, energy;
    {
      py::gil_scoped_release released;
      ir::SplineCost cost(geometry_, drives_, terms_);
      value = cost(control.data(), static_cast<int>(control.shape(0)), row.data(), interval, to, of_interval);
      energy = cost.energy;
    }
    return py::make_tuple(value, gradient, of_interval, energy);
  }

  // control (K, n) with three equal points at both ends, which stay; new control, interval, value, evaluations
  py::tuple descend(const Array& control, const Rows& row, double interval, bool fixed, int most, double tolerance) const {
    check(control, row);
    const int K = static_cast<int>(control.shape(0)), m = K - 6;
    if (m < 1) throw std::invalid_argument("control has to be (K, n) with K >= 7");
    Array result({control.shape(0), control.shape(1)});
    double* all = result.mutable_data();
    std::copy_n(control.data(), control.size(), all);
    ir::Descent done;
    {
      py::gil_scoped_release released;
      ir::SplineCost cost(geometry_, drives_, terms_);
      const std::size_t size = static_cast<std::size_t>(m) * n_, skip = 3 * static_cast<std::size_t>(n_);
      std::vector<double> x(all + skip, all + skip + size), slopes(control.size());
      x.push_back(0.0);  // logarithm of the interval, relative
      std::vector<double> scale = terms_.velocity;
      const Metric metric(m, std::move(scale), holding);
      const double first = interval;
      const auto function = [&](const std::vector<double>& at, std::vector<double>& gradient) {
        std::copy_n(at.begin(), size, all + skip);
        const double now = first * std::exp(at[size]);
        double of_interval;
        const double value = cost(all, K, row.data(), now, slopes.data(), of_interval);
        std::copy_n(slopes.begin() + static_cast<long>(skip), size, gradient.begin());
        gradient[size] = fixed ? 0.0 : of_interval * now;
        return value;
      };
      const auto precondition = [&](std::vector<double>& v) {
        const double last = v[size];
        metric.solve(v);
        v[size] = last * interval_weight;
      };
      done = ir::descend(x, function, precondition, most, tolerance);
      std::copy_n(x.begin(), size, all + skip);
      interval = first * std::exp(x[size]);
    }
    return py::make_tuple(result, interval, done.value, done.evaluations);
  }

 private:
  static constexpr double interval_weight = 4.0;  // of the logarithm of the interval, against (rad/s)^2
  static constexpr double holding = 0.02;         // against bending

  void check(const Array& control, const Rows& row) const {
    if (control.ndim() != 2 || control.shape(1) != n_ || control.shape(0) < 4)
      throw std::invalid_argument("control has to be (K, n) with K >= 4");
    if (row.ndim() != 1 || row.shape(0) != control.shape(0) - 3) throw std::invalid_argument("row has to be (K - 3,)");
    const auto rows = static_cast<std::int32_t>(pairs_ > 0 ? terms_.threshold.size() / pairs_ : 1);
    for (py::ssize_t k = 0; k < row.size(); ++k)
      if (row.data()[k] < 0 || row.data()[k] >= rows) throw std::invalid_argument("row is out of range");
  }

  int pairs_, n_;
  ir::SplineTerms terms_;
  const ir::Model& geometry_;
  const dynamics::Core& drives_;
};

}  // namespace

void bind_spline(py::module_& m) {
  py::class_<SplineCost>(m, "SplineCost", py::module_local())
      .def(py::init<const ir::Model&, const dynamics::Core&, const py::object&>(), py::keep_alive<1, 2>(),
           py::keep_alive<1, 3>())
      .def("value", &SplineCost::value)
      .def("descend", &SplineCost::descend);
}
