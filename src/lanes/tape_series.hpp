// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Taylor series of all nodes of a tape, of many trajectories at once: an operation is looked up once per
// order for all of them. What `tape_series.f90` does for one.
#ifndef SEPARATRIX_TAPE_SERIES_HPP
#define SEPARATRIX_TAPE_SERIES_HPP

#include "tape_functions.hpp"
#include "tape_types.hpp"

namespace {

enum { orders = tape_order + 1 };

typedef vec series[orders];

// 1/k.
struct inverses {
  double of[orders];
  constexpr inverses() : of() {
    for (int k = 1; k < orders; k++)
      of[k] = 1.0 / k;
  }
  constexpr double operator[](int k) const { return of[k]; }
};

constexpr inverses inverse_of;

// Values of the nodes in the present order; series of those that later orders need; whether the switching
// functions are on their upper side.
struct tape_values {
  vec now[most_tape_nodes], first[most_tape_nodes], inverse[most_tape_nodes], slip;
  series of[most_tape_series];
  mask above[most_tape_switches];
};

// Sum of a(i) b(k - i), i = from ... k - until. In two parts, so that additions need not wait for each other.
template <int k, int from, int until> LANE_LEAF vec products(const vec *a, const vec *b) {
  vec even = 0, odd = 0;
#pragma GCC unroll 32
  for (int i = from; i <= k - until; i += 2) {
    even += a[i] * b[k - i];
    if (i < k - until)
      odd += a[i + 1] * b[k - i - 1];
  }
  return even + odd;
}

template <int k> LANE_LEAF vec square_term(const vec *a) {
  vec total = 0;
#pragma GCC unroll 32
  for (int i = 0; i < (k + 1) / 2; i++)
    total += a[i] * a[k - i];
  total += total;
  return k % 2 == 0 ? total + a[k / 2] * a[k / 2] : total;
}

// Sum of the terms of a node.
LANE_LEAF vec sum_of_terms(const tape_machine &m, const tape_node &n, const vec *factors, const vec *values) {
  const tape_term *term = &m.term[n.first];
  vec y = factors[term->factor] * values[term->node];
  for (int i = 1; i < n.second; i++)
    y += factors[term[i].factor] * values[term[i].node];
  return y;
}

// Value of a function at the state, and what its series is divided by.
inline vec function_value(const tape_node &n, vec a, const tape_values &t, vec &inverse) {
  vec y, other;
  switch (n.operation) {
  case tape_power:
    inverse = 1.0 / a;
    return growth(t.first[n.second] * logarithm_or_none(a));
  case tape_sqrt:
    y = square_root(a);
    inverse = 0.5 / y;
    return y;
  case tape_exp:
    return growth(a);
  case tape_log:
    inverse = 1.0 / a;
    return logarithm_or_none(a);
  case tape_sin:
  case tape_sin_even:
    sine_cosine(a, y, other);
    return y;
  case tape_cos:
  case tape_cos_even:
    sine_cosine(a, other, y);
    return y;
  case tape_tan:
    sine_cosine(a, y, other);
    return y / other;
  case tape_atan:
    inverse = 1.0 / t.first[n.second];
    return arc_tangent(a);
  case tape_sinh:
    return hyperbolic_sine(a);
  case tape_cosh:
    return hyperbolic_cosine(a);
  case tape_tanh:
    return hyperbolic_tangent(a);
  default:
    return n.value;
  }
}

// Value of a node at the state. Where a switching function crosses zero, `crossed` states its side.
inline vec value_of(const tape_machine &m, int i, const vec *z, vec slip, vec crossed, tape_values &t) {
  const tape_node &n = m.node[i];
  if (n.operation == tape_sum)
    return n.other < 0 ? sum_of_terms(m, n, t.first, t.first)
                       : sum_of_terms(m, n, t.first, t.first) + t.first[n.other];
  const vec &a = t.first[n.first], &b = t.first[n.second];
  switch (n.operation) {
  case tape_variable:
    return z[n.first];
  case tape_slip:
    return slip;
  case tape_add:
    return a + b;
  case tape_subtract:
    return a - b;
  case tape_multiply:
  case tape_scale:
    return a * b;
  case tape_divide:
  case tape_divide_steady:
    t.inverse[i] = vec(1.0) / b;
    return a / b;
  case tape_negative:
    return -a;
  case tape_square:
    return a * a;
  case tape_select: {
    const int s = int(n.value);
    t.above[s] = pick(magnitude(crossed) == s + 1.0, crossed > 0.0, t.first[n.other] > 0.0);
    return pick(t.above[s], a, b);
  }
  case tape_select_slip:
    return pick(slip > 0.0, a, b);
  default:
    return function_value(n, a, t, t.inverse[i]);
  }
}

// Values at the state of the nodes from one number on.
inline void evaluate(const tape_machine &m, int from, const vec *z, vec slip, vec crossed, tape_values &t) {
  t.slip = slip;
  for (int i = from; i < m.nodes; i++) {
    const tape_node &n = m.node[i];
    vec y = value_of(m, i, z, slip, crossed, t);
    t.first[i] = y;
    if (n.series >= 0)
      t.of[n.series][0] = y;
    if (n.slopes >= 0)
      t.of[n.slopes][0] = 0;
    if (i < m.varying) {
      t.now[i] = 0;
      for (int k = 1; n.series >= 0 && k < orders; k++)
        t.of[n.series][k] = 0;
    } else {
      t.now[i] = y;
    }
  }
}

// Coefficient k > 0 of a node from lower ones and those of its arguments; with `bounds` a bound of its
// magnitude from theirs.
template <int k, bool bounds> LANE_LEAF vec coefficient(const tape_machine &m, int i, tape_values &t) {
  const tape_node &n = m.node[i];
  if (n.operation == tape_sum)
    return sum_of_terms(m, n, t.first, t.now);
  const vec &a = t.now[n.first], &b = t.now[n.second];
  const series *of = t.of;
  auto less = [](vec x, vec y) { return bounds ? x + y : x - y; };
  switch (n.operation) {
  case tape_add:
    return a + b;
  case tape_subtract:
    return less(a, b);
  case tape_multiply:
    return products<k, 0, 0>(of[n.first_series], of[n.second_series]);
  case tape_scale:
    return t.first[n.first] * b;
  case tape_divide:
    return less(a, products<k, 0, 1>(of[n.series], of[n.second_series])) * t.inverse[i];
  case tape_divide_steady:
    return a * t.inverse[i];
  case tape_negative:
    return bounds ? a : -a;
  case tape_square:
    return square_term<k>(of[n.first_series]);
  case tape_sqrt:
    return less(a, products<k, 1, 1>(of[n.series], of[n.series])) * t.inverse[i];
  case tape_power:
    return less(t.first[n.second] * products<k, 1, 0>(of[n.first_series], of[n.series]),
                products<k, 1, 1>(of[n.second_series], of[n.slopes])) *
           inverse_of[k] * t.inverse[i];
  case tape_exp:
  case tape_sin:
  case tape_tan:
  case tape_sinh:
  case tape_cosh:
  case tape_tanh:
    return products<k, 1, 0>(of[n.first_series], of[n.second_series]) * inverse_of[k];
  case tape_cos:
    return products<k, 1, 0>(of[n.first_series], of[n.second_series]) *
           (bounds ? inverse_of[k] : -inverse_of[k]);
  case tape_sin_even:
    return of[n.first_series][1] * of[n.second_series][k - 1] * inverse_of[k];
  case tape_cos_even:
    return of[n.first_series][1] * of[n.second_series][k - 1] * (bounds ? inverse_of[k] : -inverse_of[k]);
  case tape_log:
  case tape_atan:
    return less(a, products<k, 1, 1>(of[n.slopes], of[n.second_series]) * inverse_of[k]) * t.inverse[i];
  case tape_select:
    return bounds ? larger(a, b) : pick(t.above[int(n.value)], a, b);
  case tape_select_slip:
    return pick(t.slip > 0.0, a, b);
  default:
    return 0;
  }
}

// Coefficients of the orders from k on; bounds go one order further. Loops whose length the compiler knows
// need no guesses of the processor.
template <int k, bool bounds> inline void raise_orders(const tape_machine &m, tape_values &t) {
  if constexpr (k < tape_order + bounds) {
    for (int i = m.varying; i < m.nodes; i++) {
      const tape_node &n = m.node[i];
      vec y = n.operation == tape_variable ? t.of[n.first][k] : coefficient<k, bounds>(m, i, t);
      t.now[i] = y;
      if (n.series >= 0)
        t.of[n.series][k] = y;
      if (n.slopes >= 0)
        t.of[n.slopes][k] = y * double(k);
    }
    if constexpr (k < tape_order)
      for (int i = 0; i < m.variables; i++)
        t.of[i][k + 1] = t.now[m.rate[i]] * (m.unit * inverse_of[k + 1]);
    raise_orders<k + 1, bounds>(m, t);
  }
}

// Series of the variables, and of all nodes whose series are kept, the last but one order included. `fresh`:
// nothing is known of numbers.
[[gnu::noinline]] inline void expand(const tape_machine &m, bool fresh, const vec *z, vec slip, vec crossed,
                                     tape_values &t) {
  evaluate(m, fresh ? 0 : m.by_slip, z, slip, crossed, t);
  for (int s = 0; s < m.switches; s++)
    t.of[m.decider_series[s]][tape_order] = 0;
  for (int i = 0; i < m.variables; i++)
    t.of[i][1] = t.first[m.rate[i]] * m.unit;
  raise_orders<1, false>(m, t);
}

} // namespace

#endif
