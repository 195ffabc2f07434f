// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The motion of multibody structures between events, in lanes: sums of complex exponentials and harmonics;
// see `structure_mode`.
#ifndef SEPARATRIX_STRUCTURE_MOTION_HPP
#define SEPARATRIX_STRUCTURE_MOTION_HPP

#include "lane_elementary.hpp"
#include "lane_types.hpp"
#include "structure_types.hpp"

namespace {

const double unlimited = 1e300;

// What the caller sets for the lanes, and what they count for it; members of `lane_fields`.
struct structure_control {
  vec status, until, sections, budget, leaves, elapsed, reached, settled, flights, impacts, speed_sum,
      last_speed, margin;

  template <class each> void exchange(lane_fields<double[lanes]> &f, int first, each move) {
    move(f.status + first, status);
    move(f.until + first, until);
    move(f.sections + first, sections);
    move(f.budget + first, budget);
    move(f.leaves + first, leaves);
    move(f.elapsed + first, elapsed);
    move(f.reached + first, reached);
    move(f.settled + first, settled);
    move(f.flights + first, flights);
    move(f.impacts + first, impacts);
    move(f.speed_sum + first, speed_sum);
    move(f.last_speed + first, last_speed);
    move(f.margin + first, margin);
  }
};

// How much there is of everything, so that loops have their ends.
template <int n, int t, int j, int w> struct fixed_size {
  enum {
    coordinates = n,
    terms = t,
    joints = j,
    pushes = 0,
    waves = w,
    powers = 1,
    drifts = 0,
    idle = 0,
    misses = 0
  };
  explicit fixed_size(const structure_machine &) {}
};

struct any_size {
  int coordinates, terms, joints, pushes, waves, powers, drifts;
  // Some mode is idle; gaps are noted at which stops are missed.
  bool idle, misses;
  explicit any_size(const structure_machine &m)
      : coordinates(int(m.coordinates)), terms(0), joints(int(m.joints)), pushes(int(m.pushes)),
        waves(int(m.waves)), powers(1), drifts(0), idle(false), misses(m.misses > 0.5) {
    for (const structure_mode &t : m.mode) {
      terms = t.terms > terms ? int(t.terms) : terms;
      powers = t.powers > powers ? int(t.powers) : powers;
      drifts = t.drifts > drifts ? int(t.drifts) : drifts;
      idle = idle || t.idle > 0.5;
    }
  }
};

// The functions and their derivatives.
struct outlook {
  vec f[most_functions], f1[most_functions], f2[most_functions], f3[most_functions];
};

// Two derivatives more.
struct far_outlook {
  vec f4[most_functions], f5[most_functions];
};

// Exponentials and harmonics at an instant, and the time since the start of the flight.
struct structure_bases {
  vec elapsed;
  vec re[most_terms], im[most_terms], cosine[most_waves], sine[most_waves];
};

// Lanes of one vector. After the fields: coefficients of the modes that they are in, times the amplitudes.
struct structure_group {
  structure_control c;
  structure_fields<vec> s;
  vec decay[most_terms], turn[most_terms], square[most_terms];
  vec part_re[most_functions][most_terms], part_im[most_functions][most_terms];
  vec amplitude_re[most_functions][most_waves], amplitude_im[most_functions][most_waves];
  // Limits of the functions, bound on their sixth derivatives, mass that a joint feels.
  vec power[most_powers][most_functions], low[most_functions], high[most_functions], sixth[most_functions],
      felt_mass[most_joints];
  // How many modes there are, and the lanes that are in them.
  int modes;
  mask in_mode[most_structure_modes];
  // Some lane waits until a contact without force is free: the last functions are looked at.
  bool waits;
  // The last step of the root search is shorter. Length of the panels [s], and what turns the exponentials
  // and harmonics from one to the next.
  vec close, panel;
  structure_bases step;
  // The functions at the start, and the harmonics there.
  outlook first;
  vec first_cosine[most_waves], first_sine[most_waves];
};

// How many functions are looked at.
template <class size> inline int functions_of(const size &z, const structure_group &g) {
  return z.pushes > 0 && g.waits ? z.joints + z.pushes : z.joints;
}

// Whether the mode of a joint depends on its phase.
inline bool switches(const structure_joint &joint) { return joint.slides > 0.5 || joint.soft > 0.5; }

// Number of the joint that function j is of.
inline int joint_of(const structure_machine &m, int joints, int j) {
  if (j < joints)
    return j;
  int owner = 0;
  while (m.joint[owner].push != double(j + 1))
    owner++;
  return owner;
}

// Notes which of the lanes `where` are in which mode, by their phases.
template <class size>
inline void note_modes(const structure_machine &m, const size &z, mask where, structure_group &g) {
  int modes = 1;
  mask in[most_structure_modes] = {~mask{}};
  for (int j = 0; j < z.joints; j++) {
    const structure_joint &joint = m.joint[j];
    if (!switches(joint))
      continue;
    mask set = joint.slides > 0.5 ? g.s.phase[j] == 0.0 : magnitude(g.s.phase[j]) == 1.0;
    for (int key = 0; key < modes; key++) {
      in[key + modes] = in[key] & set;
      in[key] = in[key] & ~set;
    }
    modes *= 2;
  }
  g.modes = modes;
  for (int key = 0; key < modes; key++)
    g.in_mode[key] = (g.in_mode[key] & ~where) | (in[key] & where);
}

// At least |re + i im|, at most 8 % more.
inline vec size_above(vec re, vec im) {
  re = magnitude(re);
  im = magnitude(im);
  return re + im - 0.5857864376269049 * pick(re < im, re, im);
}

// cos and sin of the harmonics where the first has `c` and `s`.
template <class size> inline void set_waves(const size &z, vec c, vec s, structure_bases &b) {
  vec cosine = c, sine = s;
  for (int m = 0; m < z.waves; m++) {
    b.cosine[m] = cosine;
    b.sine[m] = sine;
    vec next = cosine * c - sine * s;
    sine = sine * c + cosine * s;
    cosine = next;
  }
}

template <class size>
inline void harmonics_at(const structure_machine &m, const size &z, vec time, structure_bases &b) {
  if (z.waves == 0)
    return;
  vec c, s;
  sine_cosine(time * m.drive_frequency, s, c);
  set_waves(z, c, s, b);
}

// `elapsed` after the start of the flight.
template <class size>
inline void bases_at(const structure_machine &m, const size &z, const structure_group &g, vec elapsed,
                     structure_bases &b) {
  LANE_COUNT(evaluations, vec_size);
  b.elapsed = elapsed;
  for (int k = 0; k < z.terms; k++) {
    vec sine, cosine, shrink = exponential(-g.decay[k] * elapsed);
    sine_cosine(g.turn[k] * elapsed, sine, cosine);
    b.re[k] = shrink * cosine;
    b.im[k] = shrink * sine;
  }
  harmonics_at(m, z, g.s.start + elapsed, b);
}

// The functions with three derivatives, or with `more` five.
template <class size>
inline void functions_at(const structure_machine &m, const size &z, const structure_group &g,
                         const structure_bases &b, outlook &o, far_outlook *more = nullptr) {
  for (int j = 0; j < functions_of(z, g); j++) {
    vec f = g.power[0][j], f1 = {}, f2 = {}, f3 = {}, f4 = {}, f5 = {};
    if (z.powers > 1) {
      vec c1 = g.power[1][j], c2 = g.power[2][j], c3 = g.power[3][j], t = b.elapsed;
      f += t * (c1 + t * (c2 + t * c3));
      f1 = c1 + t * (2 * c2 + 3 * t * c3);
      f2 = 2 * c2 + 6 * t * c3;
      f3 = 6 * c3;
    }
    for (int k = 0; k < z.terms; k++) {
      vec y = g.part_re[j][k] * b.re[k] - g.part_im[j][k] * b.im[k];
      vec across = g.part_re[j][k] * b.im[k] + g.part_im[j][k] * b.re[k];
      vec twice = 2 * g.decay[k], y1 = -g.decay[k] * y - g.turn[k] * across;
      vec y2 = -g.square[k] * y - twice * y1;
      f += y;
      f1 += y1;
      f2 += y2;
      vec y3 = -g.square[k] * y1 - twice * y2;
      f3 += y3;
      if (more) {
        vec y4 = -g.square[k] * y2 - twice * y3;
        f4 += y4;
        f5 -= g.square[k] * y3 + twice * y4;
      }
    }
    for (int n = 0; n < z.waves; n++) {
      double w = (n + 1) * m.drive_frequency, w2 = w * w;
      vec part = g.amplitude_re[j][n] * b.cosine[n] - g.amplitude_im[j][n] * b.sine[n];
      vec slope = g.amplitude_re[j][n] * b.sine[n] + g.amplitude_im[j][n] * b.cosine[n];
      f += part;
      f1 -= w * slope;
      f2 -= w2 * part;
      f3 += (w2 * w) * slope;
      if (more) {
        f4 += (w2 * w2) * part;
        f5 -= (w2 * w2 * w) * slope;
      }
    }
    o.f[j] = f;
    o.f1[j] = f1;
    o.f2[j] = f2;
    o.f3[j] = f3;
    if (more) {
      more->f4[j] = f4;
      more->f5[j] = f5;
    }
  }
}

} // namespace

#endif
