// Lanes: one operation on 16 floats or 8 doubles, written with the vector types of GCC and Clang, so that the same
// source serves AVX-512, AVX2 and plain SSE2 (where the compiler splits them). Lanes never mix: what one lane computes
// does not depend on its neighbours.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>

#if defined(__SSE2__)
#include <immintrin.h>
#endif

namespace ir {

typedef float Float16 __attribute__((vector_size(64)));
typedef double Double8 __attribute__((vector_size(64)));
typedef std::int32_t Int16 __attribute__((vector_size(64)));
typedef std::int64_t Int8 __attribute__((vector_size(64)));

template <class V> struct Lanes;
template <> struct Lanes<Float16> {
  using Scalar = float;
  using Mask = Int16;
  static constexpr int width = 16;
};
template <> struct Lanes<Double8> {
  using Scalar = double;
  using Mask = Int8;
  static constexpr int width = 8;
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
template <class V> IR_INLINE V abs(V x) { return max(x, -x); }
template <class V> IR_INLINE V select(Mask<V> m, V a, V b) { return m ? a : b; }

template <class V> IR_INLINE V load(const Scalar<V>* from) {
  V v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
template <class V> IR_INLINE void store(Scalar<V>* to, V v) { std::memcpy(to, &v, sizeof v); }

IR_INLINE Float16 sqrt(Float16 x) {
#if defined(__AVX512F__)
  return (Float16)_mm512_sqrt_ps((__m512)x);
#elif defined(__SSE2__)
  Float16 r;
  for (int k = 0; k < 4; ++k) {
    __m128 part;
    std::memcpy(&part, (const char*)&x + 16 * k, 16);
    part = _mm_sqrt_ps(part);
    std::memcpy((char*)&r + 16 * k, &part, 16);
  }
  return r;
#else
  Float16 r;
  for (int k = 0; k < 16; ++k) r[k] = std::sqrt(x[k]);
  return r;
#endif
}

IR_INLINE Double8 sqrt(Double8 x) {
#if defined(__AVX512F__)
  return (Double8)_mm512_sqrt_pd((__m512d)x);
#elif defined(__SSE2__)
  Double8 r;
  for (int k = 0; k < 4; ++k) {
    __m128d part;
    std::memcpy(&part, (const char*)&x + 16 * k, 16);
    part = _mm_sqrt_pd(part);
    std::memcpy((char*)&r + 16 * k, &part, 16);
  }
  return r;
#else
  Double8 r;
  for (int k = 0; k < 8; ++k) r[k] = std::sqrt(x[k]);
  return r;
#endif
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
template <class M> IR_INLINE bool any(M m) { return bits(m) != 0; }

// Whether a <= b in some lane.
template <class V> IR_INLINE bool any_not_above(V a, V b) {
#if defined(__AVX512F__)
  if constexpr (sizeof(Scalar<V>) == 4) return _mm512_cmp_ps_mask((__m512)a, (__m512)b, _CMP_LE_OQ) != 0;
  else return _mm512_cmp_pd_mask((__m512d)a, (__m512d)b, _CMP_LE_OQ) != 0;
#else
  return any(a <= b);
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

// Sine and cosine to 2 ulp for |x| < 1e5 rad (Cody and Waite's reduction, minimax polynomials of Cephes); beyond
// that lane by lane with the library's.
IR_INLINE void sincos(Double8 x, Double8& s, Double8& c) {
  if (__builtin_expect(any(abs(x) > 1e5), 0)) {
    for (int k = 0; k < 8; ++k) {
      s[k] = std::sin(x[k]);
      c[k] = std::cos(x[k]);
    }
    return;
  }
  const double magic = 6755399441055744.0;  // 1.5 * 2^52: adding it rounds to whole numbers
  const Double8 shifted = x * 0.63661977236758134308 + magic;
  Int8 quadrant;
  std::memcpy(&quadrant, &shifted, sizeof quadrant);
  const Double8 k = shifted - magic;
  Double8 r = x - k * 1.57079625129699707031;
  r -= k * 7.54978941586159635335e-8;
  r -= k * 5.39030285815811905290e-15;
  const Double8 z = r * r;
  Double8 ps = splat<Double8>(1.58962301576546568060e-10);
  ps = ps * z - 2.50507477628578072866e-8;
  ps = ps * z + 2.75573136213857245213e-6;
  ps = ps * z - 1.98412698295895385996e-4;
  ps = ps * z + 8.33333333332211858878e-3;
  ps = ps * z - 1.66666666666666307295e-1;
  ps = r + r * z * ps;
  Double8 pc = splat<Double8>(-1.13585365213876817300e-11);
  pc = pc * z + 2.08757008419747316778e-9;
  pc = pc * z - 2.75573141792967388112e-7;
  pc = pc * z + 2.48015872888517045348e-5;
  pc = pc * z - 1.38888888888730564116e-3;
  pc = pc * z + 4.16666666666665929218e-2;
  pc = 1.0 - 0.5 * z + z * z * pc;
  const Int8 odd = (quadrant & 1) != 0;
  const Double8 sine = select<Double8>(odd, pc, ps), cosine = select<Double8>(odd, ps, pc);
  s = select<Double8>((quadrant & 2) != 0, -sine, sine);
  c = select<Double8>(((quadrant + 1) & 2) != 0, -cosine, cosine);
}

}  // namespace ir
