// Lanes: one vector register holds the same number of several samples. GCC's vector extensions, nothing else.
#pragma once

#include <cmath>
#include <cstdint>

namespace ir::dynamics {

typedef double D8 __attribute__((vector_size(64)));
typedef std::int64_t I8 __attribute__((vector_size(64)));
typedef float F16 __attribute__((vector_size(64)));
typedef std::int32_t I16 __attribute__((vector_size(64)));

template <class V>
struct Lanes;
template <>
struct Lanes<D8> {
  using Scalar = double;
  using Mask = I8;
  static constexpr int width = 8;
};
template <>
struct Lanes<F16> {
  using Scalar = float;
  using Mask = I16;
  static constexpr int width = 16;
};

template <class V>
using ScalarOf = typename Lanes<V>::Scalar;
template <class V>
using MaskOf = typename Lanes<V>::Mask;

template <class V>
inline V splat(ScalarOf<V> x) {
  return V{} + x;
}
template <class V>
inline V min(V a, V b) {
  return a < b ? a : b;
}
template <class V>
inline V max(V a, V b) {
  return a > b ? a : b;
}
inline D8 abs(D8 a) { return (D8)((I8)a & 0x7fffffffffffffffLL); }
inline F16 abs(F16 a) { return (F16)((I16)a & 0x7fffffff); }
inline D8 copysign(D8 size, D8 sign) {
  return (D8)(((I8)size & 0x7fffffffffffffffLL) | ((I8)sign & (std::int64_t)0x8000000000000000ULL));
}
template <class V>
inline V sqrt(V a) {
  V r;
  for (int l = 0; l < Lanes<V>::width; ++l) r[l] = std::sqrt(a[l]);
  return r;
}
inline bool any(I8 mask) {
#ifdef __AVX512F__
  return __builtin_ia32_ptestmq512((long long __attribute__((vector_size(64))))mask,
                                   (long long __attribute__((vector_size(64))))mask, 0xff) != 0;
#else
  std::int64_t seen = 0;
  for (int l = 0; l < 8; ++l) seen |= mask[l];
  return seen != 0;
#endif
}
inline bool any(I16 mask) { return any((I8)mask); }

// Sine and cosine to about one unit in the last place, for |x| <= kReducible: reduction by pi/2 in parts, then the
// polynomials of fdlibm (double) and Cephes (float).
template <class V>
constexpr double kReducible = sizeof(ScalarOf<V>) == 8 ? 1e5 : 1e3;

inline void sincos_reducible(D8 x, D8& s, D8& c) {
  const D8 shifted = x * 0.63661977236758134308 + 6755399441055744.0;  // rounds to whole quarter turns
  const I8 quarter = (I8)shifted;
  const D8 k = shifted - 6755399441055744.0;
  D8 r = x - k * 1.57079632673412561417e+00;  // exact: 33 bits times the few of k
  r -= k * 6.07710050650619224932e-11;
  const D8 z = r * r;
  const D8 z2 = z * z;
  const D8 sine = r + r * z * ((-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03) +
                               z2 * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                                     z2 * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
  const D8 cosine = 1.0 - 0.5 * z + z2 * ((4.16666666666666019037e-02 + z * -1.38888888888741095749e-03) +
                                          z2 * ((2.48015872894767294178e-05 + z * -2.75573143513906633035e-07) +
                                                z2 * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)));
  const I8 odd = (quarter & 1) != 0;
  s = (D8)((I8)(odd ? cosine : sine) ^ (quarter & 2) << 62);
  c = (D8)((I8)(odd ? sine : cosine) ^ ((quarter + 1) & 2) << 62);
}

inline void sincos_reducible(F16 x, F16& s, F16& c) {
  const F16 shifted = x * 0.636619772f + 12582912.0f;
  const I16 quarter = (I16)shifted;
  const F16 k = shifted - 12582912.0f;
  F16 r = x - k * 1.5703125f;
  r -= k * 4.837512969970703125e-4f;
  r -= k * 7.549789948768648e-8f;
  const F16 z = r * r;
  const F16 sine = r + r * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
  const F16 cosine =
      1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  const I16 odd = (quarter & 1) != 0;
  s = (F16)((I16)(odd ? cosine : sine) ^ (quarter & 2) << 30);
  c = (F16)((I16)(odd ? sine : cosine) ^ ((quarter + 1) & 2) << 30);
}

// Of `n` angles; where one is out of reach of the reduction the C library is asked, lane by lane.
template <int kCount = 0, class V>
inline void sincos(int n, const V* x, V* s, V* c) {
  if (kCount) n = kCount;
  V largest{};
  for (int i = 0; i < n; ++i) largest = max(largest, abs(x[i]));
  if (__builtin_expect(any(largest > (ScalarOf<V>)kReducible<V>), 0)) {
    for (int i = 0; i < n; ++i)
      for (int l = 0; l < Lanes<V>::width; ++l) {
        s[i][l] = std::sin(x[i][l]);
        c[i][l] = std::cos(x[i][l]);
      }
    return;
  }
  for (int i = 0; i < n; ++i) sincos_reducible(x[i], s[i], c[i]);
}

typedef double D2 __attribute__((vector_size(16), aligned(8), may_alias));
typedef float F8 __attribute__((vector_size(32)));

// Columns j and j + 1 of eight consecutive rows, two neighbours at a time.
inline void load_pair(const double* base, int n, D8& even, D8& odd) {
  const auto two = [=](int l) { return *reinterpret_cast<const D2*>(base + l * n); };
  const auto four = [&](int l) { return __builtin_shufflevector(two(l), two(l + 2), 0, 1, 2, 3); };
  const D8 a = __builtin_shufflevector(four(0), four(4), 0, 1, 2, 3, 4, 5, 6, 7);
  const D8 b = __builtin_shufflevector(four(1), four(5), 0, 1, 2, 3, 4, 5, 6, 7);
  even = __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14);
  odd = __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15);
}

inline void store_pair(D8 even, D8 odd, double* base, int n) {
  const D8 a = __builtin_shufflevector(even, odd, 0, 8, 2, 10, 4, 12, 6, 14);
  const D8 b = __builtin_shufflevector(even, odd, 1, 9, 3, 11, 5, 13, 7, 15);
  const auto two = [=](int l) -> D2& { return *reinterpret_cast<D2*>(base + l * n); };
  two(0) = __builtin_shufflevector(a, a, 0, 1);
  two(1) = __builtin_shufflevector(b, b, 0, 1);
  two(2) = __builtin_shufflevector(a, a, 2, 3);
  two(3) = __builtin_shufflevector(b, b, 2, 3);
  two(4) = __builtin_shufflevector(a, a, 4, 5);
  two(5) = __builtin_shufflevector(b, b, 4, 5);
  two(6) = __builtin_shufflevector(a, a, 6, 7);
  two(7) = __builtin_shufflevector(b, b, 6, 7);
}

inline D8 gather(const double* base, int n) {
  return D8{base[0], base[n], base[2 * n], base[3 * n], base[4 * n], base[5 * n], base[6 * n], base[7 * n]};
}

inline void load_full(const double* base, int n, D8* columns) {
  int j = 0;
  for (; j + 1 < n; j += 2) load_pair(base + j, n, columns[j], columns[j + 1]);
  if (j < n) columns[j] = gather(base + j, n);
}

inline void load_full(const double* base, int n, F16* columns) {
  const auto both = [](D8 low, D8 high) {
    return __builtin_shufflevector(__builtin_convertvector(low, F8), __builtin_convertvector(high, F8), 0, 1, 2, 3, 4,
                                   5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
  };
  int j = 0;
  for (; j + 1 < n; j += 2) {
    D8 even, odd, even_high, odd_high;
    load_pair(base + j, n, even, odd);
    load_pair(base + 8 * n + j, n, even_high, odd_high);
    columns[j] = both(even, even_high);
    columns[j + 1] = both(odd, odd_high);
  }
  if (j < n) columns[j] = both(gather(base + j, n), gather(base + 8 * n + j, n));
}

inline void store_full(const D8* columns, int n, double* base) {
  int j = 0;
  for (; j + 1 < n; j += 2) store_pair(columns[j], columns[j + 1], base + j, n);
  if (j < n)
    for (int l = 0; l < 8; ++l) base[l * n + j] = columns[j][l];
}

inline void store_full(const F16* columns, int n, double* base) {
  const auto low = [](F16 v) {
    return __builtin_convertvector(__builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7), D8);
  };
  const auto high = [](F16 v) {
    return __builtin_convertvector(__builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15), D8);
  };
  int j = 0;
  for (; j + 1 < n; j += 2) {
    store_pair(low(columns[j]), low(columns[j + 1]), base + j, n);
    store_pair(high(columns[j]), high(columns[j + 1]), base + 8 * n + j, n);
  }
  if (j < n)
    for (int l = 0; l < 16; ++l) base[l * n + j] = columns[j][l];
}

// Rows [first, first + width) of a (count, n) array as n columns of lanes; rows beyond `count` repeat the last one.
template <class V>
inline void load_columns(const double* rows, long count, int n, long first, V* columns) {
  constexpr int W = Lanes<V>::width;
  const long left = count - first;
  if (left >= W) return load_full(rows + first * n, n, columns);
  for (int j = 0; j < n; ++j)
    for (int l = 0; l < W; ++l)
      columns[j][l] = static_cast<ScalarOf<V>>(rows[(first + (l < left ? l : left - 1)) * n + j]);
}

template <class V>
inline void store_columns(const V* columns, long count, int n, long first, double* rows) {
  constexpr int W = Lanes<V>::width;
  const long left = count - first;
  if (left >= W) return store_full(columns, n, rows + first * n);
  for (long l = 0; l < left; ++l)
    for (int j = 0; j < n; ++j) rows[(first + l) * n + j] = columns[j][l];
}

}  // namespace ir::dynamics
