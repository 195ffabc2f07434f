// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Functions that only tapes need, on vectors. Outside its domain a function is not a number.
#ifndef SEPARATRIX_TAPE_FUNCTIONS_HPP
#define SEPARATRIX_TAPE_FUNCTIONS_HPP

#include "lane_elementary.hpp"

namespace {

inline vec larger(vec a, vec b) { return pick(a < b, b, a); }
inline vec smaller(vec a, vec b) { return pick(a < b, a, b); }
inline vec with_sign(vec size, vec of) { return pick(of < 0.0, -size, size); }

const double infinite = __builtin_inf(), undefined = __builtin_nan("");

template <int n> inline vec horner(const double (&c)[n], vec z) {
  vec y = c[n - 1];
  for (int i = n - 2; i >= 0; i--)
    y = y * z + c[i];
  return y;
}

inline vec growth(vec x) { return pick(x < 700.0, exponential(x), infinite); }

inline vec logarithm_or_none(vec x) { return pick((x > 1e-300) & (x < infinite), logarithm(x), undefined); }

// sinh x/x - 1 and cosh x - 1 over x^2, for |x| <= 1.
const double sinh_series[9] = {
    1.0 / 6,          1.0 / 120,          1.0 / 5040,           1.0 / 362880,           1.0 / 39916800,
    1.0 / 6227020800, 1.0 / 1307674368e3, 1.0 / 355687428096e3, 1.0 / 121645100408832e3};
const double cosh_series[9] = {
    1.0 / 2,         1.0 / 24,          1.0 / 720,           1.0 / 40320,          1.0 / 3628800,
    1.0 / 479001600, 1.0 / 87178291200, 1.0 / 20922789888e3, 1.0 / 6402373705728e3};

inline vec hyperbolic_sine(vec x) {
  vec size = magnitude(x), z = x * x, far = growth(size);
  return pick(size < 1.0, x + x * (z * horner(sinh_series, z)), with_sign(0.5 * (far - 1.0 / far), x));
}

inline vec hyperbolic_cosine(vec x) {
  vec far = growth(magnitude(x));
  return 0.5 * (far + 1.0 / far);
}

inline vec hyperbolic_tangent(vec x) {
  vec size = magnitude(x), z = x * x;
  vec near = (x + x * (z * horner(sinh_series, z))) / (1.0 + z * horner(cosh_series, z));
  return pick(size < 0.6, near, with_sign(1.0 - 2.0 / (growth(2.0 * smaller(size, 30)) + 1.0), x));
}

// Angles whose tangents are eighths, in two parts.
const double eighths[9] = {0.0,
                           0.12435499454676144,
                           0.24497866312686414,
                           0.35877067027057225,
                           0.4636476090008061,
                           0.5585993153435624,
                           0.6435011087932844,
                           0.7188299996216245,
                           0.7853981633974483};
const double eighths_low[9] = {0.0,
                               -3.1253241424539383e-18,
                               1.0698755618734451e-17,
                               -2.4623815582638635e-17,
                               2.2698777452961687e-17,
                               -5.4556305485916264e-18,
                               1.5834785051444286e-17,
                               -2.1478388444456983e-17,
                               3.061616997868383e-17};
const double atan_series[10] = {-1.0 / 3, 1.0 / 5,   -1.0 / 7, 1.0 / 9,   -1.0 / 11,
                                1.0 / 13, -1.0 / 15, 1.0 / 17, -1.0 / 19, 1.0 / 21};

inline vec arc_tangent(vec x) {
  vec size = magnitude(x), t = pick(size > 1.0, 1.0 / size, size), from = 0, high = 0, low = 0;
  for (int k = 1; k <= 8; k++) {
    mask near = t >= (k == 1 ? 0.15 : (k - 0.5) / 8);
    put(from, near, k / 8.0);
    put(high, near, eighths[k]);
    put(low, near, eighths_low[k]);
  }
  t = pick(from > 0.0, (t - from) / (1.0 + t * from), t);
  vec z = t * t, angle = high + (low + (t + t * (z * horner(atan_series, z))));
  return with_sign(pick(size > 1.0, 1.5707963267948966 - (angle - 6.123233995736766e-17), angle), x);
}

} // namespace

#endif
