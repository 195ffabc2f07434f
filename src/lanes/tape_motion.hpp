// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// One certified step of every lane, to its first event: a turning point, an impact, or the end of the step.
// The section does not change the equations: lanes pass it within a step.
#ifndef SEPARATRIX_TAPE_MOTION_HPP
#define SEPARATRIX_TAPE_MOTION_HPP

#include "tape_search.hpp"

namespace {

const double two_pi = 6.283185307179586;
// Remainders are bounded a little above; shares of forces and speeds within which the event loop decides.
const double above = 1.01, doubt = 1e-11;
// Shortest step, as a part of that by the last coefficients.
const double shortest_share = 1e-3;
// Least change of the push of a stop, as its share, over a bounce that chatter does not end with; ten times
// that of the event loop. Least height of such a bounce, as a share of the length.
const double least_change = 1e-5, least_height = 1e-12;

// Of what controls lanes, the part that a tape's use.
struct tape_control {
  vec status, until, flights, impacts, speed_sum, last_speed, margin, budget, leaves, elapsed, reached, settled;

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

// The same for every lane: no lane looks at another.
inline vec by_level(const double *table, int stride, const int *level) {
  double out[vec_size];
  for (int i = 0; i < vec_size; i++)
    out[i] = table[level[i] * stride];
  vec y;
  memcpy(&y, out, sizeof y);
  return y;
}

// Length of the step by the last two coefficients, in units.
inline vec natural_length(const tape_machine &m, const tape_group &g) {
  vec reach = 30;
  for (int i = 0; i < m.variables; i++) {
    vec size = rough_logarithm(larger(magnitude(g.s.z[i]), m.sizes[i]) * m.tolerance);
    for (int k = tape_order - 1; k <= tape_order; k++)
      reach = smaller(reach, (size - rough_logarithm(magnitude(g.t.of[i][k]))) / double(k));
  }
  return rough_exponential(reach);
}

// Sets the variables over the step, shortened to what is proven; the lanes that no box holds.
inline mask prove_step(const tape_machine &m, vec length, tape_group &g) {
  vec need = 0;
  for (int i = 0; i < m.variables; i++) {
    if (i == tape_phase)
      continue;
    vec total = 0, power = 1;
    for (int k = 0; k < orders; k++) {
      total += magnitude(g.t.of[i][k]) * power;
      power *= length;
    }
    need = larger(need, total / m.box[0][i]);
  }
  double needs[vec_size];
  int level[vec_size];
  memcpy(needs, &need, sizeof need);
  for (int i = 0; i < vec_size; i++) {
    level[i] = 0;
    while (level[i] < tape_levels - 1 && !(needs[i] * m.box[0][tape_speed] < 0.999 * m.box[level[i]][tape_speed]))
      level[i]++;
  }
  mask lost = ~(need * m.box[0][tape_speed] < 0.999 * m.box[tape_levels - 1][tape_speed]);
  vec longest = by_level(m.longest, 1, level);
  length = smaller(length, longest);
  g.span = length * m.unit;
  vec share = length / longest, shrink = 1;
  for (int k = 0; k < orders; k++)
    shrink *= share;
  for (int i = 0; i < m.variables; i++) {
    vec power = 1, total = 0;
    for (int k = 0; k < orders; k++) {
      g.p[i][k] = g.t.of[i][k] * power;
      total += magnitude(g.p[i][k]) * double(k + 1);
      power *= length;
    }
    g.error[i] = by_level(&m.remainder[0][i], most_tape_variables, level) * shrink * above + 2.3e-16 * total;
  }
  return lost;
}

// The first turning point or impact of the step: its fraction, 1 without one. `unclear`: a shorter step may
// decide; `left`: the event loop is to.
struct tape_event {
  vec at;
  mask turns, hits, unclear, left;
};

inline tape_event find_event(const tape_machine &m, const tape_group &g) {
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
  mask falls = ((r.most_slope + slope_bound < 0.0) | (r.most_curvature + curve_bound < 0.0)) & (q[0] > bound) &
               (r.last < -bound);
  e.unclear = e.unclear | ~(falls | (r.least > bound));
  e.turns = falls & ~e.unclear & (g.c.status == lane_flying);
  e.at = any(e.turns) ? zero_of(q, 0, 1, e.turns, 1) : vec(1.0);
  // Up to there the position runs one way.
  vec stop = pick(g.s.slip > 0.0, m.upper, m.lower);
  vec end = any(e.turns) ? value_at(x, e.at) : value_at(x, 1);
  vec gap = g.s.slip * (stop - end), doubtful = g.error[tape_x] + 1e-15 * magnitude(stop);
  e.hits = (gap < -doubtful) & ~e.unclear & (g.c.status == lane_flying);
  e.left = ~e.hits & (gap <= doubtful) & ~e.unclear;
  if (any(e.hits))
    e.at = zero_of(x, stop, -g.s.slip, e.hits, e.at);
  e.turns = e.turns & ~e.hits;
  return e;
}

// Whether friction lets the body go on from rest, and which way.
inline mask slips_on(const tape_machine &m, vec force, vec &slip) {
  slip = pick(force > 0.0, 1.0, -1.0);
  vec size = magnitude(force);
  return size - m.level > doubt * (size + m.level);
}

// Whether impacts certainly do not end here, with `speed` after one and `push` against the stop.
inline mask bounces_on(const tape_machine &m, vec push, vec speed) {
  mask free = push < m.level * (1 - doubt) - doubt * magnitude(push);
  vec out = push + m.friction, back = push - m.friction;
  vec height = 0.5 * m.mass * speed * speed / out;
  mask clear = (m.damping * speed + m.stiffness * height > least_change * back) &
               (height > least_height * m.length);
  return (speed > 0.0) & (free | clear);
}

} // namespace

#endif
