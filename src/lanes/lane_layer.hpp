// SPDX-FileCopyrightText: The Separatrix developers
// SPDX-License-Identifier: GPL-3.0-or-later

// Passages through a thin Stribeck layer. Outside it the motion is Coulomb's, whose course near a velocity
// zero is a short series: its acceleration as a polynomial of its own speed V. The excess friction E e(w)
// takes the body off that course by P = V - w, so that
//   dP/dw = E e(w)/D,   D = A(w + P) + omega^2 (lag) -+ E e(w),
// from rest outwards or from the edge inwards to rest. P changes A a little only: a guess, and one
// integration over the speed with fixed nodes, make it known to rounding. What counts outside is the change
// of the free part of the motion, the integral of E e exp(-i omega t) over time.
#ifndef SEPARATRIX_LANE_LAYER_HPP
#define SEPARATRIX_LANE_LAYER_HPP

#include "lane_motion.hpp"

namespace {

// Speed per time since V = 0, by its derivatives there, and what follows from them.
struct course {
  vec rate, curl, snap, crackle, pop;
  // Acceleration and time as polynomials of the speed.
  vec acceleration[5], time[4];
};

inline course course_of(vec rate, vec curl, vec snap, vec crackle, vec pop) {
  course c = {rate, curl, snap, crackle, pop, {}, {}};
  vec unit = 1.0 / rate, g1 = curl * unit, g2 = snap * unit, g3 = crackle * unit, g4 = pop * unit;
  vec square = g1 * g1, power = unit;
  c.acceleration[0] = rate;
  c.acceleration[1] = g1;
  c.time[0] = power;
  power *= unit;
  c.acceleration[2] = 0.5 * (g2 - square) * unit;
  c.time[1] = -0.5 * g1 * power;
  c.acceleration[3] = (1.0 / 6) * (g3 - g1 * (4 * g2 - 3 * square)) * power;
  power *= unit;
  c.time[2] = (0.5 * square - (1.0 / 6) * g2) * power;
  c.acceleration[4] =
      (1.0 / 24) * (g4 - 7 * g1 * g3 - 4 * g2 * g2 + square * (25 * g2 - 15 * square)) * power;
  c.time[3] = (g1 * ((5.0 / 12) * g2 - 0.625 * square) - (1.0 / 24) * g3) * (power * unit);
  return c;
}

inline vec acceleration_at(const course &c, vec speed) {
  const vec *k = c.acceleration;
  return k[0] + speed * (k[1] + speed * (k[2] + speed * (k[3] + speed * k[4])));
}

inline vec time_at(const course &c, vec speed) {
  return speed * (c.time[0] + speed * (c.time[1] + speed * (c.time[2] + speed * c.time[3])));
}

// Speed, acceleration and its rate at a time.
inline void follow(const course &c, vec t, vec &speed, vec &rate, vec &curl) {
  vec half = 0.5 * t, third = (1.0 / 3) * t, fourth = 0.25 * t, fifth = 0.2 * t;
  speed = t * (c.rate + half * (c.curl + third * (c.snap + fourth * (c.crackle + fifth * c.pop))));
  rate = c.rate + t * (c.curl + half * (c.snap + third * (c.crackle + fourth * c.pop)));
  curl = c.curl + t * (c.snap + half * (c.crackle + third * c.pop));
}

// Integrals of E e cos(omega t) and E e sin(omega t) over the time since rest, for lanes that are `sound`.
struct passage {
  vec even, odd;
  mask sound;
};

// The passage of a body whose Coulomb course is c. Inward the time runs backwards, from rest to the edge.
// `bound` is that of the seventh derivative of the position.
template <bool outward> passage pass_layer(const lane_machine &m, const course &c, vec bound) {
  const lane_layer &l = m.layer;
  const double(&table)[layer_nodes][layer_nodes] = outward ? l.from_rest : l.from_edge;
  const double *first = outward ? l.first_from_rest : l.first_from_edge;
  const double *second = outward ? l.second_from_rest : l.second_from_edge;
  vec share = l.excess / c.rate, total = {}, lowest = c.rate;
  vec before[layer_nodes], inverse[layer_nodes], lost[layer_nodes] = {}, moment[layer_nodes] = {};
  for (int i = 0; i < layer_nodes; i++) {
    vec guess = share * (outward ? first[i] + share * second[i] : first[i] - share * second[i]);
    vec speed = l.speed[i] + guess;
    before[i] = acceleration_at(c, speed);
    lowest = before[i] < lowest ? before[i] : lowest;
    inverse[i] = 1.0 / (outward ? before[i] - l.force[i] : before[i] + l.force[i]);
    vec slope = l.force[i] * inverse[i], late = slope * time_at(c, speed);
    total += l.weight[i] * slope;
    for (int k = 0; k < layer_nodes; k++) {
      lost[k] += table[i][k] * slope;
      moment[k] += table[i][k] * late;
    }
  }
  vec rest = outward ? vec{} : time_at(c, total), change = {};
  const double stiffness = m.natural * m.natural;
  passage p = {};
  for (int i = 0; i < layer_nodes; i++) {
    vec speed = l.speed[i] + lost[i], t = time_at(c, speed);
    vec x = (acceleration_at(c, speed) - before[i] + stiffness * (lost[i] * t - moment[i])) * inverse[i];
    change = magnitude(x) > change ? magnitude(x) : change;
    vec part = (l.weight[i] * l.force[i]) * inverse[i] * (1.0 - x * (1.0 - x));
    vec angle = m.natural * (t - rest), z = angle * angle;
    p.even += part * (1.0 - z * (0.5 - (1.0 / 24) * z));
    p.odd += part * angle * (1.0 - (1.0 / 6) * z);
  }
  // What another round would change, and what the series leaves out, each over the whole layer.
  vec least = outward ? c.rate - l.excess : c.rate, unit = l.thickness / least, bend = magnitude(c.curl) / least;
  vec unit5 = unit * unit * unit * unit * unit, bend5 = bend * bend * bend * bend * bend;
  vec rounds = change * total * total * (bend / least), cut = total * unit5 * (bound / least + 105 * bend5);
  p.sound = (c.rate > 0.0) & (lowest > 0.25 * c.rate) & (rounds + cut <= l.precision) & (change < 1e-4);
  if (outward)
    p.sound = p.sound & (share <= l.steepest);
  return p;
}

// Where the flights of a machine with a layer are Coulomb's to the end: up to the edge of the layer, or to the
// barrier. Returns the lanes where the edge was not found.
inline mask find_edge(const lane_machine &m, mask found, lane_group &g) {
  vec d = g.direction, speed, rate, curl;
  course c = course_of(-d * g.end_a, d * g.end_j, -d * g.end_s, d * g.end_c, -d * g.end_p);
  vec t = time_at(c, all(m.layer.edge));
  follow(c, t, speed, rate, curl);
  mask hit = g.hits > 0.5;
  mask sound = hit | ((t > 0.0) & (magnitude(speed - m.layer.edge) < m.layer.edge - m.layer.level));
  g.reach = found ? (hit ? g.span : g.span - t) : g.reach;
  g.reach_v = found ? (hit ? g.end_v : d * speed) : g.reach_v;
  g.reach_a = found ? (hit ? g.end_a : -d * rate) : g.reach_a;
  g.reach_j = found ? (hit ? g.end_j : d * curl) : g.reach_j;
  return found & ~sound;
}

// The turning of a body at the end of its flight: in through the layer to rest, and out again in the other
// direction. The Coulomb course that it came on would have turned later.
struct turning {
  // Rest: how long before that, and where.
  vec early, x;
  // The flight out: free part at rest, and the time, motion at the outer edge.
  vec re, im, skip, v, a, j;
  mask sound;
};

inline turning turn_in_layer(const lane_machine &m, const lane_group &g) {
  const double stiffness = m.natural * m.natural;
  turning r;
  vec d = g.direction, bound = derivative_bound(m, g);
  course in = course_of(-d * g.end_a, d * g.end_j, -d * g.end_s, d * g.end_c, -d * g.end_p);
  passage inward = pass_layer<false>(m, in, bound);
  r.early = time_at(in, inward.even);
  vec h = -r.early, half = 0.5 * h, third = (1.0 / 3) * h, fourth = 0.25 * h, fifth = 0.2 * h;
  vec p = g.end_p, c = g.end_c + h * p, s = g.end_s + h * (g.end_c + half * p);
  vec j = g.end_j + h * (g.end_s + half * (g.end_c + third * p));
  vec a = g.end_a + h * (g.end_j + half * (g.end_s + third * (g.end_c + fourth * p)));
  vec v = h * (g.end_a + half * (g.end_j + third * (g.end_s + fourth * (g.end_c + fifth * p))));
  vec path = half * (g.end_a + third * (g.end_j + fourth * (g.end_s + fifth * g.end_c)));
  // How far the body is off the old course, and what that and the reversed friction do to the derivatives.
  vec off = -d * inward.odd * (1 / m.natural), jump = (2 * m.kinetic) * d - stiffness * off;
  r.x = g.end_x + h * path + off;
  a += jump;
  j += stiffness * v;
  s -= stiffness * jump;
  c -= stiffness * (stiffness * v);
  p += stiffness * (stiffness * jump);
  course out = course_of(-d * a, -d * j, -d * s, -d * c, -d * p);
  passage outward = pass_layer<true>(m, out, bound);
  r.re = g.end_re;
  r.im = g.end_im;
  turn_on<false, 6>(m, h, r.re, r.im);
  r.re += d * outward.even - v;
  r.im += m.damped * (off - (2 * m.offset) * d) - d * outward.odd;
  vec speed, rate, curl;
  r.skip = time_at(out, m.layer.edge + outward.even);
  follow(out, r.skip, speed, rate, curl);
  speed -= outward.even;
  r.v = -d * speed;
  r.a = -d * rate;
  r.j = -d * curl;
  r.sound = inward.sound & outward.sound & (out.rate + m.kinetic > m.break_away) & (r.skip > 0.0) &
            (magnitude(speed - m.layer.edge) < m.layer.edge - m.layer.level);
  return r;
}

} // namespace

#endif
