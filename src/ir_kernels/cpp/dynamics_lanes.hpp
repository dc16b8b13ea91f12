// Lanes: one vector register holds the same number of several samples. GCC's vector extensions, nothing else.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

namespace ir::dynamics {

#if defined(__AVX512F__)
#define IR_LANE_BYTES 64
#elif defined(__AVX__)
#define IR_LANE_BYTES 32
#else
#define IR_LANE_BYTES 16
#endif

typedef double Doubles __attribute__((vector_size(IR_LANE_BYTES)));
typedef std::int64_t Integers __attribute__((vector_size(IR_LANE_BYTES)));
typedef float Floats __attribute__((vector_size(IR_LANE_BYTES)));
typedef std::int32_t FloatMask __attribute__((vector_size(IR_LANE_BYTES)));

constexpr int kLanes = IR_LANE_BYTES / 8;  // doubles in a register

template <class V>
struct Lanes;
template <>
struct Lanes<Doubles> {
  using Scalar = double;
  using Mask = Integers;
  static constexpr int width = kLanes;
};
template <>
struct Lanes<Floats> {
  using Scalar = float;
  using Mask = FloatMask;
  static constexpr int width = 2 * kLanes;
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
inline Doubles abs(Doubles a) { return (Doubles)((Integers)a & 0x7fffffffffffffffLL); }
inline Floats abs(Floats a) { return (Floats)((FloatMask)a & 0x7fffffff); }
// x, negated where s is negative
inline Doubles with_sign_of(Doubles s, Doubles x) {
  return (Doubles)((Integers)x ^ ((Integers)s & (std::int64_t)0x8000000000000000ULL));
}
inline Floats with_sign_of(Floats s, Floats x) {
  return (Floats)((FloatMask)x ^ ((FloatMask)s & (std::int32_t)0x80000000U));
}
inline Doubles copysign(Doubles size, Doubles sign) {
  return (Doubles)(((Integers)size & 0x7fffffffffffffffLL) | ((Integers)sign & (std::int64_t)0x8000000000000000ULL));
}
template <class V>
inline V sqrt(V a) {
  V r;
  for (int l = 0; l < Lanes<V>::width; ++l) r[l] = std::sqrt(a[l]);
  return r;
}
inline bool any(Integers mask) {
#ifdef __AVX512F__
  return __builtin_ia32_ptestmq512((long long __attribute__((vector_size(64))))mask,
                                   (long long __attribute__((vector_size(64))))mask, 0xff) != 0;
#else
  std::int64_t seen = 0;
  for (int l = 0; l < kLanes; ++l) seen |= mask[l];
  return seen != 0;
#endif
}
inline bool any(FloatMask mask) { return any((Integers)mask); }

// Sine and cosine to about one unit in the last place, for |x| <= kReducible: reduction by pi/2 in parts, then the
// polynomials of fdlibm (double) and Cephes (float).
template <class V>
constexpr double kReducible = sizeof(ScalarOf<V>) == 8 ? 1e5 : 1e3;

inline void sincos_reducible(Doubles x, Doubles& s, Doubles& c) {
  const Doubles shifted = x * 0.63661977236758134308 + 6755399441055744.0;  // rounds to whole quarter turns
  const Integers quarter = (Integers)shifted;
  const Doubles k = shifted - 6755399441055744.0;
  Doubles r = x - k * 1.57079632673412561417e+00;  // exact: 33 bits times the few of k
  r -= k * 6.07710050650619224932e-11;
  const Doubles z = r * r;
  const Doubles z2 = z * z;
  const Doubles sine = r + r * z * ((-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03) +
                               z2 * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                                     z2 * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
  const Doubles cosine = 1.0 - 0.5 * z + z2 * ((4.16666666666666019037e-02 + z * -1.38888888888741095749e-03) +
                                          z2 * ((2.48015872894767294178e-05 + z * -2.75573143513906633035e-07) +
                                                z2 * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)));
  const Integers odd = (quarter & 1) != 0;
  s = with_sign_of((Doubles)(quarter << 62), odd ? cosine : sine);
  c = with_sign_of((Doubles)((quarter + 1) << 62), odd ? sine : cosine);
}

inline void sincos_reducible(Floats x, Floats& s, Floats& c) {
  const Floats shifted = x * 0.636619772f + 12582912.0f;
  const FloatMask quarter = (FloatMask)shifted;
  const Floats k = shifted - 12582912.0f;
  Floats r = x - k * 1.5703125f;
  r -= k * 4.837512969970703125e-4f;
  r -= k * 7.549789948768648e-8f;
  const Floats z = r * r;
  const Floats sine = r + r * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
  const Floats cosine =
      1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  const FloatMask odd = (quarter & 1) != 0;
  s = with_sign_of((Floats)(quarter << 30), odd ? cosine : sine);
  c = with_sign_of((Floats)((quarter + 1) << 30), odd ? sine : cosine);
}

// Of `n` angles; where one is out of reach of the reduction the C library is asked, lane by lane.
template <int kCount = 0, class V>
inline void sincos(int n, const V* x, V* s, V* c) {
  if (kCount) n = kCount;
  V squares{};
  for (int i = 0; i < n; ++i) squares += x[i] * x[i];
  if (__builtin_expect(any(squares > (ScalarOf<V>)(kReducible<V> * kReducible<V>)), 0)) {
    for (int i = 0; i < n; ++i)
      for (int l = 0; l < Lanes<V>::width; ++l) {
        s[i][l] = std::sin(x[i][l]);
        c[i][l] = std::cos(x[i][l]);
      }
    return;
  }
  for (int i = 0; i < n; ++i) sincos_reducible(x[i], s[i], c[i]);
}

typedef double Two __attribute__((vector_size(16), aligned(8), may_alias));
typedef float HalfFloats __attribute__((vector_size(IR_LANE_BYTES / 2)));

// Of two registers of neighbours (a0 a1 ..), (b0 b1 ..): every second lane of both, from lane 0 or lane 1. Used twice it
// gives back what it was given.
#if IR_LANE_BYTES == 64
#define IR_EVEN(a, b) __builtin_shufflevector(a, b, 0, 8, 2, 10, 4, 12, 6, 14)
#define IR_ODD(a, b) __builtin_shufflevector(a, b, 1, 9, 3, 11, 5, 13, 7, 15)
#define IR_JOIN(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15)
#define IR_LOW(a) __builtin_shufflevector(a, a, 0, 1, 2, 3, 4, 5, 6, 7)
#define IR_HIGH(a) __builtin_shufflevector(a, a, 8, 9, 10, 11, 12, 13, 14, 15)
#elif IR_LANE_BYTES == 32
#define IR_EVEN(a, b) __builtin_shufflevector(a, b, 0, 4, 2, 6)
#define IR_ODD(a, b) __builtin_shufflevector(a, b, 1, 5, 3, 7)
#define IR_JOIN(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3, 4, 5, 6, 7)
#define IR_LOW(a) __builtin_shufflevector(a, a, 0, 1, 2, 3)
#define IR_HIGH(a) __builtin_shufflevector(a, a, 4, 5, 6, 7)
#else
#define IR_EVEN(a, b) __builtin_shufflevector(a, b, 0, 2)
#define IR_ODD(a, b) __builtin_shufflevector(a, b, 1, 3)
#define IR_JOIN(a, b) __builtin_shufflevector(a, b, 0, 1, 2, 3)
#define IR_LOW(a) __builtin_shufflevector(a, a, 0, 1)
#define IR_HIGH(a) __builtin_shufflevector(a, a, 2, 3)
#endif

// Rows l, l + 2, l + 4, .. of two neighbouring columns.
inline Doubles every_second_row(const double* base, int n, int l) {
  const auto two = [=](int row) { return *reinterpret_cast<const Two*>(base + row * n); };
#if IR_LANE_BYTES == 64
  const auto four = [&](int row) { return __builtin_shufflevector(two(row), two(row + 2), 0, 1, 2, 3); };
  return __builtin_shufflevector(four(l), four(l + 4), 0, 1, 2, 3, 4, 5, 6, 7);
#elif IR_LANE_BYTES == 32
  return __builtin_shufflevector(two(l), two(l + 2), 0, 1, 2, 3);
#else
  return two(l);
#endif
}

// Columns j and j + 1 of consecutive rows, two neighbours at a time.
inline void load_pair(const double* base, int n, Doubles& first, Doubles& second) {
  const Doubles a = every_second_row(base, n, 0), b = every_second_row(base, n, 1);
  first = IR_EVEN(a, b);
  second = IR_ODD(a, b);
}

inline void store_pair(Doubles first, Doubles second, double* base, int n) {
  const Doubles a = IR_EVEN(first, second), b = IR_ODD(first, second);
  for (int l = 0; l < kLanes; l += 2) {
    std::memcpy(base + l * n, reinterpret_cast<const char*>(&a) + 8 * l, 16);
    std::memcpy(base + (l + 1) * n, reinterpret_cast<const char*>(&b) + 8 * l, 16);
  }
}

inline Doubles gather(const double* base, int n) {
  Doubles column;
  for (int l = 0; l < kLanes; ++l) column[l] = base[l * n];
  return column;
}

inline void load_full(const double* base, int n, Doubles* columns) {
  int j = 0;
  for (; j + 1 < n; j += 2) load_pair(base + j, n, columns[j], columns[j + 1]);
  if (j < n) columns[j] = gather(base + j, n);
}

inline void load_full(const double* base, int n, Floats* columns) {
  const auto both = [](Doubles low, Doubles high) {
    return IR_JOIN(__builtin_convertvector(low, HalfFloats), __builtin_convertvector(high, HalfFloats));
  };
  int j = 0;
  for (; j + 1 < n; j += 2) {
    Doubles even, odd, even_high, odd_high;
    load_pair(base + j, n, even, odd);
    load_pair(base + kLanes * n + j, n, even_high, odd_high);
    columns[j] = both(even, even_high);
    columns[j + 1] = both(odd, odd_high);
  }
  if (j < n) columns[j] = both(gather(base + j, n), gather(base + kLanes * n + j, n));
}

inline void store_full(const Doubles* columns, int n, double* base) {
  int j = 0;
  for (; j + 1 < n; j += 2) store_pair(columns[j], columns[j + 1], base + j, n);
  if (j < n)
    for (int l = 0; l < kLanes; ++l) base[l * n + j] = columns[j][l];
}

inline void store_full(const Floats* columns, int n, double* base) {
  const auto low = [](Floats v) { return __builtin_convertvector(IR_LOW(v), Doubles); };
  const auto high = [](Floats v) { return __builtin_convertvector(IR_HIGH(v), Doubles); };
  int j = 0;
  for (; j + 1 < n; j += 2) {
    store_pair(low(columns[j]), low(columns[j + 1]), base + j, n);
    store_pair(high(columns[j]), high(columns[j + 1]), base + kLanes * n + j, n);
  }
  if (j < n)
    for (int l = 0; l < 2 * kLanes; ++l) base[l * n + j] = columns[j][l];
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

#undef IR_EVEN
#undef IR_ODD
#undef IR_JOIN
#undef IR_LOW
#undef IR_HIGH

}  // namespace ir::dynamics
