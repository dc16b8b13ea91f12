// Binds the dynamics: the model is built once from arrays, its methods read and write NumPy buffers without the GIL.
#include <pybind11/stl.h>

#include <stdexcept>

#include "arrays.hpp"
#include "bindings.hpp"
#include "dynamics_bounds.hpp"
#include "dynamics_extrema.hpp"
#include "dynamics_kernels.hpp"

namespace py = pybind11;

namespace {

namespace core = ir::dynamics;

using ir::Array, ir::flat;

core::ChainInput input_of(const py::object& data) {
  core::ChainInput in;
  in.n = data.attr("n").cast<int>();
  if (in.n < 1 || in.n > core::kMaxJoints)
    throw std::invalid_argument("robot has " + std::to_string(in.n) + " joints: the compiled core takes 1 to " +
                                std::to_string(core::kMaxJoints));
  in.first_slides = data.attr("first_slides").cast<bool>();
  if (in.first_slides && in.n < 2) throw std::invalid_argument("a rail has nothing on it");
  in.origin = flat(data, "origin");
  in.axis = flat(data, "axis");
  in.mass = flat(data, "mass");
  in.com = flat(data, "com");
  in.inertia = flat(data, "inertia");
  const std::vector<double> gravity = flat(data, "gravity");
  in.gravity = {gravity[0], gravity[1], gravity[2]};
  in.rotor = flat(data, "rotor_inertia");
  in.viscous = flat(data, "viscous");
  in.coulomb = flat(data, "coulomb");
  in.ratio = flat(data, "gear_ratio");
  in.copper = flat(data, "copper_loss");
  in.envelope_speed = flat(data, "envelope_speed");
  in.envelope_torque = flat(data, "envelope_torque");
  const py::object coupling = data.attr("coupling");
  in.turns = flat(coupling, "turns");
  in.inverse = flat(coupling, "inverse");
  in.knots = static_cast<int>(in.envelope_speed.size()) / in.n;
  const py::object cylinder = data.attr("counterbalance");
  if (!cylinder.is_none()) {
    in.balanced_joint = cylinder.attr("joint").cast<int>();
    in.pivot = cylinder.attr("pivot").cast<std::array<double, 2>>();
    in.eye = cylinder.attr("rod_eye").cast<std::array<double, 2>>();
    in.piston_area = cylinder.attr("piston_area").cast<double>();
    in.gas_volume = cylinder.attr("gas_volume").cast<double>();
    in.charge_pressure = cylinder.attr("charge_pressure").cast<double>();
    in.rod_length = cylinder.attr("rod_length_at_charge").cast<double>();
    in.exponent = cylinder.attr("exponent").cast<double>();
  }
  return in;
}

class Dynamics : public core::Core {
 public:
  explicit Dynamics(const py::object& data) : Dynamics(input_of(data)) {}

  py::tuple inverse_dynamics(const Array& q, const Array& qd, const Array& qdd) const {
    return run(q, {&qd, &qdd}, [&](double* tau) {
      return core::inverse_dynamics(model, q.data(), qd.data(), qdd.data(), q.shape(0), tau);
    });
  }
  py::tuple inverse_dynamics_single(const Array& q, const Array& qd, const Array& qdd) const {
    return run(q, {&qd, &qdd}, [&](double* tau) {
      return core::inverse_dynamics(single, q.data(), qd.data(), qdd.data(), q.shape(0), tau);
    });
  }
  py::tuple bias(const Array& q, const Array& qd) const {
    return run(q, {&qd}, [&](double* tau) { return core::bias(model, q.data(), qd.data(), q.shape(0), tau); });
  }
  py::tuple gravity(const Array& q) const {
    return run(q, {}, [&](double* tau) { return core::bias(model, q.data(), nullptr, q.shape(0), tau); });
  }
  py::tuple counterbalance(const Array& q) const {
    return run(q, {}, [&](double* tau) { return core::counterbalance(model, q.data(), q.shape(0), tau); });
  }
  py::tuple forward_dynamics(const Array& q, const Array& qd, const Array& tau) const {
    return run(q, {&qd, &tau}, [&](double* qdd) {
      return core::forward_dynamics(model, q.data(), qd.data(), tau.data(), q.shape(0), qdd);
    });
  }
  py::tuple torque_limit(const Array& qd) const {
    return run(qd, {}, [&](double* limit) { return envelope.limits(model, qd.data(), qd.shape(0), limit); });
  }
  py::tuple axis_power(const Array& qd, const Array& tau) const {
    return run(qd, {&tau}, [&](double* power) {
      return core::axis_power(model, qd.data(), tau.data(), qd.shape(0), power);
    });
  }
  py::tuple mass_matrix(const Array& q) const {
    check(q, {});
    Array H = cube(q.shape(0));
    bool finite;
    {
      py::gil_scoped_release released;
      finite = core::mass_matrix(model, q.data(), q.shape(0), H.mutable_data());
    }
    return py::make_tuple(H, finite);
  }
  py::tuple torque_gradients(const Array& q, const Array& qd, const Array& qdd) const {
    check(q, {&qd, &qdd});
    Array of_q = cube(q.shape(0)), of_qd = cube(q.shape(0)), of_qdd = cube(q.shape(0));
    bool finite;
    {
      py::gil_scoped_release released;
      finite = core::torque_gradients(model, q.data(), qd.data(), qdd.data(), q.shape(0), of_q.mutable_data(),
                                    of_qd.mutable_data(), of_qdd.mutable_data());
    }
    return py::make_tuple(py::make_tuple(of_q, of_qd, of_qdd), finite);
  }

  // upper, sampled, time (n,) and the number of intervals
  py::tuple torque_bounds(const Array& coefficients, const Array& durations, double tolerance, long most) const {
    check_motion(coefficients, durations);
    core::TorqueBounds bounds;
    {
      py::gil_scoped_release released;
      bounds = core::torque_bounds(model, envelope, coefficients.data(), durations.data(), coefficients.shape(0),
                                 static_cast<int>(coefficients.shape(2)), tolerance, most);
    }
    const auto n = static_cast<py::ssize_t>(model.n);
    return py::make_tuple(Array(n, bounds.upper.data()), Array(n, bounds.sampled.data()), Array(n, bounds.time.data()),
                          bounds.intervals);
  }

  // seconds, net, taken (K,) of consecutive pieces of time
  py::tuple power_bounds(const Array& coefficients, const Array& durations, double longest) const {
    check_motion(coefficients, durations);
    core::PowerBounds bounds;
    {
      py::gil_scoped_release released;
      bounds = core::power_bounds(model, coefficients.data(), durations.data(), coefficients.shape(0),
                                static_cast<int>(coefficients.shape(2)), longest);
    }
    const auto count = static_cast<py::ssize_t>(bounds.net.size());
    return py::make_tuple(Array(count, bounds.seconds.data()), Array(count, bounds.net.data()),
                          Array(count, bounds.taken.data()));
  }

 private:
  explicit Dynamics(const core::ChainInput& in) : Dynamics(in, core::build_model(in)) {}
  Dynamics(const core::ChainInput& in, const core::Model<double>& built)
      : Core{built, core::to_single(built), core::Envelope(in.n, in.knots, in.envelope_speed, in.envelope_torque)} {}

  void check(const Array& first, std::initializer_list<const Array*> others) const {
    bool fits = first.ndim() == 2 && first.shape(1) == model.n;
    for (const Array* other : others)
      fits = fits && other->ndim() == 2 && other->shape(0) == first.shape(0) && other->shape(1) == model.n;
    if (!fits) throw std::invalid_argument("arrays have to be (N, n) of one length");
  }
  void check_motion(const Array& coefficients, const Array& durations) const {
    if (coefficients.ndim() != 3 || coefficients.shape(1) != model.n || durations.ndim() != 1 ||
        durations.shape(0) != coefficients.shape(0) || coefficients.shape(2) > core::kMaxTerms)
      throw std::invalid_argument("coefficients have to be (S, n, d + 1) and durations (S,)");
  }
  Array cube(py::ssize_t N) const { return Array({N, py::ssize_t(model.n), py::ssize_t(model.n)}); }

  template <class Function>
  py::tuple run(const Array& first, std::initializer_list<const Array*> others, Function function) const {
    check(first, others);
    Array result({first.shape(0), first.shape(1)});
    double* out = result.mutable_data();
    bool finite;
    {
      py::gil_scoped_release released;
      finite = function(out);
    }
    return py::make_tuple(result, finite);
  }
};

py::tuple dc_bus(const Array& power, const Array& dt, double capacity, const std::string& regeneration,
                 double stored) {
  if (power.ndim() != 2 || dt.ndim() != 1 || dt.shape(0) != power.shape(0))
    throw std::invalid_argument("axis_power has to be (N, n) and dt (N,)");
  const core::Regeneration kind = regeneration == "shared" ? core::Regeneration::kShared
                                : regeneration == "none" ? core::Regeneration::kNone
                                                         : core::Regeneration::kFedBack;
  const py::ssize_t N = power.shape(0);
  Array mains(N), dissipated(N), level(N);
  double *m = mains.mutable_data(), *b = dissipated.mutable_data(), *l = level.mutable_data();
  {
    py::gil_scoped_release released;
    core::dc_bus(power.data(), dt.data(), N, static_cast<int>(power.shape(1)), capacity, kind, stored, m, b, l);
  }
  return py::make_tuple(mains, dissipated, level);
}

py::tuple polynomial_extrema(const Array& coefficients, const Array& durations) {
  if (coefficients.ndim() != 3 || durations.ndim() != 1 || durations.shape(0) != coefficients.shape(0) ||
      coefficients.shape(2) < 1 || coefficients.shape(2) > core::kMaxDegree + 1)
    throw std::invalid_argument("coefficients have to be (S, n, 1..16) and durations (S,)");
  const py::ssize_t S = coefficients.shape(0), n = coefficients.shape(1);
  Array low({S, n}), high({S, n}), when_low({S, n}), when_high({S, n});
  double *l = low.mutable_data(), *h = high.mutable_data(), *wl = when_low.mutable_data(), *wh = when_high.mutable_data();
  {
    py::gil_scoped_release released;
    core::polynomial_extrema(coefficients.data(), durations.data(), S * n, static_cast<int>(n),
                             static_cast<int>(coefficients.shape(2)), l, h, wl, wh);
  }
  return py::make_tuple(low, high, when_low, when_high);
}

py::tuple polynomial_samples(const Array& coefficients, const Array& durations, const Array& begins, const Array& times) {
  if (coefficients.ndim() != 3 || durations.ndim() != 1 || durations.shape(0) != coefficients.shape(0) ||
      begins.size() != durations.size() || durations.size() == 0)
    throw std::invalid_argument("coefficients have to be (S, n, K), durations and begins (S,)");
  const py::ssize_t M = times.size(), n = coefficients.shape(1);
  Array q({M, n}), qd({M, n}), qdd({M, n});
  double *to_q = q.mutable_data(), *to_qd = qd.mutable_data(), *to_qdd = qdd.mutable_data();
  {
    py::gil_scoped_release released;
    core::polynomial_samples(coefficients.data(), durations.data(), begins.data(), durations.size(), static_cast<int>(n),
                             static_cast<int>(coefficients.shape(2)), times.data(), M, to_q, to_qd, to_qdd);
  }
  return py::make_tuple(q, qd, qdd);
}

}  // namespace

void bind_dynamics(py::module_& m) {
  py::class_<core::Core>(m, "DynamicsCore", py::module_local());
  py::class_<Dynamics, core::Core>(m, "Dynamics", py::module_local())
      .def(py::init<const py::object&>())
      .def("inverse_dynamics", &Dynamics::inverse_dynamics)
      .def("inverse_dynamics_single", &Dynamics::inverse_dynamics_single)
      .def("bias", &Dynamics::bias)
      .def("gravity", &Dynamics::gravity)
      .def("counterbalance", &Dynamics::counterbalance)
      .def("forward_dynamics", &Dynamics::forward_dynamics)
      .def("torque_limit", &Dynamics::torque_limit)
      .def("axis_power", &Dynamics::axis_power)
      .def("mass_matrix", &Dynamics::mass_matrix)
      .def("torque_gradients", &Dynamics::torque_gradients)
      .def("torque_bounds", &Dynamics::torque_bounds)
      .def("power_bounds", &Dynamics::power_bounds);
  m.def("dc_bus", &dc_bus);
  m.def("polynomial_extrema", &polynomial_extrema);
  m.def("polynomial_samples", &polynomial_samples);
}
