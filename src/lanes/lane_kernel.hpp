// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Exact flight for many bodies at once. Between events x = equilibrium + periodic response + Im(exp(lambda s)
// Z)/w_d, lambda = -g + i w_d. All lanes of a vector look for the end of their flights together: Householder
// steps of fourth order from the duration of the last flight in that direction, one or two evaluations each
// in a settled motion. What was found is then proven to be the first event: the velocity has no zero on the
// way, because the Bernstein coefficients of its Hermite interpolant between the two ends, less the bound on
// the interpolation error, are positive. While the velocity keeps its sign the position is monotone, so no
// barrier is missed either. What is rare (sticking, slow impacts, a proof that does not succeed) is left to
// the scalar code.
#ifndef SEPARATRIX_LANE_KERNEL_HPP
#define SEPARATRIX_LANE_KERNEL_HPP

#include "lane_layer.hpp"

namespace {

enum { most_rounds = 10, most_pieces = 8 };

// Are the Bernstein coefficients c of degree 6, or those of both halves, positive within?
inline mask all_positive(const vec (&c)[7]) {
  mask plain = (c[1] > 0.0) & (c[2] > 0.0) & (c[3] > 0.0) & (c[4] > 0.0) & (c[5] > 0.0);
  vec d[7];
  mask halved = ~mask{};
  for (int i = 0; i < 7; i++)
    d[i] = c[i];
  for (int level = 1; level <= 6; level++) {
    for (int i = 0; i <= 6 - level; i++)
      d[i] = 0.5 * (d[i] + d[i + 1]);
    halved = halved & (d[0] > 0.0) & (d[6 - level] > 0.0);
  }
  return plain | halved;
}

// Is w > 0 strictly between two times `span` apart? From w, w' and w'' at both and a bound on |w^(6)|: the
// error of the quintic through them is at most bound s^3 (span - s)^3/720.
inline mask positive_between(vec span, vec w0, vec rate0, vec curl0, vec w1, vec rate1, vec curl1,
                             vec bound) {
  vec step = 0.2 * span, bend = 0.05 * span * span, cube = span * span * span;
  vec b1 = w0 + step * rate0, b2 = w0 + 2 * step * rate0 + bend * curl0;
  vec b4 = w1 - step * rate1, b3 = w1 - 2 * step * rate1 + bend * curl1;
  vec error = bound * (cube * cube) * (1.0 / 14400);
  const vec c[7] = {w0,
                    (w0 + 5 * b1) * (1.0 / 6),
                    (b1 + 2 * b2) * (1.0 / 3),
                    0.5 * (b2 + b3) - error,
                    (2 * b3 + b4) * (1.0 / 3),
                    (5 * b4 + w1) * (1.0 / 6),
                    w1};
  return all_positive(c);
}

// A body set off: the free part of its motion. One within a Stribeck layer is left to the scalar code.
template <bool damping, bool layer> inline void begin_flight(const lane_machine &m, lane_group &g) {
  if (layer)
    g.status = (g.status == lane_fresh) & (g.direction * g.v < m.layer.edge) ? all(lane_left) : g.status;
  mask fresh = g.status == lane_fresh;
  if (!any(fresh))
    return;
  g.start = fresh ? g.time : g.start;
  g.z_re = fresh ? vec{} : g.z_re;
  g.z_im = fresh ? vec{} : g.z_im;
  kinematics k = evaluate<damping>(m, g, g.time - g.start);
  vec y = g.x - k.x, v = g.v - k.v;
  vec a = -m.natural * m.natural * y - 2 * m.decay * v;
  g.z_re = fresh ? v + m.decay * y : g.z_re;
  g.z_im = fresh ? m.damped * y : g.z_im;
  g.start_v = fresh ? g.v : g.start_v;
  g.start_a = fresh ? k.a + a : g.start_a;
  g.start_j = fresh ? k.j - m.natural * m.natural * v - 2 * m.decay * a : g.start_j;
  g.found = fresh ? vec{} : g.found;
  if (layer)
    g.skip = fresh ? vec{} : g.skip;
  g.status = fresh ? all(lane_flying) : g.status;
}

// Keeps the event that is `step` after the evaluated point, where `accept`.
template <bool damping, bool layer>
inline void keep_event(const lane_machine &m, const kinematics &k, mask accept, mask hit, vec span, vec step,
                       lane_group &g) {
  vec half = 0.5 * step, third = (1.0 / 3) * step, fourth = 0.25 * step, re = k.re, im = k.im;
  turn_on<damping, 3>(m, step, re, im);
  g.found = accept ? all(1) : g.found;
  g.span = accept ? span : g.span;
  g.hits = accept ? (hit ? all(1) : vec{}) : g.hits;
  g.end_x = accept ? k.x + step * (k.v + half * (k.a + third * (k.j + fourth * k.s))) : g.end_x;
  g.end_v = accept ? k.v + step * (k.a + half * (k.j + third * k.s)) : g.end_v;
  g.end_a = accept ? k.a + step * (k.j + half * k.s) : g.end_a;
  g.end_j = accept ? k.j + step * k.s : g.end_j;
  if (layer)
    g.end_s = accept ? k.s : g.end_s;
  g.end_re = accept ? re : g.end_re;
  g.end_im = accept ? im : g.end_im;
}

// Finds the ends of the flights of `seek`: a turning point, or the barrier if that lies before it. Returns
// the lanes whose search failed.
template <bool damping, bool layer>
inline mask find_events(const lane_machine &m, mask seek, mask upward, vec barrier, lane_group &g) {
  vec s = upward ? g.up_span : g.down_span, low = layer ? g.skip : vec{}, high = all(1e300);
  mask hit = (upward ? g.up_hits : g.down_hits) > 0.5;
  for (int round = 0; round < most_rounds; round++) {
    kinematics k = evaluate<damping>(m, g, s);
    vec w = g.direction * k.v, rate = g.direction * k.a, curl = g.direction * k.j, snap = g.direction * k.s;
    vec gap = g.direction * (barrier - k.x);
    // Past the turning point, short of the barrier: the body turns first.
    hit = hit & ((w > 0.0) | (gap <= 0.0));
    vec f = hit ? gap : w, f1 = hit ? -w : rate, f2 = hit ? -rate : curl, f3 = hit ? -curl : snap;
    low = f > 0.0 ? s : low;
    high = f > 0.0 ? high : s;
    // Householder's step of fourth order.
    vec step = -f * (f1 * f1 - 0.5 * f * f2) / (f1 * (f1 * f1 - f * f2) + (1.0 / 6) * f * f * f3);
    vec next = s + step;
    mask guided = (f1 < 0.0) & (next >= low) & (next <= high) & (next > 0.0);
    // Newton's step is asked, too: where the numerator vanishes Householder's says nothing.
    mask close = guided & (magnitude(step) <= m.close) & (magnitude(f) <= -2 * m.close * f1);
    vec half = 0.5 * step, third = (1.0 / 3) * step, fourth = 0.25 * step;
    vec turn_x = k.x + step * (k.v + half * (k.a + third * (k.j + fourth * k.s)));
    mask beyond = close & ~hit & (g.direction * (barrier - turn_x) <= 0.0);
    mask accept = seek & close & ~beyond;
    if (any(accept)) {
      keep_event<damping, layer>(m, k, accept, hit, next, step, g);
      seek = seek & ~accept;
      if (!any(seek))
        break;
    }
    // A turning point beyond the barrier: the impact is before it.
    low = beyond ? (layer ? g.skip : vec{}) : low;
    high = beyond ? next : high;
    hit = hit | beyond;
    vec onward = high < 1e299 ? 0.5 * (low + high) : s + m.stride;
    s = beyond ? 0.5 * next : (guided ? next : onward);
  }
  return seek;
}

// Is each of so many equal pieces of the flights proven to have no event on the way? With a layer: from its
// edge to its edge, the speed staying above.
template <bool damping, bool layer>
inline mask prove_pieces(const lane_machine &m, int pieces, vec bound, const lane_group &g) {
  vec h = (1.0 / pieces) * (layer ? g.reach - g.skip : g.span), d = g.direction;
  const double level = layer ? m.layer.level : 0;
  vec w = d * g.start_v - level, rate = d * g.start_a, curl = d * g.start_j;
  mask proven = ~mask{};
  for (int i = 1; i < pieces; i++) {
    kinematics k = evaluate<damping>(m, g, layer ? g.skip + i * h : i * h);
    proven = proven & positive_between(h, w, rate, curl, d * k.v - level, d * k.a, d * k.j, bound);
    w = d * k.v - level;
    rate = d * k.a;
    curl = d * k.j;
  }
  if (layer)
    return proven & (h > 0.0) &
           positive_between(h, w, rate, curl, d * g.reach_v - level, d * g.reach_a, d * g.reach_j, bound);
  vec end_w = g.hits > 0.5 ? d * g.end_v : vec{};
  return proven & positive_between(h, w, rate, curl, end_w, d * g.end_a, d * g.end_j, bound);
}

// Of the flights `found` just now: which are proven to have no event on the way?
template <bool damping, bool layer>
inline mask prove(const lane_machine &m, mask found, const lane_group &g) {
  vec bound = derivative_bound(m, g);
  mask proven = prove_pieces<damping, layer>(m, 1, bound, g);
  for (int pieces = 2; pieces <= most_pieces && any(found & ~proven); pieces *= 2)
    proven = proven | prove_pieces<damping, layer>(m, pieces, bound, g);
  return proven;
}

// The events of the lanes `due`: Newton's impact or the reversal of friction, and the flight that follows.
// Returns those that the scalar code must look at: sticking, chatter, a body that has left the domain.
template <bool damping, bool layer>
inline mask take_events(const lane_machine &m, mask due, mask upward, vec barrier, lane_group &g) {
  mask hit = g.hits > 0.5;
  vec w = g.direction * g.end_v, gap = g.direction * (barrier - g.end_x);
  vec push = -g.direction * g.end_a - m.kinetic;
  mask plain = (hit ? m.restitution * w > m.slow : push > m.break_away) & (magnitude(g.end_x) < m.domain);
  turning turn;
  bool turns = layer && any(due & ~hit);
  if (turns) {
    turn = turn_in_layer(m, due & ~hit, g);
    plain = hit ? plain : turn.sound & (magnitude(turn.x) < m.domain);
    gap = hit ? gap : g.direction * (barrier - turn.x);
  }
  mask rare = due & ~plain;
  due = due & plain;
  vec v = hit ? -m.restitution * g.end_v : vec{};
  vec v_jump = hit ? v - g.end_v : vec{};
  vec y_jump = (-2 * m.offset) * g.direction, a_jump = (2 * m.kinetic) * g.direction;
  if (damping)
    a_jump -= 2 * m.decay * v_jump;
  vec j_jump = -m.natural * m.natural * v_jump - 2 * m.decay * a_jump;
  mask up = due & upward, down = due & ~upward, struck = due & hit;
  g.up_span = up ? g.span : g.up_span;
  g.up_hits = up ? g.hits : g.up_hits;
  g.down_span = down ? g.span : g.down_span;
  g.down_hits = down ? g.hits : g.down_hits;
  // The event loop flies three times: to the edge of the layer, in and out.
  g.flights = due ? g.flights + (turns ? (hit ? all(1) : all(3)) : all(1)) : g.flights;
  g.impacts = struck ? g.impacts + 1.0 : g.impacts;
  g.speed_sum = struck ? g.speed_sum + w : g.speed_sum;
  g.last_speed = struck ? w : g.last_speed;
  g.margin = (due & ~hit & (gap < g.margin)) ? gap : g.margin;
  if (turns)
    g.end_x = hit ? g.end_x : turn.x;
  g.start = due ? g.start + (turns ? (hit ? g.span : g.span - turn.early) : g.span) : g.start;
  g.time = due ? g.start : g.time;
  g.x = due ? (hit ? barrier : g.end_x) : g.x;
  g.v = due ? v : g.v;
  g.start_v = due ? v : g.start_v;
  g.start_a = due ? g.end_a + a_jump : g.start_a;
  g.start_j = due ? g.end_j + j_jump : g.start_j;
  g.z_re = due ? g.end_re + v_jump + m.decay * y_jump : g.z_re;
  g.z_im = due ? g.end_im + m.damped * y_jump : g.z_im;
  if (layer)
    g.skip = due ? vec{} : g.skip;
  if (turns) {
    mask turned = due & ~hit;
    g.skip = turned ? turn.skip : g.skip;
    g.start_v = turned ? turn.v : g.start_v;
    g.start_a = turned ? turn.a : g.start_a;
    g.start_j = turned ? turn.j : g.start_j;
    g.z_re = turned ? turn.re : g.z_re;
    g.z_im = turned ? turn.im : g.z_im;
  }
  g.direction = due ? -g.direction : g.direction;
  g.found = due ? vec{} : g.found;
  return rare;
}

// The state of the lanes that have come to where they stop. The end of the period starts the clock anew.
template <bool damping> inline void take_stops(const lane_machine &m, mask sent, lane_group &g) {
  mask stopped = sent & (g.status == lane_stopped);
  if (!any(stopped))
    return;
  kinematics k = evaluate<damping>(m, g, g.until - g.start);
  mask section = stopped & (g.until >= m.period);
  g.x = stopped ? k.x : g.x;
  g.v = stopped ? k.v : g.v;
  g.flights = stopped ? g.flights + 1.0 : g.flights;
  g.time = stopped ? (section ? vec{} : g.until) : g.time;
  g.start = section ? g.start - m.period : g.start;
}

// Lanes with a layer that come to a stop. Those that need not stop at this section: their motion is noted,
// and the clock starts anew. Those within the layer at that time are `left` to the scalar code.
inline void pass_sections(const lane_machine &m, int first, mask stops, lane_group &g, lane_batch &batch) {
  mask within = stops & ((g.until < g.start + g.skip) | (g.until > g.start + g.reach));
  mask passing = stops & ~within & (g.sections > 0.5);
  g.status = stops & ~passing ? (within ? all(lane_left) : all(lane_stopped)) : g.status;
  if (!any(passing))
    return;
  kinematics k = evaluate<false>(m, g, g.until - g.start);
  for (int i = 0; i < width; i++) {
    if (passing[i]) {
      batch.section_x[(int)g.passed[i]][first + i] = k.x[i];
      batch.section_v[(int)g.passed[i]][first + i] = k.v[i];
    }
  }
  g.passed = passing ? g.passed + 1.0 : g.passed;
  g.flights = passing ? g.flights + 1.0 : g.flights;
  g.sections = passing ? g.sections - 1.0 : g.sections;
  g.x = passing ? k.x : g.x;
  g.v = passing ? k.v : g.v;
  g.time = passing ? vec{} : g.time;
  g.start = passing ? g.start - m.period : g.start;
}

// Finds what the flights of `seek` end with, and proves that it is the first. Returns the lanes where that
// failed.
template <bool damping, bool layer>
inline mask look_ahead(const lane_machine &m, mask seek, mask upward, vec barrier, lane_group &g) {
  mask left = {};
  for (int attempt = 0; attempt < (layer ? 2 : 1) && any(seek); attempt++) {
    if (attempt > 0) {
      g.found = seek ? vec{} : g.found;
      g.up_span = seek ? 0.5 * g.up_span : g.up_span;
      g.down_span = seek ? 0.5 * g.down_span : g.down_span;
    }
    left = find_events<damping, layer>(m, seek, upward, barrier, g);
    mask found = seek & ~left;
    if (layer)
      left = left | find_edge(m, found, g);
    left = left | (found & ~prove<damping, layer>(m, found, g));
    seek = left;
  }
  return left;
}

// Flies the lanes of one vector until each has stopped or is left to the scalar code.
template <bool damping> void fly(const lane_machine &m, int first, lane_batch &batch) {
  lane_group g;
  load<false>(batch, first, g);
  begin_flight<damping, false>(m, g);
  mask flying = g.status == lane_flying, sent = flying;
  while (any(flying)) {
    mask upward = g.direction > 0.0, seek = flying & (g.found < 0.5), left = {};
    vec barrier = upward ? all(m.upper) : all(m.lower);
    if (any(seek))
      left = look_ahead<damping, false>(m, seek, upward, barrier, g);
    left = left | (flying & (g.flights >= g.budget));
    mask stops = flying & ~left & (g.start + g.span >= g.until);
    g.status = stops ? all(lane_stopped) : g.status;
    flying = flying & ~left & ~stops;
    if (any(flying))
      left = left | take_events<damping, false>(m, flying, upward, barrier, g);
    g.status = left ? all(lane_left) : g.status;
    flying = flying & ~left;
  }
  take_stops<damping>(m, sent, g);
  store<false>(g, first, batch);
}

// The same with a Stribeck layer, until one lane has stopped or is left. Turnings are dear here: a lane that
// has come to one waits until all have. Before that the impacts are taken, and then the sections passed.
void fly_through_layers(const lane_machine &m, int first, lane_batch &batch) {
  lane_group g;
  load<true>(batch, first, g);
  mask sent = (g.status == lane_fresh) | (g.status == lane_flying);
  begin_flight<false, true>(m, g);
  mask flying = g.status == lane_flying;
  while (any(flying) && !any(sent & ~flying)) {
    mask upward = g.direction > 0.0, seek = flying & (g.found < 0.5), left = {};
    vec barrier = upward ? all(m.upper) : all(m.lower);
    if (any(seek))
      left = look_ahead<false, true>(m, seek, upward, barrier, g);
    left = left | (flying & (g.flights >= g.budget));
    g.status = left ? all(lane_left) : g.status;
    flying = g.status == lane_flying;
    mask stops = flying & (g.start + g.span >= g.until), due = flying & ~stops & (g.hits > 0.5);
    if (!any(due) && any(stops))
      pass_sections(m, first, stops, g, batch);
    else if (!any(due))
      due = flying;
    if (any(due)) {
      left = take_events<false, true>(m, due, upward, barrier, g);
      g.status = left ? all(lane_left) : g.status;
    }
    flying = g.status == lane_flying;
  }
  take_stops<false>(m, sent, g);
  store<true>(g, first, batch);
}

} // namespace

#define SEPARATRIX_LANE_KERNEL(name)                                                                         \
  extern "C" void name(const lane_machine *m, lane_batch *batch) {                                           \
    for (int first = 0; first < lanes; first += width)                                                       \
      if (m->layer.excess > 0)                                                                               \
        fly_through_layers(*m, first, *batch);                                                               \
      else if (m->decay > 0)                                                                                 \
        fly<true>(*m, first, *batch);                                                                        \
      else                                                                                                   \
        fly<false>(*m, first, *batch);                                                                       \
  }

#endif
