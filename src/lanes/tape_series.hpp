// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Taylor series of all nodes of a tape, of many trajectories at once: an operation is looked up once per
// order for all of them. What `tape_series.f90` does for one.
#ifndef SEPARATRIX_TAPE_SERIES_HPP
#define SEPARATRIX_TAPE_SERIES_HPP

#include "tape_functions.hpp"
#include "tape_types.hpp"

#include <cstddef>

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

// Coefficients of the present order of the nodes without series; values of all at the state; series of those
// that later orders need; whether the switching functions are on their upper side; what is known of sums of
// the next order. `tape_program.f90` knows the order of the members.
struct tape_values {
  vec now[most_tape_nodes], first[most_tape_nodes], inverse[most_tape_nodes], slip;
  series of[most_tape_series];
  mask above[most_tape_switches];
  vec ahead[most_tape_nodes], ahead_too[most_tape_nodes];
};

static_assert(offsetof(tape_values, of) == (3 * most_tape_nodes + 1) * sizeof(vec), "as in tape_program.f90");

// Coefficient k of an operand.
LANE_LEAF vec coefficient_at(int k, const tape_values &t, const tape_operand &at) {
  return t.now[at.index + (at.moves & k)];
}

// Sum of a(i) b(k - i), i = 1 ... k - 1. Odd orders add up what is known of the next one, so that
// coefficients are loaded once for both: `ahead`.
LANE_LEAF vec inner_products(int k, const vec *a, const vec *b, vec &ahead) {
  if (k % 2 == 0)
    return k == 2 ? a[1] * b[1] : ahead + a[1] * b[k - 1] + a[k - 1] * b[1];
  vec now = 0, next = 0;
  if (k > 1) {
    vec before = b[k - 1];
    now = a[1] * before;
    for (int i = 2; i < k; i++) {
      vec here = b[k - i];
      now += a[i] * here;
      next += a[i] * before;
      before = here;
    }
  }
  ahead = next;
  return now;
}

// Sum of a(i) b(k - i), i = from ... k - until. The terms with what this order has just made come last.
template <int from, int until> LANE_LEAF vec products(int k, const vec *a, const vec *b, vec &ahead) {
  vec total = inner_products(k, a, b, ahead);
  if constexpr (from == 0)
    total += a[0] * b[k];
  if constexpr (until == 0)
    total += a[k] * b[0];
  return total;
}

LANE_LEAF vec square_term(int k, const vec *a, vec &ahead) {
  vec total;
  if (k % 2 == 0) {
    vec middle = a[k / 2] * a[k / 2];
    total = k == 2 ? middle : 2.0 * (ahead + a[1] * a[k - 1]) + middle;
  } else {
    vec next = 0, now = 0;
    if (k > 1) {
      vec before = a[k - 1];
      now = a[1] * before;
      for (int i = 2; i < (k + 1) / 2; i++) {
        vec here = a[k - i];
        now += a[i] * here;
        next += a[i] * before;
        before = here;
      }
    }
    ahead = next;
    total = now + now;
  }
  return total + (a[0] + a[0]) * a[k];
}

// Sum of the terms of a node at the state.
LANE_LEAF vec sum_of_terms(const tape_machine &m, const tape_node &n, const vec *values) {
  const tape_term *term = &m.term[n.first];
  vec y = values[term->factor] * values[term->node];
  for (int i = 1; i < n.second; i++)
    y += values[term[i].factor] * values[term[i].node];
  return n.other < 0 ? y : y + values[n.other];
}

// Coefficient k > 0 of the sum of `count` parts from number `first` on.
LANE_LEAF vec sum_of_parts(int k, const tape_machine &m, int first, int count, const tape_values &t) {
  const tape_term *term = &m.term[first];
  const tape_operand *part = &m.part[first];
  vec y = t.first[term->factor] * coefficient_at(k, t, *part);
  for (int i = 1; i < count; i++)
    y += t.first[term[i].factor] * coefficient_at(k, t, part[i]);
  return y;
}

// Sine and cosine of the node that either was taken of last (-1: none): mostly both are needed.
struct tape_circle {
  int of = -1;
  vec sine = 0, cosine = 0;
};

LANE_LEAF void turn_to(const tape_node &n, vec a, tape_circle &c) {
  if (c.of != n.first)
    sine_cosine(a, c.sine, c.cosine);
  c.of = n.first;
}

// Value of a function at the state, and what its series is divided by.
inline vec function_value(const tape_node &n, vec a, const tape_values &t, tape_circle &c, vec &inverse) {
  vec y;
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
    turn_to(n, a, c);
    return c.sine;
  case tape_cos:
  case tape_cos_even:
    turn_to(n, a, c);
    return c.cosine;
  case tape_tan:
    turn_to(n, a, c);
    return c.sine / c.cosine;
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
inline vec value_of(const tape_machine &m, int i, const vec *z, vec slip, vec crossed, tape_circle &c,
                    tape_values &t) {
  const tape_node &n = m.node[i];
  if (n.operation == tape_sum)
    return sum_of_terms(m, n, t.first);
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
    return function_value(n, a, t, c, t.inverse[i]);
  }
}

// Nothing follows the value of a node that does not vary.
inline void set_steady(const tape_node &n, int i, tape_values &t) {
  t.now[i] = 0;
  for (int k = 1; n.series >= 0 && k < orders; k++)
    t.of[n.series][k] = 0;
}

// Values at the state of the nodes from one number on, up to another.
inline void evaluate(const tape_machine &m, int from, int until, const vec *z, vec slip, vec crossed,
                     tape_values &t) {
  tape_circle c;
  t.slip = slip;
  for (int i = from; i < until; i++) {
    const tape_node &n = m.node[i];
    vec y = value_of(m, i, z, slip, crossed, c, t);
    t.first[i] = y;
    if (n.series >= 0)
      t.of[n.series][0] = y;
    if (n.slopes >= 0)
      t.of[n.slopes][0] = 0;
    if (i < m.varying)
      set_steady(n, i, t);
  }
}

// Series of sine and cosine of an argument that changes by `rate`; of bounds both are positive.
template <bool bounds> LANE_LEAF void raise_circular(vec rate, vec *sine, vec *cosine) {
#pragma GCC unroll 32
  for (int k = 1; k < tape_order + bounds; k++) {
    vec part = rate * inverse_of[k];
    sine[k] = part * cosine[k - 1];
    cosine[k] = (bounds ? part : -part) * sine[k - 1];
  }
}

// Series of what grows evenly, and of sines and cosines of that. `fresh`: none of them is set.
template <bool bounds> inline void raise_even(const tape_machine &m, bool fresh, tape_values &t) {
  for (int i = 0; i < m.evens; i++) {
    const tape_even &e = m.even[i];
    if (e.operation == tape_sin_even) {
      raise_circular<bounds>(t.of[e.slopes][1], t.of[e.series], t.of[e.other]);
      continue;
    }
    vec y = e.operation == tape_variable ? t.first[e.other] * m.unit
                                         : sum_of_parts(1, m, m.node[e.node].first, m.node[e.node].second, t);
    t.of[e.series][1] = y;
    if (e.slopes >= 0)
      t.of[e.slopes][1] = y;
    for (int k = 2; fresh && k < orders; k++) {
      t.of[e.series][k] = 0;
      if (e.slopes >= 0)
        t.of[e.slopes][k] = 0;
    }
  }
}

// Coefficient k > 0 of a node from lower ones and those of its arguments; with `bounds` a bound of its
// magnitude from theirs.
template <bool bounds>
LANE_LEAF vec coefficient(int k, const tape_machine &m, const tape_operation &n, tape_values &t) {
  const series *of = t.of;
  const vec &inverse = t.inverse[n.node];
  vec &ahead = t.ahead[n.node];
  auto a = [&] { return coefficient_at(k, t, n.a); };
  auto less = [](vec x, vec y) { return bounds ? x + y : x - y; };
  switch (n.operation) {
  case tape_sum:
    return sum_of_parts(k, m, n.first, n.count, t);
  case tape_add:
    return a() + coefficient_at(k, t, n.b);
  case tape_subtract:
    return less(a(), coefficient_at(k, t, n.b));
  case tape_multiply:
    return products<0, 0>(k, of[n.first], of[n.second], ahead);
  case tape_scale:
    return t.first[n.steady] * coefficient_at(k, t, n.b);
  case tape_divide:
    return less(a(), products<0, 1>(k, of[n.own], of[n.second], ahead)) * inverse;
  case tape_divide_steady:
    return a() * inverse;
  case tape_negative:
    return bounds ? a() : -a();
  case tape_square:
    return square_term(k, of[n.first], ahead);
  case tape_sqrt:
    return less(a(), products<1, 1>(k, of[n.own], of[n.own], ahead)) * inverse;
  case tape_power:
    return less(t.first[n.steady] * products<1, 0>(k, of[n.first], of[n.own], ahead),
                products<1, 1>(k, of[n.second], of[n.slopes], t.ahead_too[n.node])) *
           inverse_of[k] * inverse;
  case tape_exp:
  case tape_sin:
  case tape_tan:
  case tape_sinh:
  case tape_cosh:
  case tape_tanh:
    return products<1, 0>(k, of[n.first], of[n.second], ahead) * inverse_of[k];
  case tape_cos:
    return products<1, 0>(k, of[n.first], of[n.second], ahead) * (bounds ? inverse_of[k] : -inverse_of[k]);
  case tape_sin_even:
    return of[n.first][1] * of[n.second][k - 1] * inverse_of[k];
  case tape_cos_even:
    return of[n.first][1] * of[n.second][k - 1] * (bounds ? inverse_of[k] : -inverse_of[k]);
  case tape_log:
  case tape_atan:
    return less(a(), products<1, 1>(k, of[n.slopes], of[n.second], ahead) * inverse_of[k]) * inverse;
  case tape_select:
    return bounds ? larger(a(), coefficient_at(k, t, n.b))
                  : pick(t.above[n.steady], a(), coefficient_at(k, t, n.b));
  case tape_select_slip:
    return pick(t.slip > 0.0, a(), coefficient_at(k, t, n.b));
  default:
    return 0;
  }
}

// Coefficient k > 0 of the rate of a variable that varies.
LANE_LEAF vec rate_at(int k, const tape_change &c, const tape_values &t) {
  vec y = coefficient_at(k, t, c.from);
  return c.factor < 0 ? y : t.first[c.factor] * y;
}

LANE_LEAF void set_coefficient(const tape_change &c, vec *of, series *all, int k, vec y) {
  of[k] = y;
  if (c.slopes >= 0)
    all[c.slopes][k] = y * double(k);
}

// Coefficients of the orders from k on; bounds go one order further. Loops whose length the compiler knows
// need no guesses of the processor.
template <bool bounds> LANE_LEAF void raise_orders(const tape_machine &m, tape_values &t) {
  for (int k = 1; k < tape_order + bounds; k++) {
    for (const tape_operation *n = m.operation; n != m.operation + m.operations; n++) {
      vec y = coefficient<bounds>(k, m, *n, t);
      t.now[n->to.index + (n->to.moves & k)] = y;
      if (n->slopes >= 0)
        t.of[n->slopes][k] = y * double(k);
    }
    for (int i = 0; i < m.variables && k < tape_order; i++)
      if (m.change[i].from.index >= 0)
        set_coefficient(m.change[i], t.of[i], t.of, k + 1,
                        rate_at(k, m.change[i], t) * (m.unit * inverse_of[k + 1]));
  }
}

// The same of all orders above the first from the values at the state. `fresh`: nothing is known yet.
template <bool bounds> LANE_LEAF void raise_all(const tape_machine &m, bool fresh, tape_values &t) {
  for (int i = 0; i < m.variables; i++)
    if (m.change[i].from.index >= 0)
      set_coefficient(m.change[i], t.of[i], t.of, 1, t.first[m.rate[i]] * m.unit);
  raise_even<bounds>(m, fresh, t);
  raise_orders<bounds>(m, t);
}

// Series of the variables, and of all nodes whose series are kept, the last but one order included. `fresh`:
// nothing is known of numbers.
[[gnu::noinline]] inline void expand(const tape_machine &m, bool fresh, const vec *z, vec slip, vec crossed,
                                     tape_values &t) {
  evaluate(m, fresh ? 0 : m.by_slip, m.nodes, z, slip, crossed, t);
  for (int s = 0; s < m.switches; s++)
    t.of[m.decider_series[s]][tape_order] = 0;
  raise_all<false>(m, fresh, t);
}

} // namespace

#endif
