// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Machines without a closed form, by Taylor series over the lanes: cubic springs, free play and pendulums,
// drag, friction that depends on speed or position, Dahl's friction, tables. Every step expands the motion to
// a fixed order by recurrences; its length follows from the last coefficients (Jorba & Zou 2005). Events are
// roots of the polynomials; that nothing comes before them is proven by the Bernstein coefficients of the
// velocity.
#ifndef SEPARATRIX_LANE_SERIES_HPP
#define SEPARATRIX_LANE_SERIES_HPP

#include "lane_restitution.hpp"
#include "lane_stops.hpp"

namespace {

enum { order = series_order, most_root_rounds = 30 };

// Successive terms of a step shrink by exp(-shrinking); the last is then 2e-14 of the first.
const double shrinking = 1.75;

// Coefficients of position and velocity in the time since the start of a step, with tables those of the
// extension and of the factor of dry friction, too.
struct expansion {
  vec x[order + 1], v[order], extension[order], factor[order];
};

// The pieces of a table that the lanes are in: see lane_tables.hpp.
struct table_piece {
  vec from, low, high, c[4];
};

// Sum of a(i) b(k - i), i = 0 ... k. In two parts, so that additions need not wait for each other, and last
// what has been known for the shortest time: b(k), a(k).
LANE_LEAF vec product(const vec *a, const vec *b, int k) {
  if (k == 0)
    return a[0] * b[0];
  vec sum = {}, other = {};
  int i = 1;
  for (; i + 1 < k; i += 2) {
    other += a[i] * b[k - i];
    sum += a[i + 1] * b[k - i - 1];
  }
  if (i < k)
    other += a[i] * b[k - i];
  return ((sum + other) + a[0] * b[k]) + a[k] * b[0];
}

// The same of a with itself.
LANE_LEAF vec square_of(const vec *a, int k) {
  if (k == 0)
    return a[0] * a[0];
  vec sum = {}, other = {};
  int i = 1;
  for (; 2 * i + 2 < k; i += 2) {
    sum += a[i] * a[k - i];
    other += a[i + 1] * a[k - i - 1];
  }
  if (2 * i < k)
    sum += a[i] * a[k - i];
  sum = 2.0 * (sum + other);
  if (k % 2 == 0)
    sum += a[k / 2] * a[k / 2];
  return sum + (2.0 * a[0]) * a[k];
}

// Sum of a(i) b(k - i)/k, i = 1 ... k: with a(i) = i c(i), coefficient k of what has the derivative c' b.
LANE_LEAF vec chain(const vec *a, const vec *b, int k) {
  vec sum = {}, other = {};
  int i = 1;
  for (; i + 1 < k; i += 2) {
    sum += a[i] * b[k - i];
    other += a[i + 1] * b[k - i - 1];
  }
  if (i < k)
    sum += a[i] * b[k - i];
  return (1.0 / k) * ((sum + other) + a[k] * b[0]);
}

// The motion of the foot of the spring, so many coefficients.
LANE_DEVICE inline void expand_foot(const lane_machine &m, vec time, int terms, vec *foot) {
  vec sine, cosine;
  sine_cosine(time * m.drive_frequency, sine, cosine);
  for (int k = 0; k < terms; k++)
    foot[k] = {};
  vec c = cosine, s = sine;
  for (int n = 0; n < m.harmonics; n++) {
    const double *rate = m.law.foot_rate[n];
    const vec part = m.cosine[n] * c + m.sine[n] * s, slope = m.sine[n] * c - m.cosine[n] * s;
    for (int k = 0; k < terms; k += 2)
      foot[k] += rate[k] * part;
    for (int k = 1; k < terms; k += 2)
      foot[k] += rate[k] * slope;
    vec next = c * cosine - s * sine;
    s = s * cosine + c * sine;
    c = next;
  }
}

// One Stribeck excess, E exp(-(|v|/v_s)^delta), delta 1 or 2, as a series.
struct excess_series {
  vec u[order], rate[order], value[order];
};

LANE_DEVICE inline vec next_excess(const lane_law &l, int i, mask within, vec d, const vec *v, int k,
                                   excess_series &e) {
  e.u[k] = (1 / l.velocity[i]) * d * v[k];
  const bool squared = l.exponent[i] > 1.5;
  const vec power = squared ? square_of(e.u, k) : e.u[k];
  e.rate[k] = double(-k) * power;
  if (k == 0)
    e.value[0] = pick(within, l.excess[i] * exponential(-power), vec{});
  else
    e.value[k] = chain(e.rate, e.value, k);
  return e.value[k];
}

// A force that a table gives, as a series.
struct table_series {
  vec u[order], square[order];

  // Coefficient k, from that of the variable. Pieces are cubic, or parabolas.
  template <int degree> LANE_LEAF vec next(const table_piece &piece, vec variable, int k) {
    u[k] = k == 0 ? variable - piece.from : variable;
    square[k] = square_of(u, k);
    vec sum = piece.c[1] * u[k] + piece.c[2] * square[k];
    if constexpr (degree > 2)
      sum += piece.c[3] * product(square, u, k);
    return k == 0 ? piece.c[0] + sum : sum;
  }
};

// The acceleration of a body that slips in `direction`, by everything but a soft barrier, as a series.
struct force_series {
  vec extension[order], square[order], turn[order], sine[order], cosine[order], dry[order], behind[order],
      factor[order], speed_square[order];
  excess_series excess[2];
  table_series table[tables];
  const table_piece *pieces = nullptr;

  // Coefficient k, from those of the foot of the spring (k alone), the position, the velocity and the rate of
  // the position in the variable of the series.
  LANE_LEAF vec next(const lane_machine &m, const lane_group &g, mask within, vec foot, const vec *x,
                     const vec *v, const vec *rate, int k) {
    const lane_law &l = m.law;
    const bool excessive = l.excess[0] > 0 || l.excess[1] > 0;
    const vec d = g.direction, viscous = l.viscous + l.asymmetric_viscous * d;
    extension[k] = foot - x[k];
    if (k == 0)
      extension[0] += l.length;
    vec a = l.stiffness * extension[k] - viscous * v[k];
    if (l.pendulum != 0) {
      if (k == 0)
        sine_cosine(extension[0], sine[0], cosine[0]);
      else {
        turn[k] = double(k) * extension[k];
        sine[k] = chain(turn, cosine, k);
        cosine[k] = -chain(turn, sine, k);
      }
      a += l.pendulum * sine[k];
    }
    if (l.cubic != 0) {
      square[k] = square_of(extension, k);
      a += l.cubic * product(square, extension, k);
    }
    if (l.table[over_extension].knots > 0)
      a += table[over_extension].next<3>(pieces[over_extension], extension[k], k);
    if (l.table[over_play].knots > 0)
      a += table[over_play].next<2>(pieces[over_play], extension[k], k);
    if (l.table[over_position].knots > 0)
      a += table[over_position].next<3>(pieces[over_position], x[k], k);
    if (l.table[over_speed].knots > 0)
      a -= d * table[over_speed].next<3>(pieces[over_speed], d * v[k], k);
    if (l.quadratic != 0 || l.cubic_damping != 0)
      speed_square[k] = square_of(v, k);
    if (l.quadratic != 0)
      a -= l.quadratic * d * speed_square[k];
    if (l.cubic_damping != 0)
      a -= l.cubic_damping * product(speed_square, v, k);
    dry[k] = {};
    if (l.dahl_stiffness > 0) {
      // z - level: its derivative is -(sigma/level) times itself and the rate of the position.
      const vec level = pick(d > 0.0, l.dahl_level[0], l.dahl_level[1]);
      behind[k] =
          k == 0 ? g.z - level : (-l.dahl_stiffness / (double(k) * level)) * product(rate, behind, k - 1);
      dry[k] = l.inverse_mass * (k == 0 ? g.z : behind[k]);
    } else {
      if (k == 0)
        dry[0] = l.kinetic * d + l.asymmetric;
      for (int i = 0; i < 2 && excessive; i++)
        if (l.excess[i] > 0)
          dry[k] += d * next_excess(l, i, within, d, v, k, excess[i]);
    }
    factor[k] = m.friction_slope * x[k];
    if (k == 0) {
      factor[0] += 1.0;
      a += l.offset;
    }
    if (l.table[factor_over_position].knots > 0)
      factor[k] += table[factor_over_position].next<3>(pieces[factor_over_position], x[k], k);
    else if (!(m.friction_slope != 0))
      return a - dry[k];
    return a - product(factor, dry, k);
  }

  // Extension and factor of dry friction where `x` has one coefficient more than they have.
  LANE_DEVICE inline void keep(const vec *x, vec *all_extension, vec *all_factor) const {
    for (int k = 0; k < order - 1; k++) {
      all_extension[k] = extension[k];
      all_factor[k] = factor[k];
    }
    all_extension[order - 1] = -x[order - 1];
    all_factor[order - 1] = {};
  }
};

// Expands the motion of every lane from where it is, in time.
LANE_DEVICE inline void expand(const lane_machine &m, const lane_group &g, const table_piece *pieces,
                               mask within, expansion &p) {
  LANE_COUNT(evaluations, vec_size);
  vec foot[order];
  force_series forces;
  forces.pieces = pieces;
  expand_foot(m, g.time, order - 1, foot);
  p.x[0] = g.x;
  p.v[0] = g.v;
  for (int k = 0; k < order - 1; k++) {
    p.v[k + 1] = (1.0 / (k + 1)) * forces.next(m, g, within, foot[k], p.x, p.v, p.v, k);
    p.x[k + 1] = (1.0 / (k + 1)) * p.v[k];
  }
  p.x[order] = (1.0 / order) * p.v[order - 1];
  if (m.law.has_tables > 0)
    forces.keep(p.x, p.extension, p.factor);
}

// Length of a step over which the terms shrink so. The last few are asked, as one may happen to be small.
LANE_DEVICE inline vec step_length(const lane_machine &m, const expansion &p) {
  const double smallest = 1e-290;
  vec least = 1e300;
  for (int k = order - 3; k <= order; k++) {
    vec length = (1.0 / k) * (m.law.log_scale - rough_logarithm(magnitude(p.x[k]) + smallest));
    put(least, length < least, length);
  }
  return rough_exponential(least - shrinking);
}

// How much the speed may change over a step where there is friction E exp(-(v/v_s)^delta): the terms of its
// series grow before they shrink, so that the last one means little. While the speed changes steadily what is
// left out of exp(-(u + x)^2) begins with x^18 H_18(u) exp(-u^2)/18!, at most 7.0e-6 exp(-u^2/2) |x|^18
// (Cramer's inequality): 7e-10 at |x| = 0.6 exp(u^2/36), whatever u; above u = 6.2 it is nil. In a contact
// the speed's own higher terms count: |x| <= 0.5. For |x| <= 2 what is left out of exp(-(u + x)) is below
// 2^18/18! = 4e-11 of it; above u = 30 it is nil.
template <bool steady>
LANE_DEVICE inline vec speed_room(const lane_law &l, const lane_group &g, mask within) {
  vec room = 1e300;
  for (int i = 0; i < 2; i++) {
    if (!(l.excess[i] > 0))
      continue;
    const bool squared = l.exponent[i] > 1.5;
    const double nil = squared ? 6.2 : 30;
    vec u = (1 / l.velocity[i]) * magnitude(g.v), least = squared ? 0.5 : 2.0, here = u - nil;
    if (steady && squared) {
      put(u, u > nil, vec(nil));
      least = 0.6 * exponential((1.0 / 36) * u * u);
    }
    put(here, here < least, least);
    here = l.velocity[i] * here;
    put(room, within & (here < room), here);
  }
  return room;
}

// How far a step may pass that: a free one has its length from the speed at its beginning, and one in a
// contact turns faster.
constexpr double room_free = 1.2, room_pressed = 1.5;

// Does the speed keep within so much over the step? Where forces change on the way, it may pass what there is
// room for.
LANE_DEVICE inline mask keeps_within(const vec (&c)[order], vec end, vec room) {
  vec power = end, sum = {};
  for (int k = 1; k < order; k++) {
    sum += magnitude(c[k]) * power;
    power *= end;
  }
  return sum <= room;
}

// A polynomial over a step, in the fraction of the step, with its derivatives.
template <int degree>
LANE_DEVICE inline void value_at(const vec (&c)[degree + 1], vec s, vec &f, vec &f1, vec &f2) {
  f = c[degree];
  f1 = {};
  f2 = {};
  for (int k = degree - 1; k >= 0; k--) {
    f2 = f2 * s + f1;
    f1 = f1 * s + f;
    f = f * s + c[k];
  }
  f2 = 2.0 * f2;
}

// Where a parabola of value a > 0, or 0, and slope b at 0 that has the value c <= 0 at 1 falls to zero.
LANE_DEVICE inline vec zero_of_parabola(vec a, vec b, vec c) {
  vec bend = c - a - b, inner = b * b - 4.0 * a * bend;
  vec root = square_root(pick(inner > 0.0, inner, vec{}));
  mask rising = b > 0.0;
  return pick(rising, b + root, 2.0 * a) / pick(rising, -2.0 * bend, root - b);
}

// Where the polynomials of `seek` that are positive at 0 and not at `high`, with the value `last` there, fall
// to zero, by Halley's steps within brackets. Returns the lanes that were not found.
template <int degree>
LANE_DEVICE inline mask fall(const vec (&c)[degree + 1], mask seek, vec high, vec last, vec &root) {
  vec low = {}, s = high * zero_of_parabola(c[0], high * c[1], last);
  s = pick((s > 0.0) & (s < high), s, high);
  for (int round = 0; round < most_root_rounds && any(seek); round++) {
    vec f, f1, f2;
    value_at<degree>(c, s, f, f1, f2);
    put(low, f > 0.0, s);
    put(high, f <= 0.0, s);
    vec next = s - 2.0 * f * f1 / (2.0 * f1 * f1 - f * f2);
    mask guided = (f1 < 0.0) & (next >= low) & (next <= high);
    // Newton's step counts, too: where the slope vanishes Halley's means nothing.
    mask close = (magnitude(next - s) <= 1e-7 * high) & (magnitude(f) <= -2e-7 * high * f1);
    mask done = seek & ((guided & close) | (high - low <= 4e-16 * high));
    put(root, done, pick(guided, next, s));
    seek = seek & ~done;
    s = pick(guided, next, 0.5 * (low + high));
  }
  return seek;
}

// Is a polynomial positive between 0 and `end`, where it may vanish? Its chord less the bound t (end - t)/2
// times its second derivative is, if the value at one end exceeds half of that derivative; else its Bernstein
// coefficients are asked.
LANE_DEVICE inline mask positive_until(const vec (&c)[order], mask asked, vec end) {
  enum { degree = order - 1 };
  vec b[order], power = end, curvature = {}, last = c[0];
  b[0] = c[0];
  for (int k = 1; k <= degree; k++) {
    b[k] = c[k] * power;
    power *= end;
    last += b[k];
    if (k > 1)
      curvature += (0.5 * k * (k - 1)) * magnitude(b[k]);
  }
  mask plain = ((c[0] > curvature) & (last > -1e-15 * curvature)) | ((last > curvature) & (c[0] >= 0.0));
  if (!any(asked & ~plain))
    return plain;
  // Divided by binomial coefficients, then summed along the rows of Pascal's triangle.
  double binomial = 1;
  for (int k = 1; k <= degree; k++) {
    binomial = binomial * (degree - k + 1) / k;
    b[k] = b[k] * (1 / binomial);
  }
  for (int level = 1; level <= degree; level++)
    for (int k = degree; k >= level; k--)
      b[k] += b[k - 1];
  mask positive = (b[0] >= 0.0) & (b[1] > 0.0);
  for (int k = 2; k < degree; k++)
    positive = positive & (b[k] > 0.0);
  return plain | positive;
}

// A step of the lanes: its polynomials in the fraction of the step, how far it goes, and what it ends with.
struct stride_of_lanes {
  vec x[order + 1], fall[order], length, end;
  mask turns, hits, slows, lost;
};

// Looks for the first event of the lanes `flying` within a step of `length`.
LANE_DEVICE inline stride_of_lanes look_for_events(const lane_machine &m, const expansion &p, mask flying,
                                                   mask within, vec barrier, vec length,
                                                   const lane_group &g) {
  stride_of_lanes t;
  vec d = g.direction, power = 1.0;
  t.length = length;
  for (int k = 0; k <= order; k++) {
    t.x[k] = p.x[k] * power;
    if (k < order)
      t.fall[k] = d * p.v[k] * power;
    power *= length;
  }
  // Outside a Stribeck layer the series is that without it: the step ends at its edge.
  vec level = pick(within, 0, m.law.edge);
  t.fall[0] -= level;
  vec w = t.fall[order - 1], x = t.x[order];
  for (int k = order - 2; k >= 0; k--)
    w += t.fall[k];
  for (int k = order - 1; k >= 0; k--)
    x += t.x[k];
  t.end = 1.0;
  mask slows = flying & (w <= 0.0);
  t.lost = mask{};
  if (any(slows)) {
    t.lost = fall<order - 1>(t.fall, slows, vec(1.0), w, t.end);
    vec there, f1, f2;
    value_at<order>(t.x, t.end, there, f1, f2);
    put(x, slows, there);
  }
  const vec free = d * (barrier - x);
  t.hits = flying & ~t.lost & (free <= 0.0);
  if (any(t.hits)) {
    vec root = t.end, gap[order + 1];
    for (int k = 0; k <= order; k++)
      gap[k] = -d * t.x[k];
    gap[0] += d * barrier;
    t.lost = t.lost | fall<order>(gap, t.hits, t.end, free, root);
    t.end = root;
  }
  slows = slows & ~t.hits;
  t.turns = slows & within;
  t.slows = slows & ~within;
  return t;
}

// Value of a table in its pieces.
LANE_DEVICE inline vec value_in(const table_piece &piece, vec x) {
  vec u = x - piece.from;
  return piece.c[0] + u * (piece.c[1] + u * (piece.c[2] + u * piece.c[3]));
}

// What decides at a turning point at `x` with the acceleration `a` before it whether the body goes on: the
// factor of dry friction there, the force that would turn it round, and that which holds it, per mass.
struct turning_forces {
  vec factor, push, holds;
};

LANE_DEVICE inline turning_forces forces_at_turn(const lane_machine &m, const table_piece *pieces, vec x,
                                                 vec a, vec direction) {
  turning_forces t;
  t.factor = 1.0 + m.friction_slope * x;
  if (m.law.table[factor_over_position].knots > 0)
    t.factor += value_in(pieces[factor_over_position], x);
  t.push = -direction * a - m.law.rest_friction * t.factor;
  t.holds = m.break_away * t.factor;
  if (m.law.table[over_speed].knots > 0) {
    mask upward = direction > 0.0;
    t.push -= pick(upward, vec(m.law.change_at_rest[0]), vec(m.law.change_at_rest[1]));
    t.holds += pick(upward, vec(m.law.change_at_rest[1]), vec(m.law.change_at_rest[0]));
    // Friction that is nothing at rest is left to the scalar code.
    put(t.holds, t.holds - direction * m.law.asymmetric * t.factor <= 0.0, 1e300);
  }
  return t;
}

// What follows the steps `due`. Returns the lanes that the scalar code must look at.
LANE_DEVICE inline mask take_series_events(const lane_machine &m, const table_piece *pieces,
                                           const stride_of_lanes &t, mask due, vec barrier, lane_group &g) {
  const bool soft = m.contact.stiffness > 0;
  vec x, scaled_v, scaled_a;
  value_at<order>(t.x, t.end, x, scaled_v, scaled_a);
  vec per_time = 1.0 / t.length, v = scaled_v * per_time, a = scaled_a * (per_time * per_time);
  vec w = g.direction * v, gap = g.direction * (barrier - x);
  put(v, t.slows, g.direction * m.law.edge);
  turning_forces at_turn = forces_at_turn(m, pieces, x, a, g.direction);
  vec restitution = m.restitution;
  if (any(due & t.hits))
    restitution = restitution_at(m, w);
  mask slow = soft ? w <= 0.0 : restitution * w <= m.slow;
  mask rare =
      due & ((t.turns & (at_turn.push <= at_turn.holds)) | (t.hits & slow) | (magnitude(x) >= m.domain) |
             (at_turn.factor <= 0.0) | (1.0 + m.friction_slope * g.x <= 0.0));
  due = due & ~rare;
  mask turns = due & t.turns, hits = due & t.hits, events = turns | hits;
  LANE_COUNT(events, count(events));
  if (m.law.dahl_stiffness > 0) {
    vec level = pick(g.direction > 0.0, m.law.dahl_level[0], m.law.dahl_level[1]);
    vec done = exponential((-m.law.dahl_stiffness / level) * (x - g.x));
    put(g.z, due, level + (g.z - level) * done);
  }
  put(g.flights, events, g.flights + 1.0);
  put(g.impacts, hits, g.impacts + 1.0);
  put(g.speed_sum, hits, g.speed_sum + w);
  put(g.last_speed, hits, w);
  put(g.margin, turns & (gap < g.margin), gap);
  put(g.time, due, g.time + t.end * t.length);
  put(g.x, due, pick(hits, barrier, x));
  if (soft) {
    put(g.touch, hits, w);
    put(g.pressed_on, hits, pick(g.direction > 0.0, vec(1.0), vec(2.0)));
    put(g.v, due, pick(turns, 0, v));
    put(g.direction, turns, -g.direction);
  } else {
    put(g.v, due, pick(turns, 0, pick(hits, -restitution * v, v)));
    put(g.direction, events, -g.direction);
  }
  return rare;
}

} // namespace

#endif
