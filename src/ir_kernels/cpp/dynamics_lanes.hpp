// Lanes of one register each, however long the processor has them: the same number of several samples; batches of
// samples as columns of such registers.
#pragma once

#include "lanes.hpp"

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

using ir::abs;
using ir::any;
using ir::Lanes;
using ir::max;
using ir::min;
using ir::Scalar;
using ir::sincos;
using ir::splat;
using ir::sqrt;
using ir::with_sign_of;

inline Doubles copysign(Doubles size, Doubles sign) { return with_sign_of(sign, abs(size)); }

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
  const auto two = [=](int row) { return *reinterpret_cast<const Double2*>(base + row * n); };
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
      columns[j][l] = static_cast<Scalar<V>>(rows[(first + (l < left ? l : left - 1)) * n + j]);
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
