// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The length of a step of every lane, and what its series leave out.
#ifndef SEPARATRIX_TAPE_STEP_HPP
#define SEPARATRIX_TAPE_STEP_HPP

#include "tape_search.hpp"

namespace {

const double two_pi = 6.283185307179586;
// Remainders are bounded a little above, and stay inside the box with it; shares of forces and speeds within
// which the event loop decides.
const double above = 1.01, inside = 1 + 2e-8, doubt = 1e-11;
// Shortest step, as a part of that by the last coefficients.
const double shortest_share = 1e-3;
// Share of its magnitude by which a variable may leave the range of its polynomial, and the part of it that a
// remainder is to have; the part of a step below which it is tried again; how steps grow at most.
const double range_share = 1e-8, margin_part = 0.3, least_part = 0.3, most_growth = 2;
// What a step leaves out, in last terms, where that is not proven; change of a node beyond what its series
// shows, in that and as a share of its value, above which a step is shortened; by how much, and how often.
const double estimate = 10, most_shown = 3, change_share = 1e-12, most_lost = 0.9, shorter = 0.6;
const int most_shortenings = 12;
// Least change of the push of a stop, as its share, over a bounce that chatter does not end with; ten times
// that of the event loop. Least height of such a bounce, as a share of the length.
const double least_change = 1e-5, least_height = 1e-12;

// Of what controls lanes, the part that a tape's use.
struct tape_control {
  vec status, until, flights, impacts, speed_sum, last_speed, margin, sections, budget, leaves, elapsed,
      reached, settled;

  template <class each> void exchange(lane_fields<double[lanes]> &f, each move) {
    move(f.status, status);
    move(f.until, until);
    move(f.flights, flights);
    move(f.impacts, impacts);
    move(f.speed_sum, speed_sum);
    move(f.last_speed, last_speed);
    move(f.margin, margin);
    move(f.sections, sections);
    move(f.budget, budget);
    move(f.leaves, leaves);
    move(f.elapsed, elapsed);
    move(f.reached, reached);
    move(f.settled, settled);
  }
};

struct tape_group {
  tape_control c;
  tape_fields<vec> s;
  tape_values t;
  tape_box box;
  // The box knows the numbers.
  bool box_is_set;
  // Of the step: its length [s], the variables over it, bounds of their errors and of those of switching
  // functions.
  vec span;
  series p[most_tape_variables];
  vec error[most_tape_variables], decider_error[most_tape_switches];
};

// Number of the first of `count` rising sizes above `need`, or of the last, for every lane.
inline vec find_size(const double *sizes, int count, vec need) {
  vec found = 0;
  for (int i = 0; i < count - 1; i++)
    found += pick(need < sizes[i], 0, 1);
  return found;
}

inline vec by_box(const double *table, int stride, const int *box) {
  double out[vec_size];
  for (int i = 0; i < vec_size; i++)
    out[i] = table[box[i] * stride];
  vec y;
  memcpy(&y, out, sizeof y);
  return y;
}

// Length of the step by the last two coefficients, three where nothing is proven, in units.
[[gnu::noinline]] inline vec natural_length(const tape_machine &m, const tape_group &g) {
  vec reach = 30;
  for (int i = m.clock ? int(tape_x) : 0; i < m.variables; i++) {
    vec size = rough_logarithm(larger(magnitude(g.s.z[i]), m.sizes[i]) * m.tolerance);
    for (int k = tape_order - (m.proves ? 1 : 2); k <= tape_order; k++)
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

// A step as far as it is proven: its length in units, and bounds of what the series leave out.
struct tape_proof {
  vec length, rest[most_tape_variables];
};

// By the table of boxes, for steps up to `length`; the length is 0 where none holds the motion.
inline void look_up(const tape_machine &m, vec length, const vec *size, tape_proof &proof) {
  vec need = 0, speed = m.clock ? vec(0) : size[tape_speed] * (inside / m.box[tape_speed]);
  for (int i = tape_x; i < m.variables; i++)
    need = larger(need, size[i] * (inside / m.box[i]));
  vec number = find_size(m.speed, tape_speeds, speed) * double(tape_levels) +
               find_size(m.level_size, tape_levels, need);
  double numbers[vec_size];
  int box[vec_size];
  memcpy(numbers, &number, sizeof number);
  for (int i = 0; i < vec_size; i++)
    box[i] = int(numbers[i]);
  vec longest = by_box(m.longest, 1, box);
  mask held = (need < m.level_size[tape_levels - 1]) & (longest > 0.0);
  if (!m.clock)
    held = held & (size[tape_phase] < 2 * two_pi) & (speed < m.speed[tape_speeds - 1]);
  proof.length = pick(held, smaller(length, longest), 0);
  vec share = proof.length / longest, shrink = above;
  for (int k = 0; k < orders; k++)
    shrink *= share;
  for (int i = 0; i < m.variables; i++)
    proof.rest[i] = by_box(&m.remainder[0][i], most_tape_variables, box) * shrink;
}

// By bounds over the range of each motion's own polynomials, which are those over a step of `length`.
[[gnu::noinline]] inline void prove_by_bounds(const tape_machine &m, vec length, tape_group &g,
                                              tape_proof &proof, vec &growth) {
  interval range[most_tape_variables];
  vec margin[most_tape_variables];
  for (int i = 0; i < m.variables; i++) {
    range[i] = bounds_of(g.p[i]);
    margin[i] = range_share * most_of(range[i]) + 1e-70;
    range[i] = {range[i].low - margin[i], range[i].high + margin[i]};
  }
  mask sound = bound_series(m, !g.box_is_set, range, g.t, g.box);
  g.box_is_set = true;
  vec power = above, excess = 1e-60;
  for (int k = 0; k < orders; k++)
    power *= length;
  for (int i = 0; i < m.variables; i++) {
    proof.rest[i] = 0;
    if (m.change[i].from.index >= 0)
      proof.rest[i] = rate_at(tape_order, m.change[i], g.box.series) * (power * (m.unit / orders));
    excess = larger(excess, proof.rest[i] / margin[i]);
  }
  sound = sound & (excess < 1e150);
  growth = rough_exponential((rough_logarithm(margin_part) - rough_logarithm(excess)) / double(orders));
  vec part = smaller(growth, 1);
  sound = sound & (part > least_part);
  vec shrink = 1;
  for (int k = 0; k < orders; k++)
    shrink *= part;
  proof.length = pick(sound, part * length, 0);
  growth = pick(sound, growth, least_part);
  for (int i = 0; i < m.variables; i++)
    proof.rest[i] *= shrink;
  power = above * proof.length;
  for (int k = 1; k < tape_order; k++)
    power *= proof.length;
  for (int i = 0; i < m.switches; i++)
    g.decider_error[i] = g.box.series.of[m.decider_series[i]][tape_order] * power;
}

// A variable at a fraction of the step.
inline vec variable_at(const tape_machine &m, const tape_group &g, int i, vec fraction) {
  return m.turns_freely ? value_at(g.t.of[i], fraction * (g.span / m.unit)) : value_at(g.p[i], fraction);
}

// What a series changes by over a step, at most.
inline vec change_of(const vec *c, vec length) {
  vec y = 0;
  for (int k = tape_order - 1; k > 0; k--)
    y = (y + magnitude(c[k])) * length;
  return y;
}

// Where a function has values, over the range of its argument in the step, that its series does not show: the
// series of a function that is nearly constant here knows nothing of a change nearby. A divisor must not lose
// most of its size, nor must the argument of a root, a power or a logarithm: far from a corner that these
// round, they are a straight line.
[[gnu::noinline]] inline mask hides_change(const tape_machine &m, vec length, const tape_group &g) {
  mask hides = {};
  for (int i = 0; i < m.checks; i++) {
    const tape_check &check = m.check[i];
    const tape_node &n = m.node[check.node];
    vec room = change_of(g.t.of[check.argument], length);
    const vec &at = g.t.first[n.operation == tape_divide ? n.second : n.first];
    if (check.own < 0) {
      hides = hides | ~(room <= most_lost * magnitude(at));
      continue;
    }
    vec value = g.t.first[check.node], inverse;
    mask sound = {};
    interval y = bounds_of_function(n, {at - room, at + room}, g.box, inverse, sound);
    vec change = larger(y.high - value, value - y.low);
    vec shown = most_shown * change_of(g.t.of[check.own], length) + change_share * magnitude(value);
    hides = hides | ~(change <= shown);
  }
  return hides;
}

// The variables over a step up to `length`, in units, with estimates of their errors; the lanes whose step
// has to be shorter still.
[[gnu::noinline]] inline mask take_length(const tape_machine &m, vec length, tape_group &g) {
  vec size[most_tape_variables];
  mask flying = g.c.status == lane_flying, open = {};
  for (int i = 0; i < most_shortenings && m.checks > 0; i++) {
    open = flying & hides_change(m, length, g);
    if (!any(open))
      break;
    put(length, open, shorter * length);
  }
  if (!m.turns_freely)
    set_variables(m, length, size, g);
  g.span = length * m.unit;
  for (int i = 0; i < m.variables; i++)
    g.error[i] = estimate * m.tolerance * larger(magnitude(g.s.z[i]), m.sizes[i]);
  return open;
}

// The variables over a step up to `length`, in units, as far as it is proven, with bounds of their errors;
// the lanes where a shorter one is to be tried. Where the table of boxes is short of most of the length, the
// motion's own bounds serve.
[[gnu::noinline]] inline mask prove_step(const tape_machine &m, vec natural, vec length, tape_group &g) {
  vec size[most_tape_variables], growth;
  tape_proof proof = {}, own;
  set_variables(m, length, size, g);
  mask flying = g.c.status == lane_flying, needs = flying;
  if (m.switches == 0) {
    look_up(m, length, size, proof);
    needs = flying & (proof.length < 0.7 * length);
  }
  put(g.s.proven, flying & ~needs, smaller(most_growth * g.s.proven, 1));
  if (any(needs)) {
    prove_by_bounds(m, length, g, own, growth);
    put(g.s.proven, needs, smaller(length / natural * smaller(growth, most_growth), 1));
    mask better = needs & (own.length > proof.length);
    put(proof.length, better, own.length);
    for (int i = 0; i < m.variables; i++)
      put(proof.rest[i], better, own.rest[i]);
  }
  mask open = flying & ~(proof.length > 0.0);
  put(proof.length, open, length);
  if (any(flying & (proof.length < length)))
    set_variables(m, proof.length, size, g);
  g.span = proof.length * m.unit;
  for (int i = 0; i < m.variables; i++)
    g.error[i] = proof.rest[i] + (orders * 2.3e-16) * size[i];
  return open;
}

} // namespace

#endif
