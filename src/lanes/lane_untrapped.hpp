// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Floating-point exceptions while lanes fly.
#ifndef SEPARATRIX_LANE_UNTRAPPED_HPP
#define SEPARATRIX_LANE_UNTRAPPED_HPP

#include <cfenv>

namespace {

// Lanes that a step does not concern hold any value, so that exceptions mean nothing: a build that traps them
// goes on.
struct untrapped {
  std::fenv_t held;
  const bool trapping = fegetexcept() != 0;
  untrapped() {
    if (trapping)
      std::feholdexcept(&held);
  }
  ~untrapped() {
    if (trapping)
      std::fesetenv(&held);
  }
};

} // namespace

#endif
