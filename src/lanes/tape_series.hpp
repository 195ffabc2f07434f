// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Taylor series of all nodes of a tape, of many trajectories at once: an operation is looked up once per
// order for all of them. What `tape_series.f90` does for one.
#ifndef SEPARATRIX_TAPE_SERIES_HPP
#define SEPARATRIX_TAPE_SERIES_HPP

#include "lane_elementary.hpp"
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

// Values of the nodes in the present order; series of those that later orders need.
struct tape_values {
  vec now[most_tape_nodes], first[most_tape_nodes], inverse[most_tape_nodes];
  series of[most_tape_series];
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

// Values at the state of the nodes from one number on.
inline void evaluate(const tape_machine &m, int from, const vec *z, vec slip, tape_values &t) {
  for (int i = from; i < m.nodes; i++) {
    const tape_node &n = m.node[i];
    const vec &a = t.first[n.first], &b = t.first[n.second];
    vec y, other;
    switch (n.operation) {
    case tape_variable:
      y = z[n.first];
      break;
    case tape_slip:
      y = slip;
      break;
    case tape_add:
      y = a + b;
      break;
    case tape_subtract:
      y = a - b;
      break;
    case tape_multiply:
    case tape_scale:
      y = a * b;
      break;
    case tape_divide:
    case tape_divide_steady:
      t.inverse[i] = vec(1.0) / b;
      y = a / b;
      break;
    case tape_negative:
      y = -a;
      break;
    case tape_square:
      y = a * a;
      break;
    case tape_sqrt:
      y = square_root(a);
      t.inverse[i] = 0.5 / y;
      break;
    case tape_exp:
      y = exponential(a);
      break;
    case tape_log:
      y = logarithm(a);
      t.inverse[i] = vec(1.0) / a;
      break;
    case tape_sin:
      sine_cosine(a, y, other);
      break;
    case tape_cos:
      sine_cosine(a, other, y);
      break;
    default:
      y = n.value;
    }
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

// Coefficient k > 0 of a node from lower ones and those of its arguments.
template <int k> LANE_LEAF vec coefficient(const tape_node &n, int i, tape_values &t) {
  const vec &a = t.now[n.first], &b = t.now[n.second];
  switch (n.operation) {
  case tape_add:
    return a + b;
  case tape_subtract:
    return a - b;
  case tape_multiply:
    return products<k, 0, 0>(t.of[n.first_series], t.of[n.second_series]);
  case tape_scale:
    return t.first[n.first] * b;
  case tape_divide:
    return (a - products<k, 0, 1>(t.of[n.series], t.of[n.second_series])) * t.inverse[i];
  case tape_divide_steady:
    return a * t.inverse[i];
  case tape_negative:
    return -a;
  case tape_square:
    return square_term<k>(t.of[n.first_series]);
  case tape_sqrt:
    return (a - products<k, 1, 1>(t.of[n.series], t.of[n.series])) * t.inverse[i];
  case tape_exp:
  case tape_sin:
    return products<k, 1, 0>(t.of[n.first_series], t.of[n.second_series]) * inverse_of[k];
  case tape_cos:
    return products<k, 1, 0>(t.of[n.first_series], t.of[n.second_series]) * -inverse_of[k];
  case tape_log:
    return (a - products<k, 1, 1>(t.of[n.slopes], t.of[n.second_series]) * inverse_of[k]) * t.inverse[i];
  default:
    return 0;
  }
}

// Coefficients of the orders from k on. Loops whose length the compiler knows need no guesses of the
// processor.
template <int k> inline void raise_orders(const tape_machine &m, tape_values &t) {
  if constexpr (k < tape_order) {
    for (int i = m.varying; i < m.nodes; i++) {
      const tape_node &n = m.node[i];
      vec y = n.operation == tape_variable ? t.of[n.first][k] : coefficient<k>(n, i, t);
      t.now[i] = y;
      if (n.series >= 0)
        t.of[n.series][k] = y;
      if (n.slopes >= 0)
        t.of[n.slopes][k] = y * double(k);
    }
    for (int i = 0; i < m.variables; i++)
      t.of[i][k + 1] = t.now[m.rate[i]] * (m.unit * inverse_of[k + 1]);
    raise_orders<k + 1>(m, t);
  }
}

// Series of the variables, and of all nodes whose series are kept, the last but one order included. `fresh`:
// nothing is known of numbers.
[[gnu::noinline]] inline void expand(const tape_machine &m, bool fresh, const vec *z, vec slip,
                                     tape_values &t) {
  evaluate(m, fresh ? 0 : m.by_slip, z, slip, t);
  t.of[m.hold][tape_order] = 0;
  if (m.throws >= 0)
    t.of[m.throws][tape_order] = 0;
  for (int i = 0; i < m.variables; i++)
    t.of[i][1] = t.first[m.rate[i]] * m.unit;
  raise_orders<1>(m, t);
}

} // namespace

#endif
