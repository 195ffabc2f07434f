// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The first event of flights of jointed structures. A flight is walked along in panels: from one to the next
// by a fixed turn of its exponentials. Over a panel each function of a joint is proven to stay within its
// limits by the Bernstein coefficients of the quintic through its values, slopes and curvatures at both ends,
// less a bound on the error from the amplitudes. Where the proof fails the root is polished by Householder
// steps of fourth order from the quintic's, and the panel up to it is proven.
#ifndef SEPARATRIX_STRUCTURE_SEARCH_HPP
#define SEPARATRIX_STRUCTURE_SEARCH_HPP

#include "structure_motion.hpp"

namespace {

enum { most_panels = 96, most_polishings = 8, most_tries = 24, most_newtons = 5 };

// Is w > 0 strictly between two times `span` apart? Zero at an end is allowed, and a zero rate there.
// `error`: bound on the sixth derivative times span^6/14400, the share of the middle coefficient.
LANE_LEAF mask stays_positive(vec span, vec w0, vec rate0, vec curl0, vec w1, vec rate1, vec curl1,
                              vec error) {
  vec step = 0.2 * span, bend = 0.05 * span * span;
  vec b1 = w0 + step * rate0, b2 = w0 + 2 * step * rate0 + bend * curl0;
  vec b4 = w1 - step * rate1, b3 = w1 - 2 * step * rate1 + bend * curl1;
  return (w0 >= 0.0) & (w0 + 5 * b1 >= 0.0) & (b1 + 2 * b2 > 0.0) & (0.5 * (b2 + b3) > error) &
         (2 * b3 + b4 > 0.0) & (5 * b4 + w1 >= 0.0) & (w1 >= 0.0);
}

// Do all functions stay within their limits between two times?
template <class size>
inline mask stays_within(const structure_machine &m, const size &z, const structure_group &g, mask asked,
                         const outlook &here, const outlook &far, vec span) {
  vec cube = span * span * span, power = cube * cube * (1.0 / 14400);
  mask within = asked;
  for (int j = 0; j < z.joints; j++) {
    const structure_joint &joint = m.joint[j];
    vec error = g.sixth[j] * power;
    if (joint.has_lower > 0.5)
      within = within & stays_positive(span, here.f[j] - g.low[j], here.f1[j], here.f2[j],
                                       far.f[j] - g.low[j], far.f1[j], far.f2[j], error);
    if (joint.has_upper > 0.5 && (joint.slides < 0.5 || any(asked & (g.s.phase[j] == 0.0))))
      within = within & stays_positive(span, g.high[j] - here.f[j], -here.f1[j], -here.f2[j],
                                       g.high[j] - far.f[j], -far.f1[j], -far.f2[j], error);
  }
  return within;
}

// The guard that lanes look for: that of `joint` (1, ...) on `side` +1 (from above, the upper limit) or -1.
struct structure_target {
  vec joint, side;
};

// -side (f - limit) of the targets: positive before the event.
template <class size>
inline void target_values(const size &z, const structure_group &g, const structure_target &target,
                          const outlook &o, vec &w, vec &w1, vec &w2) {
  w = w1 = w2 = vec{};
  for (int j = 0; j < z.joints; j++) {
    mask is = target.joint == double(j + 1);
    vec limit = pick(target.side > 0.0, g.high[j], g.low[j]);
    put(w, is, -target.side * (o.f[j] - limit));
    put(w1, is, -target.side * o.f1[j]);
    put(w2, is, -target.side * o.f2[j]);
  }
}

// Makes the function of the target exactly its limit.
template <class size>
inline void make_zero(const size &z, const structure_group &g, const structure_target &target, mask where,
                      outlook &o) {
  for (int j = 0; j < z.joints; j++)
    put(o.f[j], where & (target.joint == double(j + 1)), pick(target.side > 0.0, g.high[j], g.low[j]));
}

// Of the guards that have fallen at the end of a panel, the one that a straight line lets fall first; none:
// joint 0. The target of `zero`, which lies exactly there, is no other.
template <class size>
inline structure_target earliest_fallen(const structure_machine &m, const size &z, const structure_group &g,
                                        const outlook &here, const outlook &far) {
  structure_target target = {0, 0};
  vec least = 2;
  for (int j = 0; j < z.joints; j++)
    for (int side = -1; side <= 1; side += 2) {
      if ((side > 0 ? m.joint[j].has_upper : m.joint[j].has_lower) < 0.5)
        continue;
      vec w0 = side > 0 ? g.high[j] - here.f[j] : here.f[j] - g.low[j];
      vec w1 = side > 0 ? g.high[j] - far.f[j] : far.f[j] - g.low[j];
      vec share = w0 / (w0 - w1);
      mask first = (w1 < 0.0) & (share < least);
      put(target.joint, first, j + 1);
      put(target.side, first, side);
      put(least, first, share);
    }
  return target;
}

// Share of a panel at which the quintic through both ends of a function falls.
inline vec quintic_root(vec h, vec w, vec w1, vec w2, vec v, vec v1, vec v2) {
  vec a1 = h * w1, a2 = 0.5 * h * h * w2, d0 = v - w - a1 - a2, d1 = h * v1 - a1 - 2 * a2,
      d2 = 0.5 * h * h * v2 - a2;
  vec a3 = 10 * d0 - 4 * d1 + d2, a4 = -15 * d0 + 7 * d1 - 2 * d2, a5 = 6 * d0 - 3 * d1 + d2;
  vec low = {}, high = 1, u = pick(w > 0.0, w / (w - v), 0.7);
  for (int i = 0; i < most_newtons; i++) {
    vec p = w + u * (a1 + u * (a2 + u * (a3 + u * (a4 + u * a5))));
    vec slope = a1 + u * (2 * a2 + u * (3 * a3 + u * (4 * a4 + u * (5 * a5))));
    put(low, p > 0.0, u);
    high = pick(p > 0.0, high, u);
    vec next = u - p / slope;
    u = pick((next > low) & (next < high), next, 0.5 * (low + high));
  }
  return u;
}

// Where the search of flights is.
struct structure_walk {
  // Start and end of the panel: time since the start of the flight, functions; bases at its end.
  vec t, end;
  outlook here, far;
  structure_bases b;
  structure_target target;
  // The end is the zero of the target.
  mask at_zero;
  vec tries, panels;
};

// Keeps the end of the panel as that of the flight.
template <class size>
inline void keep_end(const size &z, mask found, const structure_walk &p, const structure_target &what,
                     structure_group &g) {
  put(g.s.found, found, 1);
  put(g.s.span, found, p.end);
  put(g.s.joint, found, what.joint);
  put(g.s.side, found, what.side);
  for (int k = 0; k < z.terms; k++) {
    put(g.s.end_re[k], found, g.s.re[k] * p.b.re[k] - g.s.im[k] * p.b.im[k]);
    put(g.s.end_im[k], found, g.s.re[k] * p.b.im[k] + g.s.im[k] * p.b.re[k]);
  }
  for (int j = 0; j < z.joints; j++) {
    put(g.s.end_f[j], found, p.far.f[j]);
    put(g.s.end_f1[j], found, p.far.f1[j]);
  }
}

inline void put_bases(int terms, int waves, mask where, const structure_bases &from, structure_bases &b) {
  for (int k = 0; k < terms; k++) {
    put(b.re[k], where, from.re[k]);
    put(b.im[k], where, from.im[k]);
  }
  for (int n = 0; n < waves; n++) {
    put(b.cosine[n], where, from.cosine[n]);
    put(b.sine[n], where, from.sine[n]);
  }
}

inline void put_outlook(int joints, mask where, const outlook &from, outlook &o) {
  for (int j = 0; j < joints; j++) {
    put(o.f[j], where, from.f[j]);
    put(o.f1[j], where, from.f1[j]);
    put(o.f2[j], where, from.f2[j]);
  }
}

// Walks on panel by panel until the proof fails. Flights that last too long end without an event.
template <class size>
inline void walk(const structure_machine &m, const size &z, const structure_bases &turn, mask walking,
                 mask &todo, structure_walk &p, structure_group &g) {
  while (any(walking)) {
    structure_bases next;
    for (int k = 0; k < z.terms; k++) {
      next.re[k] = p.b.re[k] * turn.re[k] - p.b.im[k] * turn.im[k];
      next.im[k] = p.b.re[k] * turn.im[k] + p.b.im[k] * turn.re[k];
    }
    for (int n = 0; n < z.waves; n++) {
      next.cosine[n] = p.b.cosine[n] * turn.cosine[n] - p.b.sine[n] * turn.sine[n];
      next.sine[n] = p.b.cosine[n] * turn.sine[n] + p.b.sine[n] * turn.cosine[n];
    }
    outlook there;
    functions_at<false>(m, z, g, next, there);
    LANE_COUNT(panels, count(walking));
    put_bases(z.terms, z.waves, walking, next, p.b);
    put_outlook(z.joints, walking, there, p.far);
    put(p.end, walking, p.t + g.panel);
    walking = stays_within(m, z, g, walking, p.here, p.far, g.panel);
    mask over = walking & (p.panels >= double(most_panels));
    if (any(over)) {
      keep_end(z, over, p, {0, 0}, g);
      todo = todo & ~over;
      walking = walking & ~over;
    }
    put_outlook(z.joints, walking, p.far, p.here);
    put(p.t, walking, p.end);
    put(p.panels, walking, p.panels + 1.0);
  }
}

// The end of the panel comes to the zero of the target. Returns the lanes where it was not found.
template <class size>
inline mask polish(const structure_machine &m, const size &z, mask asked, structure_walk &p,
                   structure_group &g) {
  vec w, w1, w2, v, v1, v2, low = p.t, high = p.end;
  target_values(z, g, p.target, p.here, w, w1, w2);
  target_values(z, g, p.target, p.far, v, v1, v2);
  vec s = p.t + (p.end - p.t) * quintic_root(p.end - p.t, w, w1, w2, v, v1, v2);
  for (int round = 0; round < most_polishings && any(asked); round++) {
    structure_bases b;
    outlook o;
    vec f3[most_joints], f4[most_joints], w3 = {};
    bases_at(m, z, g, s, b);
    functions_at<true>(m, z, g, b, o, f3, f4);
    target_values(z, g, p.target, o, w, w1, w2);
    for (int j = 0; j < z.joints; j++)
      put(w3, p.target.joint == double(j + 1), -p.target.side * f3[j]);
    put(low, w > 0.0, s);
    high = pick(w > 0.0, high, s);
    vec step = -w * (w1 * w1 - 0.5 * w * w2) / (w1 * (w1 * w1 - w * w2) + (1.0 / 6) * w * w * w3);
    vec next = s + step;
    mask guided = (w1 < 0.0) & (next >= low) & (next <= high) & (next > p.t);
    mask close = asked & guided & (magnitude(step) <= m.close) & (magnitude(w) <= -2 * m.close * w1);
    if (any(close)) {
      for (int k = 0; k < z.terms; k++) {
        vec re = b.re[k], im = b.im[k];
        for (int n = 3; n >= 1; n--) {
          vec part = (1.0 / n) * step, turned = b.re[k] + part * (-g.decay[k] * re - g.turn[k] * im);
          im = b.im[k] + part * (g.turn[k] * re - g.decay[k] * im);
          re = turned;
        }
        put(p.b.re[k], close, re);
        put(p.b.im[k], close, im);
      }
      vec half = 0.5 * step, third = (1.0 / 3) * step, fourth = 0.25 * step;
      for (int j = 0; j < z.joints; j++) {
        vec f = o.f[j] + step * (o.f1[j] + half * (o.f2[j] + third * (f3[j] + fourth * f4[j])));
        put(p.far.f[j], close, f);
        put(p.far.f1[j], close, o.f1[j] + step * (o.f2[j] + half * (f3[j] + third * f4[j])));
        put(p.far.f2[j], close, o.f2[j] + step * (f3[j] + half * f4[j]));
      }
      make_zero(z, g, p.target, close, p.far);
      put(p.end, close, next);
      p.at_zero = p.at_zero | close;
      asked = asked & ~close;
    }
    s = pick(guided, next, 0.5 * (low + high));
  }
  return asked;
}

// The panel becomes its first half.
template <class size>
inline void halve(const structure_machine &m, const size &z, mask asked, structure_walk &p,
                  const structure_group &g) {
  structure_bases b;
  outlook o;
  vec middle = 0.5 * (p.t + p.end);
  bases_at(m, z, g, middle, b);
  functions_at<false>(m, z, g, b, o);
  put_bases(z.terms, z.waves, asked, b, p.b);
  put_outlook(z.joints, asked, o, p.far);
  put(p.end, asked, middle);
  p.at_zero = p.at_zero & ~asked;
}

// Finds what the flights of `seek` end with. Returns the lanes where that failed.
template <class size>
inline mask find_first(const structure_machine &m, const size &z, mask seek, structure_group &g) {
  structure_walk p;
  structure_bases turn;
  for (int k = 0; k < z.terms; k++) {
    p.b.re[k] = 1;
    p.b.im[k] = {};
  }
  harmonics_at(m, z, g.s.start, p.b);
  functions_at<false>(m, z, g, p.b, p.here);
  p.target = {magnitude(g.s.left), pick(g.s.left > 0.0, 1, -1)};
  make_zero(z, g, p.target, seek & (g.s.left != 0.0), p.here);
  p.far = p.here;
  for (int j = 0; j < z.joints; j++)
    if (m.joint[j].even > 0.5)
      put(p.here.f1[j], g.s.rising == double(j + 1), vec{});
  p.t = p.end = p.tries = p.panels = vec{};
  p.at_zero = mask{};
  bases_at(m, z, g, g.panel, turn);
  vec c, s;
  sine_cosine(g.panel * m.drive_frequency, s, c);
  set_waves(z, c, s, turn);
  mask todo = seek, walking = seek, lost = {};
  while (any(todo)) {
    walk(m, z, turn, walking, todo, p, g);
    structure_target fallen = earliest_fallen(m, z, g, p.here, p.far);
    mask aims = todo & (fallen.joint > 0.0), failed = {};
    put(p.target.joint, aims, fallen.joint);
    put(p.target.side, aims, fallen.side);
    if (any(aims)) {
      p.at_zero = p.at_zero & ~aims;
      failed = polish(m, z, aims, p, g);
    }
    mask blind = todo & ~aims;
    if (any(blind))
      halve(m, z, blind, p, g);
    mask within = stays_within(m, z, g, todo, p.here, p.far, p.end - p.t) & ~failed;
    mask found = within & p.at_zero;
    keep_end(z, found, p, p.target, g);
    walking = within & ~p.at_zero;
    put_outlook(z.joints, walking, p.far, p.here);
    put(p.t, walking, p.end);
    put(p.tries, todo, p.tries + 1.0);
    failed = failed | (todo & ~found & (p.tries >= double(most_tries)));
    lost = lost | failed;
    todo = todo & ~found & ~failed;
    walking = walking & todo;
  }
  return lost;
}

} // namespace

#endif
