// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Bounds over boxes, one per trajectory: of the values of nodes by intervals, of their Taylor coefficients by
// the recurrences on magnitudes. What `tape_bounds.f90` does for one.
#ifndef SEPARATRIX_TAPE_BOUNDS_HPP
#define SEPARATRIX_TAPE_BOUNDS_HPP

#include "tape_series.hpp"

namespace {

struct interval {
  vec low, high;
};

// `series`: bounds of coefficients; `of`: intervals of the nodes.
struct tape_box {
  tape_values series;
  interval of[most_tape_nodes];
};

// More than functions round, as a share.
const double interval_rounding = 32 * 2.3e-16, tiny_number = 1e-300;

inline vec most_of(interval a) { return larger(magnitude(a.low), magnitude(a.high)); }
inline vec least_of(interval a) { return larger(larger(a.low, -a.high), 0); }

inline interval product_of(interval a, interval b) {
  vec p = a.low * b.low, q = a.low * b.high, r = a.high * b.low, s = a.high * b.high;
  return {smaller(smaller(p, q), smaller(r, s)), larger(larger(p, q), larger(r, s))};
}

// Sine or cosine: its value in the middle, and no slope is above 1.
inline interval circular(bool cosine, interval a, mask &sound) {
  vec middle = 0.5 * (a.low + a.high), reach = 0.5 * (a.high - a.low), sine, other;
  sine_cosine(middle, sine, other);
  vec value = cosine ? other : sine;
  sound = sound & (most_of(a) < 1.6e6);
  return {larger(value - reach, -1), smaller(value + reach, 1)};
}

inline interval bounds_of_function(const tape_node &n, interval a, const tape_box &box, vec &inverse,
                                   mask &sound) {
  switch (n.operation) {
  case tape_power: {
    sound = sound & (a.low > tiny_number);
    inverse = 1.0 / a.low;
    interval of_log = {logarithm_or_none(a.low), logarithm_or_none(a.high)};
    interval e = product_of(of_log, box.of[n.second]);
    vec margin = interval_rounding * most_of(e);
    return {growth(e.low - margin), growth(e.high + margin)};
  }
  case tape_sqrt: {
    sound = sound & (a.low > 0.0);
    interval y = {square_root(a.low), square_root(a.high)};
    inverse = 0.5 / y.low;
    return y;
  }
  case tape_exp:
    return {growth(a.low), growth(a.high)};
  case tape_log:
    sound = sound & (a.low > tiny_number);
    inverse = 1.0 / a.low;
    return {logarithm_or_none(a.low), logarithm_or_none(a.high)};
  case tape_sin:
  case tape_sin_even:
    return circular(false, a, sound);
  case tape_cos:
  case tape_cos_even:
    return circular(true, a, sound);
  case tape_tan: {
    interval of_cosine = circular(true, a, sound);
    sound = sound & (least_of(of_cosine) > 1e-3);
    vec sines[2], cosines[2];
    sine_cosine(a.low, sines[0], cosines[0]);
    sine_cosine(a.high, sines[1], cosines[1]);
    return {sines[0] / cosines[0], sines[1] / cosines[1]};
  }
  case tape_atan:
    inverse = 1.0 / least_of(box.of[n.second]);
    return {arc_tangent(a.low), arc_tangent(a.high)};
  case tape_sinh:
    return {hyperbolic_sine(a.low), hyperbolic_sine(a.high)};
  case tape_cosh:
    return {hyperbolic_cosine(least_of(a)), hyperbolic_cosine(most_of(a))};
  case tape_tanh:
    return {hyperbolic_tangent(a.low), hyperbolic_tangent(a.high)};
  default:
    return {vec(n.value), vec(n.value)};
  }
}

// Interval of a node; `sound`: it is defined all over the box.
inline interval bounds_of_node(const tape_machine &m, const tape_node &n, const interval *z,
                               const tape_box &box, vec &inverse, mask &sound) {
  if (n.operation == tape_sum) {
    interval total = {vec(0), vec(0)};
    if (n.other >= 0)
      total = box.of[n.other];
    for (int i = n.first; i < n.first + n.second; i++) {
      interval y = product_of(box.of[m.term[i].factor], box.of[m.term[i].node]);
      total = {total.low + y.low, total.high + y.high};
    }
    return total;
  }
  const interval a = box.of[n.first], b = box.of[n.second];
  switch (n.operation) {
  case tape_variable:
    return z[n.first];
  case tape_add:
    return {a.low + b.low, a.high + b.high};
  case tape_subtract:
    return {a.low - b.high, a.high - b.low};
  case tape_multiply:
  case tape_scale:
    return product_of(a, b);
  case tape_divide:
  case tape_divide_steady:
    sound = sound & (least_of(b) > tiny_number);
    inverse = 1.0 / least_of(b);
    return product_of(a, {1.0 / b.high, 1.0 / b.low});
  case tape_negative:
    return {-a.high, -a.low};
  case tape_square: {
    vec least = least_of(a), most = most_of(a);
    return {least * least, most * most};
  }
  case tape_select:
    return {smaller(a.low, b.low), larger(a.high, b.high)};
  case tape_select_slip: {
    mask up = box.series.slip > 0.0;
    return {pick(up, a.low, b.low), pick(up, a.high, b.high)};
  }
  default:
    return bounds_of_function(n, a, box, inverse, sound);
  }
}

// Bounds of the coefficients of all nodes, of the last order too. Steady nodes have the values `t`. Returns
// where all is defined over the box `z`.
[[gnu::noinline]] inline mask bound_series(const tape_machine &m, bool fresh, const interval *z,
                                           const tape_values &t, tape_box &box) {
  tape_values &b = box.series;
  mask sound = ~mask{};
  b.slip = t.slip;
  for (int i = fresh ? 0 : m.by_slip; i < m.nodes; i++) {
    const tape_node &n = m.node[i];
    interval y = {t.first[i], t.first[i]};
    if (i >= m.varying) {
      y = bounds_of_node(m, n, z, box, b.inverse[i], sound);
      vec room = interval_rounding * most_of(y) + tiny_number;
      y = {y.low - room, y.high + room};
    }
    box.of[i] = y;
    vec size = most_of(y);
    b.first[i] = size;
    if (n.series >= 0)
      b.of[n.series][0] = size;
    if (n.slopes >= 0)
      b.of[n.slopes][0] = 0;
    if (i < m.varying)
      set_steady(n, i, b);
  }
  raise_all<true>(m, fresh, b);
  return sound;
}

} // namespace

#endif
