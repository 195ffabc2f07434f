// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// One certified step of every lane, to its first event: a turning point, an impact, or the end of the step.
// The section of a crank does not change the equations: lanes pass it within a step. That of a clock ends
// one.
#ifndef SEPARATRIX_TAPE_MOTION_HPP
#define SEPARATRIX_TAPE_MOTION_HPP

#include "tape_step.hpp"

namespace {

// The first event of the step: its fraction, 1 without one; that of the section of a crank in a step without
// one; which switching function crosses zero, as `crossed` of `tape_fields` has it. `unclear`: a shorter step
// may decide; `left`: the event loop is to.
struct tape_event {
  vec at, section, crosses;
  mask turns, hits, unclear, left;
};

// Whether the crank turns on all the time.
[[gnu::noinline]] inline mask turns_on(const tape_group &g) {
  const vec *w = g.p[tape_speed];
  vec least = w[0] - g.error[tape_speed];
  for (int k = 1; k < orders; k++)
    least -= magnitude(w[k]);
  mask on = least > 0.0;
  if (any(~on & (g.c.status == lane_flying)))
    on = on | (range_of(w).least > g.error[tape_speed]);
  return on;
}

// A function over the step, positive at first, or leaving zero where `from_zero`: it is divided by the
// fraction there. Whether it stays positive, or falls through zero once; else neither is proven.
struct tape_fall {
  series q;
  mask falls, stays;
};

[[gnu::noinline]] inline void find_fall(const vec *p, vec sign, mask from_zero, vec bound, mask flying,
                                        tape_fall &f) {
  const double n = tape_order;
  for (int k = 0; k < orders; k++)
    f.q[k] = sign * pick(from_zero, k < tape_order ? p[k + 1] : vec(0.0), p[k]);
  vec slope_bound = (n + 2) * bound, curve_bound = (n + 2) * (n + 1) * bound;
  // Where the first terms outweigh all others, these need no range.
  vec last = f.q[0] + f.q[1], rest = 0, rest_slope = 0;
  for (int k = 2; k < orders; k++) {
    last += f.q[k];
    rest += magnitude(f.q[k]);
    rest_slope += magnitude(f.q[k]) * double(k);
  }
  f.falls = (f.q[1] + rest_slope + slope_bound < 0.0) & (f.q[0] > bound) & (last < -bound);
  f.stays = f.q[0] - magnitude(f.q[1]) - rest > bound;
  if (!any(~(f.falls | f.stays) & flying))
    return;
  tape_range r = range_of(f.q);
  f.falls = ((r.most_slope + slope_bound < 0.0) | (r.most_curvature + curve_bound < 0.0)) & (f.q[0] > bound) &
            (r.last < -bound);
  f.stays = r.least > bound;
}

// Switching functions that cross zero before the event.
[[gnu::noinline]] inline void find_switches(const tape_machine &m, const tape_group &g, tape_event &e) {
  mask flying = g.c.status == lane_flying;
  const vec length = g.span / m.unit;
  for (int s = 0; s < m.switches; s++) {
    series p;
    vec power = 1, total = 0;
    for (int k = 0; k < orders; k++) {
      p[k] = g.t.of[m.decider_series[s]][k] * power;
      total += magnitude(p[k]);
      power *= length;
    }
    vec bound = m.proves ? g.decider_error[s] + (orders * 2.3e-16) * total : estimate * m.tolerance * total;
    vec sign = pick(g.t.above[s], 1.0, -1.0);
    tape_fall f;
    find_fall(p, sign, magnitude(g.s.crossed) == s + 1.0, bound, flying, f);
    e.unclear = e.unclear | ~(f.falls | f.stays);
    mask crosses = f.falls & flying & ~e.unclear;
    if (!any(crosses))
      continue;
    vec at = zero_of(f.q, 0, 1, crosses, 1, 2);
    // Two events at a time are left to the event loop.
    e.left = e.left | (crosses & (magnitude(at - e.at) < 1e-9) & (e.turns | e.hits | (e.crosses != 0.0)));
    crosses = crosses & (at < e.at);
    e.turns = e.turns & ~crosses;
    e.hits = e.hits & ~crosses;
    put(e.at, crosses, at);
    put(e.crosses, crosses, -(s + 1) * sign);
  }
}

[[gnu::noinline]] inline tape_event find_event(const tape_machine &m, mask open, const tape_group &g) {
  tape_event e;
  const vec *x = g.p[tape_x], *phase = g.p[tape_phase];
  mask flying = g.c.status == lane_flying;
  e.unclear = open;
  e.crosses = 0;
  if (!m.clock)
    e.unclear = e.unclear | ~turns_on(g);
  tape_fall f;
  if (m.turns_freely) {
    e.at = 1;
    e.turns = e.hits = e.left = mask{};
    if (m.switches > 0)
      find_switches(m, g, e);
    return e;
  }
  // Velocity in the direction of slip.
  find_fall(g.p[tape_v], g.s.slip, g.s.z[tape_v] == 0.0, g.error[tape_v], flying, f);
  e.unclear = e.unclear | ~(f.falls | f.stays);
  mask sure = ~e.unclear & flying;
  e.turns = f.falls & sure;
  // Up to there the position runs one way. A search for whatever comes in a lane: a turning point, else an
  // impact, else the section.
  vec stop = pick(g.s.slip > 0.0, m.upper, m.lower), one = 1;
  vec doubtful = g.error[tape_x] + 1e-15 * magnitude(stop), gap = g.s.slip * (stop - value_at(x, one));
  e.hits = sure & ~e.turns & (gap < -doubtful);
  mask section = sure & ~(e.turns | e.hits) & (value_at(phase, one) >= (m.clock ? infinite : two_pi));
  mask found = e.turns | e.hits | section;
  vec at = one;
  if (any(found)) {
    series q;
    for (int k = 0; k < orders; k++)
      q[k] = pick(e.turns, f.q[k], pick(e.hits, x[k], phase[k]));
    at = zero_of(q, pick(e.turns, 0, pick(e.hits, stop, two_pi)),
                 pick(e.turns, 1, pick(e.hits, -g.s.slip, -1)), found, one, one);
  }
  e.section = pick(section, at, -1);
  e.at = pick(section, one, at);
  if (any(e.turns)) {
    gap = pick(e.turns, g.s.slip * (stop - value_at(x, e.at)), gap);
    mask before = e.turns & (gap < -doubtful);
    if (any(before))
      e.at = zero_of(x, stop, -g.s.slip, before, e.at, e.at);
    e.hits = e.hits | before;
    e.turns = e.turns & ~before;
  }
  e.left = sure & ~e.hits & (gap <= doubtful);
  if (m.switches > 0)
    find_switches(m, g, e);
  return e;
}

// Whether friction lets the body go on from rest, and which way.
inline mask slips_on(vec force, vec level, vec &slip) {
  slip = pick(force > 0.0, 1.0, -1.0);
  vec size = magnitude(force);
  return size - level > doubt * (size + level);
}

// Whether impacts certainly do not end here, with `speed` after one, `push` against the stop, and the level
// of friction at rest.
inline mask bounces_on(const tape_machine &m, vec push, vec level, vec speed) {
  mask free = push < level * (1 - doubt) - doubt * magnitude(push);
  vec friction = m.level >= 0 ? level : vec(m.friction), out = push + friction, back = push - friction;
  vec height = 0.5 * m.mass * speed * speed / out;
  mask clear =
      (m.damping * speed + m.stiffness * height > least_change * back) & (height > least_height * m.length);
  mask rests_long = (vec(m.longest_rest) > 0.0) & (speed * m.mass > m.longest_rest * out) &
                    (height > least_height * m.length);
  return (speed > 0.0) & (free | clear | rests_long);
}

} // namespace

#endif
