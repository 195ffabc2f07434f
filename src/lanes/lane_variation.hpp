// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Bodies in lanes with two directions of change of each (Benettin et al. 1980), for machines with one linear
// equation but for the sign of the friction, and a constant restitution. Along a flight a change of the free
// part Z is a decaying rotation; the saltations at events are those of `variations.f90`.
#ifndef SEPARATRIX_LANE_VARIATION_HPP
#define SEPARATRIX_LANE_VARIATION_HPP

#include "lane_kernel.hpp"

namespace {

template <bool damping> struct tangents_along : nothing_along {
  tangent_fields<vec> t;

  // Takes the directions of the lanes `passed` over the flight that has just ended and its event.
  LANE_DEVICE void cross(const lane_machine &m, mask passed, const lane_group &g) {
    if (!any(passed))
      return;
    vec sine, cosine;
    sine_cosine(g.span * m.damped, sine, cosine);
    if (damping) {
      vec shrink = exponential(-m.decay * g.span);
      sine *= shrink;
      cosine *= shrink;
    }
    const mask hit = g.hits > 0.5;
    // Behind the event the acceleration is that at the start of the next flight.
    const vec ratio = g.start_a / g.end_a;
    const vec bend = (g.start_a + m.restitution * g.end_a) / g.end_v;
    salt(m, passed, hit, cosine, sine, ratio, bend, t.first_re, t.first_im);
    salt(m, passed, hit, cosine, sine, ratio, bend, t.second_re, t.second_im);
    put(t.turns, passed & ~hit, t.turns * ratio);
    vec length = t.first_re * t.first_re + t.first_im * t.first_im;
    vec share = (t.first_re * t.second_re + t.first_im * t.second_im) / length;
    mask upright = passed & (length > 0.0);
    put(t.second_re, upright, t.second_re - share * t.first_re);
    put(t.second_im, upright, t.second_im - share * t.first_im);
  }

  // One direction: Z is v + g x + i w_d x, but for what does not change.
  LANE_LEAF void salt(const lane_machine &m, mask passed, mask hit, vec cosine, vec sine, vec ratio, vec bend,
                      vec &re, vec &im) {
    vec turned = cosine * im + sine * re;
    vec dx = turned * (1 / m.damped), dv = cosine * re - sine * im - m.decay * dx;
    vec dv_struck = bend * dx - m.restitution * dv, dx_struck = -m.restitution * dx;
    dv = pick(hit, dv_struck, ratio * dv);
    dx = pick(hit, dx_struck, dx);
    put(re, passed, dv + m.decay * dx);
    put(im, passed, m.damped * dx);
  }
};

template <bool damping> void fly_with_tangents(const lane_machine &m, lane_batch &batch, lane_tangents &all) {
  const lane_regions nowhere = {0, 1, {}};
  enum { count = sizeof all.fields / sizeof all.fields.turns };
  for (int first = 0; first < lanes; first += vec_size) {
    tangents_along<damping> along;
    for (int i = 0; i < count; i++)
      memcpy((vec *)&along.t + i, (const double *)&all.fields + i * lanes + first, sizeof(vec));
    fly<damping>(m, nowhere, first, batch, along);
    for (int i = 0; i < count; i++)
      memcpy((double *)&all.fields + i * lanes + first, (const vec *)&along.t + i, sizeof(vec));
  }
}

} // namespace

#define SEPARATRIX_LANE_VARIATION(name)                                                                      \
  extern "C" void name(const lane_machine *m, lane_batch *batch, lane_tangents *tangents) {                  \
    if (m->decay > 0)                                                                                        \
      fly_with_tangents<true>(*m, *batch, *tangents);                                                        \
    else                                                                                                     \
      fly_with_tangents<false>(*m, *batch, *tangents);                                                       \
  }

#endif
