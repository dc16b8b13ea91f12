// What Python needs of elementary functions and linear algebra where a result decides an answer: the same bits on every
// processor. BLAS and NumPy choose their loops by the processor, and with them the order of sums; here it is written down.
#include <pybind11/numpy.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <numeric>
#include <vector>

#include "arrays.hpp"
#include "bindings.hpp"
#include "elementary.hpp"
#include "spline_profile.hpp"

namespace py = pybind11;

namespace {

using ir::Array;
using Shape = std::vector<py::ssize_t>;

Shape shape_of(const Array& a) { return {a.shape(), a.shape() + a.ndim()}; }

template <double (*function)(double)> Array of_each(const Array& x) {
  Array result(shape_of(x));
  const double* from = x.data();
  double* to = result.mutable_data();
  for (py::ssize_t k = 0; k < x.size(); ++k) to[k] = function(from[k]);
  return result;
}

// Of two arrays of one shape; the Python side broadcasts.
template <double (*function)(double, double)> Array of_pairs(const Array& x, const Array& y) {
  ir::expect(shape_of(x) == shape_of(y), "shapes differ");
  Array result(shape_of(x));
  double* to = result.mutable_data();
  for (py::ssize_t k = 0; k < x.size(); ++k) to[k] = function(x.data()[k], y.data()[k]);
  return result;
}

// c (m, p) = a (m, n) b (n, p); each sum from its first term to its last
void multiply(const double* a, const double* b, double* c, py::ssize_t m, py::ssize_t n, py::ssize_t p) {
  if (p == 1) {  // eight rows at a time, that don't wait for each other
    for (py::ssize_t first = 0; first < m; first += 8) {
      const int rows = static_cast<int>(std::min<py::ssize_t>(8, m - first));
      double sums[8] = {};
      for (py::ssize_t j = 0; j < n; ++j)
        for (int i = 0; i < rows; ++i) sums[i] += a[(first + i) * n + j] * b[j];
      std::copy_n(sums, rows, c + first);
    }
    return;
  }
  for (py::ssize_t i = 0; i < m; ++i) {
    double* row = c + i * p;
    std::fill_n(row, p, 0.0);
    for (py::ssize_t j = 0; j < n; ++j) {
      const double weight = a[i * n + j];
      const double* other = b + j * p;
      for (py::ssize_t k = 0; k < p; ++k) row[k] += weight * other[k];
    }
  }
}

// As numpy.matmul: (..., m, n) (..., n, p), a single axis as a row on the left and as a column on the right.
Array product(const Array& a, const Array& b) {
  ir::expect(a.ndim() > 0 && b.ndim() > 0, "a number has no matrix product");
  Shape left = shape_of(a), right = shape_of(b);
  const bool row = left.size() == 1, column = right.size() == 1;
  if (row) left.insert(left.begin(), 1);
  if (column) right.push_back(1);
  const py::ssize_t m = left[left.size() - 2], n = left.back(), p = right.back();
  ir::expect(right[right.size() - 2] == n, "the inner lengths of a matrix product differ");
  left.resize(left.size() - 2);
  right.resize(right.size() - 2);
  const std::size_t depth = std::max(left.size(), right.size());
  left.insert(left.begin(), depth - left.size(), 1);
  right.insert(right.begin(), depth - right.size(), 1);
  Shape outer(depth);
  py::ssize_t count = 1;
  for (std::size_t d = 0; d < depth; ++d) {
    ir::expect(left[d] == right[d] || left[d] == 1 || right[d] == 1, "stacks of a matrix product don't fit together");
    outer[d] = left[d] == 1 ? right[d] : left[d];
    count *= outer[d];
  }
  Shape whole = outer;
  if (!row) whole.push_back(m);
  if (!column) whole.push_back(p);
  Array result(whole);
  double* to = result.mutable_data();
  std::vector<py::ssize_t> at(depth, 0);
  for (py::ssize_t k = 0; k < count; ++k) {
    py::ssize_t of_a = 0, of_b = 0;
    for (std::size_t d = 0; d < depth; ++d) {
      of_a = of_a * left[d] + (left[d] == 1 ? 0 : at[d]);
      of_b = of_b * right[d] + (right[d] == 1 ? 0 : at[d]);
    }
    multiply(a.data() + of_a * m * n, b.data() + of_b * n * p, to + k * m * p, m, n, p);
    for (std::size_t d = depth; d-- > 0;) {
      if (++at[d] < outer[d]) break;
      at[d] = 0;
    }
  }
  return result;
}

// Gauss elimination with the largest pivot of each column; false where one is 0 or not a number.
bool eliminate(double* a, double* b, py::ssize_t n, py::ssize_t p) {
  for (py::ssize_t k = 0; k < n; ++k) {
    py::ssize_t best = k;
    for (py::ssize_t i = k + 1; i < n; ++i)
      if (std::fabs(a[i * n + k]) > std::fabs(a[best * n + k])) best = i;
    const double pivot = a[best * n + k];
    if (!(std::fabs(pivot) > 0.0)) return false;
    if (best != k) {
      std::swap_ranges(a + k * n, a + (k + 1) * n, a + best * n);
      std::swap_ranges(b + k * p, b + (k + 1) * p, b + best * p);
    }
    for (py::ssize_t i = k + 1; i < n; ++i) {
      const double share = a[i * n + k] / pivot;
      if (share == 0.0) continue;
      for (py::ssize_t j = k + 1; j < n; ++j) a[i * n + j] -= share * a[k * n + j];
      for (py::ssize_t j = 0; j < p; ++j) b[i * p + j] -= share * b[k * p + j];
    }
  }
  for (py::ssize_t k = n; k-- > 0;) {
    for (py::ssize_t j = 0; j < p; ++j) b[k * p + j] /= a[k * n + k];
    for (py::ssize_t i = 0; i < k; ++i)
      for (py::ssize_t j = 0; j < p; ++j) b[i * p + j] -= a[i * n + k] * b[k * p + j];
  }
  return true;
}

// x (N, n, p) of a (N, n, n) x = b (N, n, p); None where a matrix is singular.
py::object solution(const Array& a, const Array& b) {
  ir::expect(a.ndim() == 3 && b.ndim() == 3 && a.shape(0) == b.shape(0), "expected two stacks of one length");
  const py::ssize_t n = a.shape(1), p = b.shape(2);
  ir::expect(a.shape(2) == n && b.shape(1) == n, "the matrices are not square, or the right sides don't fit");
  std::vector<double> matrix(a.data(), a.data() + a.size());
  Array result(shape_of(b));
  double* to = result.mutable_data();
  std::copy_n(b.data(), b.size(), to);
  for (py::ssize_t k = 0; k < a.shape(0); ++k)
    if (!eliminate(&matrix[k * n * n], to + k * n * p, n, p)) return py::none();
  return std::move(result);
}

// Rotations of pairs of columns until all are perpendicular (one-sided Jacobi, Hestenes 1958): the columns of a (m, n)
// become u s, and those of v (n, n) turn along.
void orthogonalise(std::vector<double>& a, std::vector<double>& v, py::ssize_t m, py::ssize_t n) {
  constexpr int sweeps = 60;
  constexpr double perpendicular = 1e-15;
  bool turned = true;
  for (int sweep = 0; sweep < sweeps && turned; ++sweep) {
    turned = false;
    for (py::ssize_t i = 0; i + 1 < n; ++i)
      for (py::ssize_t j = i + 1; j < n; ++j) {
        double alpha = 0.0, beta = 0.0, gamma = 0.0;
        for (py::ssize_t k = 0; k < m; ++k) {
          const double x = a[k * n + i], y = a[k * n + j];
          alpha += x * x;
          beta += y * y;
          gamma += x * y;
        }
        if (!(std::fabs(gamma) > perpendicular * std::sqrt(alpha * beta))) continue;
        turned = true;
        const double zeta = (beta - alpha) / (2.0 * gamma);
        const double t = (zeta < 0.0 ? -1.0 : 1.0) / (std::fabs(zeta) + std::sqrt(1.0 + zeta * zeta));
        const double c = 1.0 / std::sqrt(1.0 + t * t), s = c * t;
        const auto turn = [&](std::vector<double>& of, py::ssize_t rows) {
          for (py::ssize_t k = 0; k < rows; ++k) {
            const double x = of[k * n + i], y = of[k * n + j];
            of[k * n + i] = c * x - s * y;
            of[k * n + j] = s * x + c * y;
          }
        };
        turn(a, m);
        turn(v, n);
      }
  }
}

// u (m, n), s (n,) falling and v (n, n) with a (m, n) = u diag(s) v^T; columns of u are 0 where s is.
py::tuple decomposition(const Array& a) {
  ir::expect(a.ndim() == 2, "expected a matrix");
  const py::ssize_t m = a.shape(0), n = a.shape(1);
  std::vector<double> columns(a.data(), a.data() + a.size()), v(n * n, 0.0);
  for (py::ssize_t k = 0; k < n; ++k) v[k * n + k] = 1.0;
  orthogonalise(columns, v, m, n);
  std::vector<double> size(n, 0.0);
  for (py::ssize_t k = 0; k < m; ++k)
    for (py::ssize_t j = 0; j < n; ++j) size[j] += columns[k * n + j] * columns[k * n + j];
  for (double& each : size) each = std::sqrt(each);
  std::vector<py::ssize_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](py::ssize_t i, py::ssize_t j) { return size[i] > size[j]; });
  Array left({m, n}), values({n}), right({n, n});
  for (py::ssize_t j = 0; j < n; ++j) {
    const py::ssize_t from = order[j];
    values.mutable_data()[j] = size[from];
    for (py::ssize_t k = 0; k < m; ++k)
      left.mutable_data()[k * n + j] = size[from] > 0.0 ? columns[k * n + from] / size[from] : 0.0;
    for (py::ssize_t k = 0; k < n; ++k) right.mutable_data()[k * n + j] = v[k * n + from];
  }
  return py::make_tuple(left, values, right);
}

// x (n, p) of M x = right with a symmetric positive definite M in upper banded form (w + 1, n); None where it is not.
py::object banded_solution(const Array& bands, const Array& right) {
  ir::expect(bands.ndim() == 2 && right.ndim() == 2 && bands.shape(1) == right.shape(0), "the right side doesn't fit");
  const int width = static_cast<int>(bands.shape(0)) - 1, n = static_cast<int>(bands.shape(1));
  const double* entry = bands.data();
  const ir::Banded factor(n, width, [=](int i, int k) { return entry[static_cast<py::ssize_t>(width - k) * n + i]; });
  Array result(shape_of(right));
  std::copy_n(right.data(), right.size(), result.mutable_data());
  factor.solve(result.mutable_data(), static_cast<int>(right.shape(1)));
  for (py::ssize_t k = 0; k < result.size(); ++k)
    if (!std::isfinite(result.data()[k])) return py::none();
  return std::move(result);
}

// The B-splines of degree k that are not 0 at x in [t[j], t[j + 1]], or their derivative of an order, (k + 1,): de Boor's
// recurrence, then differences of the lower degree's.
void splines_at(const double* t, int k, py::ssize_t j, double x, int order, double* b) {
  std::fill_n(b, k + 1, 0.0);
  b[0] = 1.0;
  for (int degree = 1; degree <= k; ++degree) {
    const bool differs = degree > k - order;  // the last steps differentiate
    double carried = 0.0;
    for (int r = 0; r < degree; ++r) {
      const double low = t[j + 1 + r - degree], high = t[j + 1 + r], span = high - low;
      const double share = span > 0.0 ? b[r] / span : 0.0;
      b[r] = differs ? carried - degree * share : carried + (high - x) * share;
      carried = differs ? degree * share : (x - low) * share;
    }
    b[degree] = carried;
  }
}

// Control points (n, p) of the spline of degree k over knots t (n + k + 1,) that passes y (N, p) at x (N,) and whose
// derivatives of orders 1 to `left` at the first and 1 to `right` at the last x are those of `first` and `last`. Totally
// positive: elimination without pivots is stable (de Boor and Pinkus 1977).
py::object interpolated(const Array& t, int k, const Array& x, const Array& y, const Array& first, const Array& last) {
  const py::ssize_t left = first.shape(0), right = last.shape(0), count = x.size(), n = t.size() - k - 1, p = y.shape(1);
  ir::expect(k >= 1 && k <= 9 && count > 0 && n == count + left + right && y.shape(0) == count, "conditions don't fit knots");
  const py::ssize_t wide = 2 * k + 1;
  std::vector<double> band(n * wide, 0.0);  // row i, column j at i wide + (j - i + k)
  Array result({n, p});
  double* c = result.mutable_data();
  for (py::ssize_t i = 0; i < n; ++i) {
    const bool of_left = i >= 1 && i <= left, of_right = i < n - 1 && i >= n - 1 - right;
    const py::ssize_t place = i <= left ? 0 : i >= n - 1 - right ? count - 1 : i - left;
    const int order = static_cast<int>(of_left ? i : of_right ? n - 1 - i : 0);
    const double at = x.data()[place];
    const double* end = t.data() + n;
    const py::ssize_t j = std::min<py::ssize_t>(std::upper_bound(t.data() + k, end, at) - t.data() - 1, n - 1);
    double b[10];
    splines_at(t.data(), k, j, at, order, b);
    for (int r = 0; r <= k; ++r) {
      const py::ssize_t column = j - k + r - i + k;
      if (column >= 0 && column < wide) band[i * wide + column] = b[r];
      else if (b[r] != 0.0) return py::none();
    }
    const double* value = of_left    ? first.data() + (i - 1) * p
                          : of_right ? last.data() + (n - 2 - i) * p
                                     : y.data() + place * p;
    std::copy_n(value, p, c + i * p);
  }
  for (py::ssize_t i = 0; i < n; ++i) {
    const double pivot = band[i * wide + k];
    if (!(std::fabs(pivot) > 0.0)) return py::none();
    for (py::ssize_t row = i + 1; row < std::min(n, i + k + 1); ++row) {
      const double share = band[row * wide + (i - row + k)] / pivot;
      if (share == 0.0) continue;
      for (py::ssize_t j = i + 1; j < std::min(n, i + k + 1); ++j)
        band[row * wide + (j - row + k)] -= share * band[i * wide + (j - i + k)];
      for (py::ssize_t q = 0; q < p; ++q) c[row * p + q] -= share * c[i * p + q];
    }
  }
  for (py::ssize_t i = n; i-- > 0;)
    for (py::ssize_t q = 0; q < p; ++q) {
      double sum = c[i * p + q];
      for (py::ssize_t j = i + 1; j < std::min(n, i + k + 1); ++j) sum -= band[i * wide + (j - i + k)] * c[j * p + q];
      c[i * p + q] = sum / band[i * wide + k];
    }
  return std::move(result);
}

using Complex = std::complex<double>;
Complex times(Complex a, Complex b) {
  return {a.real() * b.real() - a.imag() * b.imag(), a.real() * b.imag() + a.imag() * b.real()};
}
double square_of(Complex a) { return a.real() * a.real() + a.imag() * a.imag(); }
Complex quotient(Complex a, Complex b) {
  const double size = square_of(b);
  return {(a.real() * b.real() + a.imag() * b.imag()) / size, (a.imag() * b.real() - a.real() * b.imag()) / size};
}

// All roots of c[0] z^d + ... + c[d], c[0] != 0, together (Aberth 1973), from places on a circle.
void roots_of(const Complex* c, int degree, Complex* z) {
  double radius = 0.0;  // Cauchy's and Fujiwara's bounds are far out: the mean size of the roots
  const double ratio = std::sqrt(square_of(c[degree]) / square_of(c[0]));
  radius = ratio > 0.0 ? ir::power(ratio, 1.0 / degree) : 1.0;
  if (!(radius > 1e-8 && radius < 1e8)) radius = 1.0;
  for (int k = 0; k < degree; ++k) {
    double s, co;
    ir::sine_cosine(2.0 * ir::kPi * k / degree + 0.7, s, co);
    z[k] = Complex(radius * co, radius * s);
  }
  for (int round = 0; round < 200; ++round) {
    double moved = 0.0;
    for (int k = 0; k < degree; ++k) {
      Complex value = c[0], slope = 0.0;
      for (int i = 1; i <= degree; ++i) {
        slope = times(slope, z[k]) + value;
        value = times(value, z[k]) + c[i];
      }
      if (square_of(value) == 0.0) continue;
      if (square_of(slope) == 0.0) {  // a stationary place: leave it
        z[k] += Complex(1e-3 * radius, 1e-3 * radius);
        moved = 1.0;
        continue;
      }
      const Complex newton = quotient(value, slope);
      Complex pull = 0.0;
      for (int i = 0; i < degree; ++i)
        if (i != k && square_of(z[k] - z[i]) > 0.0) pull += quotient(1.0, z[k] - z[i]);
      const Complex below = Complex(1.0, 0.0) - times(newton, pull);
      const Complex step = square_of(below) > 1e-300 ? quotient(newton, below) : newton;
      z[k] -= step;
      moved = std::max(moved, square_of(step) / std::max(square_of(z[k]), 1e-300));
    }
    if (moved < 1e-31) break;
  }
}

// Roots (N, d) of complex polynomials (N, d + 1), highest power first; real and imaginary parts in the last axis (.., 2).
Array roots(const Array& coefficients) {
  ir::expect(coefficients.ndim() == 3 && coefficients.shape(1) >= 2 && coefficients.shape(2) == 2, "expected (N, d + 1, 2)");
  const int degree = static_cast<int>(coefficients.shape(1)) - 1;
  Array result({coefficients.shape(0), static_cast<py::ssize_t>(degree), static_cast<py::ssize_t>(2)});
  std::vector<Complex> c(degree + 1), z(degree);
  for (py::ssize_t row = 0; row < coefficients.shape(0); ++row) {
    const double* from = coefficients.data() + row * 2 * (degree + 1);
    for (int k = 0; k <= degree; ++k) c[k] = Complex(from[2 * k], from[2 * k + 1]);
    roots_of(c.data(), degree, z.data());
    double* to = result.mutable_data() + row * 2 * degree;
    for (int k = 0; k < degree; ++k) to[2 * k] = z[k].real(), to[2 * k + 1] = z[k].imag();
  }
  return result;
}

}  // namespace

void bind_portable(py::module_& m) {
  m.def("sin", &of_each<ir::sine>);
  m.def("cos", &of_each<ir::cosine>);
  m.def("exp", &of_each<ir::exponential>);
  m.def("log", &of_each<ir::logarithm>);
  m.def("arcsin", &of_each<ir::arc_sine>);
  m.def("arccos", &of_each<ir::arc_cosine>);
  m.def("cbrt", &of_each<ir::cube_root>);
  m.def("arctan2", &of_pairs<ir::arc_tangent>);
  m.def("power", &of_pairs<ir::power>);
  m.def("hypot", &of_pairs<ir::length>);
  m.def("matmul", &product);
  m.def("solve", &solution);
  m.def("svd", &decomposition);
  m.def("solve_banded", &banded_solution);
  m.def("interpolate", &interpolated);
  m.def("roots", &roots);
}
