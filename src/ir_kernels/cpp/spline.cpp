// Binds the refinement of a motion along a uniform cubic B-spline: see ir_kernels/spline.py.
#include <memory>
#include <mutex>
#include <stdexcept>

#include "arrays.hpp"
#include "bending_metric.hpp"
#include "bindings.hpp"
#include "descent.hpp"
#include "elementary.hpp"
#include "spline_cost.hpp"
#include "spline_profile.hpp"
#include "spline_starts.hpp"

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
  t.tilt_axis = flat(data, "tilt_axis");
  t.tilt_direction = flat(data, "tilt_direction");
  t.tilt_max = data.attr("tilt_max").cast<double>();
  t.tilt_scale = data.attr("tilt_scale").cast<double>();
  return t;
}

class SplineCost {
 public:
  SplineCost(const ir::Model& geometry, const dynamics::Core& drives, const py::object& data)
      : pairs_(geometry.pairs()), n_(drives.model.n), terms_(terms_of(data)), geometry_(geometry), drives_(drives) {
    for (const auto* of : {&terms_.velocity, &terms_.acceleration, &terms_.jerk, &terms_.low, &terms_.high, &terms_.travel})
      if (of->size() != static_cast<std::size_t>(n_)) throw std::invalid_argument("terms have to be (n,)");
    for (const auto* of : {&terms_.tilt_axis, &terms_.tilt_direction})
      if (of->size() != 3) throw std::invalid_argument("directions of the tilt have to be (3,)");
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

  // control (K, n), of which three points at both ends stay, or follow from q, qd, qdd there, ends (2, 3, n), where these
  // are given; new control, interval, value, evaluations
  py::tuple descend(const Array& control, const Rows& row, double interval, bool fixed, int most, double tolerance,
                    const Array& ends) const {
    check(control, row);
    const int K = static_cast<int>(control.shape(0));
    ir::expect(K >= 7, "control has to be (K, n) with K >= 7");
    ir::expect(ends.size() == 0 || (ends.ndim() == 3 && ends.shape(0) == 2 && ends.shape(1) == 3 && ends.shape(2) == n_),
               "ends have to be (2, 3, n)");
    const double* moving = ends.size() > 0 ? ends.data() : nullptr;
    Array result({control.shape(0), control.shape(1)});
    double* all = result.mutable_data();
    std::copy_n(control.data(), control.size(), all);
    ir::Descent done;
    {
      py::gil_scoped_release released;
      const Borrowed cost(*this);
      done = descended(*cost, all, K, row.data(), interval, fixed, most, tolerance, moving);
    }
    return py::make_tuple(result, interval, done.value, done.evaluations);
  }

  // The same from starts along paths, points (P, n) one path after the other, counts (L,) of them, under the first row of
  // thresholds; the control points stay within the joints' ranges. A list of what descend returns.
  py::list descend_along(const Array& points, const ir::Indices& counts, double spacing, double slower, double duration,
                         int fewest, int most, int evaluations, double tolerance) const {
    ir::expect(points.ndim() == 2 && points.shape(1) == n_, "points have to be (P, n)");
    struct Result {
      ir::SplineStart spline;
      ir::Descent done;
    };
    std::vector<Result> results;
    {
      py::gil_scoped_release released;
      const Borrowed cost(*this);
      const double* path = points.data();
      for (py::ssize_t l = 0; l < counts.size(); path += counts.data()[l] * n_, ++l) {
        ir::SplineStart start = ir::spline_along(path, counts.data()[l], n_, terms_.velocity, terms_.acceleration,
                                                 {spacing, slower, duration, fewest, most});
        const int K = static_cast<int>(start.control.size()) / n_;
        const std::vector<std::int32_t> row(K - 3, 0);
        cost->forget();
        const ir::Descent done = descended(*cost, start.control.data(), K, row.data(), start.interval, duration > 0.0,
                                           evaluations, tolerance);
        for (std::size_t k = 0; k < start.control.size(); ++k)
          start.control[k] = std::min(std::max(start.control[k], terms_.low[k % n_]), terms_.high[k % n_]);
        results.push_back({std::move(start), done});
      }
    }
    py::list found;
    for (const Result& r : results) {
      const Array control({static_cast<py::ssize_t>(r.spline.control.size()) / n_, static_cast<py::ssize_t>(n_)},
                          r.spline.control.data());
      found.append(py::make_tuple(control, r.spline.interval, r.done.value, r.done.evaluations));
    }
    return found;
  }

  // Of splines that pass p(s) at their inner knots, p by breaks (B + 1,) and cubics (4, B, n): from s (C,) and a duration;
  // new s, duration, value, evaluations.
  py::tuple descend_profile(const Array& breaks, const Array& cubics, const Array& s, double duration, bool fixed, int most,
                            double tolerance) const {
    ir::expect(cubics.ndim() == 3 && cubics.shape(0) == 4 && cubics.shape(1) + 1 == breaks.size() && cubics.shape(2) == n_,
               "cubics have to be (4, B, n) and breaks (B + 1,)");
    const int C = static_cast<int>(s.size());
    ir::expect(C >= 4, "s has to be (C,) with C >= 4");
    Array result(s.size());
    ir::Descent done;
    {
      py::gil_scoped_release released;
      const Borrowed cost(*this);
      const ir::CubicPath path{breaks.data(), cubics.data(), static_cast<long>(cubics.shape(1)), n_};
      done = profiled(*cost, path, s.data(), C, duration, fixed, most, tolerance, result.mutable_data());
    }
    return py::make_tuple(result, duration, done.value, done.evaluations);
  }

 private:
  static constexpr double interval_weight = 4.0;  // of the logarithm of the interval, against (rad/s)^2
  static constexpr double holding = 0.02;         // against bending
  static constexpr double profile_bending = 0.03; // weight of the jerk of s in its metric
  static constexpr double profile_scale = 0.03, profile_time = 0.1;  // of s, and of the duration's logarithm

  // Sets the three control points at both ends for q, qd, qdd there, ends (2, 3, n), at an interval h; returns the derivative
  // by h of a cost whose slopes (K, n) by all control points are given, nullptr: 0.
  double put_ends(const double* ends, double h, double* all, int K, const double* slopes) const {
    double of_interval = 0.0;
    for (int end = 0; end < 2; ++end)
      for (int j = 0; j < n_; ++j) {
        const double* state = ends + 3 * end * n_ + j;
        const double q = state[0], v = state[n_], a = state[2 * n_];
        const double middle = q - h * h * a / 6.0, bend = 0.5 * h * h * a, lean = h * v;
        const std::size_t first = static_cast<std::size_t>(end == 0 ? 0 : K - 3) * n_ + j;
        all[first] = middle + bend - lean;
        all[first + n_] = middle;
        all[first + 2 * n_] = middle + bend + lean;
        if (slopes == nullptr) continue;
        of_interval += slopes[first] * (2.0 / 3.0 * h * a - v) - slopes[first + n_] * (h * a / 3.0) +
                       slopes[first + 2 * n_] * (2.0 / 3.0 * h * a + v);
      }
    return of_interval;
  }

  ir::Descent descended(ir::SplineCost& cost, double* all, int K, const std::int32_t* row, double& interval, bool fixed,
                        int most, double tolerance, const double* ends = nullptr) const {
    const int m = K - 6;
    const std::size_t size = static_cast<std::size_t>(m) * n_;
    double* inner = all + 3 * static_cast<std::size_t>(n_);
    std::vector<double> x(inner, inner + size), slopes(static_cast<std::size_t>(K) * n_);
    x.push_back(0.0);  // logarithm of the interval, relative
    const ir::BendingMetric metric(m, terms_.velocity, holding);
    const double first = interval;
    const auto function = [&](const std::vector<double>& at, std::vector<double>& gradient) {
      std::copy_n(at.begin(), size, inner);
      const double now = first * ir::exponential(at[size]);
      double of_interval;
      if (ends != nullptr) put_ends(ends, now, all, K, nullptr);
      const double value = cost(all, K, row, now, slopes.data(), of_interval);
      if (ends != nullptr) of_interval += put_ends(ends, now, all, K, slopes.data());
      std::copy_n(slopes.begin() + 3 * n_, size, gradient.begin());
      gradient[size] = fixed ? 0.0 : of_interval * now;
      return value;
    };
    const auto precondition = [&](std::vector<double>& v) {
      metric.solve(v.data());
      v[size] *= interval_weight;
    };
    const ir::Descent done = ir::descend(x, function, precondition, most, tolerance);
    std::copy_n(x.begin(), size, inner);
    interval = first * ir::exponential(x[size]);
    if (ends != nullptr) put_ends(ends, interval, all, K, nullptr);
    return done;
  }

  // x: the change of s and of the duration's logarithm, each in its scale
  // long: the function and its derivative side by side
  ir::Descent profiled(ir::SplineCost& cost, const ir::CubicPath& path, const double* s, int C, double& duration, bool fixed,
                       int most, double tolerance, double* result) const {
    const ir::Banded knots = ir::knots_of(C), metric = ir::jerk_metric(C, profile_bending * static_cast<double>(C + 3) * (C + 3) * (C + 3));
    const int K = C + 6;
    const std::vector<std::int32_t> row(K - 3, 0);
    std::vector<double> all(static_cast<std::size_t>(K) * n_), slopes(all.size()), along(static_cast<std::size_t>(C) * n_),
        x(C + 1, 0.0), unused(n_);
    double* inner = &all[3 * static_cast<std::size_t>(n_)];
    for (int k = 0; k < 3; ++k) {
      path.at(0.0, &all[static_cast<std::size_t>(k) * n_], unused.data());
      path.at(1.0, &all[static_cast<std::size_t>(K - 1 - k) * n_], unused.data());
    }
    const auto place = [&](const std::vector<double>& at, int i) {
      return std::min(std::max(s[i] + profile_scale * at[i], 0.0), 1.0);
    };
    const auto lasts = [&](const std::vector<double>& at) { return duration * ir::exponential(profile_time * at[C]); };
    const auto function = [&](const std::vector<double>& at, std::vector<double>& gradient) {
      for (int i = 0; i < C; ++i) path.at(place(at, i), inner + i * n_, &along[static_cast<std::size_t>(i) * n_]);
      for (int k = 0; k < C * n_; ++k) inner[k] *= 6.0;
      for (int j = 0; j < n_; ++j) inner[j] -= all[j], inner[(C - 1) * n_ + j] -= all[(K - 1) * n_ + j];
      knots.solve(inner, n_);
      double of_interval;
      const double now = lasts(at) / (C + 3), value = cost(all.data(), K, row.data(), now, slopes.data(), of_interval);
      double* owed = &slopes[3 * static_cast<std::size_t>(n_)];
      knots.solve(owed, n_);
      for (int i = 0; i < C; ++i) {
        double sum = 0.0;
        for (int j = 0; j < n_; ++j) sum += owed[i * n_ + j] * along[static_cast<std::size_t>(i) * n_ + j];
        gradient[i] = 6.0 * profile_scale * sum;
      }
      gradient[C] = fixed ? 0.0 : profile_time * of_interval * now;
      return value;
    };
    const auto precondition = [&](std::vector<double>& v) { metric.solve(v.data(), 1); };
    const ir::Descent done = ir::descend(x, function, precondition, most, tolerance);
    for (int i = 0; i < C; ++i) result[i] = place(x, i);
    duration = lasts(x);
    return done;
  }

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
      .def("descend", &SplineCost::descend)
      .def("descend_along", &SplineCost::descend_along)
      .def("descend_profile", &SplineCost::descend_profile);
}
