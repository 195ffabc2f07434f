// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Polynomials over a step: their range and slopes by Bernstein coefficients, and their zeros.
#ifndef SEPARATRIX_TAPE_SEARCH_HPP
#define SEPARATRIX_TAPE_SEARCH_HPP

#include "tape_bounds.hpp"

namespace {

// Least coefficient and least and largest first and second differences, times the powers of the degree that
// make them bounds of value, slope and curvature; the last coefficient.
struct tape_range {
  vec least, most_slope, most_curvature, last;
};

static_assert(tape_order % 3 == 0, "to_bernstein takes three rounds at a time");

// Bernstein coefficients over the step.
LANE_LEAF void to_bernstein(const vec *p, vec *b) {
  const int n = tape_order;
  double inverse = 1;
  for (int k = 0; k <= n; k++) {
    b[k] = p[k] * inverse;
    inverse = inverse * (k + 1) / (n - k + (k == n));
  }
  // Three of the `n` rounds of sums at a time: each number is loaded and stored once for them.
  for (int k = 1; k <= n; k += 3) {
    vec zeroth = b[k], first = zeroth + b[k - 1];
    b[k] = first;
    vec here = b[k + 1], next = here + zeroth, second = next + first;
    zeroth = here;
    first = next;
    b[k + 1] = second;
    for (int i = k + 2; i <= n; i++) {
      here = b[i];
      next = here + zeroth;
      vec after = next + first;
      b[i] = after + second;
      zeroth = here;
      first = next;
      second = after;
    }
  }
}

// Lower and upper bound over the step.
[[gnu::noinline]] inline interval bounds_of(const vec *p) {
  series b;
  to_bernstein(p, b);
  interval range = {b[0], b[0]};
  for (int k = 1; k < orders; k++) {
    range.low = smaller(range.low, b[k]);
    range.high = larger(range.high, b[k]);
  }
  return range;
}

[[gnu::noinline]] inline tape_range range_of(const vec *p) {
  const int n = tape_order;
  series b;
  to_bernstein(p, b);
  tape_range r;
  r.least = b[0];
  vec slope = b[1] - b[0];
  r.most_slope = slope;
  r.most_curvature = b[2] - b[1] - slope;
  for (int i = 1; i <= n; i++) {
    r.least = smaller(r.least, b[i]);
    vec next = b[i] - b[i - 1];
    r.most_slope = larger(r.most_slope, next);
    if (i > 1)
      r.most_curvature = larger(r.most_curvature, next - slope);
    slope = next;
  }
  r.most_slope = r.most_slope * double(n);
  r.most_curvature = r.most_curvature * double(n * (n - 1));
  r.last = b[n];
  return r;
}

inline vec value_at(const vec *p, vec t) {
  vec y = p[tape_order];
  for (int k = tape_order - 1; k >= 0; k--)
    y = y * t + p[k];
  return y;
}

// The zero of p - level that falls from a positive value at 0, or with `sign` -1 rises from a negative one,
// before `end`: Newton's steps within halvings, of the lanes `where`; elsewhere `other`.
[[gnu::noinline]] inline vec zero_of(const vec *p, vec level, vec sign, mask where, vec end, vec other) {
  // The next step then is below rounding.
  const double close = 3e-9;
  vec low = 0, high = end, from = sign * (p[0] - level), to = sign * (value_at(p, end) - level);
  vec t = end * (from / (from - to));
  t = pick((t >= low) & (t <= high), t, 0.5 * end);
  mask open = where;
  for (int i = 0; i < 100 && any(open); i++) {
    vec value = p[tape_order], slope = 0;
    for (int k = tape_order - 1; k >= 0; k--) {
      slope = slope * t + value;
      value = value * t + p[k];
    }
    value = value - level;
    mask before = sign * value > 0.0;
    put(low, open & before, t);
    put(high, open & ~before, t);
    vec next = t - value / slope;
    next = pick((next >= low) & (next <= high), next, 0.5 * (low + high));
    mask done = magnitude(next - t) <= close * t;
    put(t, open, next);
    open = open & ~done;
  }
  return pick(where, t, other);
}

} // namespace

#endif
