// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Contacts with a soft barrier, by Taylor series over the lanes. The force K p^n (1 + a p') is not analytic
// in the time where the penetration p vanishes. In the variable sigma with dt = 2 u d sigma, u = sqrt(p), it
// is: u' = w, w' = 2 u (acceleration), t' = 2 u, w = p's rate, and p^n = u^(2n) for whole 2n. The contact
// ends at a simple zero of u. Over a slip u is monotone, as w keeps its sign.
#ifndef SEPARATRIX_LANE_CONTACT_HPP
#define SEPARATRIX_LANE_CONTACT_HPP

#include "lane_tables.hpp"

namespace {

// The first term that a step leaves out is about exp(-18 x 1.4) = 1e-11 of its depth and speed.
const double contact_shrinking = 1.4;

// A step shorter than this share of what the series allow is left to the scalar code.
const double shortest_share = 1e-9;

// Coefficients in sigma: u, position, velocity, time since the start of the step; with tables those of the
// extension and of the factor of dry friction, too.
struct contact_expansion {
  vec u[order + 1], x[order], v[order], time[order + 1], extension[order], factor[order];
};

// The side that is pressed: 1 above, -1 below.
LANE_DEVICE inline vec side_of(const lane_group &g) { return pick(g.pressed_on < 1.5, vec(1.0), vec(-1.0)); }

LANE_DEVICE inline vec surface_of(const lane_machine &m, const lane_group &g) {
  return pick(g.pressed_on < 1.5, vec(m.upper), vec(m.lower));
}

// Damping of the law of a contact.
LANE_DEVICE inline vec damping_of(const lane_machine &m, const lane_group &g) {
  const lane_contact &c = m.contact;
  return c.by_impact > 0 ? pick(g.touch > 0.0, c.damping / g.touch, vec{}) : vec(c.damping);
}

// The foot of the spring where the time is a series: its Taylor polynomial of degree `foot_terms` in the
// time.
struct foot_series {
  vec taylor[order], power[order][order];

  LANE_DEVICE void start(const lane_machine &m, vec time) {
    expand_foot(m, time, int(m.contact.foot_terms) + 1, taylor);
  }

  // Coefficient k, where `time` has those up to k, the first being 0.
  LANE_DEVICE vec next(const lane_machine &m, const vec *time, int k) {
    const int terms = int(m.contact.foot_terms);
    if (k == 0)
      return taylor[0];
    power[1][k] = time[k];
    vec sum = taylor[1] * time[k];
    for (int j = 2; j <= terms && j <= k; j++) {
      vec next = {};
      for (int i = 1; i <= k - j + 1; i++)
        next += time[i] * power[j - 1][k - i];
      power[j][k] = next;
      sum += taylor[j] * next;
    }
    return sum;
  }
};

// Coefficient k of u^power, where `square` has those of u^2 up to k; `cube` is filled up to k.
LANE_LEAF vec power_of(int power, const vec *u, const vec *square, vec *cube, int k) {
  if (power == 2)
    return square[k];
  if (power == 4)
    return square_of(square, k);
  cube[k] = product(square, u, k);
  return power == 3 ? cube[k] : power == 5 ? product(cube, square, k) : square_of(cube, k);
}

// Expands the contacts of the lanes from where they are.
LANE_DEVICE inline void expand_contact(const lane_machine &m, const lane_group &g, const table_piece *pieces,
                                       contact_expansion &p) {
  LANE_COUNT(evaluations, vec_size);
  const lane_contact &c = m.contact;
  const vec side = side_of(g), damping = damping_of(m, g);
  const int power = int(c.twice_exponent);
  vec rate[order], path[order], square[order], cube[order], force[order], w[order], all_forces[order];
  foot_series foot;
  force_series others;
  others.pieces = pieces;
  foot.start(m, g.time);
  vec depth = side * (g.x - surface_of(m, g));
  put(depth, depth < 0.0, vec{});
  p.u[0] = square_root(depth);
  p.v[0] = g.v;
  p.time[0] = {};
  for (int k = 0; k < order - 1; k++) {
    rate[k] = 2.0 * p.u[k];
    square[k] = square_of(p.u, k);
    p.x[k] = side * square[k];
    if (k == 0)
      p.x[0] = g.x;
    w[k] = side * p.v[k];
    if (m.law.dahl_stiffness > 0)
      path[k] = product(rate, p.v, k);
    vec push;
    if (c.linear > 0)
      push = c.stiffness * square[k] + damping * w[k];
    else {
      force[k] = c.stiffness * power_of(power, p.u, square, cube, k);
      push = force[k] + damping * product(force, w, k);
    }
    all_forces[k] = others.next(m, g, ~mask{}, foot.next(m, p.time, k), p.x, p.v, path, k) - side * push;
    p.v[k + 1] = (1.0 / (k + 1)) * product(rate, all_forces, k);
    p.u[k + 1] = (1.0 / (k + 1)) * w[k];
    p.time[k + 1] = (1.0 / (k + 1)) * rate[k];
  }
  p.u[order] = (1.0 / order) * side * p.v[order - 1];
  p.time[order] = (2.0 / order) * p.u[order - 1];
  if (m.law.has_tables > 0) {
    p.x[order - 1] = side * square_of(p.u, order - 1);
    others.keep(p.x, p.extension, p.factor);
  }
}

// Length of a step over which the terms shrink by exp(-shrinking) from one to the next, compared with the
// speed and with the depth that it can reach; at most so long that the polynomial of the foot holds.
LANE_DEVICE inline vec contact_length(const lane_machine &m, const lane_group &g,
                                      const contact_expansion &p) {
  const double smallest = 1e-290, stiffness = m.contact.log_stiffness;
  const double power = m.contact.twice_exponent + 2;
  vec u = logarithm(p.u[0] + smallest), v = logarithm(magnitude(g.v) + smallest);
  // Either is at least what the other can turn into: v^2 = K u^power.
  vec turned = 0.5 * (stiffness + power * u), high = pick(v > turned, v, turned);
  vec depth = (1 / power) * (2.0 * high - stiffness);
  // Without other forces only every `power`th coefficient is not nil where the contact begins. Compared are
  // the last ones in units of the time that the depth takes at that speed.
  vec unit = exponential(depth - high), scale = 1.0, largest = smallest;
  for (int k = 0; k < order - int(power); k++)
    scale *= unit;
  const vec per_depth = exponential(-depth), per_speed = exponential(-high);
  for (int k = order - int(power) + 1; k <= order; k++) {
    vec v_term = scale * magnitude(p.v[k - 1]) * per_speed;
    scale *= unit;
    vec u_term = scale * magnitude(p.u[k]) * per_depth, term = pick(u_term > v_term, u_term, v_term);
    put(largest, term > largest, term);
  }
  vec least = (depth - high) - (1.0 / order) * logarithm(largest) - contact_shrinking;
  vec longest = m.contact.log_foot_time - depth;
  return exponential(pick(least < longest, least, longest));
}

// Length over which the first terms of the speed are at most `room` each.
LANE_DEVICE inline vec length_within(const contact_expansion &p, vec room) {
  vec least = 1e300;
  for (int k = 1; k <= 6; k++) {
    vec length = (1.0 / k) * (logarithm(room) - logarithm(magnitude(p.v[k]) + 1e-290));
    put(least, length < least, length);
  }
  return exponential(least);
}

// A step of the contacts: its polynomials in the fraction of the step, how far it goes, what it ends with.
struct contact_stride {
  vec u[order + 1], fall[order], time[order + 1], length, end, duration;
  mask turns, leaves, stops, lost;
};

// Looks for the first event of the contacts `pressed` within a step of `length`.
LANE_DEVICE inline contact_stride look_along_contact(const lane_machine &m, const contact_expansion &p,
                                                     mask pressed, vec length, const lane_group &g) {
  contact_stride t;
  const vec side = side_of(g);
  mask inward = g.direction * side > 0.0;
  vec power = 1.0;
  t.length = length;
  for (int k = 0; k <= order; k++) {
    t.u[k] = p.u[k] * power;
    t.time[k] = p.time[k] * power;
    if (k < order)
      t.fall[k] = g.direction * p.v[k] * power;
    power *= length;
  }
  vec f, f1, f2;
  t.end = 1.0;
  t.lost = mask{};
  value_at<order - 1>(t.fall, t.end, f, f1, f2);
  t.turns = pressed & (f <= 0.0);
  if (any(t.turns))
    t.lost = fall<order - 1>(t.fall, t.turns, vec(1.0), f, t.end);
  value_at<order>(t.u, t.end, f, f1, f2);
  t.leaves = pressed & ~t.lost & ~inward & (f <= 0.0);
  if (any(t.leaves)) {
    vec root = t.end;
    t.lost = t.lost | fall<order>(t.u, t.leaves, t.end, f, root);
    put(t.end, t.leaves, root);
  }
  value_at<order>(t.time, t.end, t.duration, f1, f2);
  vec ahead = g.until - g.time;
  t.stops = pressed & ~t.lost & (t.duration >= ahead);
  if (any(t.stops)) {
    vec rest[order + 1], root = t.end;
    for (int k = 0; k <= order; k++)
      rest[k] = -t.time[k];
    rest[0] += ahead;
    t.lost = t.lost | fall<order>(rest, t.stops, t.end, ahead - t.duration, root);
    put(t.end, t.stops, root);
    put(t.duration, t.stops, ahead);
  }
  // The foot's polynomial does not hold for so long.
  t.lost = t.lost | (t.duration > m.contact.foot_time);
  t.turns = t.turns & ~t.leaves & ~t.stops;
  t.leaves = t.leaves & ~t.stops;
  return t;
}

// A step in series.
struct series_motion {
  const expansion &p;
  vec from;

  LANE_DEVICE inline void at(vec time, mask, vec &x, vec &v) const {
    const vec s = time - from;
    x = p.x[order];
    v = {};
    for (int k = order - 1; k >= 0; k--) {
      x = x * s + p.x[k];
      v = v * s + p.v[k];
    }
  }
};

// A step of the contacts. Where no root of the time is found, the sample is not a number.
struct contact_motion {
  const contact_stride &t;
  const lane_group &g;
  vec side, surface;

  LANE_DEVICE inline void at(vec time, mask due, vec &x, vec &v) const {
    vec rest[order + 1], ahead = time - g.time, root = t.end, u, f1, f2, w;
    for (int k = 0; k <= order; k++)
      rest[k] = -t.time[k];
    rest[0] += ahead;
    put(root, ahead <= 0.0, vec{});
    const mask lost = fall<order>(rest, due & (ahead > 0.0), t.end, ahead - t.duration, root);
    value_at<order>(t.u, root, u, f1, f2);
    value_at<order - 1>(t.fall, root, w, f1, f2);
    x = surface + side * (u * u);
    v = g.direction * w;
    put(x, lost, vec(not_known));
  }
};

// Does the formula push all the way? `pulls` where it does not at the end of the step.
LANE_DEVICE inline mask pushes(const lane_machine &m, mask asked, const contact_stride &t,
                               const lane_group &g, mask &pulls) {
  const lane_contact &c = m.contact;
  pulls = mask{};
  if (c.linear > 0 || !(c.damping > 0))
    return ~mask{};
  const vec share = damping_of(m, g) * side_of(g) * g.direction;
  vec margin[order];
  for (int k = 0; k < order; k++)
    margin[k] = share * t.fall[k];
  margin[0] += 1.0;
  vec last, f1, f2;
  value_at<order - 1>(margin, t.end, last, f1, f2);
  pulls = asked & (last <= 0.0);
  return positive_until(margin, asked, t.end) & ~pulls;
}

// What follows the steps `due` that end with an event, or go on. Returns the lanes that the scalar code must
// look at.
LANE_DEVICE inline mask take_contact_events(const lane_machine &m, const table_piece *pieces,
                                            const contact_stride &t, mask due, lane_group &g) {
  const vec side = side_of(g), surface = surface_of(m, g);
  vec u, f1, f2, w, slope;
  value_at<order>(t.u, t.end, u, f1, f2);
  value_at<order - 1>(t.fall, t.end, w, slope, f2);
  vec x = surface + side * (u * u), v = g.direction * w;
  put(x, t.leaves, surface);
  vec a = g.direction * slope / (2.0 * u * t.length);
  turning_forces at_turn = forces_at_turn(m, pieces, x, a, g.direction);
  mask rare = due & ((t.turns & ~(at_turn.push > at_turn.holds)) | (magnitude(x) >= m.domain) |
                     (at_turn.factor <= 0.0) | (t.leaves & (w <= 0.0)));
  due = due & ~rare;
  mask turns = due & t.turns, leaves = due & t.leaves;
  LANE_COUNT(events, count(turns | leaves));
  if (m.law.dahl_stiffness > 0) {
    vec level = pick(g.direction > 0.0, m.law.dahl_level[0], m.law.dahl_level[1]);
    vec done = exponential((-m.law.dahl_stiffness / level) * (x - g.x));
    put(g.z, due, level + (g.z - level) * done);
  }
  put(g.flights, turns | leaves, g.flights + 1.0);
  put(g.time, due, g.time + t.duration);
  put(g.x, due, x);
  put(g.v, due, pick(turns, 0, v));
  put(g.direction, turns, -g.direction);
  put(g.pressed_on, leaves, 0);
  return rare;
}

// A step of the contacts `pressed`; `limit`: of its length, for the next attempt where one could not be
// proven. Returns the lanes that have come to where they are to stop; adds to `left` those that the scalar
// code must look at.
template <class rider>
LANE_DEVICE inline mask press_on(const lane_machine &m, mask pressed, vec &limit, mask &left, lane_group &g,
                                 rider &along) {
  contact_expansion p;
  table_piece pieces[tables];
  if (m.law.has_tables > 0)
    find_pieces(m, g, pieces);
  expand_contact(m, g, pieces, p);
  vec natural = contact_length(m, g, p), room = speed_room<false>(m.law, g, pressed);
  const bool fades = any(pressed & (room < 1e299));
  if (fades) {
    vec within = length_within(p, room);
    put(natural, within < natural, within);
  }
  vec length = pick(limit < natural, limit, natural);
  mask kept = ~mask{};
  if (m.law.has_tables > 0)
    kept = keep_in_pieces(m, g, pieces, p, pressed, length);
  contact_stride t = look_along_contact(m, p, pressed, length, g);
  mask pulls, proven = pressed & kept & ~t.lost & positive_until(t.fall, pressed, t.end) &
                       pushes(m, pressed & ~t.lost, t, g, pulls);
  if (fades)
    proven = proven & keeps_within(t.fall, t.end, room_pressed * room);
  // A body that neither moves nor presses stays for ever in the variable of the series.
  mask idle = (p.u[0] <= 0.0) & (magnitude(g.v) < 1e-12);
  // Where its law comes to pull, the contact has no force: a kink.
  mask lost = pressed & (idle | pulls | (~proven & ~(length > shortest_share * natural)));
  proven = proven & ~lost;
  along.flown(proven, pick(t.stops, vec(for_ever), g.time + t.duration),
              contact_motion{t, g, side_of(g), surface_of(m, g)});
  lost = lost | (proven & take_contact_events(m, pieces, t, proven, g)) |
         (pressed & ((g.flights >= g.budget) | along.weary()));
  along.came_off(proven & ~lost & t.leaves, magnitude(g.v));
  put(limit, pressed, pick(proven, vec(1e300), 0.5 * length));
  left = left | lost;
  return proven & ~lost & t.stops;
}

// Are the contacts to go on next, and not the free flights? Where there are more of them.
LANE_DEVICE inline bool contacts_first(mask pressed, mask flying) {
  return 2 * count(pressed) > count(flying);
}

// Steps on with all lanes of one vector until one has stopped or is left to the scalar code.
template <class rider>
LANE_DEVICE void fly_in_series(const lane_machine &m, const lane_regions &regions, int first,
                               lane_batch &batch, rider &along) {
  const double shortest = 1e-12 * m.period;
  lane_group g;
  load<true>(batch, first, g);
  put(g.status, g.status == lane_fresh, lane_flying);
  mask flying = g.status == lane_flying, sent = flying;
  // A step that could not be proven is taken in halves.
  vec limit = m.stride, contact_limit = 1e300;
  int rounds = 0;
  while (any(sent) && !any(sent & (g.status != lane_flying)) && !is_due_back(rounds)) {
    mask pressed = sent & (g.pressed_on > 0.5), left = {};
    if (contacts_first(pressed, sent)) {
      mask there = press_on(m, pressed, contact_limit, left, g, along);
      put(g.status, left, lane_left);
      if (any(there))
        stop_or_pass(m.period, m.domain, there, g.x, g.v, regions, g);
      continue;
    }
    flying = sent & ~pressed;
    mask upward = g.direction > 0.0;
    mask within = m.law.edge <= 0 ? ~mask{} : g.direction * g.v <= m.law.edge;
    vec barrier = pick(upward, m.upper, m.lower);
    expansion p;
    table_piece pieces[tables];
    if (m.law.has_tables > 0)
      find_pieces(m, g, pieces);
    expand(m, g, pieces, within, p);
    vec length = step_length(m, p), ahead = g.until - g.time, room = speed_room<true>(m.law, g, within);
    vec longest = room / (magnitude(p.v[1]) + 1e-290);
    put(length, longest < length, longest);
    put(length, limit < length, limit);
    put(length, length >= ahead, ahead);
    mask kept = ~mask{};
    if (m.law.has_tables > 0)
      kept = keep_in_pieces(m, g, pieces, p, flying, length);
    mask last = length >= ahead;
    stride_of_lanes t = look_for_events(m, p, flying, within, barrier, length, g);
    mask proven = flying & kept & ~t.lost & positive_until(t.fall, flying, t.end);
    if (any(flying & (room < 1e299)))
      proven = proven & keeps_within(t.fall, t.end, room_free * room);
    // At a barrier that it moves towards, a body hits at once.
    left = flying & ((~proven & (length <= shortest)) | (g.direction * (barrier - g.x) <= 0.0));
    proven = proven & ~left;
    mask onward = last & ~(t.turns | t.hits | t.slows);
    const vec heading = g.direction;
    along.flown(proven, pick(onward, vec(for_ever), g.time + t.end * t.length), series_motion{p, g.time});
    left = left | (proven & take_series_events(m, pieces, t, proven, barrier, g)) |
           (flying & ((g.flights >= g.budget) | along.weary()));
    along.met(proven & t.hits & ~left, g.time, g.last_speed,
              m.contact.stiffness > 0 ? vec(not_known) : magnitude(g.v), heading);
    // A step that leaves a piece of a table may do so behind its event.
    put(limit, flying, pick(proven, m.stride, 0.5 * pick(kept, t.end, vec(1.0)) * length));
    put(g.status, left, lane_left);
    mask there = proven & ~left & onward;
    if (any(there))
      stop_or_pass(m.period, m.domain, there, g.x, g.v, regions, g);
  }
  store<true>(g, first, batch);
}

} // namespace

#endif
