// Binds the refinement of a motion along a uniform cubic B-spline: see ir_kernels/spline.py.
#include <memory>
#include <mutex>
#include <stdexcept>

#include "arrays.hpp"
#include "bending_metric.hpp"
#include "bindings.hpp"
#include "descent.hpp"
#include "spline_cost.hpp"

namespace py = pybind11;

namespace {

using ir::Array, ir::flat;
using Rows = py::array_t<std::int32_t, py::array::c_style | py::array::forcecast>;
namespace dynamics = ir::dynamics;

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
  t.smoothing = data.attr("smoothing").cast<double>();
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

class SplineCost {
 public:
  SplineCost(const ir::Model& geometry, const dynamics::Core& drives, const py::object& data)
      : pairs_(geometry.pairs()), n_(drives.model.n), terms_(terms_of(data)), geometry_(geometry), drives_(drives) {
    for (const auto* of : {&terms_.velocity, &terms_.acceleration, &terms_.jerk, &terms_.low, &terms_.high, &terms_.travel})
      if (of->size() != static_cast<std::size_t>(n_)) throw std::invalid_argument("terms have to be (n,)");
    const std::size_t given = terms_.threshold.size();
    if (geometry.chain.n != n_ || (pairs_ > 0 ? given == 0 || given % pairs_ != 0 : given != 0))
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
      const Borrowed cost(*this);
      value = (*cost)(control.data(), static_cast<int>(control.shape(0)), row.data(), interval, to, of_interval);
      energy = cost->energy;
    }
    return py::make_tuple(value, gradient, of_interval, energy);
  }

  // control (K, n), of which three points at both ends stay; new control, interval, value, evaluations
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
      const Borrowed cost(*this);
      const std::size_t size = static_cast<std::size_t>(m) * n_;
      double* inner = all + 3 * static_cast<std::size_t>(n_);
      std::vector<double> x(inner, inner + size), slopes(control.size());
      x.push_back(0.0);  // logarithm of the interval, relative
      const ir::BendingMetric metric(m, terms_.velocity, holding);
      const double first = interval;
      const auto function = [&](const std::vector<double>& at, std::vector<double>& gradient) {
        std::copy_n(at.begin(), size, inner);
        const double now = first * std::exp(at[size]);
        double of_interval;
        const double value = (*cost)(all, K, row.data(), now, slopes.data(), of_interval);
        std::copy_n(slopes.begin() + 3 * n_, size, gradient.begin());
        gradient[size] = fixed ? 0.0 : of_interval * now;
        return value;
      };
      const auto precondition = [&](std::vector<double>& v) {
        metric.solve(v.data());
        v[size] *= interval_weight;
      };
      done = ir::descend(x, function, precondition, most, tolerance);
      std::copy_n(x.begin(), size, inner);
      interval = first * std::exp(x[size]);
    }
    return py::make_tuple(result, interval, done.value, done.evaluations);
  }

 private:
  static constexpr double interval_weight = 4.0;  // of the logarithm of the interval, against (rad/s)^2
  static constexpr double holding = 0.02;         // against bending

  // A workspace that nobody else uses meanwhile; it is kept for the next call.
  class Borrowed {
   public:
    explicit Borrowed(const SplineCost& from) : from_(from) {
      {
        const std::lock_guard<std::mutex> lock(from.busy_);
        if (!from.idle_.empty()) {
          cost_ = std::move(from.idle_.back());
          from.idle_.pop_back();
        }
      }
      if (!cost_) cost_ = std::make_unique<ir::SplineCost>(from.geometry_, from.drives_, from.terms_);
      cost_->forget();
    }
    ~Borrowed() {
      try {
        const std::lock_guard<std::mutex> lock(from_.busy_);
        from_.idle_.push_back(std::move(cost_));
      } catch (...) {  // no memory to keep it
      }
    }
    Borrowed(const Borrowed&) = delete;
    Borrowed& operator=(const Borrowed&) = delete;
    ir::SplineCost& operator*() const { return *cost_; }
    ir::SplineCost* operator->() const { return cost_.get(); }

   private:
    const SplineCost& from_;
    std::unique_ptr<ir::SplineCost> cost_;
  };

  void check(const Array& control, const Rows& row) const {
    if (control.ndim() != 2 || control.shape(1) != n_ || control.shape(0) < 4)
      throw std::invalid_argument("control has to be (K, n) with K >= 4");
    if (row.ndim() != 1 || row.shape(0) != control.shape(0) - 3) throw std::invalid_argument("row has to be (K - 3,)");
    if (pairs_ == 0) return;  // nor thresholds
    const auto rows = static_cast<py::ssize_t>(terms_.threshold.size()) / pairs_;
    for (py::ssize_t k = 0; k < row.size(); ++k)
      if (row.data()[k] < 0 || row.data()[k] >= rows) throw std::invalid_argument("row is out of range");
  }

  int pairs_, n_;
  const ir::SplineTerms terms_;
  const ir::Model& geometry_;
  const dynamics::Core& drives_;
  mutable std::mutex busy_;
  mutable std::vector<std::unique_ptr<ir::SplineCost>> idle_;
};

}  // namespace

void bind_spline(py::module_& m) {
  py::class_<SplineCost>(m, "SplineCost", py::module_local())
      .def(py::init<const ir::Model&, const dynamics::Core&, const py::object&>(), py::keep_alive<1, 2>(),
           py::keep_alive<1, 3>())
      .def("value", &SplineCost::value)
      .def("descend", &SplineCost::descend);
}
