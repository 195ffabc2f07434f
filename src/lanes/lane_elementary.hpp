// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The elementary functions on vectors, or for one body: the same operations in the same order as in
// `elementary.f90`, so the bits depend neither on the width nor on the processor.
#ifndef SEPARATRIX_LANE_ELEMENTARY_HPP
#define SEPARATRIX_LANE_ELEMENTARY_HPP

// What a GPU's compiler is to make for the GPU.
#ifdef __CUDACC__
#define LANE_ONE_BODY
#define LANE_DEVICE __host__ __device__
#define LANE_LEAF __host__ __device__ __forceinline__
#define LANE_UNROLL _Pragma("unroll")
#else
#define LANE_DEVICE
#define LANE_UNROLL
// The compiler stops inlining by itself where there is much to inline.
#define LANE_LEAF inline __attribute__((always_inline))
#endif

// A build that counts what the kernel does defines this; see
// `scripts/evidence/bench_peers/counted_lanes.cpp`.
#ifndef LANE_COUNT
#define LANE_COUNT(what, number)
#endif

#ifdef LANE_ONE_BODY
#include "lane_one_body.hpp"
#else
#include "lane_vectors.hpp"
#endif

namespace {

LANE_LEAF reg magnitude(reg a) { return real_of(bits_of(a) & INT64_MAX); }

LANE_OF_PARTS(magnitude)
LANE_OF_PARTS(square_root)

// Adding it rounds to the nearest integer, which then stands in the last bits.
const double to_integer = 6755399441055744.0;

LANE_LEAF void sine_cosine(reg angle, reg &sine, reg &cosine) {
  reg shifted = angle * 6.36619772367581382433e-01 + to_integer;
  reg quarters = shifted - to_integer;
  reg_mask quadrant = bits_of(shifted);
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
  sine = real_of(bits_of(s) ^ ((quadrant & 2) << 62));
  cosine = real_of(bits_of(c) ^ (((quadrant + 1) & 2) << 62));
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
  return y * real_of((bits_of(shifted) - bits_of(all(to_integer)) + 1023) << 52);
}

LANE_OF_PARTS(exponential)

// Natural logarithm of normal x > 0.
LANE_DEVICE inline reg logarithm(reg x) {
  const int64_t of_half = 0x3FE0000000000000, of_fraction = 0x000FFFFFFFFFFFFF;
  reg_mask bits = bits_of(x);
  reg twos = real_of(bits_of(all(to_integer)) + ((bits >> 52) - 1022)) - to_integer;
  reg f = real_of((bits & of_fraction) | of_half);
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

LANE_OF_PARTS(logarithm)

// The same to 0.01, for what needs no more.
LANE_LEAF reg rough_logarithm(reg x) {
  const int64_t of_one = 0x3FF0000000000000, of_fraction = 0x000FFFFFFFFFFFFF;
  reg_mask bits = bits_of(x);
  reg twos = real_of(bits_of(all(to_integer)) + ((bits >> 52) - 1023)) - to_integer;
  reg f = real_of((bits & of_fraction) | of_one) - 1.0;
  return 6.93147180559945286227e-01 * (twos + f * (1.34 - 0.34 * f));
}

LANE_OF_PARTS(rough_logarithm)

// e**x to 0.4 % for -700 <= x <= 700; below that e**-700.
LANE_LEAF reg rough_exponential(reg x) {
  x = x < -700.0 ? all(-700.0) : x;
  reg y = x * 1.44269504088896338700e+00, shifted = y + to_integer, f = y - (shifted - to_integer);
  return (1.0 + f * (0.6931 + 0.2402 * f)) *
         real_of((bits_of(shifted) - bits_of(all(to_integer)) + 1023) << 52);
}

LANE_OF_PARTS(rough_exponential)

#undef LANE_OF_PARTS

} // namespace

#endif
