// Chain and collision model as Python sees them: arrays in, arrays out, the GIL released around every loop.
#include <pybind11/numpy.h>
#include <pybind11/stl.h>

#include <stdexcept>

#include "bindings.hpp"
#include "certify.hpp"
#include "queries.hpp"

namespace py = pybind11;
using Array = py::array_t<double, py::array::c_style | py::array::forcecast>;
using Indices = py::array_t<std::int64_t, py::array::c_style | py::array::forcecast>;

namespace {

void expect(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

std::size_t rows_of(const Array& q, int n) {
  expect(q.ndim() == 2 && q.shape(1) == n, "q has to be (N, n)");
  return static_cast<std::size_t>(q.shape(0));
}

Array empty(std::initializer_list<py::ssize_t> shape) { return Array(std::vector<py::ssize_t>(shape)); }

ir::Chain chain_of(const Array& joint_origin, const Array& joint_axis, const Array& base_pose) {
  const int n = static_cast<int>(joint_axis.shape(0));
  expect(joint_axis.size() == 3 * n && joint_origin.size() == 16 * n && base_pose.size() == 16, "not a chain");
  return ir::Chain(n, joint_origin.data(), joint_axis.data(), base_pose.data());
}

// Poses of the links' own frames, eight configurations at a time.
void write_link_poses(const ir::Chain& chain, const double* q, std::size_t count, double* result) {
  std::vector<ir::Double8> lanes(chain.n);
  std::vector<ir::Frame<ir::Double8>> frames(chain.n + 1);
  for (std::size_t first = 0; first < count; first += 8) {
    const int used = static_cast<int>(std::min<std::size_t>(8, count - first));
    for (int j = 0; j < chain.n; ++j)
      for (int k = 0; k < 8; ++k) lanes[j][k] = q[(first + std::min(k, used - 1)) * chain.n + j];
    chain.forward(lanes.data(), frames.data());
    for (int link = 0; link <= chain.n; ++link) {
      const auto& f = frames[link];
      const double* g = &chain.internal[9 * link];  // own frame = internal frame x transposed g
      for (int k = 0; k < used; ++k) {
        double* pose = result + ((first + k) * (chain.n + 1) + link) * 16;
        const double turn[9] = {f.x.x[k], f.y.x[k], f.z.x[k], f.x.y[k], f.y.y[k], f.z.y[k], f.x.z[k], f.y.z[k], f.z.z[k]};
        const double origin[3] = {f.origin.x[k], f.origin.y[k], f.origin.z[k]};
        for (int i = 0; i < 3; ++i) {
          for (int j = 0; j < 3; ++j)
            pose[4 * i + j] = turn[3 * i] * g[3 * j] + turn[3 * i + 1] * g[3 * j + 1] + turn[3 * i + 2] * g[3 * j + 2];
          pose[4 * i + 3] = origin[i] + chain.base_origin[i];
          pose[12 + i] = 0.0;
        }
        pose[15] = 1.0;
      }
    }
  }
}

void write_jacobians(const ir::Chain& chain, const double* tcp, const double* q, std::size_t count, double* result) {
  std::vector<ir::Double8> lanes(chain.n);
  std::vector<ir::Frame<ir::Double8>> frames(chain.n + 1);
  const double own[3] = {tcp[3], tcp[7], tcp[11]};
  double local[3];
  chain.to_internal(chain.n, own, local);
  const ir::Local point(local);
  for (std::size_t first = 0; first < count; first += 8) {
    const int used = static_cast<int>(std::min<std::size_t>(8, count - first));
    for (int j = 0; j < chain.n; ++j)
      for (int k = 0; k < 8; ++k) lanes[j][k] = q[(first + std::min(k, used - 1)) * chain.n + j];
    chain.forward(lanes.data(), frames.data());
    const auto at = ir::place(frames[chain.n], point);
    for (int j = 0; j < chain.n; ++j) {
      const auto& axis = frames[j + 1].z;
      const auto linear = ir::cross(axis, at - frames[j + 1].origin);
      for (int k = 0; k < used; ++k) {
        double* column = result + (first + k) * 6 * chain.n + j;
        const double values[6] = {linear.x[k], linear.y[k], linear.z[k], axis.x[k], axis.y[k], axis.z[k]};
        for (int i = 0; i < 6; ++i) column[i * chain.n] = values[i];
      }
    }
  }
}

// Checked in Python (ir_kernels.geometry): here the arrays only change their form.
ir::Model model_of(const Array& joint_origin, const Array& joint_axis, const Array& base_pose, const Indices& link,
                   const Array& ends, const Array& radius, const Indices& kind, const Array& pose, const Array& size,
                   const std::vector<std::array<Array, 4>>& hulls, const Indices& environment,
                   const Indices& self_pairs) {
  ir::Model m(chain_of(joint_origin, joint_axis, base_pose));
  const py::ssize_t capsules = link.size(), bodies = kind.size();
  expect(ends.size() == 6 * capsules && radius.size() == capsules, "capsules don't fit together");
  expect(pose.size() == 16 * bodies && size.size() == 3 * bodies && py::ssize_t(hulls.size()) == bodies,
         "bodies don't fit together");
  for (py::ssize_t c = 0; c < capsules; ++c) {
    ir::Capsule capsule;
    capsule.link = static_cast<int>(link.data()[c]);
    expect(capsule.link >= 0 && capsule.link <= m.chain.n, "a capsule's link is out of range");
    double p0[3], p1[3];
    m.chain.to_internal(capsule.link, ends.data() + 6 * c, p0);
    m.chain.to_internal(capsule.link, ends.data() + 6 * c + 3, p1);
    double middle[3], axis[3], square = 0.0;
    for (int i = 0; i < 3; ++i) {
      middle[i] = 0.5 * (p0[i] + p1[i]);
      axis[i] = 0.5 * (p1[i] - p0[i]);
      square += axis[i] * axis[i];
    }
    capsule.middle = ir::Local(middle);
    capsule.axis = ir::Local(axis);
    capsule.radius = radius.data()[c];
    capsule.half = std::sqrt(square);
    capsule.inverse_square = square > 0.0 ? 0.25 / square : 0.0;
    m.capsules.push_back(capsule);
  }
  for (py::ssize_t b = 0; b < bodies; ++b) {
    const double *t = pose.data() + 16 * b, *s = size.data() + 3 * b;
    ir::Body<double> body{};
    ir::Hull hull;
    double centre[3] = {0, 0, 0};
    m.kind.push_back(static_cast<int>(kind.data()[b]));
    switch (m.kind.back()) {
      case ir::box:
        for (int i = 0; i < 3; ++i) body.half[i] = 0.5 * s[i];
        break;
      case ir::cylinder:
        body.radius = s[0], body.half_length = 0.5 * s[1];
        body.half[0] = body.half[1] = s[0], body.half[2] = 0.5 * s[1];
        break;
      case ir::sphere:
        body.radius = body.half[0] = body.half[1] = body.half[2] = s[0];
        break;
      case ir::capsule:
        body.radius = s[0], body.half_length = 0.5 * s[1];
        body.half[0] = body.half[1] = s[0], body.half[2] = 0.5 * s[1] + s[0];
        break;
      case ir::plane:
        break;
      case ir::mesh: {
        const auto& [vertices, edges, normals, offsets] = hulls[b];
        const auto copied = [](const Array& a) { return std::vector<double>(a.data(), a.data() + a.size()); };
        hull = {copied(vertices), copied(normals), copied(edges), copied(offsets)};
        expect(!hull.vertices.empty() && hull.normals.size() == 3 * hull.offsets.size(), "a hull is incomplete");
        for (int i = 0; i < 3; ++i) {
          double low = hull.vertices[i], high = low;
          for (std::size_t v = i; v < hull.vertices.size(); v += 3) {
            low = std::min(low, hull.vertices[v]);
            high = std::max(high, hull.vertices[v]);
          }
          centre[i] = 0.5 * (low + high);
          body.half[i] = 0.5 * (high - low);
        }
        for (std::size_t v = 0; v < hull.vertices.size(); ++v) hull.vertices[v] -= centre[v % 3];
        for (std::size_t f = 0; f < hull.offsets.size(); ++f)
          for (int i = 0; i < 3; ++i) hull.offsets[f] -= hull.normals[3 * f + i] * centre[i];
        break;
      }
      default:
        expect(false, "a body's kind is unknown");
    }
    double world[3];
    for (int i = 0; i < 3; ++i)
      world[i] = t[4 * i] * centre[0] + t[4 * i + 1] * centre[1] + t[4 * i + 2] * centre[2] + t[4 * i + 3] -
                 m.chain.base_origin[i];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) body.axis[i][j] = t[4 * j + i];
      body.offset[i] = body.axis[i][0] * world[0] + body.axis[i][1] * world[1] + body.axis[i][2] * world[2];
    }
    m.bodies_double.push_back(body);
    m.hulls.push_back(std::move(hull));
  }
  const auto pairs_of = [](const Indices& pairs, py::ssize_t first, py::ssize_t second) {
    std::vector<std::array<int, 2>> result;
    for (py::ssize_t z = 0; 2 * z < pairs.size(); ++z) {
      const std::int64_t a = pairs.data()[2 * z], b = pairs.data()[2 * z + 1];
      expect(a >= 0 && a < first && b >= 0 && b < second, "a pair is out of range");
      result.push_back({static_cast<int>(a), static_cast<int>(b)});
    }
    return result;
  };
  m.environment = pairs_of(environment, capsules, bodies);
  for (const auto& pair : pairs_of(self_pairs, capsules, capsules)) {
    ir::SelfPair self{};  // finish() has the rest
    self.a = pair[0], self.b = pair[1];
    m.self_pairs.push_back(self);
  }
  m.finish();
  return m;
}

struct WitnessResult {
  Array distance, point_a, point_b, normal;
  explicit WitnessResult(py::ssize_t n) : distance(n), point_a(empty({n, 3})), point_b(empty({n, 3})), normal(empty({n, 3})) {}
  ir::WitnessArrays arrays() {
    return {distance.mutable_data(), point_a.mutable_data(), point_b.mutable_data(), normal.mutable_data()};
  }
};

}  // namespace

void bind_geometry(py::module_& m) {
  m.def("link_poses", [](const Array& origin, const Array& axis, const Array& base, const Array& q) {
    const ir::Chain chain = chain_of(origin, axis, base);
    const std::size_t count = rows_of(q, chain.n);
    Array result = empty({py::ssize_t(count), chain.n + 1, 4, 4});
    double* to = result.mutable_data();
    py::gil_scoped_release release;
    write_link_poses(chain, q.data(), count, to);
    return result;
  });
  m.def("jacobian", [](const Array& origin, const Array& axis, const Array& base, const Array& tcp, const Array& q) {
    const ir::Chain chain = chain_of(origin, axis, base);
    const std::size_t count = rows_of(q, chain.n);
    expect(tcp.size() == 16, "tcp has to be (4, 4)");
    Array result = empty({py::ssize_t(count), 6, chain.n});
    double* to = result.mutable_data();
    py::gil_scoped_release release;
    write_jacobians(chain, tcp.data(), q.data(), count, to);
    return result;
  });
  py::class_<ir::Model>(m, "Model", py::module_local())
      .def(py::init(&model_of))
      .def("distances",
           [](const ir::Model& model, const Array& q) {
             const std::size_t count = rows_of(q, model.chain.n);
             Array result = empty({py::ssize_t(count), model.pairs()});
             double* to = result.mutable_data();
             py::gil_scoped_release release;
             ir::distances(model, q.data(), count, to);
             return result;
           })
      .def("min_distance",
           [](const ir::Model& model, const Array& q, const Array& offset) {
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
           })
      .def("witnesses",
           [](const ir::Model& model, const Array& q, const Indices& pair, bool gradient) {
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
           })
      .def("is_free", [](const ir::Model& model, const Array& q, const Array& threshold) {
        const std::size_t count = rows_of(q, model.chain.n);
        expect(threshold.size() == model.pairs(), "threshold has to be (Z,)");
        py::array_t<bool> result(static_cast<py::ssize_t>(count));
        bool* to = result.mutable_data();
        py::gil_scoped_release release;
        ir::is_free(model, q.data(), count, threshold.data(), to);
        return result;
      })
      .def("certify_edges",
           [](const ir::Model& model, const Array& q0, const Array& q1, const Array& threshold) {
             const std::size_t count = rows_of(q0, model.chain.n);
             expect(rows_of(q1, model.chain.n) == count, "q1 has to be as long as q0");
             expect(threshold.size() == model.pairs(), "threshold has to be (Z,)");
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
           })
      .def("certify_trajectory",
           [](const ir::Model& model, const Array& coefficients, const Array& durations, const Array& threshold) {
             expect(coefficients.ndim() == 3 && coefficients.shape(1) == model.chain.n && coefficients.shape(2) > 0,
                    "coefficients has to be (S, n, K)");
             expect(durations.size() == coefficients.shape(0), "durations has to be (S,)");
             expect(threshold.size() == model.pairs(), "threshold has to be (Z,)");
             ir::Outcome o;
             {
               py::gil_scoped_release release;
               o = ir::certify_trajectory(model, coefficients.data(), static_cast<int>(coefficients.shape(2)),
                                          durations.data(), static_cast<std::size_t>(durations.size()),
                                          threshold.data());
             }
             return py::make_tuple(static_cast<int>(o.verdict), o.t0, o.t1, o.pair, o.bound);
           });
}
