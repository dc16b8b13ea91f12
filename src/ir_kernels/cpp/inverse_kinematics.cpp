// Binds inverse kinematics: closed form of spherical wrists, cyclic coordinate descent of any chain.
#include <memory>
#include <stdexcept>

#include "arrays.hpp"
#include "bindings.hpp"
#include "ccd.hpp"
#include "inverse_kinematics_spherical.hpp"

namespace py = pybind11;
namespace inverse = ir::inverse;

namespace {

using ir::Array;

// Hands the memory of a vector to NumPy.
template <class T>
py::array_t<T> owned(std::vector<T>&& values, std::vector<py::ssize_t> shape) {
  auto holder = std::make_unique<std::vector<T>>(std::move(values));
  T* data = holder->data();
  const py::capsule owner(holder.get(), [](void* p) { delete static_cast<std::vector<T>*>(p); });
  holder.release();
  return py::array_t<T>(std::move(shape), data, owner);
}

void copy(const py::handle& source, double* target, py::ssize_t size, const char* name) {
  const Array array = source.cast<Array>();
  if (array.size() != size) throw std::invalid_argument(std::string(name) + " has the wrong size");
  std::copy_n(array.data(), size, target);
}

class SphericalWristIk {
 public:
  SphericalWristIk(const py::object& geometry, const Array& to_base, const Array& from_tcp, const Array& low,
                   const Array& high) {
    copy(geometry.attr("axis"), &arm_.axis[0][0], 18, "axis");
    copy(geometry.attr("plane"), &arm_.plane[0][0], 9, "plane");
    copy(geometry.attr("axis_point"), arm_.axis_point, 3, "axis_point");
    copy(geometry.attr("wrist_in_hand"), arm_.wrist_in_hand, 3, "wrist_in_hand");
    copy(to_base, arm_.to_base, 16, "to_base");
    copy(from_tcp, arm_.from_tcp, 16, "from_tcp");
    copy(low, arm_.low, 6, "position_min");
    copy(high, arm_.high, 6, "position_max");
    double hand[16];
    copy(geometry.attr("hand"), hand, 16, "hand");
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j) arm_.hand_rotation[i][j] = hand[4 * i + j];
    arm_.lateral = geometry.attr("lateral").cast<double>();
    arm_.forward = geometry.attr("forward").cast<double>();
    arm_.elbow_sign = geometry.attr("elbow_sign").cast<double>();
    arm_.wrist_zero = geometry.attr("wrist_zero").cast<double>();
    plane_quantity(geometry.attr("shoulder"), arm_.shoulder);
    plane_quantity(geometry.attr("upper_arm"), arm_.upper_arm);
    plane_quantity(geometry.attr("forearm"), arm_.forearm);
  }

  // q, pose index, branch; None where a pose isn't a rigid transform
  py::object solve(const Array& poses) const {
    if (poses.ndim() != 3 || poses.shape(1) != 4 || poses.shape(2) != 4)
      throw std::invalid_argument("poses have to be (N, 4, 4)");
    inverse::IkSolutions found;
    {
      py::gil_scoped_release released;
      found = inverse::solve(arm_, poses.data(), poses.shape(0));
    }
    if (found.refused >= 0) return py::none();
    const auto M = static_cast<py::ssize_t>(found.pose.size());
    return py::make_tuple(owned(std::move(found.q), {M, 6}), owned(std::move(found.pose), {M}),
                          owned(std::move(found.branch), {M}));
  }

 private:
  static void plane_quantity(const py::object& value, double* target) {
    target[0] = value.attr("real").cast<double>();
    target[1] = value.attr("imag").cast<double>();
  }
  inverse::SphericalArm arm_{};
};

py::tuple ccd(const Array& origin, const Array& axis, const Array& base, const Array& tcp, const Array& pose,
              const Array& low, const Array& high, double rotation_length, const Array& starts, double xi,
              long max_sweeps, long newton_steps, double newton_tolerance) {
  const py::ssize_t n = low.size();
  if (n < 1 || n > inverse::kMaxJoints || origin.size() != 16 * n || axis.size() != 3 * n || base.size() != 16 ||
      tcp.size() != 16 || pose.size() != 16 || high.size() != n || starts.ndim() != 2 || starts.shape(1) != n)
    throw std::invalid_argument("ccd: sizes of the arrays don't belong together, or more than " +
                                std::to_string(inverse::kMaxJoints) + " joints");
  inverse::CcdProblem problem(static_cast<int>(n), origin.data(), axis.data(), base.data(), tcp.data(), pose.data(),
                           low.data(), high.data(), rotation_length);
  problem.xi = xi;
  problem.max_sweeps = max_sweeps;
  problem.newton_steps = newton_steps;
  problem.newton_tolerance = newton_tolerance;
  const py::ssize_t P = starts.shape(0);
  Array q({P, n}), psi(P), distance(P), angle(P);
  py::array_t<std::int64_t> sweeps(P), steps(P);
  const inverse::CcdArrays out{q.mutable_data(),     psi.mutable_data(),    distance.mutable_data(),
                            angle.mutable_data(), sweeps.mutable_data(), steps.mutable_data()};
  {
    py::gil_scoped_release released;
    inverse::run(problem, starts.data(), P, out);
  }
  return py::make_tuple(q, psi, distance, angle, sweeps, steps);
}

}  // namespace

void bind_inverse_kinematics(py::module_& m) {
  py::class_<SphericalWristIk>(m, "SphericalWristIk", py::module_local())
      .def(py::init<const py::object&, const Array&, const Array&, const Array&, const Array&>())
      .def("solve", &SphericalWristIk::solve);
  m.def("ccd", &ccd);
}
