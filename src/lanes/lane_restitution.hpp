// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Restitution that changes with the impact speed.
#ifndef SEPARATRIX_LANE_RESTITUTION_HPP
#define SEPARATRIX_LANE_RESTITUTION_HPP

#include "lane_elementary.hpp"
#include "lane_types.hpp"

namespace {

// Value of a curve; as `value_at` of `curve_law.f90`.
LANE_DEVICE inline vec curve_at(const lane_curve &c, vec x) {
  const int last = int(c.count) - 1;
  vec from = c.at[0], width = c.at[1] - c.at[0], left = c.value[0], right = c.value[1], start = c.slope[0],
      end = c.slope[1];
  for (int i = 1; i < last; i++) {
    mask beyond = x >= c.at[i];
    put(from, beyond, c.at[i]);
    put(width, beyond, c.at[i + 1] - c.at[i]);
    put(left, beyond, c.value[i]);
    put(right, beyond, c.value[i + 1]);
    put(start, beyond, c.slope[i]);
    put(end, beyond, c.slope[i + 1]);
  }
  vec s = (x - from) / width, r = 1.0 - s;
  vec value = left * r * r * (1.0 + 2.0 * s) + right * s * s * (3.0 - 2.0 * s) +
              width * s * r * (start * r - end * s);
  put(value, x <= c.at[0], c.value[0]);
  put(value, x >= c.at[last], c.value[last]);
  return value;
}

// Restitution of a machine of one body, or of a joint, at an impact speed w; as `restitution_at` of
// `contact_law.f90`.
template <class contact> LANE_DEVICE inline vec restitution_at(const contact &m, vec w) {
  vec k = m.restitution;
  if (m.restitution_law == linear_restitution) {
    k = m.restitution - m.coefficients[0] * w;
    put(k, k < 0.0, vec{});
  } else if (m.restitution_law == power_restitution) {
    vec triggered = k * exponential(-m.coefficients[1] * logarithm(w / m.coefficients[0]));
    put(k, w > m.coefficients[0], triggered);
  } else if (m.restitution_law == viscoelastic_restitution) {
    vec root = exponential(logarithm(w) / 5.0);
    vec triggered = 1.0 - m.coefficients[0] * root + m.coefficients[1] * (root * root);
    put(triggered, triggered < 0.0, vec{});
    put(k, w > 2.2250738585072014e-308, pick(triggered < 1.0, triggered, 1));
  }
  if (m.restitution_law == curve_restitution) {
    k = k + curve_at(m.curve, w);
    put(k, k < 0.0, vec{});
    put(k, k > 1.0, vec(1.0));
  }
  return k;
}

} // namespace

#endif
