// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// What the modes of multibody structures make of the lanes that are in them: coordinates and speeds,
// coefficients and limits of their functions, lengths of their panels.
#ifndef SEPARATRIX_STRUCTURE_MODES_HPP
#define SEPARATRIX_STRUCTURE_MODES_HPP

#include "structure_motion.hpp"

namespace {

// What a joint adds to `still` and `level`: its direction, its coordinate where it is held, the position of
// the stop that is pressed.
inline vec pull_of(const structure_joint &joint, const structure_fields<vec> &s, int j) {
  if (joint.soft > 0.5)
    return pick(s.phase[j] == 1.0, joint.upper, pick(s.phase[j] == -1.0, joint.lower, 0));
  return pick(s.phase[j] == 0.0, s.held[j], s.phase[j]);
}

// Powers of time in coordinate i that neither amplitudes nor drifts have.
template <class size>
inline void still_of(const structure_machine &m, const size &z, const structure_mode &t,
                     const structure_fields<vec> &s, int i, vec (&p)[most_powers]) {
  for (int n = 0; n < z.powers; n++) {
    p[n] = t.still[n][i];
    for (int j = 0; j < z.joints; j++)
      if (switches(m.joint[j]))
        p[n] += t.still_by_joint[n][j][i] * pull_of(m.joint[j], s, j);
  }
}

// 1 where lanes move at all, else 0.
template <class size>
inline vec moves_of(const structure_machine &m, const size &z, const structure_group &g) {
  vec moves = 1;
  if (!z.idle)
    return moves;
  for (int key = 0; key < g.modes; key++)
    if (m.mode[key].idle > 0.5)
      put(moves, g.in_mode[key], vec{});
  return moves;
}

// The lanes of `among`, whose bases are `b`: coordinates and speeds.
template <class size>
inline void position_at(const structure_machine &m, const size &z, mask among, const structure_group &g,
                        const vec (&re)[most_terms], const vec (&im)[most_terms], const structure_bases &b,
                        vec (&q)[most_coordinates], vec (&v)[most_coordinates]) {
  const structure_fields<vec> &s = g.s;
  for (int key = 0; key < g.modes; key++) {
    mask in = g.in_mode[key] & among;
    if (!any(in))
      continue;
    const structure_mode &t = m.mode[key];
    for (int i = 0; i < z.coordinates; i++) {
      vec p[most_powers] = {};
      still_of(m, z, t, s, i, p);
      for (int d = 0; d < z.drifts; d++) {
        p[0] += t.drift[d][i] * s.position[d];
        p[1] += t.drift[d][i] * s.pace[d];
      }
      vec position = p[0], speed = {};
      if (z.powers > 1) {
        position += b.elapsed * (p[1] + b.elapsed * (p[2] + b.elapsed * p[3]));
        speed = p[1] + b.elapsed * (2 * p[2] + 3 * b.elapsed * p[3]);
      }
      for (int n = 0; n < z.waves; n++) {
        position += t.wave_re[n][i] * b.cosine[n] - t.wave_im[n][i] * b.sine[n];
        speed -=
            ((n + 1) * m.drive_frequency) * (t.wave_re[n][i] * b.sine[n] + t.wave_im[n][i] * b.cosine[n]);
      }
      for (int k = 0; k < z.terms; k++) {
        position += t.shape_re[k][i] * re[k] - t.shape_im[k][i] * im[k];
        double pace_re = -t.decay[k] * t.shape_re[k][i] - t.turn[k] * t.shape_im[k][i];
        double pace_im = t.turn[k] * t.shape_re[k][i] - t.decay[k] * t.shape_im[k][i];
        speed += pace_re * re[k] - pace_im * im[k];
      }
      put(q[i], in, position);
      put(v[i], in, speed);
    }
  }
}

// Limits of function j of the lanes `in`, and the direction in which it is looked at: that of the slide, or
// into the contact.
template <class size>
inline vec set_limits(const structure_machine &m, const size &z, mask in, int j, structure_group &g) {
  const int owner = joint_of(m, z.joints, j);
  const structure_joint &joint = m.joint[owner];
  const vec phase = g.s.phase[owner];
  mask moves = phase != 0.0;
  vec d = 1, low = joint.lower, high = joint.upper;
  if (joint.slides > 0.5) {
    d = pick(moves, phase, 1);
    low = pick(moves, 0, -joint.upper);
    high = pick(moves, unlimited, joint.upper);
  } else if (joint.soft > 0.5) {
    mask pressed = magnitude(phase) == 1.0, waits = magnitude(phase) == 2.0;
    d = pick(phase < 0.0, -1, 1);
    vec stop = d * pick(phase < 0.0, joint.lower, joint.upper);
    if (j < z.joints) {
      put(low, moves, joint.pulls > 0.5 ? stop : pick(pressed, joint.stiffness * stop, stop));
    } else {
      // Where it waits its force stays below nothing.
      low = pick(waits, -joint.stiffness * stop, -unlimited);
      d = pick(waits, -d, 0);
    }
    high = j < z.joints ? pick(moves, unlimited, joint.upper) : vec(unlimited);
  }
  put(g.low[j], in, low);
  put(g.high[j], in, high);
  return d;
}

// Whether any lane of `asked` has a limit of function j on `side` -1 or +1.
template <class size>
inline bool has_limit(const structure_machine &m, const size &z, const structure_group &g, mask asked, int j,
                      int side) {
  if (j >= z.joints)
    return side < 0;
  const structure_joint &joint = m.joint[j];
  if (joint.slides > 0.5)
    return side < 0 || any(asked & (g.s.phase[j] == 0.0));
  if (joint.soft > 0.5 && side < 0 && any(asked & (g.s.phase[j] != 0.0)))
    return true;
  if ((side > 0 ? joint.has_upper : joint.has_lower) < 0.5)
    return false;
  return joint.soft < 0.5 || any(asked & (g.s.phase[j] == 0.0));
}

// The coefficients of the flights of the lanes `changed`, from their amplitudes and phases.
template <class size>
inline void enter_modes(const structure_machine &m, const size &z, mask changed, structure_group &g) {
  mask waits = {};
  for (int j = z.joints; j < z.joints + z.pushes; j++)
    waits = waits | (magnitude(g.s.phase[joint_of(m, z.joints, j)]) == 2.0);
  g.waits = any(waits);
  for (int key = 0; key < g.modes; key++) {
    mask in = g.in_mode[key] & changed;
    if (!any(in))
      continue;
    const structure_mode &t = m.mode[key];
    vec amplitude[most_terms], steepest = {};
    for (int k = 0; k < z.terms; k++) {
      double square = t.decay[k] * t.decay[k] + t.turn[k] * t.turn[k];
      put(g.decay[k], in, t.decay[k]);
      put(g.turn[k], in, t.turn[k]);
      put(g.square[k], in, square);
      amplitude[k] = size_above(g.s.re[k], g.s.im[k]);
    }
    for (int j = 0; j < z.joints + z.pushes; j++) {
      vec d = set_limits(m, z, in, j, g), steady_size = t.steady[j], sixth = t.steady_sixth[j];
      for (int k = 0; k < z.terms; k++) {
        double square = t.decay[k] * t.decay[k] + t.turn[k] * t.turn[k];
        vec share = t.part_size[k][j] * amplitude[k];
        steady_size += share;
        sixth += (square * square * square) * share;
        put(g.part_re[j][k], in, d * (t.part_re[k][j] * g.s.re[k] - t.part_im[k][j] * g.s.im[k]));
        put(g.part_im[j][k], in, d * (t.part_re[k][j] * g.s.im[k] + t.part_im[k][j] * g.s.re[k]));
      }
      for (int n = 0; n < z.waves; n++) {
        put(g.amplitude_re[j][n], in, d * t.amplitude_re[n][j]);
        put(g.amplitude_im[j][n], in, d * t.amplitude_im[n][j]);
      }
      for (int n = 0; n < z.powers; n++) {
        vec level = t.level[n][j];
        for (int i = 0; i < z.joints; i++)
          if (switches(m.joint[i]))
            level += t.level_by_joint[n][j][i] * pull_of(m.joint[i], g.s, i);
        for (int i = 0; i < z.drifts; i++) {
          if (n == 0)
            level += t.level_by_position[i][j] * g.s.position[i];
          if (n < 2)
            level += t.level_by_pace[n][i][j] * g.s.pace[i];
        }
        put(g.power[n][j], in, d * level);
      }
      put(g.sixth[j], in, sixth);
      if (j < z.joints)
        put(g.felt_mass[j], in, t.felt_mass[j]);
      vec ratio = sixth / (steady_size + 1e-300);
      put(steepest, ratio > steepest, ratio);
    }
    put(g.close, in, t.close);
    // The longest that will do.
    mask fits = in;
    for (int l = panel_lengths - 1; l >= 0; l--) {
      fits = fits & (steepest <= t.steepest[l]);
      if (!any(fits))
        break;
      put(g.panel, fits, t.panel[l]);
      for (int k = 0; k < z.terms; k++) {
        put(g.step.re[k], fits, t.step_re[l][k]);
        put(g.step.im[k], fits, t.step_im[l][k]);
      }
      for (int n = 0; n < z.waves; n++) {
        put(g.step.cosine[n], fits, t.step_cosine[l][n]);
        put(g.step.sine[n], fits, t.step_sine[l][n]);
      }
    }
  }
}

inline void put_outlook(int functions, const outlook &from, outlook &o) {
  for (int j = 0; j < functions; j++) {
    o.f[j] = from.f[j];
    o.f1[j] = from.f1[j];
    o.f2[j] = from.f2[j];
    o.f3[j] = from.f3[j];
  }
}

inline void put_outlook(int functions, mask where, const outlook &from, outlook &o) {
  for (int j = 0; j < functions; j++) {
    put(o.f[j], where, from.f[j]);
    put(o.f1[j], where, from.f1[j]);
    put(o.f2[j], where, from.f2[j]);
    put(o.f3[j], where, from.f3[j]);
  }
}

// The functions where the flights of the lanes `in` start, where `b` has the harmonics.
template <class size>
inline void look_from_start(const structure_machine &m, const size &z, mask in, structure_bases &b,
                            structure_group &g) {
  outlook o;
  b.elapsed = {};
  for (int k = 0; k < z.terms; k++) {
    b.re[k] = 1;
    b.im[k] = {};
  }
  functions_at(m, z, g, b, o);
  put_outlook(functions_of(z, g), in, o, g.first);
  for (int n = 0; n < z.waves; n++) {
    put(g.first_cosine[n], in, b.cosine[n]);
    put(g.first_sine[n], in, b.sine[n]);
  }
}

} // namespace

#endif
