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

#include "lane_contact.hpp"
#include "lane_layer.hpp"
#include "lane_modes.hpp"
#include "lane_stops.hpp"

namespace {

enum { most_rounds = 10, most_pieces = 8 };

// Are the Bernstein coefficients c of degree 6, or those of both halves, positive within?
LANE_LEAF mask all_positive(const vec (&c)[7]) {
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
LANE_LEAF mask positive_between(vec span, vec w0, vec rate0, vec curl0, vec w1, vec rate1, vec curl1,
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
template <bool damping, bool layer, class machine>
LANE_DEVICE inline void begin_flight(const machine &m, lane_group &g) {
  if constexpr (layer)
    put(g.status, (g.status == lane_fresh) & (g.direction * g.v < m.layer.edge), lane_left);
  mask fresh = g.status == lane_fresh;
  if (!any(fresh))
    return;
  put(g.start, fresh, g.time);
  put(g.z_re, fresh, 0);
  put(g.z_im, fresh, 0);
  kinematics k = evaluate<damping>(m, g, g.time - g.start);
  vec y = g.x - k.x, v = g.v - k.v;
  if constexpr (machine::modal)
    y = (g.x - m.origin) - k.x;
  vec a = -m.natural * m.natural * y - 2 * m.decay * v;
  put(g.z_re, fresh, v + m.decay * y);
  put(g.z_im, fresh, m.damped * y);
  put(g.start_v, fresh, g.v);
  put(g.start_a, fresh, k.a + a);
  put(g.start_j, fresh, k.j - m.natural * m.natural * v - 2 * m.decay * a);
  put(g.found, fresh, 0);
  if (layer)
    put(g.skip, fresh, 0);
  put(g.status, fresh, lane_flying);
}

// Keeps the event that is `step` after the evaluated point, where `accept`.
template <bool damping, bool layer, class machine>
LANE_DEVICE inline void keep_event(const machine &m, const kinematics &k, mask accept, mask hit, vec span,
                                   vec step, lane_group &g) {
  vec half = 0.5 * step, third = (1.0 / 3) * step, fourth = 0.25 * step, re = k.re, im = k.im;
  turn_on<damping, 3>(m, step, re, im);
  put(g.found, accept, 1);
  put(g.span, accept, span);
  put(g.hits, accept, pick(hit, 1, 0));
  put(g.end_x, accept, k.x + step * (k.v + half * (k.a + third * (k.j + fourth * k.s))));
  put(g.end_v, accept, k.v + step * (k.a + half * (k.j + third * k.s)));
  put(g.end_a, accept, k.a + step * (k.j + half * k.s));
  put(g.end_j, accept, k.j + step * k.s);
  if (layer)
    put(g.end_s, accept, k.s);
  put(g.end_re, accept, re);
  put(g.end_im, accept, im);
}

// Finds the ends of the flights of `seek`: a turning point, or the barrier if that lies before it. Returns
// the lanes whose search failed.
template <bool damping, bool layer, class machine>
LANE_DEVICE inline mask find_events(const machine &m, mask seek, mask upward, vec barrier, lane_group &g) {
  vec s = pick(upward, g.up_span, g.down_span), low = layer ? g.skip : vec{}, high = 1e300;
  mask hit = pick(upward, g.up_hits, g.down_hits) > 0.5;
  if constexpr (machine::modal) {
    hit = pick(m.guess > 0.0, m.leads_to == 0.0, hit);
    s = pick(m.guess > 0.0, m.guess, s);
  }
  for (int round = 0; round < most_rounds; round++) {
    kinematics k = evaluate<damping>(m, g, s);
    vec w = g.direction * k.v, rate = g.direction * k.a, curl = g.direction * k.j, snap = g.direction * k.s;
    vec gap = g.direction * (barrier - k.x), gap1 = -w, gap2 = -rate, gap3 = -curl;
    if constexpr (machine::modal) {
      gap -= m.lead * w;
      gap1 -= m.lead * rate;
      gap2 -= m.lead * curl;
      gap3 -= m.lead * snap;
    }
    // Past the turning point, short of the barrier: the body turns first.
    hit = hit & ((w > 0.0) | (gap <= 0.0));
    vec f = pick(hit, gap, w), f1 = pick(hit, gap1, rate), f2 = pick(hit, gap2, curl),
        f3 = pick(hit, gap3, snap);
    put(low, f > 0.0, s);
    high = pick(f > 0.0, high, s);
    // Householder's step of fourth order.
    vec step = -f * (f1 * f1 - 0.5 * f * f2) / (f1 * (f1 * f1 - f * f2) + (1.0 / 6) * f * f * f3);
    vec next = s + step;
    mask guided = (f1 < 0.0) & (next >= low) & (next <= high) & (next > 0.0);
    // Newton's step counts, too: where the numerator vanishes Householder's means nothing.
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
    put(low, beyond, layer ? g.skip : vec{});
    put(high, beyond, next);
    hit = hit | beyond;
    vec onward = pick(high < 1e299, 0.5 * (low + high), s + m.stride);
    s = pick(beyond, 0.5 * next, pick(guided, next, onward));
  }
  return seek;
}

// Is each of so many equal pieces of the flights proven to have no event on the way? With a layer: from its
// edge to its edge, the speed staying above.
template <bool damping, bool layer, class machine>
LANE_DEVICE inline mask prove_pieces(const machine &m, int pieces, vec bound, const lane_group &g) {
  vec h = (1.0 / pieces) * (layer ? g.reach - g.skip : g.span), d = g.direction;
  double level = 0;
  if constexpr (layer)
    level = m.layer.level;
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
  vec end_w = pick(g.hits > 0.5, d * g.end_v, 0);
  return proven & positive_between(h, w, rate, curl, end_w, d * g.end_a, d * g.end_j, bound);
}

// Of flights `asked` out of a barrier that may not pull: does it push on the whole way? The others are let
// pass.
LANE_DEVICE inline mask prove_pushing(const lane_modes &f, mask asked, vec bound, const lane_group &g) {
  mask proven = ~asked;
  vec d = g.direction, sixth = f.sixth_periodic + f.sixth_free * free_size(g) + f.lead * bound;
  for (int pieces = 1; pieces <= most_pieces && any(~proven); pieces *= 2) {
    vec h = (1.0 / pieces) * g.span, gap = {}, rate = {}, curl = {};
    mask positive = ~mask{};
    for (int i = 0; i <= pieces; i++) {
      kinematics k = evaluate<true>(f, g, i * h);
      vec next = d * (f.barrier - k.x - f.lead * k.v), next_rate = -d * (k.v + f.lead * k.a),
          next_curl = -d * (k.a + f.lead * k.j);
      if (i == pieces)
        put(next, g.hits > 0.5, 0);
      if (i > 0)
        positive = positive & positive_between(h, gap, rate, curl, next, next_rate, next_curl, sixth);
      gap = next;
      rate = next_rate;
      curl = next_curl;
    }
    proven = proven | positive;
  }
  return proven;
}

// Of the flights `found` just now: which are proven to have no event on the way?
template <bool damping, bool layer, class machine>
LANE_DEVICE inline mask prove(const machine &m, mask found, const lane_group &g) {
  vec bound = derivative_bound(m, g);
  mask proven = prove_pieces<damping, layer>(m, 1, bound, g);
  for (int pieces = 2; pieces <= most_pieces && any(found & ~proven); pieces *= 2)
    proven = proven | prove_pieces<damping, layer>(m, pieces, bound, g);
  if constexpr (machine::modal)
    proven = proven & prove_pushing(m, found & proven & (m.lead > 0.0), bound, g);
  return proven;
}

// The events of the lanes `due`: Newton's impact or the reversal of friction, and the flight that follows.
// Returns those that the scalar code must look at: sticking, chatter, a body that has left the domain.
template <bool damping, bool layer>
LANE_DEVICE inline mask take_events(const lane_machine &m, mask due, mask upward, vec barrier,
                                    lane_group &g) {
  mask hit = g.hits > 0.5;
  vec w = g.direction * g.end_v, gap = g.direction * (barrier - g.end_x);
  vec push = -g.direction * g.end_a - m.kinetic;
  vec restitution = m.restitution;
  if (m.restitution_law != constant_restitution && any(due & hit))
    restitution = restitution_at(m, w);
  mask plain = pick(hit, restitution * w > m.slow, push > m.break_away) & (magnitude(g.end_x) < m.domain);
  turning turn = {};
  bool turns = layer && any(due & ~hit);
  if (turns) {
    turn = turn_in_layer(m, due & ~hit, g);
    plain = pick(hit, plain, turn.sound & (magnitude(turn.x) < m.domain));
    gap = pick(hit, gap, g.direction * (barrier - turn.x));
  }
  mask rare = due & ~plain;
  due = due & plain;
  vec v = pick(hit, -restitution * g.end_v, 0);
  vec v_jump = pick(hit, v - g.end_v, 0);
  vec y_jump = (-2 * m.offset) * g.direction, a_jump = (2 * m.kinetic) * g.direction;
  if (damping)
    a_jump -= 2 * m.decay * v_jump;
  vec j_jump = -m.natural * m.natural * v_jump - 2 * m.decay * a_jump;
  mask up = due & upward, down = due & ~upward, struck = due & hit;
  LANE_COUNT(events, count(due));
  put(g.up_span, up, g.span);
  put(g.up_hits, up, g.hits);
  put(g.down_span, down, g.span);
  put(g.down_hits, down, g.hits);
  // The event loop flies to the edge of the layer, in and out.
  put(g.flights, due, g.flights + (turns ? pick(hit, 1, 3) : vec(1)));
  put(g.impacts, struck, g.impacts + 1.0);
  put(g.speed_sum, struck, g.speed_sum + w);
  put(g.last_speed, struck, w);
  put(g.margin, due & ~hit & (gap < g.margin), gap);
  if (turns)
    g.end_x = pick(hit, g.end_x, turn.x);
  put(g.start, due, g.start + (turns ? pick(hit, g.span, g.span - turn.early) : g.span));
  put(g.time, due, g.start);
  put(g.x, due, pick(hit, barrier, g.end_x));
  put(g.v, due, v);
  put(g.start_v, due, v);
  put(g.start_a, due, g.end_a + a_jump);
  put(g.start_j, due, g.end_j + j_jump);
  put(g.z_re, due, g.end_re + v_jump + m.decay * y_jump);
  put(g.z_im, due, g.end_im + m.damped * y_jump);
  if (layer)
    put(g.skip, due, 0);
  if (turns) {
    mask turned = due & ~hit;
    put(g.skip, turned, turn.skip);
    put(g.start_v, turned, turn.v);
    put(g.start_a, turned, turn.a);
    put(g.start_j, turned, turn.j);
    put(g.z_re, turned, turn.re);
    put(g.z_im, turned, turn.im);
  }
  put(g.direction, due, -g.direction);
  put(g.found, due, 0);
  return rare;
}

// Finds what the flights of `seek` end with, and proves that it is the first. Returns the lanes where that
// failed.
template <bool damping, bool layer, class machine>
LANE_DEVICE inline mask look_ahead(const machine &m, mask seek, mask upward, vec barrier, lane_group &g) {
  mask left = {};
  for (int attempt = 0; attempt < (layer ? 2 : 1) && any(seek); attempt++) {
    if (attempt > 0) {
      put(g.found, seek, 0);
      put(g.up_span, seek, 0.5 * g.up_span);
      put(g.down_span, seek, 0.5 * g.down_span);
    }
    left = find_events<damping, layer>(m, seek, upward, barrier, g);
    mask found = seek & ~left;
    if constexpr (layer)
      left = left | find_edge(m, found, g);
    left = left | (found & ~prove<damping, layer>(m, found, g));
    seek = left;
  }
  return left;
}

// Flies the lanes of one vector until one has stopped or is left to the scalar code. They pass the sections
// together, so that those set off together, whose first flights take longer to find, stay together.
template <bool damping, class rider>
LANE_DEVICE void fly(const lane_machine &m, const lane_regions &regions, int first, lane_batch &batch,
                     rider &along) {
  lane_group g;
  load<false>(batch, first, g);
  begin_flight<damping, false>(m, g);
  mask flying = g.status == lane_flying, sent = flying;
  int rounds = 0;
  while (any(sent) && !any(sent & (g.status != lane_flying)) && !is_due_back(rounds)) {
    flying = sent;
    while (any(flying) && !is_due_back(rounds)) {
      mask upward = g.direction > 0.0, seek = flying & (g.found < 0.5), left = {};
      vec barrier = pick(upward, m.upper, m.lower);
      if (any(seek))
        left = look_ahead<damping, false>(m, seek, upward, barrier, g);
      left = left | (flying & (g.flights >= g.budget));
      flying = flying & ~left & (g.start + g.span < g.until);
      if (any(flying)) {
        along.flown(flying, g.start + g.span, closed_motion<damping, lane_machine>{m, g});
        mask rare = take_events<damping, false>(m, flying, upward, barrier, g);
        along.cross(m, flying & ~rare, g);
        along.met(flying & ~rare & (g.hits > 0.5), g.start, magnitude(g.end_v), magnitude(g.start_v),
                  -g.direction);
        left = left | rare;
      }
      put(g.status, left, lane_left);
      flying = flying & ~left;
    }
    mask there = (g.status == lane_flying) & ~flying;
    along.flown(there, for_ever, closed_motion<damping, lane_machine>{m, g});
    take_stops<damping>(m, there, regions, g);
  }
  store<false>(g, first, batch);
}

// The same with a Stribeck layer. Turnings are dear here, so no lane waits for another at a section, but one
// that has come to a turning waits until all have. Before that the impacts are taken, and then the stops.
LANE_DEVICE void fly_through_layers(const lane_machine &m, const lane_regions &regions, int first,
                                    lane_batch &batch) {
  lane_group g;
  load<true>(batch, first, g);
  mask sent = (g.status == lane_fresh) | (g.status == lane_flying);
  begin_flight<false, true>(m, g);
  mask flying = g.status == lane_flying;
  int rounds = 0;
  while (any(flying) && !any(sent & ~flying) && !is_due_back(rounds)) {
    mask upward = g.direction > 0.0, seek = flying & (g.found < 0.5), left = {};
    vec barrier = pick(upward, m.upper, m.lower);
    if (any(seek))
      left = look_ahead<false, true>(m, seek, upward, barrier, g);
    left = left | (flying & (g.flights >= g.budget));
    flying = flying & ~left;
    mask stops = flying & (g.start + g.span >= g.until), due = flying & ~stops & (g.hits > 0.5);
    if (!any(due) && any(stops)) {
      mask within = stops & ((g.until < g.start + g.skip) | (g.until > g.start + g.reach));
      left = left | within;
      take_stops<false>(m, stops & ~within, regions, g);
    } else if (!any(due))
      due = flying;
    if (any(due))
      left = left | take_events<false, true>(m, due, upward, barrier, g);
    put(g.status, left, lane_left);
    flying = g.status == lane_flying;
  }
  store<true>(g, first, batch);
}

// The same where the equation changes with the mode: a flight begins anew after every event. Contacts without
// a closed form are expanded in series.
template <class rider>
LANE_DEVICE void fly_through_modes(const lane_machine &m, const lane_regions &regions, int first,
                                   lane_batch &batch, rider &along) {
  const bool in_series = m.contact.stiffness > 0;
  lane_group g;
  lane_modes f(m);
  load<true>(batch, first, g);
  // Idle lanes, too: what they hold is evaluated with the others.
  f.enter(~mask{}, g);
  begin_flight<true, false>(f, g);
  mask flying = g.status == lane_flying, sent = flying;
  vec limit = 1e300;
  int rounds = 0;
  while (any(sent) && !any(sent & (g.status != lane_flying)) && !is_due_back(rounds)) {
    mask passed = {};
    flying = sent;
    while (any(flying) && !is_due_back(rounds)) {
      mask pressed = in_series ? flying & (g.pressed_on > 0.5) : mask{}, left = {};
      if (in_series && contacts_first(pressed, flying)) {
        mask there = press_on(m, pressed, limit, left, g, along);
        if (any(there))
          stop_or_pass(m.period, m.domain, there, g.x, g.v, regions, g);
        passed = passed | there;
        flying = flying & ~left & ~there;
        put(g.status, left, lane_left);
        put(g.status, flying & pressed & (g.pressed_on < 0.5), lane_fresh);
      } else {
        mask free = flying & ~pressed, seek = free & (g.found < 0.5);
        if (any(seek))
          left = look_ahead<true, false>(f, seek, g.direction > 0.0, f.barrier, g);
        // Friction that has dropped to zero stays there. A slip has it where either end has, as its position
        // does not turn round.
        if (m.friction_slope != 0)
          left = left | (seek & ((1.0 + m.friction_slope * g.x <= 0.0) |
                                 (1.0 + m.friction_slope * (f.origin + g.end_x) <= 0.0)));
        left = left | (free & (g.flights >= g.budget));
        mask due = free & ~left & (g.start + g.span < g.until);
        flying = pressed | due;
        if (any(due))
          left = left | pass_mode_events(f, due, g, along);
        put(g.status, left, lane_left);
        flying = flying & ~left;
      }
      f.enter(g.status == lane_fresh, g);
      begin_flight<true, false>(f, g);
    }
    mask there = (g.status == lane_flying) & ~passed & ~flying;
    along.flown(there, for_ever, closed_motion<true, lane_modes>{f, g});
    take_stops<true>(f, there, regions, g);
  }
  store<true>(g, first, batch);
}

// How the bodies of a machine fly.
enum flight { plain, damped, layered, modal, in_series };

LANE_DEVICE inline flight flight_of(const lane_machine &m) {
  if (m.law.series > 0)
    return in_series;
  if (m.several_modes > 0)
    return modal;
  if (m.layer.excess > 0)
    return layered;
  return m.decay > 0 ? damped : plain;
}

// Nothing rides through layers.
template <flight kind, class rider>
LANE_DEVICE inline void fly_group(const lane_machine &m, const lane_regions &regions, int first,
                                  lane_batch &batch, rider &along) {
  if constexpr (kind == in_series)
    fly_in_series(m, regions, first, batch, along);
  else if constexpr (kind == modal)
    fly_through_modes(m, regions, first, batch, along);
  else if constexpr (kind == layered)
    fly_through_layers(m, regions, first, batch);
  else
    fly<kind == damped>(m, regions, first, batch, along);
}

template <flight kind>
inline void fly_batch(const lane_machine &m, const lane_regions &regions, lane_batch &batch) {
  nothing_along along;
  for (int first = 0; first < lanes; first += vec_size)
    fly_group<kind>(m, regions, first, batch, along);
}

// Calls FUNCTION<kind of the machine's flights> with what follows.
#define LANE_FOR_FLIGHT(machine, FUNCTION, ...)                                                              \
  switch (flight_of(machine)) {                                                                              \
  case plain:                                                                                                \
    FUNCTION<plain>(__VA_ARGS__);                                                                            \
    break;                                                                                                   \
  case damped:                                                                                               \
    FUNCTION<damped>(__VA_ARGS__);                                                                           \
    break;                                                                                                   \
  case layered:                                                                                              \
    FUNCTION<layered>(__VA_ARGS__);                                                                          \
    break;                                                                                                   \
  case modal:                                                                                                \
    FUNCTION<modal>(__VA_ARGS__);                                                                            \
    break;                                                                                                   \
  case in_series:                                                                                            \
    FUNCTION<in_series>(__VA_ARGS__);                                                                        \
    break;                                                                                                   \
  }

} // namespace

#define SEPARATRIX_LANE_KERNEL(name)                                                                         \
  extern "C" void name(const lane_machine *m, const lane_regions *regions, lane_batch *batch) {              \
    LANE_FOR_FLIGHT(*m, fly_batch, *m, *regions, *batch)                                                     \
  }

#endif
