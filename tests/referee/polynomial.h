/* SPDX-FileCopyrightText: The Separatrix developers
 * SPDX-License-Identifier: GPL-3.0-or-later
 *
 * Polynomials of the referee, and where they first fall through zero.
 */
#include <math.h>
#include <stdbool.h>
#include <stddef.h>
#include <string.h>

#ifndef REAL_IS_LONG
typedef double real;
#define R(name) name
#else
typedef long double real;
#define R(name) name##l
#endif

enum { ORDER = 22, DEEPEST = 60 };

static real value(const real *c, int n, real s) {
  real sum = c[n];
  for (int j = n - 1; j >= 0; j--)
    sum = sum * s + c[j];
  return sum;
}

static void shifted(const real *c, int n, real s, real *out) {
  for (int j = 0; j <= n; j++)
    out[j] = c[j];
  for (int i = 0; i < n; i++)
    for (int j = n - 1; j >= i; j--)
      out[j] += s * out[j + 1];
}

/* The root between a, where c is positive, and b, where it is not; c is monotone there. */
static real polished(const real *c, int n, real a, real b) {
  real s = (a + b) / 2;
  for (int i = 0; i < 200 && b > a; i++) {
    const real f = value(c, n, s);
    if (f > 0)
      a = s;
    else
      b = s;
    real slope = 0;
    for (int j = n; j >= 1; j--)
      slope = slope * s + j * c[j];
    real next = s - f / slope;
    if (!(next > a && next < b))
      next = (a + b) / 2;
    if (next == s || next == a || next == b)
      return next;
    s = next;
  }
  return s;
}

static real search(const real *c, int n, real a, real b, int depth) {
  const real middle = (a + b) / 2, r = (b - a) / 2;
  real d[ORDER + 1], range = 0, bend = 0, power = r;
  shifted(c, n, middle, d);
  for (int j = 1; j <= n; j++) {
    range += R(fabs)(d[j]) * power;
    if (j >= 2)
      bend += j * R(fabs)(d[j]) * power / r;
    power *= r;
  }
  if (d[0] > range)
    return -1;
  const real first = value(d, n, -r), last = value(d, n, r);
  if (first <= 0)
    return a;
  if (R(fabs)(d[1]) > bend)
    return last > 0 ? -1 : middle + polished(d, n, -r, r);
  if (depth == DEEPEST)
    return d[0] > 0 ? -1 : middle;
  const real left = search(c, n, a, middle, depth + 1);
  return left >= 0 ? left : search(c, n, middle, b, depth + 1);
}

/* The first s in (0, h] where the polynomial falls through zero, -1 if there is none. Roots at 0 itself do
 * not count. */
static real first_zero(const real *c, int n, real h) {
  while (n > 0 && c[0] == 0) {
    c++;
    n--;
  }
  if (c[0] < 0)
    return 0;
  real range = 0;
  for (int j = n; j >= 1; j--)
    range = (range + R(fabs)(c[j])) * h;
  if (c[0] > range)
    return -1;
  return search(c, n, 0, h, 0);
}
