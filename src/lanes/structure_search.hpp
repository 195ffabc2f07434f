// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// The first event of flights of multibody structures. A flight is walked along in panels: from one to the
// next by a fixed turn of its exponentials. Over a panel each function of a joint is proven to stay within
// its limits by the Bernstein coefficients of the quintic through its values, slopes and curvatures at both
// ends, less a bound on the error from the amplitudes. Where the proof fails the root is polished by
// Householder steps of fourth order from the quintic's, and the panel up to it is proven.
#ifndef SEPARATRIX_STRUCTURE_SEARCH_HPP
#define SEPARATRIX_STRUCTURE_SEARCH_HPP

#include "structure_misses.hpp"

namespace {

enum { most_panels = 256, most_polishings = 8, most_tries = 24, most_newtons = 3 };

// A step over which the slope changes by no more than this share is off by that to the power seven.
const double straight = 1.0 / 64;

// Is w > 0 strictly between two times `span` apart? Zero at an end is allowed, and a zero rate there.
// `error`: bound on the sixth derivative times span^6/14400, the share of the middle coefficient. `halves`:
// of both halves.
template <bool halves>
LANE_LEAF mask stays_positive(vec span, vec w0, vec rate0, vec curl0, vec w1, vec rate1, vec curl1,
                              vec error) {
  vec step = 0.2 * span, bend = 0.05 * span * span;
  vec b1 = w0 + step * rate0, b2 = w0 + 2 * step * rate0 + bend * curl0;
  vec b4 = w1 - step * rate1, b3 = w1 - 2 * step * rate1 + bend * curl1;
  if (!halves)
    return (w0 >= 0.0) & (w0 + 5 * b1 >= 0.0) & (b1 + 2 * b2 > 0.0) & (0.5 * (b2 + b3) > error) &
           (2 * b3 + b4 > 0.0) & (5 * b4 + w1 >= 0.0) & (w1 >= 0.0);
  vec d[7] = {w0,
              (w0 + 5 * b1) * (1.0 / 6),
              (b1 + 2 * b2) * (1.0 / 3),
              0.5 * (b2 + b3) - error,
              (2 * b3 + b4) * (1.0 / 3),
              (5 * b4 + w1) * (1.0 / 6),
              w1};
  mask positive = (w0 >= 0.0) & (w1 >= 0.0);
  for (int level = 1; level <= 6; level++) {
    for (int i = 0; i <= 6 - level; i++)
      d[i] = 0.5 * (d[i] + d[i + 1]);
    positive = positive & (level == 1 ? (d[0] >= 0.0) & (d[5] >= 0.0) : (d[0] > 0.0) & (d[6 - level] > 0.0));
  }
  return positive;
}

// Do all functions stay within their limits between two times? `triggered`: some are beyond them at the end.
template <bool halves, class size>
inline mask stays_within(const structure_machine &m, const size &z, const structure_group &g, mask asked,
                         const outlook &here, const outlook &far, vec span, mask &triggered) {
  vec cube = span * span * span, power = cube * cube * (1.0 / 14400);
  mask within = asked;
  for (int j = 0; j < functions_of(z, g); j++) {
    vec error = g.sixth[j] * power;
    // Where nothing waits the last functions are nothing.
    mask idle = j < z.joints ? mask{} : g.low[j] == -unlimited;
    if (has_limit(m, z, g, asked, j, -1)) {
      triggered = triggered | ((far.f[j] < g.low[j]) & ~idle);
      within = within & (idle | stays_positive<halves>(span, here.f[j] - g.low[j], here.f1[j], here.f2[j],
                                                       far.f[j] - g.low[j], far.f1[j], far.f2[j], error));
    }
    if (has_limit(m, z, g, asked, j, 1)) {
      triggered = triggered | (far.f[j] > g.high[j]);
      within = within & stays_positive<halves>(span, g.high[j] - here.f[j], -here.f1[j], -here.f2[j],
                                               g.high[j] - far.f[j], -far.f1[j], -far.f2[j], error);
    }
  }
  return within;
}

// The same by both halves where that may help.
template <class size>
inline mask proven_within(const structure_machine &m, const size &z, const structure_group &g, mask asked,
                          const outlook &here, const outlook &far, vec span) {
  mask triggered = {}, none = {};
  mask within = stays_within<false>(m, z, g, asked, here, far, span, triggered);
  mask doubtful = asked & ~within & ~triggered;
  if (any(doubtful))
    within = within | stays_within<true>(m, z, g, doubtful, here, far, span, none);
  return within;
}

// The guard that lanes look for: that of `joint` (1, ...) on `side` +1 (from above, the upper limit) or -1.
struct structure_target {
  vec joint, side;
};

// A function and three derivatives of it.
struct guard_derivatives {
  vec w = {}, w1 = {}, w2 = {}, w3 = {};
};

// -side (f - limit) of the targets: positive before the event.
template <class size>
inline guard_derivatives derivatives_of(const size &z, const structure_group &g,
                                        const structure_target &target, const outlook &o) {
  guard_derivatives c;
  for (int j = 0; j < functions_of(z, g); j++) {
    mask is = target.joint == double(j + 1);
    put(c.w, is, -target.side * (o.f[j] - pick(target.side > 0.0, g.high[j], g.low[j])));
    put(c.w1, is, -target.side * o.f1[j]);
    put(c.w2, is, -target.side * o.f2[j]);
    put(c.w3, is, -target.side * o.f3[j]);
  }
  return c;
}

// Makes the function of the target exactly its limit.
template <class size>
inline void make_zero(const size &z, const structure_group &g, const structure_target &target, mask where,
                      outlook &o) {
  for (int j = 0; j < functions_of(z, g); j++)
    put(o.f[j], where & (target.joint == double(j + 1)), pick(target.side > 0.0, g.high[j], g.low[j]));
}

// of the guards triggered at the end of a panel, the one that a straight line lets fall first; none:
// joint 0. The target of `zero`, which lies exactly there, is no other.
template <class size>
inline structure_target earliest_triggered(const structure_machine &m, const size &z,
                                           const structure_group &g, const outlook &here,
                                           const outlook &far) {
  structure_target target = {0, 0};
  // The share is a ratio.
  vec least_value = 2, least_span = 1;
  for (int j = 0; j < functions_of(z, g); j++)
    for (int side = -1; side <= 1; side += 2) {
      if (!has_limit(m, z, g, ~mask{}, j, side))
        continue;
      vec w0 = side > 0 ? g.high[j] - here.f[j] : here.f[j] - g.low[j];
      vec w1 = side > 0 ? g.high[j] - far.f[j] : far.f[j] - g.low[j];
      mask first = (w1 < 0.0) & (w0 * least_span < least_value * (w0 - w1));
      if (j >= z.joints)
        first = first & (g.low[j] != -unlimited);
      put(target.joint, first, j + 1);
      put(target.side, first, side);
      put(least_value, first, w0);
      put(least_span, first, w0 - w1);
    }
  return target;
}

// Share of a panel of length h at which the polynomial of degree 7 through both ends of a function falls.
inline vec zero_at(vec h, const guard_derivatives &a, const guard_derivatives &b) {
  vec square = h * h, a1 = h * a.w1, a2 = 0.5 * square * a.w2, a3 = (1.0 / 6) * square * h * a.w3;
  vec d0 = b.w - (a.w + a1 + a2 + a3), d1 = h * b.w1 - (a1 + 2 * a2 + 3 * a3),
      d2 = square * b.w2 - (2 * a2 + 6 * a3), d3 = (1.0 / 6) * square * h * b.w3 - a3;
  vec a4 = 35 * d0 - 15 * d1 + 2.5 * d2 - d3, a5 = -84 * d0 + 39 * d1 - 7 * d2 + 3 * d3,
      a6 = 70 * d0 - 34 * d1 + 6.5 * d2 - 3 * d3, a7 = -20 * d0 + 10 * d1 - 2 * d2 + d3;
  vec low = {}, high = 1, u = pick(a.w > 0.0, a.w / (a.w - b.w), 0.7);
  for (int i = 0; i < most_newtons; i++) {
    vec p = a6 + u * a7, slope = a7;
    const vec rest[] = {a5, a4, a3, a2, a1, a.w};
    for (const vec &c : rest) {
      slope = p + u * slope;
      p = c + u * p;
    }
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
  for (int j = 0; j < functions_of(z, g); j++) {
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

// Panels that reach the next stop end there, and the flight with them, where gaps are noted: those after it
// are none of it. Returns their lanes.
template <class size>
inline mask cut_at_stop(const structure_machine &m, const size &z, mask walking, const structure_group &g,
                        structure_bases &next) {
  vec stop = g.c.until - g.s.start;
  mask cut = walking & (next.elapsed >= stop);
  if (!any(cut))
    return cut;
  structure_bases b;
  bases_at(m, z, g, stop, b);
  put_bases(z.terms, z.waves, cut, b, next);
  put(next.elapsed, cut, stop);
  return cut;
}

// Walks on panel by panel until the proof fails. Flights that last too long end without an event.
template <class size>
inline void walk(const structure_machine &m, const size &z, mask walking, mask &sought, structure_walk &p,
                 structure_group &g) {
  while (any(walking)) {
    structure_bases next;
    next.elapsed = p.t + g.panel;
    for (int k = 0; k < z.terms; k++) {
      next.re[k] = p.b.re[k] * g.step.re[k] - p.b.im[k] * g.step.im[k];
      next.im[k] = p.b.re[k] * g.step.im[k] + p.b.im[k] * g.step.re[k];
    }
    for (int n = 0; n < z.waves; n++) {
      next.cosine[n] = p.b.cosine[n] * g.step.cosine[n] - p.b.sine[n] * g.step.sine[n];
      next.sine[n] = p.b.cosine[n] * g.step.sine[n] + p.b.sine[n] * g.step.cosine[n];
    }
    mask cut = {};
    if (z.misses)
      cut = cut_at_stop(m, z, walking, g, next);
    outlook there;
    functions_at(m, z, g, next, there);
    LANE_COUNT(panels, count(walking));
    put_bases(z.terms, z.waves, walking, next, p.b);
    put_outlook(functions_of(z, g), walking, there, p.far);
    put(p.end, walking, next.elapsed);
    walking = proven_within(m, z, g, walking, p.here, p.far, z.misses ? next.elapsed - p.t : g.panel);
    if (z.misses)
      note_misses(m, z, walking, p.t, p.end, p.here, p.far, g);
    mask over = walking & (cut | (p.panels >= double(most_panels)));
    if (any(over)) {
      keep_end(z, over, p, {0, 0}, g);
      put(g.s.found, over & cut, 2);
      sought = sought & ~over;
      walking = walking & ~over;
    }
    put_outlook(functions_of(z, g), walking, p.far, p.here);
    put(p.t, walking, p.end);
    put(p.panels, walking, p.panels + 1.0);
  }
}

// Newton's step from `step` to the zero of Taylor's polynomial of the targets.
template <class size>
inline vec zero_nearby(const size &z, const structure_group &g, const structure_target &target,
                       const guard_derivatives &c, const far_outlook &far, vec step) {
  vec w4 = {}, w5 = {};
  for (int j = 0; j < functions_of(z, g); j++) {
    mask is = target.joint == double(j + 1);
    put(w4, is, -target.side * far.f4[j]);
    put(w5, is, -target.side * far.f5[j]);
  }
  vec half = 0.5 * step, third = (1.0 / 3) * step, fourth = 0.25 * step, fifth = 0.2 * step;
  vec w = c.w + step * (c.w1 + half * (c.w2 + third * (c.w3 + fourth * (w4 + fifth * w5))));
  vec slope = c.w1 + step * (c.w2 + half * (c.w3 + third * (w4 + fourth * w5)));
  return step - w / slope;
}

// The end of the panel comes to the zero of the target. Returns the lanes where it was not found.
template <class size>
inline mask polish(const structure_machine &m, const size &z, mask asked, structure_walk &p,
                   structure_group &g) {
  vec low = p.t, high = p.end;
  guard_derivatives a = derivatives_of(z, g, p.target, p.here), c = derivatives_of(z, g, p.target, p.far);
  vec s = p.t + (p.end - p.t) * zero_at(p.end - p.t, a, c);
  for (int round = 0; round < most_polishings && any(asked); round++) {
    structure_bases b;
    outlook o;
    far_outlook far;
    bases_at(m, z, g, s, b);
    functions_at(m, z, g, b, o, &far);
    c = derivatives_of(z, g, p.target, o);
    vec w = c.w, w1 = c.w1, w2 = c.w2;
    put(low, w > 0.0, s);
    high = pick(w > 0.0, high, s);
    vec step = -w * (w1 * w1 - 0.5 * w * w2) / (w1 * (w1 * w1 - w * w2) + (1.0 / 6) * w * w * c.w3);
    // Where the step is short Taylor's polynomial is the function: its zero, by one step of Newton's method
    // where the slope hardly changes on the way.
    mask near = (magnitude(step) <= g.close) & (magnitude(step * w2) <= -straight * w1);
    vec zero = zero_nearby(z, g, p.target, c, far, step);
    step = pick(near, zero, step);
    vec next = s + step;
    mask guided = (w1 < 0.0) & (next >= low) & (next <= high) & (next > p.t);
    mask close = asked & guided & near & (magnitude(step) <= g.close) & (magnitude(w) <= -2 * g.close * w1);
    if (any(close)) {
      for (int k = 0; k < z.terms; k++) {
        vec re = b.re[k], im = b.im[k];
        for (int n = 5; n >= 1; n--) {
          vec part = (1.0 / n) * step, turned = b.re[k] + part * (-g.decay[k] * re - g.turn[k] * im);
          im = b.im[k] + part * (g.turn[k] * re - g.decay[k] * im);
          re = turned;
        }
        put(p.b.re[k], close, re);
        put(p.b.im[k], close, im);
      }
      vec half = 0.5 * step, third = (1.0 / 3) * step, fourth = 0.25 * step, fifth = 0.2 * step;
      for (int j = 0; j < functions_of(z, g); j++) {
        vec f5 = far.f5[j], f4 = far.f4[j], f3 = o.f3[j], f2 = o.f2[j], f1 = o.f1[j];
        vec slope = f1 + step * (f2 + half * (f3 + third * (f4 + fourth * f5)));
        put(p.far.f[j], close,
            o.f[j] + step * (f1 + half * (f2 + third * (f3 + fourth * (f4 + fifth * f5)))));
        put(p.far.f1[j], close, slope);
        put(p.far.f2[j], close, f2 + step * (f3 + half * (f4 + third * f5)));
        put(p.far.f3[j], close, f3 + step * (f4 + half * f5));
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
  functions_at(m, z, g, b, o);
  put_bases(z.terms, z.waves, asked, b, p.b);
  put_outlook(functions_of(z, g), asked, o, p.far);
  put(p.end, asked, middle);
  p.at_zero = p.at_zero & ~asked;
}

// Finds what the flights of `seek` end with. Returns the lanes where that failed.
template <class size>
inline mask find_first(const structure_machine &m, const size &z, mask seek, structure_group &g) {
  structure_walk p;
  for (int k = 0; k < z.terms; k++) {
    p.b.re[k] = 1;
    p.b.im[k] = {};
  }
  for (int n = 0; n < z.waves; n++) {
    p.b.cosine[n] = g.first_cosine[n];
    p.b.sine[n] = g.first_sine[n];
  }
  put_outlook(functions_of(z, g), g.first, p.here);
  put_outlook(functions_of(z, g), g.first, p.far);
  p.target = {magnitude(g.s.left), pick(g.s.left > 0.0, 1, -1)};
  make_zero(z, g, p.target, seek & (g.s.left != 0.0), p.here);
  for (int j = 0; j < z.joints; j++)
    if (m.joint[j].even > 0.5)
      put(p.here.f1[j], g.s.rising == double(j + 1), vec{});
  p.t = p.end = p.tries = p.panels = vec{};
  p.at_zero = mask{};
  mask sought = seek, walking = seek, lost = {};
  while (any(sought)) {
    walk(m, z, walking, sought, p, g);
    structure_target triggered = earliest_triggered(m, z, g, p.here, p.far);
    mask aims = sought & (triggered.joint > 0.0), failed = {};
    put(p.target.joint, aims, triggered.joint);
    put(p.target.side, aims, triggered.side);
    if (any(aims)) {
      p.at_zero = p.at_zero & ~aims;
      failed = polish(m, z, aims, p, g);
    }
    mask blind = sought & ~aims;
    if (any(blind))
      halve(m, z, blind, p, g);
    mask within = proven_within(m, z, g, sought, p.here, p.far, p.end - p.t) & ~failed;
    if (z.misses)
      note_misses(m, z, within, p.t, p.end, p.here, p.far, g);
    mask found = within & p.at_zero;
    keep_end(z, found, p, p.target, g);
    walking = within & ~p.at_zero;
    put_outlook(functions_of(z, g), walking, p.far, p.here);
    put(p.t, walking, p.end);
    put(p.tries, sought, p.tries + 1.0);
    failed = failed | (sought & ~found & (p.tries >= double(most_tries)));
    lost = lost | failed;
    sought = sought & ~found & ~failed;
    walking = walking & sought;
  }
  return lost;
}

} // namespace

#endif
