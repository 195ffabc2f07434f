// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// By how much lanes of multibody structures miss their stops: the gaps where they stop closing.
#ifndef SEPARATRIX_STRUCTURE_MISSES_HPP
#define SEPARATRIX_STRUCTURE_MISSES_HPP

#include "structure_modes.hpp"

namespace {

enum { most_approaches = 20 };

// A least gap is good to this share of itself; a step shorter than this share of a panel is the last; a rate
// that has dropped to this share is none.
const double miss_share = 1e-10, last_step = 1e-12, rest_share = 1e-12;

// A gap and its first three derivatives at the time t since the start of the flight.
struct gap_derivatives {
  vec t, gap, rate, curl, bend;
};

// The gap of joint j on `side` at the time t.
template <class size>
inline gap_derivatives gap_at(const structure_machine &m, const size &z, const structure_group &g, int j,
                              int side, vec t) {
  structure_bases b;
  outlook o;
  bases_at(m, z, g, t, b);
  functions_at(m, z, g, b, o);
  const double away = -side;
  return {t, away * (o.f[j] - (side > 0 ? g.high[j] : g.low[j])), away * o.f1[j], away * o.f2[j],
          away * o.f3[j]};
}

inline void put(gap_derivatives &to, mask where, const gap_derivatives &from) {
  put(to.t, where, from.t);
  put(to.gap, where, from.gap);
  put(to.rate, where, from.rate);
  put(to.curl, where, from.curl);
  put(to.bend, where, from.bend);
}

// Between two instants at which the rate of a gap, or its curvature, has opposite signs: where it is zero.
template <bool of_rate, class size>
inline gap_derivatives turning_gap(const structure_machine &m, const size &z, const structure_group &g,
                                   mask asked, int j, int side, gap_derivatives low, gap_derivatives high) {
  const vec y0 = of_rate ? low.rate : low.curl, y1 = of_rate ? high.rate : high.curl;
  vec share = y0 / (y0 - y1), from = low.t, to = high.t;
  vec t = from + (to - from) * pick(share < 0.05, 0.05, pick(share > 0.95, 0.95, share));
  gap_derivatives at = low;
  for (int round = 0; round < most_approaches && any(asked); round++) {
    gap_derivatives now = gap_at(m, z, g, j, side, t);
    put(at, asked, now);
    if (of_rate)
      asked = asked & (magnitude(now.rate) * (to - from) > miss_share * magnitude(now.gap));
    vec y = of_rate ? now.rate : now.curl;
    mask below = pick(y0 < 0.0, y < 0.0, y >= 0.0);
    put(from, below, t);
    put(to, ~below, t);
    vec next = t - y / (of_rate ? now.curl : now.bend);
    next = pick((next > from) & (next < to), next, 0.5 * (from + to));
    asked = asked & (magnitude(next - t) > last_step * (high.t - low.t));
    t = next;
  }
  return at;
}

// A rate that is none: a slide that ends there has left rounding.
inline vec at_rest(const gap_derivatives &from, const gap_derivatives &to) {
  return rest_share * (magnitude(from.rate) + (to.t - from.t) * magnitude(from.curl));
}

// Notes the gaps of the lanes `asked` that stop closing between two instants.
template <class size>
inline void note_least(const structure_machine &m, const size &z, mask asked, int j, int side,
                       const gap_derivatives &from, const gap_derivatives &to, structure_group &g) {
  // Where friction holds what the contact is between, rates are rounding.
  const double none = m.joint[j].tie * m.drive_frequency;
  mask turns = asked & (from.rate < -none) & (to.rate >= -at_rest(from, to));
  if (!any(turns))
    return;
  mask inside = turns & (to.rate > 0.0);
  vec gap = to.gap;
  if (any(inside))
    put(gap, inside, turning_gap<true>(m, z, g, inside, j, side, from, to).gap);
  gap = pick(gap < 0.0, 0, gap);
  put(g.c.margin, turns & (gap < g.c.margin), gap);
}

// Notes by how much the lanes `passed` miss stops between `start` and `end` of a panel, with their functions
// there: as `note_misses` of guard_search.f90.
template <class size>
inline void note_misses(const structure_machine &m, const size &z, mask passed, vec start, vec end,
                        const outlook &here, const outlook &far, structure_group &g) {
  for (int j = 0; j < z.joints; j++)
    for (int side = -1; side <= 1; side += 2) {
      if (m.joint[j].slides > 0.5 || !has_limit(m, z, g, passed, j, side))
        continue;
      const vec limit = side > 0 ? g.high[j] : g.low[j];
      const double away = -side;
      gap_derivatives from = {start, away * (here.f[j] - limit), away * here.f1[j], away * here.f2[j],
                              away * here.f3[j]};
      gap_derivatives to = {end, away * (far.f[j] - limit), away * far.f1[j], away * far.f2[j],
                            away * far.f3[j]};
      mask open = passed & (g.s.phase[j] == 0.0);
      mask bends = open & (from.curl * to.curl < 0.0) & ((from.rate < 0.0) | (to.rate >= -at_rest(from, to)));
      gap_derivatives middle = to;
      if (any(bends))
        put(middle, bends, turning_gap<false>(m, z, g, bends, j, side, from, to));
      note_least(m, z, open, j, side, from, middle, g);
      note_least(m, z, bends, j, side, middle, to, g);
    }
}

} // namespace

#endif
