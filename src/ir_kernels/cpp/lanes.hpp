// Lanes: one operation on several floats or doubles, written with the vector types of GCC and Clang, so that the same
// source serves AVX-512, AVX2 and plain SSE2 (where the compiler splits long ones). Lanes never mix: what one lane computes
// does not depend on its neighbours.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <type_traits>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace ir {

typedef float Float16 __attribute__((vector_size(64)));
typedef double Double8 __attribute__((vector_size(64)));
typedef std::int32_t Int16 __attribute__((vector_size(64)));
typedef std::int64_t Int8 __attribute__((vector_size(64)));

template <class V, class = void> struct Lanes;
template <class V> struct Lanes<V, std::void_t<decltype(V{}[0] + V{})>> {  // vector types
  using Scalar = std::decay_t<decltype(V{}[0])>;
  using Mask = decltype(V{} < V{});
  static constexpr int width = sizeof(V) / sizeof(Scalar);
};
template <class V> using Scalar = typename Lanes<V>::Scalar;
template <class V> using Mask = typename Lanes<V>::Mask;

#define IR_INLINE inline __attribute__((always_inline))

// Signed zeros and NaN don't matter here: inputs are finite.
template <class V> IR_INLINE V min(V a, V b) { return a < b ? a : b; }
template <class V> IR_INLINE V max(V a, V b) { return a > b ? a : b; }
#if defined(__AVX512F__)
template <> IR_INLINE Float16 min(Float16 a, Float16 b) { return (Float16)_mm512_min_ps((__m512)a, (__m512)b); }
template <> IR_INLINE Float16 max(Float16 a, Float16 b) { return (Float16)_mm512_max_ps((__m512)a, (__m512)b); }
template <> IR_INLINE Double8 min(Double8 a, Double8 b) { return (Double8)_mm512_min_pd((__m512d)a, (__m512d)b); }
template <> IR_INLINE Double8 max(Double8 a, Double8 b) { return (Double8)_mm512_max_pd((__m512d)a, (__m512d)b); }
#endif

template <class V> IR_INLINE V splat(Scalar<V> x) { return V{} + x; }
template <class V> IR_INLINE V clamp(V x, V low, V high) { return min(max(x, low), high); }
template <class V> constexpr Scalar<Mask<V>> sign_bit = std::numeric_limits<Scalar<Mask<V>>>::min();
template <class V> IR_INLINE V abs(V x) { return (V)((Mask<V>)x & ~sign_bit<V>); }
// x, negated where s is negative
template <class V> IR_INLINE V with_sign_of(V s, V x) { return (V)((Mask<V>)x ^ ((Mask<V>)s & sign_bit<V>)); }
template <class V> IR_INLINE V select(Mask<V> m, V a, V b) { return m ? a : b; }

template <class V> IR_INLINE V load(const Scalar<V>* from) {
  V v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
template <class V> IR_INLINE void store(Scalar<V>* to, V v) { std::memcpy(to, &v, sizeof v); }

template <class V> IR_INLINE V sqrt(V x) {
#if defined(__AVX512F__)
  if constexpr (sizeof(V) == 64 && sizeof(Scalar<V>) == 4) return (V)_mm512_sqrt_ps((__m512)x);
  else if constexpr (sizeof(V) == 64) return (V)_mm512_sqrt_pd((__m512d)x);
#endif
  V r;
#if defined(__SSE2__)
  for (int k = 0; k < Lanes<V>::width; k += 16 / sizeof(Scalar<V>)) {
    if constexpr (sizeof(Scalar<V>) == 4) _mm_storeu_ps((float*)&r + k, _mm_sqrt_ps(_mm_loadu_ps((const float*)&x + k)));
    else _mm_storeu_pd((double*)&r + k, _mm_sqrt_pd(_mm_loadu_pd((const double*)&x + k)));
  }
#else
  for (int k = 0; k < Lanes<V>::width; ++k) r[k] = std::sqrt(x[k]);
#endif
  return r;
}

// One bit per lane that is set.
IR_INLINE std::uint32_t bits(Int16 m) {
#if defined(__AVX512F__)
  return _mm512_test_epi32_mask((__m512i)m, (__m512i)m);
#elif defined(__SSE2__)
  std::uint32_t r = 0;
  for (int k = 0; k < 4; ++k) {
    __m128 part;
    std::memcpy(&part, (const char*)&m + 16 * k, 16);
    r |= static_cast<std::uint32_t>(_mm_movemask_ps(part)) << (4 * k);
  }
  return r;
#else
  std::uint32_t r = 0;
  for (int k = 0; k < 16; ++k) r |= static_cast<std::uint32_t>(m[k] != 0) << k;
  return r;
#endif
}
IR_INLINE std::uint32_t bits(Int8 m) {
#if defined(__AVX512F__)
  return _mm512_test_epi64_mask((__m512i)m, (__m512i)m);
#elif defined(__SSE2__)
  std::uint32_t r = 0;
  for (int k = 0; k < 4; ++k) {
    __m128d part;
    std::memcpy(&part, (const char*)&m + 16 * k, 16);
    r |= static_cast<std::uint32_t>(_mm_movemask_pd(part)) << (2 * k);
  }
  return r;
#else
  std::uint32_t r = 0;
  for (int k = 0; k < 8; ++k) r |= static_cast<std::uint32_t>(m[k] != 0) << k;
  return r;
#endif
}
template <class M> IR_INLINE bool any(M m) {
#if defined(__AVX512F__)
  if constexpr (sizeof(M) == 64) return _mm512_test_epi32_mask((__m512i)m, (__m512i)m) != 0;
#endif
  std::int64_t part[sizeof(M) / 8], seen = 0;
  std::memcpy(part, &m, sizeof m);
  for (const std::int64_t p : part) seen |= p;
  return seen != 0;
}

// Whether a <= b in some lane.
template <class V> IR_INLINE bool any_not_above(V a, V b) {
#if defined(__AVX512F__)
  if constexpr (sizeof(Scalar<V>) == 4) return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LE_OQ) != 0;
  else return _mm512_cmp_pd_mask((__m512d)a, (__m512d)b, _CMP_LE_OQ) != 0;
#else
  return any(a <= b);
#endif
}

// Of sixteen lanes where a <= b.
IR_INLINE std::uint32_t bits_not_above(Float16 a, Float16 b) {
#if defined(__AVX512F__)
  return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LE_OQ);
#else
  return bits(a <= b);
#endif
}

// The largest lane.
template <class V> IR_INLINE Scalar<V> highest(V v) {
#if defined(__AVX512F__)
  if constexpr (sizeof(Scalar<V>) == 4) return _mm512_reduce_max_ps((__m512)v);
#endif
  Scalar<V> r = v[0];
  for (int k = 1; k < Lanes<V>::width; ++k) r = v[k] > r ? v[k] : r;
  return r;
}

// The largest of lanes 8 part to 8 part + 7.
IR_INLINE float highest_of_eight(Float16 v, int part) {
  typedef float Float8 __attribute__((vector_size(32)));
  typedef float Float4 __attribute__((vector_size(16)));
  const Float8 a = part == 0 ? __builtin_shufflevector(v, v, 0, 1, 2, 3, 4, 5, 6, 7)
                             : __builtin_shufflevector(v, v, 8, 9, 10, 11, 12, 13, 14, 15);
  const Float4 low = __builtin_shufflevector(a, a, 0, 1, 2, 3), high = __builtin_shufflevector(a, a, 4, 5, 6, 7);
  const Float4 b = low > high ? low : high;
  const Float4 turned = __builtin_shufflevector(b, b, 2, 3, 0, 1), c = b > turned ? b : turned;
  return c[0] > c[1] ? c[0] : c[1];
}
IR_INLINE double highest_of_eight(Double8 v, int) { return highest(v); }

// Three lanes-wide coordinates.
template <class V> struct Vec {
  V x, y, z;
};
template <class V> IR_INLINE Vec<V> operator+(Vec<V> a, Vec<V> b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
template <class V> IR_INLINE Vec<V> operator-(Vec<V> a, Vec<V> b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
template <class V> IR_INLINE Vec<V> operator*(V s, Vec<V> a) { return {s * a.x, s * a.y, s * a.z}; }
template <class V> IR_INLINE V dot(Vec<V> a, Vec<V> b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
template <class V> IR_INLINE Vec<V> cross(Vec<V> a, Vec<V> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class V> IR_INLINE Vec<V> select(Mask<V> m, Vec<V> a, Vec<V> b) {
  return {m ? a.x : b.x, m ? a.y : b.y, m ? a.z : b.z};
}

typedef double Double2 __attribute__((vector_size(16), aligned(8), may_alias));

// Eight rows of n values as n columns.
IR_INLINE void load_columns(const double* const row[8], int n, Double8* column) {
  int j = 0;
  for (; j + 1 < n; j += 2) {  // two neighbours at a time, first of every second row
    const auto two = [&](int k) { return *reinterpret_cast<const Double2*>(row[k] + j); };
    const auto four = [&](int k) { return __builtin_shufflevector(two(k), two(k + 2), 0, 1, 2, 3); };
    const Double8 even = __builtin_shufflevector(four(0), four(4), 0, 1, 2, 3, 4, 5, 6, 7);
    const Double8 odd = __builtin_shufflevector(four(1), four(5), 0, 1, 2, 3, 4, 5, 6, 7);
    column[j] = __builtin_shufflevector(even, odd, 0, 8, 2, 10, 4, 12, 6, 14);
    column[j + 1] = __builtin_shufflevector(even, odd, 1, 9, 3, 11, 5, 13, 7, 15);
  }
  if (j < n)
    for (int k = 0; k < 8; ++k) column[j][k] = row[k][j];
}

// Sine and cosine to about one unit in the last place, for |x| <= reducible: reduction by pi/2 in parts, then the
// polynomials of fdlibm (double) and Cephes (float).
template <class V> constexpr Scalar<V> reducible = sizeof(Scalar<V>) == 8 ? 1e5 : 1e3;

template <class V> IR_INLINE void sincos_reducible(V x, V& s, V& c) {
  constexpr bool exact = sizeof(Scalar<V>) == 8;
  constexpr Scalar<V> magic = exact ? 6755399441055744.0 : 12582912.0;  // adding it rounds to whole numbers
  constexpr int to_sign = 8 * sizeof(Scalar<V>) - 2;
  const V shifted = x * Scalar<V>(0.63661977236758134308) + magic;
  const Mask<V> quarter = (Mask<V>)shifted;
  const V k = shifted - magic;
  V sine, cosine;
  if constexpr (exact) {
    V r = x - k * 1.57079632673412561417e+00;  // exact: 33 bits times the few of k
    r -= k * 6.07710050650619224932e-11;
    const V z = r * r, z2 = z * z;
    sine = r + r * z * ((-1.66666666666666324348e-01 + z * 8.33333333332248946124e-03) +
                        z2 * ((-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06) +
                              z2 * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)));
    cosine = 1.0 - 0.5 * z + z2 * ((4.16666666666666019037e-02 + z * -1.38888888888741095749e-03) +
                                   z2 * ((2.48015872894767294178e-05 + z * -2.75573143513906633035e-07) +
                                         z2 * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)));
  } else {
    V r = x - k * 1.5703125f;
    r -= k * 4.837512969970703125e-4f;
    r -= k * 7.549789948768648e-8f;
    const V z = r * r;
    sine = r + r * z * (-1.6666654611e-1f + z * (8.3321608736e-3f + z * -1.9515295891e-4f));
    cosine = 1.0f - 0.5f * z + z * z * (4.166664568298827e-2f + z * (-1.388731625493765e-3f + z * 2.443315711809948e-5f));
  }
  const Mask<V> odd = (quarter & 1) != 0;
  s = with_sign_of((V)(quarter << to_sign), odd ? cosine : sine);
  c = with_sign_of((V)((quarter + 1) << to_sign), odd ? sine : cosine);
}

// An angle less its whole turns, in extended precision: the remainder of a division is exact on every processor.
inline double without_turns(double x) {
  constexpr long double turn = 6.283185307179586476925286766559005768L;
  if (!std::isfinite(x)) return std::numeric_limits<double>::quiet_NaN();
  return static_cast<double>(std::fmod(static_cast<long double>(x), turn));
}

// Lanes that are out of reach of the reduction lose their whole turns first.
template <class V> __attribute__((noinline, cold)) void sincos_far(int n, const V* x, V* s, V* c) {
  for (int i = 0; i < n; ++i) {
    V near = x[i];
    for (int k = 0; k < Lanes<V>::width; ++k)
      if (!(std::fabs(near[k]) <= reducible<V>)) near[k] = static_cast<Scalar<V>>(without_turns(near[k]));
    sincos_reducible(near, s[i], c[i]);
  }
}

// Of `n` angles.
template <int known_n = 0, class V> IR_INLINE void sincos(int n, const V* x, V* s, V* c) {
  if (known_n) n = known_n;
  V squares{};
  for (int i = 0; i < n; ++i) squares += x[i] * x[i];
  if (__builtin_expect(any(squares > reducible<V> * reducible<V>), 0)) return sincos_far(n, x, s, c);
  for (int i = 0; i < n; ++i) sincos_reducible(x[i], s[i], c[i]);
}

}  // namespace ir
