// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Restitution that changes with the impact speed.
#ifndef SEPARATRIX_LANE_RESTITUTION_HPP
#define SEPARATRIX_LANE_RESTITUTION_HPP

#include "lane_types.hpp"
#include "lane_vectors.hpp"

namespace {

// Restitution at an impact speed w; as `restitution_at` of `contact_law.f90`.
inline vec restitution_at(const lane_machine &m, vec w) {
  vec k = m.restitution;
  if (m.restitution_law == linear_restitution) {
    k = m.restitution - m.coefficients[0] * w;
    put(k, k < 0.0, vec{});
  } else if (m.restitution_law == power_restitution) {
    vec fallen = k * exponential(-m.coefficients[1] * logarithm(w / m.coefficients[0]));
    put(k, w > m.coefficients[0], fallen);
  } else if (m.restitution_law == viscoelastic_restitution) {
    vec root = exponential(logarithm(w) / 5.0);
    vec fallen = 1.0 - m.coefficients[0] * root + m.coefficients[1] * (root * root);
    put(fallen, fallen < 0.0, vec{});
    put(k, w > 2.2250738585072014e-308, pick(fallen < 1.0, fallen, 1));
  }
  return k;
}

} // namespace

#endif
