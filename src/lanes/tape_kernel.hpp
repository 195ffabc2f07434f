// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Certified Taylor flight of many trajectories at once, of a body whose equations are a tape, from event to
// event. What happens rarely is left to the event loop, from the start of the step on.
#ifndef SEPARATRIX_TAPE_KERNEL_HPP
#define SEPARATRIX_TAPE_KERNEL_HPP

#include "tape_motion.hpp"

namespace {

enum { tape_members = sizeof(tape_batch::fields) / sizeof(double[lanes]) };

// Attractors at whose points the lanes are on the section, with x, v and further variables; 0 = none.
inline vec attractors_reached(const tape_machine &m, const tape_batch &batch, const vec *z) {
  const int n = m.variables - 1;
  vec found = 0;
  for (int r = batch.regions - 1; r >= 0; r--) {
    const tape_region &region = batch.region[r];
    vec d[most_tape_section], square = 0;
    for (int i = 0; i < n; i++) {
      const int of = i < 2 ? tape_x + i : i == 2 ? int(tape_speed) : i + 1;
      d[i] = (z[of] - region.point[i]) * region.scaling[i];
    }
    for (int j = 0; j < n; j++)
      for (int k = 0; k <= j; k++)
        square += (j == k ? 1 : 2) * region.metric[j * (j + 1) / 2 + k] * d[j] * d[k];
    put(found, square <= region.reach, region.attractor);
  }
  return found;
}

// Past the section, or up to it where a lane stops there; `cross` is its fraction of whole steps.
[[gnu::noinline]] inline void pass_section(const tape_machine &m, const tape_batch &batch, mask past, vec at,
                                           vec cross, vec *end, tape_group &g) {
  mask again = past & (cross < 0.0);
  if (any(again))
    cross = zero_of(g.p[tape_phase], two_pi, -1, again, at, cross);
  vec there[most_tape_variables], when = g.s.time + cross * g.span;
  for (int i = 0; i < m.variables; i++)
    there[i] = value_at(g.p[i], cross);
  there[tape_phase] = 0;
  vec reached = batch.complete ? attractors_reached(m, batch, there) : vec(0.0);
  mask stops = batch.complete ? past & (reached > 0.5) & (g.c.leaves > 0.5) : past;
  mask goes = past & ~stops;
  put(g.c.flights, past, g.c.flights + 1.0);
  put(g.s.lasted, stops, when);
  put(g.s.passed, stops, 1);
  put(g.c.status, stops, lane_stopped);
  for (int i = 0; i < m.variables; i++)
    put(g.s.z[i], stops, there[i]);
  put(g.s.time, stops, 0);
  put(g.c.elapsed, goes, g.c.elapsed + (when - g.s.since));
  put(g.s.since, goes, 0);
  put(g.c.until, goes, g.s.phase_end - g.c.elapsed);
  put(g.c.reached, goes, reached);
  put(g.c.settled, goes, pick(reached < 0.5, -1, pick(g.c.settled < 0.0, g.c.elapsed, g.c.settled)));
  put(g.s.time, goes, (at - cross) * g.span);
  put(end[tape_phase], goes, end[tape_phase] - two_pi);
}

// What the events of a step do; the lanes that are left to the event loop.
[[gnu::noinline]] inline mask take_events(const tape_machine &m, tape_event &e, vec *end, vec &slip,
                                          tape_group &g) {
  vec force = value_at(g.t.of[m.hold], e.at * (g.span / m.unit)), next;
  mask left = e.left;
  slip = g.s.slip;
  if (any(e.turns)) {
    mask moves = slips_on(m, force, next);
    vec gap = pick(slip > 0.0, m.upper - end[tape_x], end[tape_x] - m.lower);
    left = left | (e.turns & ~(moves & (next != slip) & (gap > 0.0)));
    put(end[tape_v], e.turns, 0);
    put(g.c.margin, e.turns & ~left, smaller(g.c.margin, gap));
    put(slip, e.turns, next);
  }
  if (any(e.hits)) {
    vec before = end[tape_v], after = before * -m.restitution;
    left = left | (e.hits & ~bounces_on(m, g.s.slip * force, magnitude(after)));
    put(end[tape_x], e.hits, pick(g.s.slip > 0.0, m.upper, m.lower));
    put(end[tape_v], e.hits, after);
    if (m.throws >= 0) {
      vec thrown = value_at(g.t.of[m.throws], e.at * (g.span / m.unit)) * m.throw_factor * (after - before);
      put(end[tape_speed], e.hits, end[tape_speed] + thrown);
      left = left | (e.hits & ~(end[tape_speed] > 0.0));
    }
    put(slip, e.hits, -g.s.slip);
    mask counts = e.hits & ~left;
    put(g.c.impacts, counts, g.c.impacts + 1.0);
    put(g.c.last_speed, counts, magnitude(before));
    put(g.c.speed_sum, counts, g.c.speed_sum + magnitude(before));
  }
  return left;
}

// One step of the lanes that are flying.
inline void step(const tape_machine &m, const tape_batch &batch, bool fresh, tape_group &g) {
  mask flying = g.c.status == lane_flying;
  expand(m, fresh, g.s.z, g.s.slip, g.t);
  vec natural = natural_length(m, g), left_time = (g.c.until - g.s.time) / m.unit;
  vec length = smaller(smaller(natural, left_time), g.s.limit);
  mask left = prove_step(m, length, g);
  mask to_end = flying & (g.span >= g.c.until - g.s.time);
  tape_event e = find_event(m, g);
  mask unclear = flying & e.unclear & ~left;
  put(g.s.limit, unclear, 0.5 * (g.span / m.unit));
  left = left | (unclear & ~(g.s.limit >= shortest_share * natural)) | (g.c.flights >= g.c.budget);
  mask moves = flying & ~unclear & ~left;
  vec end[most_tape_variables], slip;
  for (int i = 0; i < m.variables; i++)
    end[i] = value_at(g.p[i], e.at);
  mask finite = moves;
  for (int i = 0; i < m.variables; i++)
    finite = finite & (magnitude(end[i]) < 1e300);
  left = left | (moves & ~finite);
  e.turns = e.turns & moves;
  e.hits = e.hits & moves;
  e.left = e.left & moves;
  left = left | take_events(m, e, end, slip, g);
  moves = moves & ~left;
  put(g.c.status, flying & left, lane_left);
  put(g.s.limit, moves, 1e300);
  mask past = moves & (end[tape_phase] >= two_pi);
  put(g.s.time, moves & ~past, g.s.time + e.at * g.span);
  if (any(past))
    pass_section(m, batch, past, e.at, e.section, end, g);
  moves = moves & (g.c.status == lane_flying);
  mask ends = moves & to_end & ~(e.turns | e.hits);
  put(g.s.time, ends, g.c.until);
  put(g.c.status, ends, lane_stopped);
  put(g.c.flights, moves & (ends | e.turns | e.hits), g.c.flights + 1.0);
  put(g.s.slip, moves, slip);
  for (int i = 0; i < m.variables; i++)
    put(g.s.z[i], moves, end[i]);
}

inline void fly_tape(const tape_machine &m, lane_batch &control, tape_batch &batch) {
  for (int first = 0; first < lanes; first += vec_size) {
    tape_group g;
    g.c.exchange(control.fields, first, [](const double *from, vec &to) { memcpy(&to, from, sizeof to); });
    mask sent = (g.c.status == lane_fresh) | (g.c.status == lane_flying);
    if (!any(sent))
      continue;
    put(g.c.status, sent, lane_flying);
    for (int i = 0; i < tape_members; i++)
      memcpy((vec *)&g.s + i, (const double *)&batch.fields + i * lanes + first, sizeof(vec));
    for (bool fresh = true; !any(sent & (g.c.status != lane_flying)); fresh = false)
      step(m, batch, fresh, g);
    g.c.exchange(control.fields, first, [](double *to, const vec &from) { memcpy(to, &from, sizeof from); });
    for (int i = 0; i < tape_members; i++)
      memcpy((double *)&batch.fields + i * lanes + first, (const vec *)&g.s + i, sizeof(vec));
  }
}

} // namespace

#define SEPARATRIX_TAPE_KERNEL(name)                                                                         \
  extern "C" void name(const tape_machine *m, lane_batch *control, tape_batch *batch) {                      \
    fly_tape(*m, *control, *batch);                                                                          \
  }

#endif
