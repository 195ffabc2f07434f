// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Vectors as wide as the processor that this is compiled for, and the elementary functions on them. The same
// operations in the same order as in `elementary.f90`, so the bits do not depend on the width.
#ifndef SEPARATRIX_LANE_VECTORS_HPP
#define SEPARATRIX_LANE_VECTORS_HPP

#include <cstdint>
#include <cstring>

namespace {

#if defined(__AVX512F__)
enum { width = 8 };
#elif defined(__AVX__)
enum { width = 4 };
#else
enum { width = 2 };
#endif

typedef double vec __attribute__((vector_size(8 * width)));
typedef int64_t mask __attribute__((vector_size(8 * width)));

inline vec all(double x) { return x - vec{}; }

inline bool any(mask m) {
  int64_t bits = 0;
  for (int i = 0; i < width; i++)
    bits |= m[i];
  return bits != 0;
}

inline vec magnitude(vec a) { return (vec)((mask)a & INT64_MAX); }

// Adding it rounds to the nearest integer, which then stands in the last bits.
const double to_integer = 6755399441055744.0;

inline void sine_cosine(vec angle, vec &sine, vec &cosine) {
  vec shifted = angle * 6.36619772367581382433e-01 + to_integer;
  vec quarters = shifted - to_integer;
  mask quadrant = (mask)shifted;
  vec high = angle - quarters * 1.57079632673412561417e+00;
  vec low = quarters * 6.07710050650619224932e-11;
  vec r = high - low, tail = (high - r) - low, z = r * r;
  vec odd_part = -1.66666666666666324348e-01 +
                 z * (8.33333333332248946124e-03 +
                      z * (-1.98412698298579493134e-04 +
                           z * (2.75573137070700676789e-06 +
                                z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10))));
  vec sin_r = r + (r * z * odd_part + tail * (1.0 - 0.5 * z));
  vec even_part = 4.16666666666666019037e-02 +
                  z * (-1.38888888888741095749e-03 +
                       z * (2.48015872894767294178e-05 +
                            z * (-2.75573143513906633035e-07 +
                                 z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))));
  vec half = 0.5 * z, w = 1.0 - half;
  vec cos_r = w + (((1.0 - w) - half) + (z * z * even_part - r * tail));
  mask odd = (quadrant & 1) != 0;
  vec s = odd ? cos_r : sin_r, c = odd ? sin_r : cos_r;
  sine = (vec)((mask)s ^ ((quadrant & 2) << 62));
  cosine = (vec)((mask)c ^ (((quadrant + 1) & 2) << 62));
}

// e**x for -700 <= x <= 700; below that e**-700.
inline vec exponential(vec x) {
  x = x < -700.0 ? all(-700.0) : x;
  vec shifted = x * 1.44269504088896338700e+00 + to_integer, twos = shifted - to_integer;
  vec r = (x - twos * 6.93147180369123816490e-01) - twos * 1.90821492927058770002e-10;
  vec z = r * r;
  vec c = r - z * (1.66666666666666019037e-01 +
                   z * (-2.77777777770155933842e-03 +
                        z * (6.61375632143793436117e-05 +
                             z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08))));
  vec y = 1.0 + (r - (r * c) / (c - 2.0));
  return y * (vec)(((mask)shifted - (mask)all(to_integer) + 1023) << 52);
}

} // namespace

#endif
