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
  const int n = m.clock ? m.variables - 2 : m.variables - 1;
  vec found = 0;
  for (int r = batch.regions - 1; r >= 0; r--) {
    const tape_region &region = batch.region[r];
    vec d[most_tape_section], square = 0;
    for (int i = 0; i < n; i++) {
      const int of = m.clock || i < 2 ? tape_x + i : i == 2 ? int(tape_speed) : i + 1;
      d[i] = (z[of] - region.point[i]) * region.scaling[i];
    }
    for (int j = 0; j < n; j++)
      for (int k = 0; k <= j; k++)
        square += (j == k ? 1 : 2) * region.metric[j * (j + 1) / 2 + k] * d[j] * d[k];
    put(found, square <= region.reach, region.attractor);
  }
  return found;
}

// Time and phase of a drive, and the sign of slip where that is no event, of lanes whose state has changed.
inline void set_clock(const tape_machine &m, mask moved, tape_group &g) {
  put(g.s.z[0], moved, g.s.origin + g.s.time);
  put(g.s.z[1], moved, g.s.time * m.phase_speed);
  if (m.turns_freely)
    put(g.s.slip, moved, pick(g.s.z[tape_v] < 0.0, -1, 1));
}

// Lanes that come to the time where they are to stop, with variables `z`. At the end of a period the clock
// starts anew, and those that need not stop pass; see `stop_or_pass`. Returns the lanes that stop.
inline mask stop_or_pass_clock(const tape_machine &m, const tape_batch &batch, mask there, const vec *z,
                               tape_group &g) {
  mask section = there & (g.c.until >= m.period);
  vec reached = attractors_reached(m, batch, z);
  mask passing = section & (g.c.sections > 0.5) & (magnitude(z[tape_x]) <= m.domain) &
                 ((reached < 0.5) | (g.c.leaves < 0.5));
  passing = batch.complete ? passing : mask{};
  mask stops = there & ~passing;
  put(g.s.origin, section, g.s.origin + (m.clock == 2 ? m.period : 0));
  put(g.c.elapsed, passing, g.c.elapsed + m.period);
  put(g.c.reached, passing, reached);
  put(g.c.settled, passing, pick(reached < 0.5, -1, pick(g.c.settled < 0.0, g.c.elapsed, g.c.settled)));
  put(g.c.sections, passing, g.c.sections - 1.0);
  put(g.c.flights, there, g.c.flights + 1.0);
  put(g.c.status, stops, lane_stopped);
  put(g.s.time, stops, pick(section, 0, g.c.until));
  for (int i = tape_x; i < m.variables; i++)
    put(g.s.z[i], stops, z[i]);
  set_clock(m, stops, g);
  return stops;
}

// Where the lanes come to the time of their stop before an event, the step ends there. The lanes that go on,
// at a time `after` the section.
[[gnu::noinline]] inline mask pass_clock(const tape_machine &m, const tape_batch &batch, mask moves,
                                         tape_event &e, vec *end, vec &after, tape_group &g) {
  vec cross = (g.c.until - g.s.time) / g.span, z[most_tape_variables];
  mask there = moves & (cross <= e.at);
  after = g.s.time + e.at * g.span;
  if (!any(there))
    return moves;
  mask cut = there & (e.turns | e.hits | e.left | (e.crosses != 0.0));
  for (int i = tape_x; i < m.variables; i++) {
    z[i] = variable_at(m, g, i, cross);
    put(end[i], cut, z[i]);
  }
  put(e.at, cut, cross);
  put(e.crosses, cut, 0);
  e.turns = e.turns & ~cut;
  e.hits = e.hits & ~cut;
  e.left = e.left & ~cut;
  put(after, there, (e.at - cross) * g.span);
  return moves & ~stop_or_pass_clock(m, batch, there, z, g);
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

// Values that events need: nodes come after those that they are made of.
inline void evaluate_for_events(const tape_machine &m, const vec *z, vec slip, tape_values &t) {
  int last = m.hold;
  const int others[] = {m.level, m.bounce, m.throws};
  for (int node : others)
    last = node > last ? node : last;
  evaluate(m, m.by_slip, last + 1, z, slip, 0, t);
}

// What an impact throws the speed of the phase by, and the velocity after it.
inline vec bounce(const tape_machine &m, const tape_event &e, vec *end, tape_group &g) {
  vec before = end[tape_v], restitution = m.restitution;
  if (m.bounce >= 0 || m.throws >= 0)
    evaluate_for_events(m, end, g.s.slip, g.t);
  if (m.bounce >= 0)
    restitution = g.t.first[m.bounce];
  vec after = pick((restitution >= 0.0) & (restitution <= 1.0), before * -restitution, undefined);
  if (m.throws >= 0)
    put(end[tape_speed], e.hits, end[tape_speed] + g.t.first[m.throws] * m.throw_factor * (after - before));
  return after;
}

// What acts on the body at rest at the end of the step, what holds it, and which way it then slips, if it
// does so for either sign of slip where branches depend on that.
inline mask forces_at_rest(const tape_machine &m, const vec *end, tape_group &g, vec &force, vec &level,
                           vec &slip) {
  level = m.hold_level;
  mask moves = ~mask{};
  vec same = 0;
  for (int sign = m.branches_by_slip ? -1 : 1; sign <= 1; sign += 2) {
    evaluate_for_events(m, end, g.s.slip * double(sign), g.t);
    force = g.t.first[m.hold];
    if (m.level >= 0)
      level = g.t.first[m.level];
    moves = moves & slips_on(force, level, slip);
    if (sign < 0 || !m.branches_by_slip)
      same = slip;
  }
  return moves & (same == slip);
}

// What the events of a step do; the lanes that are left to the event loop.
[[gnu::noinline]] inline mask take_events(const tape_machine &m, const tape_event &e, vec *end, vec &slip,
                                          tape_group &g) {
  mask left = e.left;
  slip = g.s.slip;
  if (!any(e.turns | e.hits))
    return left;
  vec before = end[tape_v], after = 0, force, level, next;
  if (any(e.hits)) {
    put(end[tape_x], e.hits, pick(g.s.slip > 0.0, m.upper, m.lower));
    after = bounce(m, e, end, g);
    if (m.throws >= 0)
      left = left | (e.hits & ~(end[tape_speed] > 0.0));
  }
  put(end[tape_v], e.turns | e.hits, 0);
  mask moves = forces_at_rest(m, end, g, force, level, next);
  vec gap = pick(slip > 0.0, m.upper - end[tape_x], end[tape_x] - m.lower);
  left = left | (e.turns & ~(moves & (next != slip) & (gap > 0.0)));
  put(g.c.margin, e.turns & ~left, smaller(g.c.margin, gap));
  left = left | (e.hits & ~bounces_on(m, slip * force, level, magnitude(after)));
  put(end[tape_v], e.hits, after);
  put(slip, e.turns | e.hits, -slip);
  mask counts = e.hits & ~left;
  put(g.c.impacts, counts, g.c.impacts + 1.0);
  put(g.c.last_speed, counts, magnitude(before));
  put(g.c.speed_sum, counts, g.c.speed_sum + magnitude(before));
  return left;
}

// Length of the next step, in units; `natural`: by the last coefficients.
inline vec next_length(const tape_machine &m, const tape_group &g, vec natural) {
  vec left_time = (g.c.until - g.s.time) / m.unit;
  if (m.passes)
    put(left_time, (g.c.sections > 0.5) & (g.c.until >= m.period), left_time + 0.5 * (m.period / m.unit));
  return smaller(smaller(natural * g.s.proven, left_time), g.s.limit);
}

// Bodies that come to rest where friction does not hold them: the event loop ends their motion.
inline mask comes_to_rest(const tape_machine &m, const tape_group &g) {
  const double slow = 1e5 * m.hold_level / m.mass;
  return (magnitude(g.t.first[m.rate[tape_v]]) <= slow) & (magnitude(g.s.z[tape_v]) <= slow * m.unit);
}

// Lanes that fly on through a step, with the state at its end; those that are left, or try a shorter one, go
// no further.
inline mask move(const tape_machine &m, const tape_event &e, vec natural, vec *end, mask &left,
                 tape_group &g) {
  mask flying = g.c.status == lane_flying, unclear = flying & e.unclear;
  put(g.s.limit, unclear, 0.5 * (g.span / m.unit));
  left = (unclear & ~(g.s.limit >= shortest_share * natural)) | (g.c.flights >= g.c.budget);
  mask moves = flying & ~unclear & ~left, finite = moves;
  if (m.clock) {
    vec time = e.at * g.span;
    end[0] = g.s.z[0] + time;
    end[1] = g.s.z[1] + time * m.phase_speed;
  }
  for (int i = m.clock ? int(tape_x) : 0; i < m.variables; i++) {
    end[i] = variable_at(m, g, i, e.at);
    finite = finite & (magnitude(end[i]) < 1e300);
  }
  left = left | (moves & ~finite);
  return moves & finite;
}

// The end of a step of the lanes with a crank; those that do not stop at the section, whose state is there
// already.
inline mask end_step(const tape_machine &m, const tape_batch &batch, mask moves, const tape_event &e,
                     mask to_end, vec *end, tape_group &g) {
  mask past = moves & (end[tape_phase] >= two_pi);
  put(g.s.time, moves & ~past, g.s.time + e.at * g.span);
  if (any(past))
    pass_section(m, batch, past, e.at, e.section, end, g);
  moves = moves & (g.c.status == lane_flying);
  mask ends = moves & to_end & ~(e.turns | e.hits) & (e.crosses == 0.0);
  put(g.s.time, ends, g.c.until);
  put(g.c.status, ends, lane_stopped);
  put(g.c.flights, ends, g.c.flights + 1.0);
  return moves;
}

// One step of the lanes that are flying.
inline void step(const tape_machine &m, const tape_batch &batch, bool fresh, tape_group &g) {
  mask flying = g.c.status == lane_flying, left;
  expand(m, fresh, g.s.z, g.s.slip, g.s.crossed, g.t);
  vec natural = natural_length(m, g), end[most_tape_variables], slip, after;
  mask rests = m.turns_freely ? comes_to_rest(m, g) : mask{};
  vec length = next_length(m, g, natural);
  mask open = m.proves ? prove_step(m, natural, length, g) : take_length(m, length, g);
  mask to_end = flying & (g.span >= g.c.until - g.s.time);
  tape_event e = find_event(m, open, g);
  mask moves = move(m, e, natural, end, left, g);
  left = left | (moves & rests);
  moves = moves & ~rests;
  e.turns = e.turns & moves;
  e.hits = e.hits & moves;
  e.left = e.left & moves;
  if (m.clock)
    moves = pass_clock(m, batch, moves, e, end, after, g);
  left = left | take_events(m, e, end, slip, g);
  moves = moves & ~left;
  put(g.c.status, flying & left, lane_left);
  put(g.s.limit, moves, 1e300);
  put(g.s.crossed, moves, e.crosses);
  put(g.c.flights, moves & (e.turns | e.hits), g.c.flights + 1.0);
  if (!m.clock)
    moves = end_step(m, batch, moves, e, to_end, end, g);
  put(g.s.slip, moves, slip);
  for (int i = m.clock ? int(tape_x) : 0; i < m.variables; i++)
    put(g.s.z[i], moves, end[i]);
  if (m.clock) {
    put(g.s.time, moves, after);
    set_clock(m, moves, g);
  }
}

// Lanes of a vector that are in one batch, and batches that fly at once.
const int in_batch = lanes, piece = vec_size < in_batch ? vec_size : in_batch,
          batches_at_once = vec_size / piece;
static_assert(batches_at_once * piece == vec_size && batches_at_once <= 2, "as separatrix_fly_tape has them");

// Copies the lanes of a group from batches to vectors, or back; the first lane is number `first` of its
// batch.
struct tape_exchange {
  lane_batch *const *control;
  tape_batch *const *batch;
  int first;

  template <bool in> void run(tape_group &g) const {
    for (int part = 0; part < batches_at_once; part++) {
      auto copy = [&](double *lane, vec &all) {
        double *vector = (double *)&all + part * piece;
        memcpy(in ? vector : lane + first, in ? lane + first : vector, sizeof(double[piece]));
      };
      g.c.exchange(control[part]->fields, copy);
      double *fields = (double *)&batch[part]->fields;
      for (int i = 0; i < tape_members; i++)
        copy(fields + i * lanes, *((vec *)&g.s + i));
    }
  }
};

// The lanes of `batches_at_once` batches, of which the first knows where they can converge to.
inline void fly_tape(const tape_machine &m, lane_batch *const *control, tape_batch *const *batch) {
  for (int first = 0; first < lanes; first += piece) {
    const tape_exchange here = {control, batch, first};
    tape_group g;
    here.run<true>(g);
    mask sent = (g.c.status == lane_fresh) | (g.c.status == lane_flying);
    if (!any(sent))
      continue;
    put(g.c.status, sent, lane_flying);
    g.box_is_set = false;
    for (bool fresh = true; !any(sent & (g.c.status != lane_flying)); fresh = false)
      step(m, *batch[0], fresh, g);
    here.run<false>(g);
  }
}

} // namespace

#define SEPARATRIX_TAPE_KERNEL(name)                                                                         \
  extern "C" void name(const tape_machine *m, lane_batch *const *control, tape_batch *const *batch) {        \
    fly_tape(*m, control, batch);                                                                            \
  }

#endif
