// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Vectors as wide as the processor that this is compiled for, and the elementary functions on them. The same
// operations in the same order as in `elementary.f90`, so the bits do not depend on the width.
#ifndef SEPARATRIX_LANE_VECTORS_HPP
#define SEPARATRIX_LANE_VECTORS_HPP

#include <cstdint>
#include <cstring>

// The compiler stops inlining by itself where there is much to inline.
#define LANE_LEAF inline __attribute__((always_inline))

// A build that counts what the kernel does defines this; see `scripts/bench_peers/counted_lanes.cpp`.
#ifndef LANE_COUNT
#define LANE_COUNT(what, number)
#endif

namespace {

#if defined(__AVX512F__)
enum { width = 8 };
#elif defined(__AVX__)
enum { width = 4 };
#else
enum { width = 2 };
#endif

enum { vec_size = 2 * width };

typedef double reg __attribute__((vector_size(8 * width)));
typedef int64_t reg_mask __attribute__((vector_size(8 * width)));

inline reg all(double x) { return x - reg{}; }

// Two registers: while the operations of one wait for each other, those of the other go on.
struct mask {
  reg_mask low, high;
};

struct vec {
  reg low, high;
  vec() = default;
  vec(double x) : low(all(x)), high(all(x)) {}
  vec(reg low, reg high) : low(low), high(high) {}
};

#define LANE_OPERATOR(result, type, op)                                                                      \
  inline result operator op(type a, type b) { return {a.low op b.low, a.high op b.high}; }

LANE_OPERATOR(vec, vec, +)
LANE_OPERATOR(vec, vec, -)
LANE_OPERATOR(vec, vec, *)
LANE_OPERATOR(vec, vec, /)
LANE_OPERATOR(mask, vec, <)
LANE_OPERATOR(mask, vec, <=)
LANE_OPERATOR(mask, vec, >)
LANE_OPERATOR(mask, vec, >=)
LANE_OPERATOR(mask, vec, ==)
LANE_OPERATOR(mask, vec, !=)
LANE_OPERATOR(mask, mask, &)
LANE_OPERATOR(mask, mask, |)

#undef LANE_OPERATOR

inline vec operator-(vec a) { return {-a.low, -a.high}; }
inline mask operator~(mask m) { return {~m.low, ~m.high}; }
inline void operator+=(vec &a, vec b) { a = a + b; }
inline void operator-=(vec &a, vec b) { a = a - b; }
inline void operator*=(vec &a, vec b) { a = a * b; }

// a where m holds, elsewhere b.
inline vec pick(mask m, vec a, vec b) { return {m.low ? a.low : b.low, m.high ? a.high : b.high}; }
inline mask pick(mask m, mask a, mask b) { return (m & a) | (~m & b); }

// Replaces a by b where m holds.
inline void put(vec &a, mask m, vec b) { a = pick(m, b, a); }

// Down to two integers by vectors, so that few have to be taken out one by one.
inline bool any(mask m) {
  typedef int64_t two __attribute__((vector_size(16)));
  reg_mask both = m.low | m.high;
  two parts[width / 2], bits = {};
  memcpy(parts, &both, sizeof both);
  for (const two &part : parts)
    bits |= part;
  return (bits[0] | bits[1]) != 0;
}

// Lanes of a mask.
inline int count(mask m) {
  reg_mask both = m.low + m.high;
  int64_t sum = 0;
  for (int i = 0; i < width; i++)
    sum -= both[i];
  return int(sum);
}

inline vec magnitude(vec a) {
  return {(reg)((reg_mask)a.low & INT64_MAX), (reg)((reg_mask)a.high & INT64_MAX)};
}

inline reg square_root(reg a) {
  reg root;
  for (int i = 0; i < width; i++)
    root[i] = __builtin_sqrt(a[i]);
  return root;
}

inline vec square_root(vec a) { return {square_root(a.low), square_root(a.high)}; }

// Adding it rounds to the nearest integer, which then stands in the last bits.
const double to_integer = 6755399441055744.0;

LANE_LEAF void sine_cosine(reg angle, reg &sine, reg &cosine) {
  reg shifted = angle * 6.36619772367581382433e-01 + to_integer;
  reg quarters = shifted - to_integer;
  reg_mask quadrant = (reg_mask)shifted;
  reg high = angle - quarters * 1.57079632673412561417e+00;
  reg low = quarters * 6.07710050650619224932e-11;
  reg r = high - low, tail = (high - r) - low, z = r * r;
  reg odd_part = -1.66666666666666324348e-01 +
                 z * (8.33333333332248946124e-03 +
                      z * (-1.98412698298579493134e-04 +
                           z * (2.75573137070700676789e-06 +
                                z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))));
  reg sin_r = r + (r * z * odd_part + tail * (1.0 - 0.5 * z));
  reg even_part = 4.16666666666666019037e-02 +
                  z * (-1.38888888888741095749e-03 +
                       z * (2.48015872894767294178e-05 +
                            z * (-2.75573143513906633035e-07 +
                                 z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
  reg half = 0.5 * z, w = 1.0 - half;
  reg cos_r = w + (((1.0 - w) - half) + (z * z * even_part - r * tail));
  reg_mask odd = (quadrant & 1) != 0;
  reg s = odd ? cos_r : sin_r, c = odd ? sin_r : cos_r;
  sine = (reg)((reg_mask)s ^ ((quadrant & 2) << 62));
  cosine = (reg)((reg_mask)c ^ (((quadrant + 1) & 2) << 62));
}

LANE_LEAF void sine_cosine(vec angle, vec &sine, vec &cosine) {
  sine_cosine(angle.low, sine.low, cosine.low);
  sine_cosine(angle.high, sine.high, cosine.high);
}

// e**x for -700 <= x <= 700; below that e**-700.
LANE_LEAF reg exponential(reg x) {
  x = x < -700.0 ? all(-700.0) : x;
  reg shifted = x * 1.44269504088896338700e+00 + to_integer, twos = shifted - to_integer;
  reg r = (x - twos * 6.93147180369123816490e-01) - twos * 1.90821492927058770002e-10;
  reg z = r * r;
  reg c = r - z * (1.66666666666666019037e-01 +
                   z * (-2.77777777770155933842e-03 +
                        z * (6.61375632143793436117e-05 +
                             z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))));
  reg y = 1.0 + (r - (r * c) / (c - 2.0));
  return y * (reg)(((reg_mask)shifted - (reg_mask)all(to_integer) + 1023) << 52);
}

LANE_LEAF vec exponential(vec x) { return {exponential(x.low), exponential(x.high)}; }

// Natural logarithm of normal x > 0.
inline reg logarithm(reg x) {
  const int64_t of_half = 0x3FE0000000000000, of_fraction = 0x000FFFFFFFFFFFFF;
  reg_mask bits = (reg_mask)x;
  reg twos = (reg)((reg_mask)all(to_integer) + ((bits >> 52) - 1022)) - to_integer;
  reg f = (reg)((bits & of_fraction) | of_half);
  reg_mask small = f < 0.70710678118654752440;
  f = small ? 2.0 * f : f;
  twos = small ? twos - 1.0 : twos;
  f = f - 1.0;
  reg s = f / (2.0 + f), z = s * s;
  reg r = z * (6.666666666666735130e-01 +
               z * (3.999999999940941908e-01 +
                    z * (2.857142874366239149e-01 +
                         z * (2.222219843214978396e-01 +
                              z * (1.818357216161805012e-01 +
                                   z * (1.531383769920937332e-01 + z * 1.479819860510658591e-01))))));
  reg half_square = 0.5 * f * f;
  return twos * 6.93147180369123816490e-01 -
         ((half_square - (s * (half_square + r) + twos * 1.90821492927058770002e-10)) - f);
}

inline vec logarithm(vec x) { return {logarithm(x.low), logarithm(x.high)}; }

} // namespace

#endif
