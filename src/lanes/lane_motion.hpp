// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The motion of many bodies between events. x = equilibrium + periodic response + Im(exp(lambda s) Z)/w_d,
// lambda = -g + i w_d.
#ifndef SEPARATRIX_LANE_MOTION_HPP
#define SEPARATRIX_LANE_MOTION_HPP

#include "lane_elementary.hpp"
#include "lane_types.hpp"

#include <cstddef>

namespace {

typedef lane_fields<vec> lane_group;

enum {
  members = sizeof(lane_batch::fields) / sizeof(double[lanes]),
  plain_members = offsetof(lane_fields<double[lanes]>, pressed_on) / sizeof(double[lanes])
};

template <bool all> LANE_DEVICE inline void load(const lane_batch &batch, int first, lane_group &g) {
  LANE_UNROLL
  for (int i = 0; i < (all ? members : plain_members); i++)
    memcpy((vec *)&g + i, (const double *)&batch.fields + i * lanes + first, sizeof(vec));
}

template <bool all> LANE_DEVICE inline void store(const lane_group &g, int first, lane_batch &batch) {
  LANE_UNROLL
  for (int i = 0; i < (all ? members : plain_members); i++)
    memcpy((double *)&batch.fields + i * lanes + first, (const vec *)&g + i, sizeof(vec));
}

// Position and four derivatives, and the free part exp(lambda s) Z.
struct kinematics {
  vec x, v, a, j, s, re, im;
};

// With `brief` position and velocity alone.
template <bool damping, bool brief = false, class machine>
LANE_DEVICE inline kinematics evaluate(const machine &m, const lane_group &g, vec elapsed) {
  LANE_COUNT(evaluations, vec_size);
  kinematics k;
  vec turn_s, turn_c, sine, cosine;
  sine_cosine(elapsed * m.damped, turn_s, turn_c);
  sine_cosine((g.start + elapsed) * m.drive_frequency, sine, cosine);
  if (damping) {
    vec shrink = exponential(-m.decay * elapsed);
    turn_s *= shrink;
    turn_c *= shrink;
  }
  k.re = turn_c * g.z_re - turn_s * g.z_im;
  k.im = turn_s * g.z_re + turn_c * g.z_im;
  const auto stiffness = m.natural * m.natural, drag = 2 * m.decay;
  vec y = k.im * (1 / m.damped);
  k.v = damping ? k.re - m.decay * y : k.re;
  if constexpr (!brief) {
    k.a = damping ? -stiffness * y - drag * k.v : -stiffness * y;
    k.j = damping ? -stiffness * k.v - drag * k.a : -stiffness * k.v;
    k.s = damping ? -stiffness * k.a - drag * k.j : -stiffness * k.a;
  }
  vec c = cosine, s = sine;
  for (int n = 0; n < m.harmonics; n++) {
    double w = (n + 1) * m.drive_frequency, w2 = w * w;
    vec part = m.cosine[n] * c + m.sine[n] * s, slope = m.sine[n] * c - m.cosine[n] * s;
    y += part;
    k.v += w * slope;
    if constexpr (!brief) {
      k.a -= w2 * part;
      k.j -= (w2 * w) * slope;
      k.s += (w2 * w2) * part;
    }
    vec next = c * cosine - s * sine;
    s = s * cosine + c * sine;
    c = next;
  }
  if constexpr (machine::modal)
    k.x = m.rest + y;
  else
    k.x = (m.rest - g.direction * m.offset) + y;
  return k;
}

// exp(lambda step) (re + i im) for a step short enough for so many terms.
template <bool damping, int terms, class machine>
LANE_DEVICE inline void turn_on(const machine &m, vec step, vec &re, vec &im) {
  vec a = re, b = im;
  for (int n = terms; n >= 1; n--) {
    vec part = (1.0 / n) * step;
    vec next = re + part * (damping ? -m.decay * a - m.damped * b : -m.damped * b);
    b = im + part * (damping ? m.damped * a - m.decay * b : m.damped * a);
    a = next;
  }
  re = a;
  im = b;
}

// At least |Z|, at most 8 % more.
LANE_DEVICE inline vec free_size(const lane_group &g) {
  vec re = magnitude(g.z_re), im = magnitude(g.z_im);
  return re + im - 0.5857864376269049 * pick(re < im, re, im);
}

// Bound on the seventh derivative of the position.
template <class machine> LANE_DEVICE inline vec derivative_bound(const machine &m, const lane_group &g) {
  return m.bound_periodic + m.bound_free * free_size(g);
}

// Derivatives 4 to 6 of the position at the end of the flight, without damping.
LANE_DEVICE inline void end_derivatives(const lane_machine &m, const lane_group &g, vec &snap, vec &crackle,
                                        vec &pop) {
  vec sine, cosine;
  sine_cosine((g.start + g.span) * m.drive_frequency, sine, cosine);
  const double stiffness = m.natural * m.natural, fourth = stiffness * stiffness;
  snap = (fourth * (1 / m.natural)) * g.end_im;
  crackle = fourth * g.end_re;
  pop = -stiffness * snap;
  vec c = cosine, s = sine;
  for (int n = 0; n < m.harmonics; n++) {
    double w = (n + 1) * m.drive_frequency, w2 = w * w, w4 = w2 * w2;
    vec part = w4 * (m.cosine[n] * c + m.sine[n] * s);
    snap += part;
    crackle += (w * w4) * (m.sine[n] * c - m.cosine[n] * s);
    pop -= w2 * part;
    vec next = c * cosine - s * sine;
    s = s * cosine + c * sine;
    c = next;
  }
}

} // namespace

#endif
