// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// What lanes of multibody structures do between flights: impacts, sticking and sliding, the flights that
// follow, stops. What several joints would have to decide together is left to the scalar code.
#ifndef SEPARATRIX_STRUCTURE_EVENTS_HPP
#define SEPARATRIX_STRUCTURE_EVENTS_HPP

#include "lane_restitution.hpp"
#include "structure_search.hpp"

namespace {

// Amplitudes of the flights that set off from the state and the phases of `fresh`, where `b` has the
// harmonics. Returns those that no mode in lanes has.
template <class size>
inline mask set_amplitudes(const structure_machine &m, const size &z, mask fresh, const structure_bases &b,
                           structure_group &g) {
  mask unknown = fresh;
  put(g.s.start, fresh, g.s.time);
  put(g.s.found, fresh, 0);
  note_modes(m, z, fresh, g);
  for (int key = 0; key < g.modes; key++) {
    mask in = g.in_mode[key] & fresh;
    const structure_mode &t = m.mode[key];
    if (t.known < 0.5 || !any(in))
      continue;
    unknown = unknown & ~in;
    vec position[most_coordinates], speed[most_coordinates];
    for (int i = 0; i < z.coordinates; i++) {
      position[i] = g.s.q[i];
      speed[i] = g.s.v[i];
      for (int n = 0; n < z.waves; n++) {
        double w = (n + 1) * m.drive_frequency;
        position[i] -= t.wave_re[n][i] * b.cosine[n] - t.wave_im[n][i] * b.sine[n];
        speed[i] += w * (t.wave_re[n][i] * b.sine[n] + t.wave_im[n][i] * b.cosine[n]);
      }
    }
    for (int j = 0; j < z.joints; j++) {
      if (m.joint[j].slides < 0.5)
        continue;
      vec held = {};
      for (int i = 0; i < z.coordinates; i++)
        held += m.joint[j].row[i] * position[i];
      put(g.s.held[j], in, held);
    }
    for (int i = 0; i < z.coordinates; i++) {
      vec still[most_powers] = {};
      still_of(m, z, t, g.s, i, still);
      position[i] -= still[0];
      if (z.powers > 1)
        speed[i] -= still[1];
    }
    for (int d = 0; d < z.drifts; d++) {
      vec b = {}, c = {};
      for (int i = 0; i < z.coordinates; i++) {
        b += t.position_from_position[i][d] * position[i] + t.position_from_speed[i][d] * speed[i];
        c += t.pace_from_speed[i][d] * speed[i];
      }
      put(g.s.position[d], in, b);
      put(g.s.pace[d], in, c);
    }
    for (int k = 0; k < z.terms; k++) {
      vec re = {}, im = {};
      for (int i = 0; i < z.coordinates; i++) {
        re += t.from_position_re[i][k] * position[i] + t.from_speed_re[i][k] * speed[i];
        im += t.from_position_im[i][k] * position[i] + t.from_speed_im[i][k] * speed[i];
      }
      put(g.s.re[k], in, re);
      put(g.s.im[k], in, im);
    }
  }
  return unknown;
}

// Does the chatter of a gap that opens at speed u, with its acceleration and the rate of that, end so soon
// that the scalar code may complete it? As in `multibody_transition.f90`, with room for rounding.
inline mask chatters_out(const structure_machine &m, const structure_joint &joint, vec u, vec a, vec rate) {
  if (joint.restitution >= 1)
    return mask{};
  vec last = 2 * u / (-a * (1 - joint.restitution));
  return (a < 0.0) & (last <= 1.001 * m.chatter_time) &
         (last * magnitude(rate) <= -1.001 * a * m.chatter_share);
}

// Flights of the lanes `fresh`, where `b` has the harmonics. Returns those that do not start as their phases
// require: joints that should stick but do not, or a chatter that ends.
template <class size>
inline mask set_off(const structure_machine &m, const size &z, mask fresh, structure_bases &b,
                    structure_group &g) {
  mask wrong = set_amplitudes(m, z, fresh, b, g);
  enter_modes(m, z, fresh & ~wrong, g);
  look_from_start(m, z, fresh, b, g);
  const outlook &o = g.first;
  for (int j = 0; j < functions_of(z, g); j++) {
    const structure_joint &joint = m.joint[joint_of(m, z.joints, j)];
    mask above = g.s.left == double(j + 1), below = g.s.left == -double(j + 1);
    mask even = joint.even > 0.5 ? g.s.rising == double(j + 1) : mask{};
    vec room = joint.tie;
    if (joint.slides > 0.5)
      room = pick(g.s.phase[j] == 0.0, joint.tie, m.slowest);
    if (joint.soft > 0.5 && joint.pulls < 0.5)
      room = j < z.joints ? pick(magnitude(g.s.phase[j]) == 1.0, joint.tie * joint.stiffness, joint.tie)
                          : vec(joint.tie * joint.stiffness);
    // What has just been zero must rise, all else be above.
    mask clear_below = pick(below, pick(even, o.f2[j], o.f1[j]) > 0.0, o.f[j] > g.low[j] + room);
    mask clear_above = pick(above, o.f1[j] < 0.0, o.f[j] < g.high[j] - room);
    if (j >= z.joints)
      clear_below = clear_below | (g.low[j] == -unlimited);
    if (has_limit(m, z, g, fresh, j, -1))
      wrong = wrong | (fresh & ~clear_below);
    if (has_limit(m, z, g, fresh, j, 1))
      wrong = wrong | (fresh & ~clear_above);
    if (switches(joint))
      continue;
    wrong = wrong | (fresh & above & chatters_out(m, joint, -o.f1[j], -o.f2[j], o.f3[j]));
    wrong = wrong | (fresh & below & chatters_out(m, joint, o.f1[j], o.f2[j], o.f3[j]));
  }
  return wrong;
}

// Sticking or sliding of joint j where `at` it was found. Where it turns, and it or another that sticks takes
// more force to hold than to slide, the other might give way instead: the scalar code decides which does.
inline void slide_or_stick(const structure_machine &m, int j, mask at, mask &rare, mask &stuck,
                           structure_group &g) {
  const structure_joint &joint = m.joint[j];
  vec d = g.s.phase[j];
  mask slid = at & (d != 0.0), gave_way = at & (d == 0.0);
  // What would hold it.
  vec force = -(g.s.end_f1[j] * g.felt_mass[j] + joint.kinetic);
  mask holds = magnitude(force)<joint.upper - joint.tie, turns = force> joint.upper + joint.tie;
  rare = rare | (slid & ~holds & ~turns);
  stuck = slid & holds;
  for (int i = 0; i < int(m.joints); i++)
    if (i != j && m.joint[i].slides > 0.5 && (joint.even < 0.5 || m.joint[i].even < 0.5))
      rare = rare | (slid & turns & (g.s.phase[i] == 0.0));
  put(g.s.phase[j], slid, pick(holds, 0, -d));
  put(g.s.left, slid & turns, -double(j + 1));
  put(g.s.phase[j], gave_way, -g.s.side);
  put(g.s.left, gave_way, -double(j + 1));
  put(g.s.rising, gave_way, j + 1);
}

// Soft contact j begins or ends, or its force does, where `at` that was found. Returns the lanes where it
// begins.
inline mask press_or_leave(const structure_machine &m, int j, mask at, structure_group &g) {
  const structure_joint &joint = m.joint[j];
  const vec phase = g.s.phase[j], side = pick(phase < 0.0, -1, 1);
  const double from_here = -double(j + 1);
  mask begins = at & (phase == 0.0), ends = at & ~begins;
  put(g.s.phase[j], begins, g.s.side);
  if (joint.pulls > 0.5)
    put(g.s.left, begins, from_here);
  mask cut = joint.pulls > 0.5 ? mask{} : ends & (magnitude(phase) == 1.0);
  put(g.s.phase[j], cut, 2 * phase);
  put(g.s.left, cut, -joint.push);
  mask free = ends & ~cut;
  put(g.s.phase[j], free, 0);
  put(g.s.left, free, -from_here * side);
  return begins;
}

// A soft contact without force pushes again where `at` that was found.
inline void press_again(int j, mask at, structure_group &g) {
  put(g.s.phase[j], at, 0.5 * g.s.phase[j]);
  put(g.s.left, at, -double(j + 1));
}

// Impact of contact j where `at` it was found.
template <class size>
inline void apply_impact(const structure_machine &m, const size &z, int j, mask at, mask &rare,
                         structure_group &g) {
  const structure_joint &joint = m.joint[j];
  vec change = -(1 + restitution_at(joint, magnitude(g.s.end_f1[j]))) * g.s.end_f1[j];
  for (int i = 0; i < z.coordinates; i++)
    put(g.s.v[i], at, g.s.v[i] + change * joint.kick[i]);
  for (int i = 0; i < z.joints; i++) {
    if (m.joint[i].slides < 0.5 || joint.cross[i] == 0)
      continue;
    mask slides = g.s.phase[i] != 0.0;
    vec before = pick(slides, g.s.phase[i] * g.s.end_f[i], 0), kick = change * joint.cross[i],
        after = before + kick;
    rare = rare | (at & (magnitude(after) <= 1e-12 * (magnitude(before) + magnitude(kick))));
    put(g.s.phase[i], at, pick(after > 0.0, 1, -1));
  }
  put(g.s.left, at, g.s.side * double(j + 1));
}

// The events of the lanes `due` and the flights that follow. Returns the lanes that the scalar code must look
// at: they are where their last flight began.
template <class size>
inline mask take_events(const structure_machine &m, const size &z, mask due, structure_group &g) {
  vec q[most_coordinates], v[most_coordinates], phase[most_joints], time = g.s.time, left = g.s.left,
                                                                    burst = g.s.burst, speed = {};
  structure_bases b;
  mask rare = {}, struck = {}, stuck = {}, changed = {};
  for (int i = 0; i < z.coordinates; i++) {
    q[i] = g.s.q[i];
    v[i] = g.s.v[i];
  }
  for (int j = 0; j < z.joints; j++)
    phase[j] = g.s.phase[j];
  const vec moves = moves_of(m, z, g);
  harmonics_at(m, z, g.s.start + g.s.span, b);
  b.elapsed = g.s.span;
  position_at(m, z, due, g, g.s.end_re, g.s.end_im, b, g.s.q, g.s.v);
  put(g.s.time, due, g.s.start + g.s.span);
  put(g.s.left, due, 0);
  put(g.s.rising, due, 0);
  put(g.s.burst, due & (g.s.span >= m.burst_gap), 0);
  for (int i = 0; i < z.coordinates; i++)
    rare = rare | (due & ~(magnitude(g.s.q[i]) < m.domain));
  for (int j = 0; j < z.joints; j++) {
    mask at = due & (g.s.joint == double(j + 1)), now = {};
    if (!any(at))
      continue;
    changed = changed | at;
    if (m.joint[j].slides > 0.5) {
      slide_or_stick(m, j, at, rare, now, g);
      stuck = stuck | now;
    } else if (m.joint[j].soft > 0.5) {
      mask begins = press_or_leave(m, j, at, g);
      put(speed, begins, magnitude(g.s.end_f1[j]));
      struck = struck | begins;
    } else {
      // The scalar code counts impacts that follow each other so fast.
      rare = rare | (at & (g.s.span < m.shortest));
      apply_impact(m, z, j, at, rare, g);
      put(speed, at, magnitude(g.s.end_f1[j]));
      put(g.s.burst, at, g.s.burst + 1.0);
      struck = struck | at;
    }
  }
  for (int j = z.joints; j < z.joints + z.pushes; j++) {
    mask at = due & (g.s.joint == double(j + 1));
    changed = changed | at;
    press_again(joint_of(m, z.joints, j), at, g);
  }
  LANE_COUNT(events, count(changed));
  rare = rare | set_off(m, z, due & ~rare, b, g);
  if (any(rare)) {
    for (int i = 0; i < z.coordinates; i++) {
      put(g.s.q[i], rare, q[i]);
      put(g.s.v[i], rare, v[i]);
    }
    for (int j = 0; j < z.joints; j++)
      put(g.s.phase[j], rare, phase[j]);
    put(g.s.time, rare, time);
    put(g.s.left, rare, left);
    put(g.s.burst, rare, burst);
  }
  put(g.c.flights, changed & ~rare, g.c.flights + moves);
  put(g.s.sticks, stuck & ~rare, g.s.sticks + 1.0);
  struck = struck & ~rare;
  put(g.c.impacts, struck, g.c.impacts + 1.0);
  put(g.c.speed_sum, struck, g.c.speed_sum + speed);
  put(g.c.last_speed, struck, speed);
  return rare;
}

// The attractors to which points on the section have converged, 0 = none; as `squared_distance` of
// `attractors.f90`.
template <class size>
inline vec attractors_reached(const size &z, const structure_batch &batch, const vec (&q)[most_coordinates],
                              const vec (&v)[most_coordinates]) {
  vec reached = {};
  for (int r = batch.regions - 1; r >= 0; r--) {
    const structure_region &region = batch.region[r];
    vec d[most_section], square = {};
    for (int i = 0; i < z.coordinates; i++) {
      d[i] = (q[i] - region.point[i]) * region.scaling[i];
      d[z.coordinates + i] = (v[i] - region.point[z.coordinates + i]) * region.scaling[z.coordinates + i];
    }
    for (int j = 0, at = 0; j < 2 * z.coordinates; j++) {
      vec row = {};
      for (int i = 0; i < j; i++)
        row += region.metric[at + i] * d[i];
      square += d[j] * (2 * row + region.metric[at + j] * d[j]);
      at += j + 1;
    }
    put(reached, square <= region.reach, region.attractor);
  }
  return reached;
}

// Lanes `there`, where they are to stop: those that need not stop at the section pass; see `stop_or_pass` of
// lane_stops.hpp. What does not move may be at rest, which the caller has to be asked.
template <class size>
inline void take_stops(const structure_machine &m, const size &z, mask there, bool complete,
                       const structure_batch &batch, structure_group &g) {
  structure_bases b;
  vec re[most_terms], im[most_terms];
  bases_at(m, z, g, g.c.until - g.s.start, b);
  for (int k = 0; k < z.terms; k++) {
    re[k] = g.s.re[k] * b.re[k] - g.s.im[k] * b.im[k];
    im[k] = g.s.re[k] * b.im[k] + g.s.im[k] * b.re[k];
  }
  position_at(m, z, there, g, re, im, b, g.s.q, g.s.v);
  const vec moves = moves_of(m, z, g);
  mask section = there & (g.c.until >= m.period), passing = section & (g.c.sections > 0.5) & (moves > 0.5);
  for (int i = 0; i < z.coordinates; i++)
    passing = passing & (magnitude(g.s.q[i]) <= m.domain);
  passing = complete ? passing : mask{};
  vec reached = any(passing) ? attractors_reached(z, batch, g.s.q, g.s.v) : vec{};
  passing = passing & ((reached < 0.5) | (g.c.leaves < 0.5));
  put(g.c.flights, there, g.c.flights + moves);
  put(g.s.time, there, pick(section, vec{}, g.c.until));
  put(g.s.left, there, 0);
  put(g.s.burst, there, 0);
  put(g.s.start, section, g.s.start - m.period);
  put(g.c.elapsed, passing, g.c.elapsed + m.period);
  put(g.c.reached, passing, reached);
  put(g.c.settled, passing, pick(reached < 0.5, -1, pick(g.c.settled < 0.0, g.c.elapsed, g.c.settled)));
  put(g.c.sections, passing, g.c.sections - 1.0);
  put(g.c.status, there & ~passing, lane_stopped);
}

} // namespace

#endif
