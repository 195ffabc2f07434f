// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Machines whose equation is linear in every mode of slip, but not the same in all: barriers that are springs
// with dampers, friction that differs by direction or changes with the position. Each lane has the
// coefficients of the mode it is in; the search for events and its proof are those of the plain machine.
#ifndef SEPARATRIX_LANE_MODES_HPP
#define SEPARATRIX_LANE_MODES_HPP

#include "lane_restitution.hpp"
#include "lane_stops.hpp"

namespace {

// The coefficients of the modes that the lanes are in, as `lane_machine` has those of its only one.
struct lane_modes {
  enum { modal = 1 };
  const lane_machine &machine;
  double drive_frequency, period, domain;
  int harmonics;
  vec natural, damped, decay, origin, rest, barrier, leads_to, lead, guess, close, stride;
  vec bound_periodic, bound_free, sixth_periodic, sixth_free;
  vec cosine[most_harmonics], sine[most_harmonics];

  LANE_DEVICE explicit lane_modes(const lane_machine &m)
      : machine(m), drive_frequency(m.drive_frequency), period(m.period), domain(m.domain),
        harmonics(m.harmonics) {}

  // Takes over the coefficients of the modes that the lanes `changed` have come to.
  LANE_DEVICE void enter(mask changed, const lane_group &g) {
    for (int k = 0; k < lane_modes_count; k++) {
      const lane_mode &t = machine.mode[k];
      const double heading = k % 2 == 0 ? 1 : -1;
      mask in = changed & (g.pressed_on == k / 2) & (g.direction == heading);
      if (!any(in))
        continue;
      put(natural, in, t.natural);
      put(damped, in, t.damped);
      put(decay, in, t.decay);
      put(origin, in, t.origin);
      put(rest, in, t.rest);
      put(barrier, in, t.barrier);
      put(leads_to, in, t.leads_to);
      put(lead, in, t.lead);
      put(guess, in, t.guess);
      put(close, in, t.close);
      put(stride, in, t.stride);
      put(bound_periodic, in, t.bound_periodic);
      put(bound_free, in, t.bound_free);
      put(sixth_periodic, in, t.sixth_periodic);
      put(sixth_free, in, t.sixth_free);
      for (int n = 0; n < harmonics; n++) {
        put(cosine[n], in, t.cosine[n]);
        put(sine[n], in, t.sine[n]);
      }
    }
  }
};

// Once the force of a barrier that may not pull has dropped to zero, does it stay so until the body is out?
// It does while the speed w outwards is far more than the barrier's time constant `lead` times what the
// acceleration can be until then.
LANE_DEVICE inline mask leaves_for_good(const lane_modes &f, const lane_group &g, vec w) {
  const lane_machine &m = f.machine;
  const double stiffness = m.natural * m.natural;
  vec a = magnitude(g.end_a);
  vec jerk = 2.0 * (stiffness * w + 2 * m.decay * a) + m.force_rate;
  return (f.lead <= 0.0) | (w > 4.0 * f.lead * (a + 2.0 * f.lead * jerk));
}

// The events of the lanes `due`: impact, reversal of friction, or a change between free and pressed. Returns
// those that the scalar code must look at; the others are `lane_fresh` in the mode that follows.
LANE_DEVICE inline mask take_mode_events(const lane_modes &f, mask due, lane_group &g) {
  const lane_machine &m = f.machine;
  mask hit = g.hits > 0.5, impact = hit & (f.leads_to < 0.0), passage = hit & (f.leads_to >= 0.0);
  mask free = g.pressed_on < 0.5;
  vec w = g.direction * g.end_v, gap = g.direction * (f.barrier - g.end_x);
  vec position = f.origin + pick(hit & (f.lead <= 0.0), f.barrier, g.end_x);
  vec factor = 1.0 + m.friction_slope * position;
  vec push = -g.direction * g.end_a - m.kinetic * factor;
  vec restitution = m.restitution;
  if (any(due & impact))
    restitution = restitution_at(m, w);
  mask turns_back = (push > m.break_away * factor) & (~free | ((position < m.upper) & (position > m.lower)));
  mask passes = (w > 0.0) & leaves_for_good(f, g, w);
  mask plain = pick(impact, restitution * w > m.slow, pick(passage, passes, turns_back)) &
               (magnitude(position) < m.domain) & (factor > 0.0);
  mask rare = due & ~plain;
  due = due & plain;
  mask up = due & free & (g.direction > 0.0), down = due & free & (g.direction < 0.0);
  put(g.up_span, up, g.span);
  put(g.up_hits, up, g.hits);
  put(g.down_span, down, g.span);
  put(g.down_hits, down, g.hits);
  mask struck = due & (impact | (passage & free));
  LANE_COUNT(events, count(due));
  put(g.flights, due, g.flights + 1.0);
  put(g.impacts, struck, g.impacts + 1.0);
  put(g.speed_sum, struck, g.speed_sum + w);
  put(g.last_speed, struck, w);
  put(g.margin, due & ~hit & free & (gap < g.margin), gap);
  put(g.time, due, g.start + g.span);
  put(g.x, due, position);
  put(g.v, due, pick(passage, g.end_v, pick(impact, -restitution * g.end_v, 0)));
  put(g.direction, due & ~passage, -g.direction);
  put(g.touch, due & passage & free, w);
  put(g.pressed_on, due & passage, f.leads_to);
  put(g.status, due, lane_fresh);
  return rare;
}

// The same with what rides along. Out of a barrier, its surface is the origin.
template <class rider>
LANE_DEVICE inline mask pass_mode_events(const lane_modes &f, mask due, lane_group &g, rider &along) {
  const mask hit = g.hits > 0.5, passage = hit & (f.leads_to >= 0.0), free = g.pressed_on < 0.5;
  const vec heading = g.direction;
  along.flown(due, g.start + g.span, closed_motion<true, lane_modes>{f, g});
  const mask rare = take_mode_events(f, due, g), taken = due & ~rare;
  along.met(taken & hit & ~passage, g.time, magnitude(g.end_v), magnitude(g.v), heading);
  along.met(taken & passage & free, g.time, magnitude(g.end_v), vec(not_known), heading);
  const mask out = taken & passage & ~free;
  along.came_off(out & (f.lead <= 0.0), magnitude(g.end_v));
  along.released(out & (f.lead > 0.0), g.time, f.origin);
  return rare;
}

} // namespace

#endif
