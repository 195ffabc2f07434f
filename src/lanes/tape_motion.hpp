// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// One certified step of every lane, to its first event: a turning point, an impact, or the end of the step.
// The section does not change the equations: lanes pass it within a step.
#ifndef SEPARATRIX_TAPE_MOTION_HPP
#define SEPARATRIX_TAPE_MOTION_HPP

#include "tape_search.hpp"

namespace {

const double two_pi = 6.283185307179586;
// Remainders are bounded a little above, and stay inside the box with it; shares of forces and speeds within
// which the event loop decides.
const double above = 1.01, inside = 1 + 2e-8, doubt = 1e-11;
// Shortest step, as a part of that by the last coefficients.
const double shortest_share = 1e-3;
// Least change of the push of a stop, as its share, over a bounce that chatter does not end with; ten times
// that of the event loop. Least height of such a bounce, as a share of the length.
const double least_change = 1e-5, least_height = 1e-12;

// Of what controls lanes, the part that a tape's use.
struct tape_control {
  vec status, until, flights, impacts, speed_sum, last_speed, margin, budget, leaves, elapsed, reached,
      settled;

  template <class each> void exchange(lane_fields<double[lanes]> &f, int first, each move) {
    move(&f.status[first], status);
    move(&f.until[first], until);
    move(&f.flights[first], flights);
    move(&f.impacts[first], impacts);
    move(&f.speed_sum[first], speed_sum);
    move(&f.last_speed[first], last_speed);
    move(&f.margin[first], margin);
    move(&f.budget[first], budget);
    move(&f.leaves[first], leaves);
    move(&f.elapsed[first], elapsed);
    move(&f.reached[first], reached);
    move(&f.settled[first], settled);
  }
};

struct tape_group {
  tape_control c;
  tape_fields<vec> s;
  tape_values t;
  // Of the step: its length [s], the variables over it, bounds of their errors.
  vec span;
  series p[most_tape_variables];
  vec error[most_tape_variables];
};

// Number of the first of `count` sizes above `need`, or of the last, for every lane.
inline void find_size(const double *sizes, int count, vec need, int *found) {
  double needs[vec_size];
  memcpy(needs, &need, sizeof need);
  for (int i = 0; i < vec_size; i++) {
    found[i] = 0;
    while (found[i] < count - 1 && !(needs[i] < sizes[found[i]]))
      found[i]++;
  }
}

inline vec by_box(const double *table, int stride, const int *box) {
  double out[vec_size];
  for (int i = 0; i < vec_size; i++)
    out[i] = table[box[i] * stride];
  vec y;
  memcpy(&y, out, sizeof y);
  return y;
}

// Length of the step by the last two coefficients, in units.
[[gnu::noinline]] inline vec natural_length(const tape_machine &m, const tape_group &g) {
  vec reach = 30;
  for (int i = 0; i < m.variables; i++) {
    vec size = rough_logarithm(larger(magnitude(g.s.z[i]), m.sizes[i]) * m.tolerance);
    for (int k = tape_order - 1; k <= tape_order; k++)
      reach = smaller(reach, (size - rough_logarithm(magnitude(g.t.of[i][k]))) / double(k));
  }
  return rough_exponential(reach);
}

// Sets the variables over a step of `length`, in units; `size`: bounds of their magnitudes.
inline void set_variables(const tape_machine &m, vec length, vec *size, tape_group &g) {
  series power;
  power[0] = 1;
  for (int k = 1; k < orders; k++)
    power[k] = power[k - 1] * length;
  for (int i = 0; i < m.variables; i++) {
    vec total = 0;
    for (int k = 0; k < orders; k++) {
      g.p[i][k] = g.t.of[i][k] * power[k];
      total += magnitude(g.p[i][k]);
    }
    size[i] = total;
  }
}

// The same, shortened to what is proven; the lanes that no box holds.
[[gnu::noinline]] inline mask prove_step(const tape_machine &m, vec length, tape_group &g) {
  vec size[most_tape_variables];
  set_variables(m, length, size, g);
  vec need = 0, speed = size[tape_speed] * (inside / m.box[tape_speed]);
  for (int i = tape_x; i < m.variables; i++)
    need = larger(need, size[i] * (inside / m.box[i]));
  int box[vec_size], level[vec_size];
  find_size(m.speed, tape_speeds, speed, box);
  find_size(m.level_size, tape_levels, need, level);
  for (int i = 0; i < vec_size; i++)
    box[i] = box[i] * tape_levels + level[i];
  vec longest = by_box(m.longest, 1, box);
  mask lost = ~((size[tape_phase] < 2 * two_pi) & (speed < m.speed[tape_speeds - 1]) &
                (need < m.level_size[tape_levels - 1]) & (longest > 0.0));
  if (any(length > longest)) {
    length = smaller(length, longest);
    set_variables(m, length, size, g);
  }
  g.span = length * m.unit;
  vec share = length / longest, shrink = above;
  for (int k = 0; k < orders; k++)
    shrink *= share;
  for (int i = 0; i < m.variables; i++)
    g.error[i] = by_box(&m.remainder[0][i], most_tape_variables, box) * shrink + (orders * 2.3e-16) * size[i];
  return lost;
}

// The first turning point or impact of the step: its fraction, 1 without one; that of the section in a step
// without one. `unclear`: a shorter step may
// decide; `left`: the event loop is to.
struct tape_event {
  vec at, section;
  mask turns, hits, unclear, left;
};

[[gnu::noinline]] inline tape_event find_event(const tape_machine &m, const tape_group &g) {
  const double n = tape_order;
  tape_event e;
  const vec *w = g.p[tape_speed], *v = g.p[tape_v], *x = g.p[tape_x];
  // The phase runs on.
  vec least = w[0] - g.error[tape_speed];
  for (int k = 1; k < orders; k++)
    least -= magnitude(w[k]);
  e.unclear = ~(least > 0.0);
  if (any(e.unclear & (g.c.status == lane_flying)))
    e.unclear = e.unclear & ~(range_of(w).least > g.error[tape_speed]);
  // Velocity in the direction of slip; a zero at the start is divided out.
  mask from_rest = g.s.z[tape_v] == 0.0;
  series q;
  for (int k = 0; k < orders; k++)
    q[k] = g.s.slip * pick(from_rest, k < tape_order ? v[k + 1] : vec(0.0), v[k]);
  tape_range r = range_of(q);
  vec bound = g.error[tape_v], slope_bound = (n + 2) * bound, curve_bound = (n + 2) * (n + 1) * bound;
  mask falls = ((r.most_slope + slope_bound < 0.0) | (r.most_curvature + curve_bound < 0.0)) &
               (q[0] > bound) & (r.last < -bound);
  e.unclear = e.unclear | ~(falls | (r.least > bound));
  mask sure = ~e.unclear & (g.c.status == lane_flying);
  e.turns = falls & sure;
  // Up to there the position runs one way. A search for whatever comes in a lane: a turning point, else an
  // impact, else the section.
  const vec *phase = g.p[tape_phase];
  vec stop = pick(g.s.slip > 0.0, m.upper, m.lower), one = 1;
  vec doubtful = g.error[tape_x] + 1e-15 * magnitude(stop), gap = g.s.slip * (stop - value_at(x, one));
  e.hits = sure & ~e.turns & (gap < -doubtful);
  mask section = sure & ~(e.turns | e.hits) & (value_at(phase, one) >= two_pi);
  mask found = e.turns | e.hits | section;
  vec at = one;
  if (any(found)) {
    for (int k = 0; k < orders; k++)
      q[k] = pick(e.turns, q[k], pick(e.hits, x[k], phase[k]));
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
  return e;
}

// Whether friction lets the body go on from rest, and which way.
inline mask slips_on(const tape_machine &m, vec force, vec &slip) {
  slip = pick(force > 0.0, 1.0, -1.0);
  vec size = magnitude(force);
  return size - m.hold_level > doubt * (size + m.hold_level);
}

// Whether impacts certainly do not end here, with `speed` after one and `push` against the stop.
inline mask bounces_on(const tape_machine &m, vec push, vec speed) {
  mask free = push < m.hold_level * (1 - doubt) - doubt * magnitude(push);
  vec out = push + m.friction, back = push - m.friction;
  vec height = 0.5 * m.mass * speed * speed / out;
  mask clear =
      (m.damping * speed + m.stiffness * height > least_change * back) & (height > least_height * m.length);
  return (speed > 0.0) & (free | clear);
}

} // namespace

#endif
